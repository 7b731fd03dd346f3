/* A fitted model of emacm ${version} in C99: from samples over time to a decision. See README.md. */
#ifndef EMACM_MODEL_H
#define EMACM_MODEL_H

#include <stdint.h>

typedef ${real} emacm_real;

#define EMACM_FS ${fs}         /* sampling rate of the channels and the velocity [Hz] */
#define EMACM_MAX_SPEED ${max_speed}  /* of the measured shaft [rad/s] */
#define EMACM_EVERY ${every}      /* revolutions of a reading; 0: all up to emacm_finish */
#define EMACM_CHANNELS ${n_channels}     /* ${channels} */
#define EMACM_ROWS ${n_rows}         /* the channels, and a constant 1 */
#define EMACM_KINDS ${n_kinds}        /* 2: forward and reverse strokes apart */
#define EMACM_SEGMENT ${length}   /* samples over angle */
#define EMACM_LINES ${n_lines}     /* spectral lines in use */
#define EMACM_BINS ${n_bins}       /* of a channel */
#define EMACM_WORK ${n_work}
#define EMACM_FEATURES ${n_features}
#define EMACM_CLASSES ${n_classes}
#define EMACM_TRUTHS ${n_truths}      /* with the unknown state, if the model has one */
#define EMACM_DECISIONS ${n_decisions}
#define EMACM_DENSITIES ${n_densities}    /* the samples as they are, and up to so many times as dense */
#define EMACM_GRID ${grid}       /* points over angle that are held, a power of 2 */
#define EMACM_RING ${ring}      /* samples over angle that are held */
#define EMACM_HELD ${held}        /* samples over time that are held, a power of 2 */
#define EMACM_TAIL ${tail}       /* samples near the end of a stroke; more of them are merged */

enum { /* emacm_state.flags; with any of them but the last one, there is no decision */
    EMACM_NO_SEGMENT = 1,   /* no stroke (of one direction) is as long as a segment */
    EMACM_NO_POWER = 2,     /* a bin without power: a constant or dead channel */
    EMACM_OVERFLOW = 4,     /* features are not finite, or too far from all classes */
    EMACM_TURNED_BACK = 8,  /* the shaft turned back by more than 0.25 rad along a stroke */
    EMACM_CREPT = 16,       /* the shaft moved too far at or below the speed of standstill */
    EMACM_REJECTED = 32     /* a sample was not finite or too fast: the reading began anew */
};

typedef struct { /* a stroke, of samples of one density */
    emacm_real grid[EMACM_ROWS][EMACM_GRID];
    emacm_real tail_at[EMACM_TAIL], tail[EMACM_TAIL][EMACM_ROWS];
    emacm_real power[EMACM_ROWS][EMACM_BINS], cross[EMACM_CHANNELS][EMACM_BINS];
    emacm_real at, lost, reached, gap, step[3];
    uint32_t done, next, count, n_tail;
} emacm_density;

typedef struct {
    emacm_density density[EMACM_DENSITIES];
    emacm_real first[EMACM_CHANNELS], sum[EMACM_CHANNELS];
    emacm_real fastest, back, reversal;
    uint32_t n, last;
} emacm_stroke;

typedef struct {
    /* The last reading. */
    int decision;                           /* place in emacm_decisions; -1: none, see flags */
    uint32_t flags;
    emacm_real features[EMACM_FEATURES];    /* input of the classifier */
    emacm_real posterior[EMACM_CLASSES];    /* given that one of emacm_classes is true */
    emacm_real unknown;                     /* probability of the unknown state */
    emacm_real typicality;                  /* -1: the model does not state it */
    emacm_real risk[EMACM_DECISIONS];       /* expected cost of each decision */
    /* What the next one needs. */
    emacm_stroke stroke, kept;
    emacm_real ring[EMACM_DENSITIES][EMACM_ROWS][EMACM_RING];
    emacm_real work[EMACM_WORK], lines[2 * EMACM_LINES];
    emacm_real total[EMACM_CHANNELS][EMACM_KINDS][EMACM_BINS];
    emacm_real held[EMACM_HELD][EMACM_CHANNELS], kept_held[EMACM_HELD][EMACM_CHANNELS];
    emacm_real velocity[EMACM_HELD];
    emacm_real turned, turned_lost, before;
    uint32_t count[EMACM_KINDS], n_pushed, n_taken, found;
    int direction, is_resting, is_restored, has_before, is_ended;
} emacm_state;

extern const char *const emacm_classes[EMACM_CLASSES];
extern const char *const emacm_decisions[EMACM_DECISIONS];

void emacm_reset(emacm_state *s);
/* Take one sample of each channel and the velocity [rad/s]; 1 when a reading is complete. */
int emacm_push(emacm_state *s, const emacm_real *samples, emacm_real velocity);
/* Complete the reading with the samples so far; 1, or 0 if there is none. */
int emacm_finish(emacm_state *s);

#endif
