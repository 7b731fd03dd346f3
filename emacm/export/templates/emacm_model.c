/* A fitted model of emacm ${version} in C99. The algorithm is that of emacm.OrderMonitor.
   Compile without options that change the order of sums (-ffast-math). */
#include "emacm_model.h"

#include <math.h>
#include <string.h>

typedef emacm_real real;
#define MATH(name) ${math}
#define SAMPLES(s, q) ((s)->held[(q) % EMACM_HELD])
#define VELOCITY(s, q) ((s)->velocity[(q) % EMACM_HELD])

${tables}
const char *const emacm_classes[EMACM_CLASSES] = {${classes}};
const char *const emacm_decisions[EMACM_DECISIONS] = {${decisions}};

static void accumulate(real *sum, real *lost, real step) /* Kahan's compensated sum */
{
    volatile real total, kept;
    step -= *lost;
    total = *sum + step;
    kept = total - *sum;
    *lost = kept - step;
    *sum = total;
}

/* Transform EMACM_SEGMENT / 2 complex numbers, which are in the order of PLACES. */
static void transform(real *z)
{
    uint32_t size = EMACM_SEGMENT / 2, m = 1, n, p, start, k, q, r, w;
    real t[2 * LARGEST_RADIX], re, im, *x;
    int stage;
    for (stage = 0; stage < N_RADICES; stage++, m = n) {
        p = RADICES[stage];
        n = m * p;
        for (start = 0; start < size; start += n)
            for (k = 0; k < m; k++) {
                x = z + 2 * (start + k);
                for (q = 0; q < p; q++) {
                    w = q * k * (EMACM_SEGMENT / n);
                    re = x[2 * q * m];
                    im = x[2 * q * m + 1];
                    t[2 * q] = re * COSINE[w] + im * SINE[w];
                    t[2 * q + 1] = im * COSINE[w] - re * SINE[w];
                }
                if (p == 2) {
                    x[0] = t[0] + t[2];
                    x[1] = t[1] + t[3];
                    x[2 * m] = t[0] - t[2];
                    x[2 * m + 1] = t[1] - t[3];
                    continue;
                }
                for (r = 0; r < p; r++) {
                    re = im = 0;
                    for (q = 0; q < p; q++) {
                        w = q * r % p * (EMACM_SEGMENT / p);
                        re += t[2 * q] * COSINE[w] + t[2 * q + 1] * SINE[w];
                        im += t[2 * q + 1] * COSINE[w] - t[2 * q] * SINE[w];
                    }
                    x[2 * r * m] = re;
                    x[2 * r * m + 1] = im;
                }
            }
    }
}

/* Set a line of a real signal from the transform of its even and odd samples. */
static void line_of(const real *z, uint32_t k, real *re, real *im)
{
    uint32_t size = EMACM_SEGMENT / 2;
    const real *a = z + 2 * (k % size), *b = z + 2 * ((size - k) % size);
    real odd_re = (a[1] + b[1]) / 2, odd_im = (b[0] - a[0]) / 2;
    *re = (a[0] + b[0]) / 2 + COSINE[k] * odd_re + SINE[k] * odd_im;
    *im = (a[1] - b[1]) / 2 + COSINE[k] * odd_im - SINE[k] * odd_re;
}

/* Transform a windowed segment. */
static void transform_segment(emacm_state *s, const real *ring, uint32_t start, int row)
{
    uint32_t i;
    real mean = 0, *z = s->work;
    for (i = 0; i < EMACM_SEGMENT; i++)
        mean += ring[(start + i) % EMACM_RING];
    mean = DETREND ? mean / EMACM_SEGMENT : row == EMACM_CHANNELS ? 0 : -s->stroke.first[row];
    for (i = 0; i < EMACM_SEGMENT; i++)
        z[2 * PLACES[i / 2] + (i & 1)] = (ring[(start + i) % EMACM_RING] - mean) * WINDOW[i];
    transform(z);
}

/* Add the powers of a segment to the bins. The mean that is subtracted from a channel is known
   later: the powers of channel, constant 1, and both are summed apart. */
static void add_segment(emacm_state *s, int d, emacm_density *b)
{
    int row;
    uint32_t k, e;
    real re, im, *u = s->lines;
    for (row = EMACM_CHANNELS; row >= 0; row--) {
        transform_segment(s, s->ring[d][row], b->next, row);
        for (k = 0; k < EMACM_LINES; k++) {
            line_of(s->work, k, &re, &im);
            if (row == EMACM_CHANNELS) {
                u[2 * k] = re;
                u[2 * k + 1] = im;
            }
            for (e = BIN_FROM[k]; e < BIN_FROM[k + 1]; e++) {
                b->power[row][BIN_OF[e]] += BIN_WEIGHT[e] * (re * re + im * im);
                if (row < EMACM_CHANNELS)
                    b->cross[row][BIN_OF[e]] += BIN_WEIGHT[e] * (re * u[2 * k] + im * u[2 * k + 1]);
            }
        }
    }
    b->count++;
    b->next += STEP;
}

/* Filter the grid for the next sample over angle, and move on by two points. */
static void emit(emacm_state *s, int d, emacm_density *b)
{
    uint32_t base = 2 * b->done, mask = EMACM_GRID - 1, i;
    int row;
    for (row = 0; row < EMACM_ROWS; row++) {
        real *grid = b->grid[row], sum = TAPS[HALF] * grid[(base + FIRST + HALF) & mask];
        for (i = 0; i < HALF; i++)
            sum += TAPS[i] * (grid[(base + FIRST + i) & mask] +
                              grid[(base + FIRST + 2 * HALF - i) & mask]);
        /* Of the constant 1, what the resampling lacks. */
        s->ring[d][row][b->done % EMACM_RING] = row == EMACM_CHANNELS ? 1 - sum : sum;
        grid[base & mask] = grid[(base + 1) & mask] = 0;
    }
    b->done++;
    b->at -= 2;
    b->reached -= 2;
    for (i = 0; i < b->n_tail; i++)
        b->tail_at[i] -= 2;
    if (b->done - b->next == EMACM_SEGMENT)
        add_segment(s, d, b);
}

/* Add a weighted sample to the four points around a place; none beyond what is held. */
static void add_to_grid(emacm_density *b, real at, const real *weighted)
{
    uint32_t cell, mask = EMACM_GRID - 1;
    real place, square, even[2], odd[2], *grid;
    int row, i;
    if (!(at >= 1 && at < EMACM_GRID - 2))
        return;
    cell = (uint32_t)at;
    place = at - (real)cell - (real)0.5;
    square = place * place;
    for (i = 0; i < 2; i++) {
        const real *c = KERNEL[i];
        even[i] = (c[4] * square + c[2]) * square + c[0];
        odd[i] = ((c[5] * square + c[3]) * square + c[1]) * place;
    }
    cell += 2 * b->done - 1;
    for (row = 0; row < EMACM_ROWS; row++) {
        grid = b->grid[row];
        grid[cell & mask] += (even[0] + odd[0]) * weighted[row];
        grid[(cell + 1) & mask] += (even[1] + odd[1]) * weighted[row];
        grid[(cell + 2) & mask] += (even[1] - odd[1]) * weighted[row];
        grid[(cell + 3) & mask] += (even[0] - odd[0]) * weighted[row];
    }
}

/* Make room: forget samples too far from the end, and divide those between near neighbours among
   them, so that sums and first moments remain. */
static void thin_tail(emacm_density *b)
{
    real apart = TAIL_RANGE / EMACM_TAIL, span, share;
    uint32_t i, n;
    int row, round;
    for (round = 0; round == 0 || b->n_tail > EMACM_TAIL / 4 * 3; round++, apart *= 2) {
        for (i = n = 0; i < b->n_tail; i++) {
            if (b->tail_at[i] <= b->reached - TAIL_RANGE)
                continue;
            span = round && n && i + 1 < b->n_tail ? b->tail_at[i + 1] - b->tail_at[n - 1] : apart;
            if (MATH(fabs)(span) < apart) {
                share = span > 0 ? (b->tail_at[i] - b->tail_at[n - 1]) / span : 1;
                share = MATH(fmin)(MATH(fmax)(share, 0), 1);
                for (row = 0; row < EMACM_ROWS; row++) {
                    b->tail[n - 1][row] += (1 - share) * b->tail[i][row];
                    b->tail[i + 1][row] += share * b->tail[i][row];
                }
                continue;
            }
            b->tail_at[n] = b->tail_at[i];
            memmove(b->tail[n++], b->tail[i], sizeof b->tail[i]);
        }
        b->n_tail = n;
    }
}

/* Spread a sample that stands for the way halfway to its neighbours. */
static void spread(emacm_state *s, int d, emacm_density *b, real at, real width, real *values)
{
    int row;
    for (row = 0; row < EMACM_CHANNELS; row++)
        values[row] *= width;
    values[EMACM_CHANNELS] = width;
    add_to_grid(b, at, values);
    if (b->done == 0) /* its mirror image at the start */
        add_to_grid(b, 2 * MARGIN - at, values);
    if (width != 0) {
        if (b->n_tail == EMACM_TAIL)
            thin_tail(b);
        b->tail_at[b->n_tail] = at;
        memcpy(b->tail[b->n_tail++], values, sizeof b->tail[0]);
    }
    if (at > b->reached)
        b->reached = at;
    while (b->reached >= LAG + 2)
        emit(s, d, b);
}

/* Set the values at a place after a sample, by band-limited interpolation over time. */
static void set_values(const emacm_state *s, int factor, uint32_t q, int place, real *values)
{
    const real(*held)[EMACM_CHANNELS] = s->is_restored ? s->kept_held : s->held;
    const real *first = s->stroke.first;
    real gain = 0;
    int c, j;
    for (c = 0; c < EMACM_CHANNELS; c++)
        values[c] = factor == 1 ? held[q % EMACM_HELD][c] - first[c] : 0;
    for (j = -REACH; factor > 1 && j <= REACH; j++) {
        int tap = (REACH - j) * factor + place; /* of the filter for this density */
        uint32_t from = q + (uint32_t)j, last = s->n_pushed - 1;
        if (tap > 2 * REACH * factor)
            continue;
        if (j < 0 && q < (uint32_t)-j) /* the signal is mirrored at the ends of the reading */
            from = (uint32_t)-j - q;
        else if (s->is_ended && from > last)
            from = 2 * last - from;
        gain += UPSAMPLING[factor - 1][tap];
        for (c = 0; c < EMACM_CHANNELS; c++)
            values[c] += UPSAMPLING[factor - 1][tap] * (held[from % EMACM_HELD][c] - first[c]);
    }
    for (c = 0; factor > 1 && c < EMACM_CHANNELS; c++)
        values[c] += (gain - 1) * first[c]; /* the filter does not pass a constant exactly */
}

/* Spread sample q and the denser ones up to the next: the way between samples is a cubic. */
static void spread_interval(emacm_state *s, int d, uint32_t q, real d1, real d2, real d3)
{
    emacm_density *b = &s->stroke.density[d];
    int r, factor = d + 1;
    real from = 0, to, u, values[EMACM_ROWS];
    for (r = 0; r < factor; r++, from = to) {
        u = (real)(r + 1) / (real)factor;
        to = d2;
        if (r + 1 < factor)
            to = d1 * u * (u - 1) * (u - 2) / 6 - d2 * (u + 1) * u * (u - 2) / 2 +
                 (d2 + d3) * (u + 1) * u * (u - 1) / 6;
        set_values(s, factor, q, r, values);
        spread(s, d, b, b->at + from, (b->gap + to - from) / 2, values);
        b->gap = to - from;
    }
    accumulate(&b->at, &b->lost, d2);
}

static void append(emacm_state *s, uint32_t q)
{
    emacm_stroke *t = &s->stroke;
    real v = VELOCITY(s, q), way = 0;
    int c, d;
    if (t->n)
        way = (real)s->direction * POINTS * (v + VELOCITY(s, q - 1));
    for (c = 0; c < EMACM_CHANNELS && t->n < MEAN_OF; c++)
        t->sum[c] += SAMPLES(s, q)[c] - t->first[c];
    t->back = MATH(fmax)(0, t->back - way);
    t->reversal = MATH(fmax)(t->reversal, t->back);
    t->fastest = MATH(fmax)(t->fastest, MATH(fabs)(v));
    t->n++;
    for (d = 0; d < EMACM_DENSITIES; d++) {
        real *e = t->density[d].step;
        e[0] = e[1];
        e[1] = e[2];
        e[2] = way;
        if (t->fastest > SPEEDS[d] || t->n < 4)
            continue; /* the samples are too sparse, or the first cubic is not known yet */
        if (t->n == 4)
            spread_interval(s, d, q - 3, 3 * (e[0] - e[1]) + e[2], e[0], e[1]);
        spread_interval(s, d, q - 2, e[0], e[1], e[2]);
    }
}

static void begin_stroke(emacm_state *s, uint32_t q, int direction)
{
    emacm_stroke *t = &s->stroke;
    int d;
    s->direction = TURNS[direction < 0] ? direction : 0;
    s->is_resting = s->is_restored = 0;
    if (!s->direction)
        return;
    memset(t, 0, sizeof *t);
    memcpy(t->first, SAMPLES(s, q), sizeof t->first);
    for (d = 0; d < EMACM_DENSITIES; d++)
        t->density[d].at = t->density[d].reached = MARGIN;
    t->last = q;
    append(s, q);
}

/* End the stroke at the last sample in which the shaft turned. */
static void end_stroke(emacm_state *s)
{
    emacm_stroke *t = &s->stroke;
    emacm_density *b;
    uint32_t n_angles, i;
    int d, c, kind = EMACM_KINDS > 1 && s->direction < 0;
    real *e, *ones, mean, end, values[EMACM_ROWS];
    if (!s->direction)
        return;
    s->direction = 0;
    if (s->is_resting) {
        for (d = 0; d < EMACM_DENSITIES; d++)
            if (t->density[d].done - s->kept.density[d].next > EMACM_RING)
                s->found |= EMACM_CREPT; /* samples over angle are lost */
        memcpy(t, &s->kept, sizeof *t);
    }
    s->is_restored = s->is_resting;
    for (d = 0; d < EMACM_DENSITIES - 1 && t->fastest > SPEEDS[d]; d++)
        ;
    b = &t->density[d];
    ones = b->power[EMACM_CHANNELS];
    e = b->step;
    if (t->n < 4)
        return;
    spread_interval(s, d, t->last - 1, e[1], e[2], 3 * (e[2] - e[1]) + e[0]);
    set_values(s, d + 1, t->last, 0, values);
    spread(s, d, b, b->at, b->gap / 2, values);
    end = (b->at - MARGIN) / 2 + ROUNDING;
    n_angles = end < 0 ? 0 : b->done + (uint32_t)end + 1;
    if (n_angles >= EMACM_SEGMENT && t->reversal > MAX_REVERSAL)
        s->found |= EMACM_TURNED_BACK;
    if (n_angles >= b->next + EMACM_SEGMENT) {
        for (i = 0; i < b->n_tail; i++) /* mirror images at the end */
            add_to_grid(b, 2 * b->at - b->tail_at[i], b->tail[i]);
        while (b->done < n_angles)
            emit(s, d, b);
    }
    for (c = 0; c < EMACM_CHANNELS; c++) {
        mean = t->sum[c] / (real)(t->n < MEAN_OF ? t->n : MEAN_OF);
        for (i = 0; i < EMACM_BINS; i++)
            s->total[c][kind][i] += b->power[c][i] + mean * (2 * b->cross[c][i] + mean * ones[i]);
    }
    s->count[kind] += b->count;
}

/* Follow the strokes of the shaft by one more sample. */
static void take(emacm_state *s, uint32_t q)
{
    emacm_stroke *t = &s->stroke;
    real v = VELOCITY(s, q);
    int turns = MATH(fabs)(v) > MIN_SPEED, direction = v > 0 ? 1 : -1;
    if (s->direction && ((turns && direction != s->direction) || q - t->last > MAX_GAP))
        end_stroke(s);
    if (!s->direction) {
        if (turns)
            begin_stroke(s, q, direction);
        return;
    }
    if (!turns && !s->is_resting) { /* it may be the end of the stroke */
        memcpy(&s->kept, t, sizeof *t);
        memcpy(s->kept_held, s->held, sizeof s->held);
    }
    s->is_resting = !turns;
    append(s, q);
    if (turns)
        t->last = q;
}

/* Squared length of (x - mean) times a matrix; of no columns, times a diagonal. */
static real squared_length(const real *x, const real *mean, const real *matrix, int n_columns)
{
    int i, j;
    real total = 0, sum;
    for (j = 0; j < (n_columns ? n_columns : EMACM_FEATURES); j++) {
        sum = n_columns ? 0 : (x[j] - mean[j]) * matrix[j];
        for (i = 0; n_columns && i < EMACM_FEATURES; i++)
            sum += (mean ? x[i] - mean[i] : x[i]) * matrix[i * n_columns + j];
        total += sum * sum;
    }
    return total;
}

#if HAS_TYPICALITY
/* Continued fraction of the incomplete beta function, by the method of Lentz. */
static real beta_fraction(real a, real b, real x)
{
    real c = 1, d = 1 / (1 - (a + b) * x / (a + 1)), product = d, m, term;
    int k, odd;
    for (k = 1, m = 1; k < 300; k++, m++) {
        for (odd = 0; odd < 2; odd++) {
            term = odd ? -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
                       : m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
            d = 1 / (1 + term * d);
            c = 1 + term / c;
            product *= c * d;
        }
        if (MATH(fabs)(c * d - 1) < TIED)
            break;
    }
    return product;
}

/* Probability that Student's t is above a positive limit. */
static real student_above(real limit)
{
    real a = DEGREES / 2, b = (real)0.5, ratio = limit * limit / DEGREES;
    real x = 1 / (1 + ratio), rest = ratio / (1 + ratio), front;
    front = MATH(exp)(LOG_BETA - a * MATH(log1p)(ratio) + b * MATH(log)(rest)) / 2;
    if (x < (a + 1) / (a + b + 2))
        return front * beta_fraction(a, b, x) / a;
    return (real)0.5 - front * beta_fraction(b, a, rest) / b;
}

/* Fraction of left-out training recordings that are at least as far from all classes. */
static real typicality_of(const real *x, real *scaled)
{
    real logs[3], inside[EMACM_CLASSES], far = LARGEST, value, large, sum;
    int i, k, nearest = 0;
    for (k = 0; k < EMACM_CLASSES; k++) {
        inside[k] = 0;
        if (N_DIRECTIONS)
            inside[k] = MATH(fmin)(
                squared_length(x, CLASS_MEANS[k], DIRECTIONS, N_DIRECTIONS), LARGEST);
        if (inside[k] < inside[nearest])
            nearest = k;
    }
    for (i = 0, large = 0; i < EMACM_FEATURES; i++) {
        value = (x[i] - CLASS_MEANS[nearest][i]) / DEVIATIONS[i];
        large = MATH(fmax)(large, value * value);
        value *= MATH(sqrt)(2 / (1 + MATH(sqrt)(1 + value * value / 9)));
        scaled[i] = value * DEVIATIONS[i];
    }
    sum = squared_length(scaled, 0, FACTOR, EMACM_FEATURES);
    if (N_DIRECTIONS)
        sum -= squared_length(scaled, 0, DIRECTIONS, N_DIRECTIONS);
    logs[1] = MATH(log)(MATH(fmax)(MATH(fmin)(sum, LARGEST), 0) + (real)1e-3);
    logs[2] = MATH(log)(MATH(fmin)(large, LARGEST) + (real)1e-3);
    for (k = 0; k < EMACM_CLASSES; k++) { /* logarithm of a sum of exponentials */
        logs[0] = MATH(log)(inside[k] + (real)1e-3);
        for (i = 0, large = -LARGEST; i < 3; i++)
            if (USED[i])
                large = MATH(fmax)(large, logs[i] * SLOPES[i] - LEVELS[i][k]);
        for (i = 0, sum = 0; i < 3; i++)
            if (USED[i])
                sum += MATH(exp)(logs[i] * SLOPES[i] - LEVELS[i][k] - large);
        far = MATH(fmin)(far, large + MATH(log)(sum));
    }
    if (far > THRESHOLD) {
        value = student_above(TAIL_AT + TAIL_MEAN * (far - THRESHOLD)) / TAIL_SHARE;
        return MATH(fmax)(TAIL_PEAKS * MATH(fmin)(value, 1), SMALLEST);
    }
    for (i = 0; i < N_VALUES && VALUES[i] < far; i++)
        ;
    return SURVIVAL[i];
}

/* Bayes factor for the unknown state. */
static real evidence(real typicality)
{
    real surprise = -MATH(log)(typicality);
    if (surprise < SERIES)
        return (real)0.5 + surprise / 6 + surprise * surprise / 24;
    return (MATH(expm1)(surprise) - surprise) / (surprise * surprise);
}
#endif

/* Classify the averaged powers; return the decision of least risk, or -1. */
static int decide(emacm_state *s)
{
    real *z = s->work, *x = s->features, joint[EMACM_CLASSES], truth[EMACM_TRUTHS];
    real risks[EMACM_DECISIONS], largest = -INFINITY, sum = 0, least = INFINITY, value;
    int n = 0, c, i, k, decision = -1, n_tied = 0, is_unknown = 1;
    for (k = 0; k < EMACM_KINDS; k++)
        if (s->count[k] == 0)
            s->flags |= EMACM_NO_SEGMENT;
    if (s->flags & ~(uint32_t)EMACM_REJECTED)
        return -1;
    for (c = 0; c < EMACM_CHANNELS; c++)
        for (k = 0; k < EMACM_KINDS; k++)
            for (i = 0; i < EMACM_BINS; i++)
                z[n++] = s->total[ORDER[c]][k][i] / (real)s->count[k];
${stages}
    for (i = 0; i < EMACM_FEATURES; i++) {
        x[i] = z[i];
        if (!isfinite(x[i]))
            s->flags |= EMACM_OVERFLOW;
    }
    for (k = 0; k < EMACM_CLASSES; k++) { /* Eq. (2.44) of Chirico, and the prior */
        value = squared_length(x, MEANS[k], FACTORS[k % N_GROUPS], FACTOR_COLUMNS);
        joint[k] = (real)-0.5 * (MATH(fmin)(value, INFINITY) + LOG_SCALE[k]) / TEMPERATURE;
        joint[k] += LOG_PRIORS[k];
        largest = MATH(fmax)(largest, joint[k]);
    }
    if (largest == -INFINITY && !HAS_UNKNOWN)
        s->flags |= EMACM_OVERFLOW;
    if (s->flags & EMACM_OVERFLOW)
        return -1;
    for (k = 0; k < EMACM_CLASSES; k++) {
        if (largest == -INFINITY) /* nothing tells the classes apart; it is unknown */
            joint[k] = LOG_PRIORS[k];
        s->posterior[k] = MATH(exp)(joint[k] - (largest == -INFINITY ? 0 : largest));
        sum += s->posterior[k];
    }
    s->typicality = -1;
    s->unknown = 0;
#if HAS_TYPICALITY
    s->typicality = typicality_of(x, s->work);
    if (HAS_UNKNOWN) {
        value = UNKNOWN_LIMIT > 0 ? (real)0.5 : evidence(s->typicality);
        if (UNKNOWN_LIMIT > 0 && s->typicality <= UNKNOWN_LIMIT)
            value = (1 + evidence(s->typicality / UNKNOWN_LIMIT) / UNKNOWN_LIMIT) / 2;
        s->unknown = isinf(value) ? 1 : 1 / (1 + (1 - UNKNOWN_PRIOR) / (UNKNOWN_PRIOR * value));
    }
#endif
    for (k = 0; k < EMACM_CLASSES; k++) {
        s->posterior[k] /= sum;
        truth[k] = s->posterior[k] * (1 - s->unknown);
        is_unknown = is_unknown && truth[k] < s->unknown;
    }
    if (HAS_UNKNOWN)
        truth[EMACM_TRUTHS - 1] = s->unknown;
    for (i = 0; i < EMACM_DECISIONS; i++) {
        s->risk[i] = risks[i] = 0;
        for (k = 0; k < EMACM_TRUTHS; k++) {
            s->risk[i] += COST[i][k] * truth[k];
            risks[i] += CANONICAL_COST[i][k] * truth[k];
        }
        least = MATH(fmin)(least, risks[i]);
    }
    /* Of equal risks the first; the unknown state if and only if it is the most probable one. */
    for (i = 0; i < EMACM_DECISIONS; i++)
        n_tied += risks[i] <= least * (1 + TIED);
    for (i = EMACM_DECISIONS - 1; i >= 0; i--)
        if (risks[i] <= least * (1 + TIED) && (i != UNKNOWN_ROW || is_unknown || n_tied == 1))
            decision = i;
    if (HAS_UNKNOWN && is_unknown && risks[UNKNOWN_ROW] <= least * (1 + TIED))
        decision = UNKNOWN_ROW;
    return decision;
}

static void begin_reading(emacm_state *s)
{
    memset(s->total, 0, sizeof s->total);
    memset(s->count, 0, sizeof s->count);
    s->turned = s->turned_lost = 0;
    s->n_pushed = s->n_taken = s->found = 0;
    s->direction = s->is_resting = s->is_restored = s->is_ended = 0;
}

void emacm_reset(emacm_state *s)
{
    memset(s, 0, sizeof *s);
    s->decision = -1;
}

static int complete(emacm_state *s)
{
    s->is_ended = 1;
    for (; s->n_taken != s->n_pushed; s->n_taken++)
        take(s, s->n_taken);
    end_stroke(s);
    s->flags = s->found;
    s->decision = decide(s);
    begin_reading(s);
    return 1;
}

int emacm_finish(emacm_state *s)
{
    s->has_before = 0;
    return s->n_pushed == 0 ? 0 : complete(s);
}

int emacm_push(emacm_state *s, const emacm_real *samples, emacm_real velocity)
{
    uint32_t q = s->n_pushed;
    int c, is_valid = MATH(fabs)(velocity) <= (real)EMACM_MAX_SPEED;
    for (c = 0; c < EMACM_CHANNELS; c++)
        is_valid = is_valid && isfinite(samples[c]);
    if (!is_valid) {
        begin_reading(s);
        s->has_before = 0;
        s->found |= EMACM_REJECTED;
        s->flags |= EMACM_REJECTED;
        return 0;
    }
    memcpy(SAMPLES(s, q), samples, sizeof s->held[0]);
    VELOCITY(s, q) = velocity;
    if (s->has_before && MATH(fabs)(velocity) > MIN_SPEED)
        accumulate(&s->turned, &s->turned_lost, MATH(fabs)(velocity + s->before));
    s->before = velocity;
    s->has_before = 1;
    s->n_pushed++;
    if (EMACM_EVERY > 0 && s->turned - LIMIT - s->turned_lost >= LIMIT_REST)
        return complete(s);
    for (; s->n_pushed - s->n_taken > (uint32_t)DELAY; s->n_taken++)
        take(s, s->n_taken);
    return 0;
}
