/* $MODEL_TITLE, written by halfarrow. What it keeps to:
$OBLIGATION_LINES
 */
#include "$model.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "results need arithmetic without excess precision: on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif
#ifdef __FAST_MATH__
#error "results need arithmetic by the standard: compile without -ffast-math"
#endif

typedef $model ha_model;

enum {
    HA_NX = $MODEL_STATES,
    HA_NU = $MODEL_INPUTS,
    HA_NP = $MODEL_PARAMETERS,
    HA_NY = $MODEL_OUTPUTS,
    HA_NZ = $COUNT_HELD,
    HA_NK = $COUNT_CONSERVED,
    HA_NQ = $COUNT_POSITIONS,
    HA_NG = $COUNT_INDICATORS,
    /* A direction: time, inputs, held signals, conserved constants, states, positions at the start. */
    HA_DIRECTION = $LAYOUT_DIRECTION,
    HA_HELD_AT = $LAYOUT_HELD,
    HA_CONSERVED_AT = $LAYOUT_CONSERVED,
    HA_STATES_AT = $LAYOUT_STATES,
    HA_POSITIONS_AT = $LAYOUT_POSITIONS
};

