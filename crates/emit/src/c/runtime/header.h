/* MODEL_NAME: a model to be stepped, written by halfarrow.
 *
 *     static MODEL m;                       no heap and no global state: a model is one plain structure,
 *     if (MODEL_reset(&m) == MODEL_OK       which can be copied to save it and copied back
 *         && MODEL_start(&m, 0.0) == MODEL_OK) {
 *         while (m.t < 10.0 && MODEL_step(&m) == MODEL_OK) {
 *             ...                           outputs are in m.y, inputs may be set in m.u
 *         }
 *     }
 *
 * All values are in SI units. Every function but MODEL_message gives 0 or the code of a failure, which then stands in
 * m.failure; MODEL_message says what it means. After a failure the model has to be started again.
 *
//if single
 * Real numbers are float. Time is double, so that it does not stand still in long runs; so is what follows from time or from
 * parameters alone, until something else reads it. What a step adds to a state is carried on where it is less than its last
 * digit.
 *
//end
 * Method: METHOD_NAME with a step of STEP_LENGTH s. What a step costs at most:
COST_LINES
 */
#ifndef MODEL_GUARD_H
#define MODEL_GUARD_H

#ifdef __cplusplus
extern "C" {
#endif

/* How many there are. */
enum {
    MODEL_STATES = NUMBER_STATES,
    MODEL_INPUTS = NUMBER_INPUTS,
    MODEL_PARAMETERS = NUMBER_PARAMETERS,
    MODEL_OUTPUTS = NUMBER_OUTPUTS,
    MODEL_INDICATORS = NUMBER_INDICATORS,
    /* Jumps within one step at most. */
    MODEL_MOST_JUMPS = NUMBER_JUMPS
};

//if states
/* Places in m.x. */
enum {
STATE_LINES
};

//end
//if inputs
/* Places in m.u. A changed input is a jump at the beginning of the next step, then constant. */
enum {
INPUT_LINES
};

//end
//if parameters
/* Places in m.p; to be set by MODEL_set_parameter. What follows from a parameter follows it. */
enum {
PARAMETER_LINES
};

//end
//if outputs
/* Places in m.y. */
enum {
OUTPUT_LINES
};

//end
/* Why something failed. */
enum {
    MODEL_OK = 0,
CODES
};

typedef struct MODEL_failure {
    int code;
    /* Which of its kind: of the equations, states, laws... */
    int where;
    /* When, in s; not a number if at any time. */
    ha_wide time;
} MODEL_failure;

//if delays
typedef struct MODEL_point {
    ha_wide t;
    double value, slope, jump;
} MODEL_point;

typedef struct MODEL_delay {
    ha_wide time, start;
    int first, count, full;
} MODEL_delay;

//end
//if samples
typedef struct MODEL_sample {
    ha_wide period, next, taken;
    double value;
} MODEL_sample;

//end
typedef struct MODEL {
    ha_wide t; /* time, in s */
    ha_wide step; /* length of a step, in s; may be changed before the start */
    double x[SIZE_STATES]; /* states */
    double u[SIZE_INPUTS]; /* inputs */
    double p[SIZE_PARAMETERS]; /* parameters */
    double y[SIZE_OUTPUTS]; /* outputs, as they are at t */
    MODEL_failure failure;
    int most_evaluations; /* evaluations at most each time a Newton block is solved, but for the start and jumps */

    /* What follows is for the functions below. */
PRIVATE_PARTS
} MODEL;

/* Everything as the model says, parameters at their defaults. */
int MODEL_reset(MODEL *m);

/* Sets a parameter. Before a start the start values follow it; during a run it is a jump at the present time.
 * MODEL_STRUCTURE says that the equations are others with this value: it is taken, but no run starts or goes on until other
 * parameters fit it. */
int MODEL_set_parameter(MODEL *m, int parameter, ha_wide value);

/* Begins a run at a time with the start values of the model; outputs are then those at the start. They were found by the
 * exporter; for other parameters, inputs or times they are solved for here, or MODEL_NO_START says that they were not. */
int MODEL_start(MODEL *m, ha_wide t);

/* Begins a run at a time with these states. */
int MODEL_start_from(MODEL *m, ha_wide t, const double *x);

/* One step; jumps within it are met exactly. */
int MODEL_step(MODEL *m);

/* One step that ends at another time than the next one: not more than m.step away. */
int MODEL_step_until(MODEL *m, ha_wide end);

/* Counts steps from the present time on. */
void MODEL_align(MODEL *m);

/* What the last failure means. */
const char *MODEL_message(const MODEL *m);

/* ---- for another integrator: what MODEL_step is made of ---- */

/* Rates of the states, as in the present interval between jumps. */
int MODEL_rates(MODEL *m, ha_wide t, const double *x, double *dx);

/* Outputs. */
int MODEL_observe(MODEL *m, ha_wide t, const double *x, double *y);

//if directional_derivative
/* Derivatives of the rates along a direction v of the states, exactly. */
int MODEL_tangent(MODEL *m, ha_wide t, const double *x, const double *v, double *dv);

//end
//if derivatives
/* Derivatives of rates (dv) and outputs (dy), where asked for, along a direction of the states (v) and inputs (w), exactly. */
int MODEL_directional(MODEL *m, ha_wide t, const double *x, const double *v, const double *w, double *dv, double *dy);

//end
//if switches
/* Functions of the state that change their sign where a condition switches. */
int MODEL_indicators(MODEL *m, ha_wide t, const double *x, double *g);

/* Whether one of them has another sign than at the last jump. */
int MODEL_switched(MODEL *m, ha_wide t, const double *x, int *switched);

//end
/* The next time after t at which something jumps, infinite if nothing does. */
ha_wide MODEL_next_jump(MODEL *m, ha_wide t);

/* The run stands at a jump, at a switch, or at its beginning: conditions are taken anew, samples taken. */
int MODEL_cross(MODEL *m, ha_wide t, const double *x);

/* The run has come to (t, x): solutions and delays go on from there. */
int MODEL_accept(MODEL *m, ha_wide t, const double *x);

#ifdef __cplusplus
}
#endif

#endif
