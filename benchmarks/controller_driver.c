/* Give recordings from a file to an exported model, and write its readings as doubles.

   Input: for each recording a uint32 number of rows, and rows of channels and velocity as
   emacm_real. Output: recording, decision, flags, typicality, unknown, posterior, risk, features.
   With a second argument, print the seconds of the processor instead. */
#include "emacm_model.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static void write_reading(const emacm_state *s, double number)
{
    int i;
    double head[5];
    head[0] = number;
    head[1] = s->decision;
    head[2] = s->flags;
    head[3] = s->typicality;
    head[4] = s->unknown;
    fwrite(head, sizeof head[0], 5, stdout);
    for (i = 0; i < EMACM_CLASSES + EMACM_DECISIONS + EMACM_FEATURES; i++) {
        double value = i < EMACM_CLASSES ? s->posterior[i]
                       : i < EMACM_CLASSES + EMACM_DECISIONS
                           ? s->risk[i - EMACM_CLASSES]
                           : s->features[i - EMACM_CLASSES - EMACM_DECISIONS];
        fwrite(&value, sizeof value, 1, stdout);
    }
}

int main(int argc, char **argv)
{
    static emacm_state s;
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    uint32_t n, i, number;
    clock_t spent = 0, start;
    if (!file)
        return 2;
    emacm_reset(&s);
    for (number = 0; fread(&n, sizeof n, 1, file) == 1; number++) {
        size_t width = EMACM_CHANNELS + 1;
        emacm_real *rows = malloc(n * width * sizeof *rows);
        if (!rows || fread(rows, sizeof *rows, n * width, file) != n * width)
            return 3;
        start = clock();
        for (i = 0; i < n; i++)
            if (emacm_push(&s, rows + i * width, rows[i * width + EMACM_CHANNELS]) && argc < 3)
                write_reading(&s, number);
        spent += clock() - start;
        if (emacm_finish(&s) && argc < 3)
            write_reading(&s, number);
        free(rows);
    }
    if (argc > 2)
        printf("%.6f\n", (double)spent / CLOCKS_PER_SEC);
    fclose(file);
    return 0;
}
