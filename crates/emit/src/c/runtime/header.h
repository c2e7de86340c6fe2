/* $MODEL_NAME: a model to be stepped, written by halfarrow.
 *
 *     static $model m;                       no heap and no global state: a model is one plain structure,
 *     if ($model_reset(&m) == $MODEL_OK       which can be copied to save it and copied back
 *         && $model_start(&m, 0.0) == $MODEL_OK) {
 *         while (m.t < 10.0 && $model_step(&m) == $MODEL_OK) {
 *             ...                           outputs are in m.y, inputs may be set in m.u
 *         }
 *     }
 *
 * All values are in SI units. Every function but $model_message gives 0 or the code of a failure, which then stands in
 * m.failure; $model_message says what it means. After a failure the model has to be started again.
 *
//if single
 * Real numbers are float. Time is double, so that it does not stand still in long runs; so is what follows from time or from
 * parameters alone, until something else reads it. What a step adds to a state is carried on where it is less than its last
 * digit.
 *
//end
 * Method: $METHOD_NAME with a step of $STEP_LENGTH s. What a step costs at most:
$COST_LINES
 */
#ifndef $MODEL_GUARD_H
#define $MODEL_GUARD_H

#ifdef __cplusplus
extern "C" {
#endif

/* How many there are. */
enum {
    $MODEL_STATES = $NUMBER_STATES,
    $MODEL_INPUTS = $NUMBER_INPUTS,
    $MODEL_PARAMETERS = $NUMBER_PARAMETERS,
    $MODEL_OUTPUTS = $NUMBER_OUTPUTS,
    $MODEL_INDICATORS = $NUMBER_INDICATORS,
    /* Jumps within one step at most. */
    $MODEL_MOST_JUMPS = $NUMBER_JUMPS
};

//if states
/* Places in m.x. */
enum {
$STATE_LINES
};

//end
//if inputs
/* Places in m.u. A changed input is a jump at the beginning of the next step, then constant. */
enum {
$INPUT_LINES
};

//end
//if parameters
/* Places in m.p; to be set by $model_set_parameter. What follows from a parameter follows it. */
enum {
$PARAMETER_LINES
};

//end
//if outputs
/* Places in m.y. */
enum {
$OUTPUT_LINES
};

//end
/* Why something failed. */
enum {
    $MODEL_OK = 0,
$CODES
};

typedef struct $model_failure {
    int code;
    /* Which of its kind: of the equations, states, laws... */
    int where;
    /* When, in s; not a number if at any time. */
    double time;
} $model_failure;

//if delays
typedef struct $model_point {
    double t;
    $real value, slope, jump;
} $model_point;

typedef struct $model_delay {
    double time, start;
    int first, count, full;
} $model_delay;

//end
//if samples
typedef struct $model_sample {
    double period, next, taken;
    $real value;
} $model_sample;

//end
//if clauses
/* What happens at events: whether a condition holds, when it became true last and how fast that follows each other, or period
 * and number of the next time; whether it happens now. */
typedef struct $model_clause {
    double start, last, interval, period, next;
    int holds, faster, fired;
} $model_clause;

//end
typedef struct $model {
$PUBLIC_PARTS

    /* What follows is for the functions below. */
$PRIVATE_PARTS
} $model;

/* Everything as the model says, parameters at their defaults. */
int $model_reset($model *m);

/* Sets a parameter. Before a start the start values follow it; during a run it is a jump at the present time.
 * $MODEL_STRUCTURE says that the equations are others with this value: it is taken, but no run starts or goes on until other
 * parameters fit it. */
int $model_set_parameter($model *m, int parameter, double value);

/* Begins a run at a time with the start values of the model; outputs are then those at the start. They were found by the
 * exporter; for other parameters, inputs or times they are solved for here, or $MODEL_NO_START says that they were not. */
int $model_start($model *m, double t);

//if modes
/* Begins a run at a time with these states, which are those of mode 0: a run that stands in another one is gone on from by a copy of
 * the structure. */
//else
/* Begins a run at a time with these states. */
//end
int $model_start_from($model *m, double t, const $real *x);

/* One step; jumps within it are met exactly. */
int $model_step($model *m);

/* One step that ends at another time than the next one: not more than m.step away. */
int $model_step_until($model *m, double end);

/* Counts steps from the present time on. */
void $model_align($model *m);

/* What the last failure means. */
const char *$model_message(const $model *m);

/* ---- for another integrator: what $model_step is made of ---- */

/* Rates of the states, as in the present interval between jumps. */
int $model_rates($model *m, double t, const $real *x, $real *dx);

/* Outputs. */
int $model_observe($model *m, double t, const $real *x, $real *y);

//if directional_derivative
/* Derivatives of the rates along a direction v of the states, exactly. */
int $model_tangent($model *m, double t, const $real *x, const $real *v, $real *dv);

//end
//if derivatives
/* Derivatives of rates (dv) and outputs (dy), where asked for, along a direction of the states (v) and inputs (w), exactly. */
int $model_directional($model *m, double t, const $real *x, const $real *v, const $real *w, $real *dv, $real *dy);

//end
//if switches
/* Functions of the state that change their sign where a condition switches. */
int $model_indicators($model *m, double t, const $real *x, $real *g);

/* Whether one of them has another sign than at the last jump. */
int $model_switched($model *m, double t, const $real *x, int *switched);

//end
//if modes
/* Whether the present mode is over where no indicator has told it: a branch of a set-valued law has ended, or other variables should be
 * independent. The run stands at a jump then, behind which $model_go_on leads to the next mode. */
int $model_is_over($model *m, double t, const $real *x, int *over);

/* A step has ended, or a jump has been crossed, at (t, x): goes on in another mode if the present one is over, which changes x. */
int $model_go_on($model *m, double t, $real *x);

/* How great the states of the present mode have been, 0 where that is not known. */
void $model_sizes(const $model *m, $real *sizes);

//end
/* The next time after t at which something jumps, infinite if nothing does. */
double $model_next_jump($model *m, double t);

//if clauses
/* The run stands at a jump, at a switch, or at its beginning: conditions are taken anew, samples taken, and what happens at
 * events happens, which may change x. */
//else
/* The run stands at a jump, at a switch, or at its beginning: conditions are taken anew, samples taken. */
//end
int $model_cross($model *m, double t, $real *x);

/* The run has come to (t, x): solutions and delays go on from there. */
int $model_accept($model *m, double t, const $real *x);
//if rates_motion

/* Rates have just been asked for at (t, x), by one who may not tell of every step: positions are followed from there. */
int $model_follow($model *m, double t, const $real *x);
//end

#ifdef __cplusplus
}
#endif

#endif
