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

//always
typedef $model ha_model;

//always
enum {
    HA_NX = $MODEL_STATES,
    HA_NU = $MODEL_INPUTS,
    HA_NP = $MODEL_PARAMETERS,
    HA_NY = $MODEL_OUTPUTS,
    HA_NZ = $COUNT_HELD
};

//always
enum {
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

//if impulses
//always
enum {
    /* What storages keep; balances of impulses; states and constants by which storages tell what they keep; impulses. */
    HA_STORED = $JUMP_STORED,
    HA_BALANCES = $JUMP_BALANCES,
    HA_UNKNOWNS = $JUMP_UNKNOWNS,
    HA_IMPULSES = $JUMP_IMPULSES,
    /* Where what resets change begins among what is computed. */
    HA_FIRST_MOVED = $FIRST_MOVED
};
//end
