/* Twelve readings, which Python decided on as stated below. From the folder of this file:
   cc -std=c99 -O2 -o check check.c emacm_model.c -lm && ./check */
#include "emacm_model.h"

#include <math.h>
#include <stdio.h>

${check_tables}

int main(void)
{
    static emacm_state s;
    emacm_real samples[EMACM_CHANNELS], velocity, worst, apart;
    uint32_t noise, i, size;
    int number, c, reading, failed, n_failed = 0;
    for (number = 0; number < N_READINGS; number++) {
        noise = (uint32_t)number + 1;
        size = N_SAMPLES[number];
        emacm_reset(&s);
        for (i = 0, reading = 0; i < size && !reading; i++) {
            for (c = 0; c < EMACM_CHANNELS; c++) {
                noise = noise * 1664525u + 1013904223u;
                samples[c] = (emacm_real)((int32_t)(noise >> 8) - 8388608) * LEVEL[number][c];
            }
            velocity = (emacm_real)SECTIONS[16 * i / size] * SPEED[number];
            reading = emacm_push(&s, samples, velocity);
        }
        if (!reading)
            emacm_finish(&s);
        worst = (emacm_real)fabs(s.typicality - TYPICALITY[number]);
        for (c = 0; c < EMACM_FEATURES; c++) {
            apart = (emacm_real)fabs(s.features[c] - FEATURES[number][c]);
            worst = (emacm_real)fmax(worst, apart / (1 + fabs(FEATURES[number][c])));
        }
        failed = s.decision != DECISION[number] || (s.decision >= 0 && !(worst <= TOLERANCE));
        n_failed += failed;
        printf("reading %d: %s, flags %lu, typicality %.4f, deviation from Python %.2g%s\n", number,
               s.decision < 0 ? "no decision" : emacm_decisions[s.decision],
               (unsigned long)s.flags, s.typicality, worst, failed ? " DIFFERS" : "");
    }
    printf("%d of %d readings as in Python; the state has %lu bytes\n", N_READINGS - n_failed,
           N_READINGS, (unsigned long)sizeof s);
    return n_failed > 0;
}
