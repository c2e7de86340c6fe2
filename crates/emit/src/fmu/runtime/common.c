#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- what both versions of the interface share ---- */

enum {
    HA_NX = $MODEL_STATES,
    HA_NU = $MODEL_INPUTS,
    HA_NP = $MODEL_PARAMETERS,
    HA_NY = $MODEL_OUTPUTS,
    HA_NG = $MODEL_INDICATORS,
    /* Value references: time, states, their derivatives, inputs, parameters, outputs, event indicators. */
    HA_FIRST_STATE = 1,
    HA_FIRST_DERIVATIVE = HA_FIRST_STATE + HA_NX,
    HA_FIRST_INPUT = HA_FIRST_DERIVATIVE + HA_NX,
    HA_FIRST_PARAMETER = HA_FIRST_INPUT + HA_NU,
    HA_FIRST_OUTPUT = HA_FIRST_PARAMETER + HA_NP,
    HA_FIRST_INDICATOR = HA_FIRST_OUTPUT + HA_NY,
    HA_REFERENCES = HA_FIRST_INDICATOR + HA_NG
};

/* Modes; a failure of the model leaves it in HA_FAILED. */
enum { HA_INSTANTIATED, HA_INITIALISING, HA_EVENT, HA_CONTINUOUS, HA_STEPPING, HA_TERMINATED, HA_FAILED };

/* Evaluations at most each time a Newton block is solved in model exchange. Integrators try points far from the last one that
 * they have completed, and some tell of no step between two communication points: the solution is followed all that way, and
 * no clock waits for it as for the steps of co-simulation. */
enum { HA_TRIAL_EVALUATIONS = 1000000 };

/* What may be done with a parameter: 0 nothing, 1 set before the start, 2 set at any time. */
static const unsigned char ha_settable[] = {
$SETTABLE
};

/* Everything that a run consists of: saved and restored as a whole. */
typedef struct {
    $model m;
    int mode;
    /* Whether the start has to be found. */
    int start_due;
    /* Whether it has just been found or a jump been crossed here. */
    int fresh;
    double start_time;
    int rates_due;
    int outputs_due;
    double dx[HA_NX > 0 ? HA_NX : 1];
    double y[HA_NY > 0 ? HA_NY : 1];
    /* Greatest magnitude of each event indicator so far. */
    double scales[HA_NG > 0 ? HA_NG : 1];
} ha_state;

typedef struct ha_fmu {
    ha_state s;
    int exchange;
    int logging;
    /* Co-simulation: whether it has an event mode; whether steps return where something jumps, and whether the last one has. */
    int event_mode;
    int stops;
    int stopped;
    /* Whether what failed last is but a trial of the importer: the model has no value there, and goes on from elsewhere. */
    int discarded;
    /* Whether what is said last is a warning. */
    int warned;
//if moves
    /* Whether the last event has changed states, and whether the step completed last asks for one. */
    int moved;
//if modes
    /* Whether the last event has led to another mode. */
    int renewed;
//end
    int event_due;
//end
    char name[128];
    void *environment;
    void (*log)(struct ha_fmu *f, const char *message);
    void *logger;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *place);
} ha_fmu;

static void ha_say(ha_fmu *f, const char *message)
{
    if (f->log != NULL) {
        f->log(f, message);
    }
}

/* A failure of the model, in words. */
static int ha_failed(ha_fmu *f)
{
    char text[1024];
    const double time = f->s.m.failure.time;
    if (time == time) {
        (void)snprintf(text, sizeof text, "at t = %g s: %s", time, $model_message(&f->s.m));
    } else {
        (void)snprintf(text, sizeof text, "with these parameters: %s", $model_message(&f->s.m));
    }
    ha_say(f, text);
    f->s.mode = HA_FAILED;
    return 0;
}

/* A point at which the model has no value. In continuous time it is one that the integrator of the importer tries: the run
 * goes on from any other. */
static int ha_without_value(ha_fmu *f)
{
    const int mode = f->s.mode;
    f->discarded = f->exchange && mode == HA_CONTINUOUS;
    (void)ha_failed(f);
    if (f->discarded) {
        f->s.mode = mode;
        f->s.m.failure.code = $MODEL_OK;
    }
    return 0;
}

static int ha_refuse(ha_fmu *f, const char *what)
{
    f->discarded = 0;
    f->warned = 0;
    ha_say(f, what);
    return 0;
}

/* Whether the model is in one of the modes, given as bits. */
static int ha_is_in(ha_fmu *f, int modes, const char *function)
{
    static const char *const names[] = {
        "instantiated", "initialization", "event", "continuous-time", "step", "terminated", "failed"
    };
    char text[256];
    f->discarded = 0;
    f->warned = 0;
    if ((modes >> f->s.mode) & 1) {
        return 1;
    }
    (void)snprintf(text, sizeof text, "%s cannot be called in the mode: %s", function, names[f->s.mode]);
    ha_say(f, text);
    return 0;
}

#define HA_IN(mode) (1 << (mode))
#define HA_RUNNING (HA_IN(HA_EVENT) | HA_IN(HA_CONTINUOUS) | HA_IN(HA_STEPPING))
#define HA_ANY (HA_IN(HA_INSTANTIATED) | HA_IN(HA_INITIALISING) | HA_RUNNING | HA_IN(HA_TERMINATED))

static void ha_changed(ha_fmu *f)
{
    f->s.rates_due = 1;
    f->s.outputs_due = 1;
}

static int ha_begin(ha_fmu *f)
{
    f->s.mode = HA_INSTANTIATED;
    f->s.start_due = 1;
    f->s.fresh = 0;
    f->s.start_time = 0.0;
    memset(f->s.scales, 0, sizeof f->s.scales);
    ha_changed(f);
    if ($model_reset(&f->s.m) != $MODEL_OK) {
        return 0;
    }
    if (f->exchange) {
        f->s.m.most_evaluations = HA_TRIAL_EVALUATIONS;
    }
    return 1;
}

/* Finds the start, if that is due. */
static int ha_started(ha_fmu *f)
{
    if (f->s.start_due && f->s.mode <= HA_INITIALISING) {
        if ($model_start(&f->s.m, f->s.start_time) != $MODEL_OK) {
            return ha_failed(f);
        }
        f->s.start_due = 0;
        f->s.fresh = 1;
        ha_changed(f);
    }
    return 1;
}

static int ha_rates(ha_fmu *f)
{
    if (f->s.rates_due) {
        if ($model_rates(&f->s.m, f->s.m.t, f->s.m.x, f->s.dx) != $MODEL_OK) {
            return ha_without_value(f);
        }
//if rates_motion
        if (f->exchange && f->s.mode == HA_CONTINUOUS && $model_follow(&f->s.m, f->s.m.t, f->s.m.x) != $MODEL_OK) {
            return ha_without_value(f);
        }
//end
        f->s.rates_due = 0;
    }
    return 1;
}

static int ha_outputs(ha_fmu *f)
{
    if (f->s.outputs_due) {
        if ($model_observe(&f->s.m, f->s.m.t, f->s.m.x, f->s.y) != $MODEL_OK) {
            return ha_without_value(f);
        }
        f->s.outputs_due = 0;
    }
    return 1;
}

/* Event indicators. Each changes its sign a rounding error behind the border, so that an importer that stands exactly on
 * its root stands clearly on the new side. */
static int ha_indicators(ha_fmu *f, double *values)
{
//if switches
    int i;
    if ($model_indicators(&f->s.m, f->s.m.t, f->s.m.x, values) != $MODEL_OK) {
        return ha_without_value(f);
    }
    for (i = 0; i < HA_NG; ++i) {
        const double behind = 1e-12 * f->s.scales[i] + 1e-300;
        values[i] += f->s.m.sides[i] ? behind : -behind;
    }
//else
    (void)f;
    (void)values;
//end
    return 1;
}

/* Takes note of how great the indicators are. */
static int ha_scale(ha_fmu *f)
{
//if switches
    double values[HA_NG];
    int i;
    if ($model_indicators(&f->s.m, f->s.m.t, f->s.m.x, values) != $MODEL_OK) {
        return ha_failed(f);
    }
    for (i = 0; i < HA_NG; ++i) {
        const double size = values[i] < 0.0 ? -values[i] : values[i];
        if (size - size == 0.0 && size > f->s.scales[i]) {
            f->s.scales[i] = size;
        }
    }
//else
    (void)f;
//end
    return 1;
}

static int ha_get(ha_fmu *f, unsigned reference, double *value)
{
    const int r = reference < HA_REFERENCES ? (int)reference : -1;
    if (r < 0) {
        return ha_refuse(f, "there is no variable with this value reference");
    }
    if (r >= HA_FIRST_INPUT && r < HA_FIRST_OUTPUT) {
        *value = r < HA_FIRST_PARAMETER ? f->s.m.u[r - HA_FIRST_INPUT] : f->s.m.p[r - HA_FIRST_PARAMETER];
        return 1;
    }
    if (!ha_started(f)) {
        return 0;
    }
    if (r < HA_FIRST_STATE) {
        *value = f->s.m.t;
    } else if (r < HA_FIRST_DERIVATIVE) {
        *value = f->s.m.x[r - HA_FIRST_STATE];
    } else if (r < HA_FIRST_INPUT) {
        if (!ha_rates(f)) {
            return 0;
        }
        *value = f->s.dx[r - HA_FIRST_DERIVATIVE];
    } else if (r < HA_FIRST_INDICATOR) {
        if (!ha_outputs(f)) {
            return 0;
        }
        *value = f->s.y[r - HA_FIRST_OUTPUT];
    } else {
        double indicators[HA_NG > 0 ? HA_NG : 1];
        if (!ha_indicators(f, indicators)) {
            return 0;
        }
        *value = indicators[r - HA_FIRST_INDICATOR];
    }
    return 1;
}

static int ha_set(ha_fmu *f, unsigned reference, double value)
{
    const int r = reference < HA_REFERENCES ? (int)reference : -1;
    const int before = f->s.mode <= HA_INITIALISING;
    if (!(value - value == 0.0)) {
        return ha_refuse(f, "a variable is to be set to a value that is not finite");
    }
    if (r >= HA_FIRST_INPUT && r < HA_FIRST_PARAMETER) {
        f->s.m.u[r - HA_FIRST_INPUT] = value;
    } else if (r >= HA_FIRST_PARAMETER && r < HA_FIRST_OUTPUT) {
        const int parameter = r - HA_FIRST_PARAMETER;
        int status;
        if (ha_settable[parameter] < (before ? 1 : 2)) {
            return ha_refuse(f, before ? "this variable cannot be set" : "this parameter is fixed once the run has begun");
        }
        status = $model_set_parameter(&f->s.m, parameter, value);
        if (status == $MODEL_STRUCTURE) {
            /* Other parameters may be set with it: the start or the next step says whether they all fit. */
            f->s.m.failure.code = $MODEL_OK;
        } else if (status != $MODEL_OK) {
            return ha_failed(f);
        }
    } else {
        return ha_refuse(f, "only inputs and parameters can be set");
    }
    if (before) {
        f->s.start_due = 1;
    }
    f->s.fresh = 0;
    ha_changed(f);
    return 1;
}

/* The end of the initialization. */
static int ha_initialised(ha_fmu *f)
{
    if (!ha_started(f)) {
        return 0;
    }
    f->s.mode = f->exchange || f->event_mode ? HA_EVENT : HA_STEPPING;
    return 1;
}

/* A jump at the present point, and the time of the next one. All that happens at one instant happens in it. */
static int ha_event(ha_fmu *f, double *next)
{
//if moves
    double before[HA_NX > 0 ? HA_NX : 1];
//if modes
    const int mode = f->s.m.mode;
//end
    memcpy(before, f->s.m.x, sizeof before);
    f->moved = 0;
//end
//if modes
    f->s.m.outside = f->exchange;
//end
    if (!f->s.fresh) {
//if leaps
        /* Inputs move on their own between events, and jump between steps. */
        if (f->exchange) {
            memcpy(f->s.m.u_crossed, f->s.m.u, sizeof f->s.m.u_crossed);
        }
//end
        if ($model_cross(&f->s.m, f->s.m.t, f->s.m.x) != $MODEL_OK) {
            return ha_failed(f);
        }
//if modes
        if ($model_go_on(&f->s.m, f->s.m.t, f->s.m.x) != $MODEL_OK) {
            return ha_failed(f);
        }
//end
        f->s.fresh = 1;
        ha_changed(f);
    }
    if (!ha_scale(f)) {
        return 0;
    }
//if moves
    {
        int i;
        for (i = 0; i < HA_NX; ++i) {
            f->moved = f->moved || f->s.m.x[i] != before[i];
        }
//if modes
        /* States are others in another mode. */
        f->renewed = f->s.m.mode != mode;
        f->moved = f->moved || f->renewed;
//end
    }
//end
    *next = $model_next_jump(&f->s.m, f->s.m.t);
    return 1;
}

/* An integrator has made a step. Where it is too long to follow the solution of an equation, or its importer does not tell of
 * every step, the solution is taken anew, as after a jump, and that is said. */
static int ha_stepped(ha_fmu *f)
{
    $model *m = &f->s.m;
//if moves
    f->event_due = 0;
//end
    if ($model_accept(m, m->t, m->x) != $MODEL_OK) {
        const $model_failure failure = m->failure;
        m->failure.code = $MODEL_OK;
//if moves
        /* What happens at events may be due there: the importer is asked for one. */
        (void)failure;
        f->event_due = 1;
        ha_changed(f);
        return 1;
//else
        if ($model_cross(m, m->t, m->x) != $MODEL_OK) {
            m->failure = failure;
            return ha_failed(f);
        }
        f->warned = 1;
        ha_say(f, "the way since the last completed step is too long to follow the solution of an equation: it is taken anew");
        ha_changed(f);
//end
    }
//if modes
    {
        /* A mode may be over where no indicator has told it. */
        int over;
        if ($model_is_over(m, m->t, m->x, &over) != $MODEL_OK) {
            return ha_failed(f);
        }
        f->event_due = f->event_due || over;
    }
//end
    return ha_scale(f);
}

/* Steps of the fixed method from one communication point to the next; one that is no multiple of them ends in a shorter
 * one. */
static int ha_advance_to(ha_fmu *f, double from, double length)
{
    $model *m = &f->s.m;
    const double slack = 1e-9 * m->step;
    const double end = from + length;
    if (!(length >= 0.0 && length - length == 0.0)) {
        return ha_refuse(f, "the communication step is not a finite number of seconds, or below zero");
    }
    if (!(from - m->t <= 1e-6 * m->step && m->t - from <= 1e-6 * m->step)) {
        char text[256];
        (void)snprintf(text, sizeof text, "the step is to begin at %.17g s, but the model stands at %.17g s", from, m->t);
        return ha_refuse(f, text);
    }
    ha_changed(f);
    f->stopped = 0;
    m->stops = f->stops;
    while (m->t + slack < end && !f->stopped) {
        int status;
        if (end - m->t < m->step - slack) {
            status = $model_step_until(m, end);
            $model_align(m);
        } else {
            status = $model_step(m);
        }
        if (status != $MODEL_OK) {
            return ha_failed(f);
        }
        f->stopped = f->stops && m->crossed == m->t;
    }
    return 1;
}

/* Derivatives of all rates and outputs along a direction of states and inputs. */
static int ha_along(ha_fmu *f, const unsigned *knowns, size_t columns, const double *seed, double *dv, double *dy)
{
    double v[HA_NX > 0 ? HA_NX : 1];
    double w[HA_NU > 0 ? HA_NU : 1];
    size_t i;
    memset(v, 0, sizeof v);
    memset(w, 0, sizeof w);
    for (i = 0; i < columns; ++i) {
        const int r = knowns[i] < HA_REFERENCES ? (int)knowns[i] : -1;
        if (r >= HA_FIRST_STATE && r < HA_FIRST_DERIVATIVE) {
            v[r - HA_FIRST_STATE] = seed[i];
        } else if (r >= HA_FIRST_INPUT && r < HA_FIRST_PARAMETER) {
            w[r - HA_FIRST_INPUT] = seed[i];
        } else {
            return ha_refuse(f, "derivatives are taken by states and inputs");
        }
    }
    if ($model_directional(&f->s.m, f->s.m.t, f->s.m.x, v, w, dv, dy) != $MODEL_OK) {
        return ha_without_value(f);
    }
    return 1;
}

/* That of one of them. */
static int ha_of(ha_fmu *f, unsigned unknown, const double *dv, const double *dy, double *result)
{
    const int r = unknown < HA_REFERENCES ? (int)unknown : -1;
    if (r >= HA_FIRST_DERIVATIVE && r < HA_FIRST_INPUT) {
        *result = dv[r - HA_FIRST_DERIVATIVE];
    } else if (r >= HA_FIRST_OUTPUT && r < HA_FIRST_INDICATOR) {
        *result = dy[r - HA_FIRST_OUTPUT];
    } else {
        return ha_refuse(f, "derivatives are those of outputs and of derivatives of states");
    }
    return 1;
}

/* Derivatives of rates and outputs along a direction of states and inputs. */
static int ha_direction(ha_fmu *f, const unsigned *unknowns, size_t rows, const unsigned *knowns, size_t columns, const double *seed, double *result)
{
    double dv[HA_NX > 0 ? HA_NX : 1];
    double dy[HA_NY > 0 ? HA_NY : 1];
    size_t i;
    memset(dv, 0, sizeof dv);
    memset(dy, 0, sizeof dy);
    if (!ha_started(f) || !ha_along(f, knowns, columns, seed, dv, dy)) {
        return 0;
    }
    for (i = 0; i < rows; ++i) {
        if (!ha_of(f, unknowns[i], dv, dy, &result[i])) {
            return 0;
        }
    }
    return 1;
}

/* A copy of the whole state. */
static int ha_save(ha_fmu *f, void **saved)
{
    if (*saved == NULL) {
        *saved = f->allocate(1, sizeof f->s);
    }
    if (*saved == NULL) {
        return ha_refuse(f, "there is no memory for the state");
    }
    memcpy(*saved, &f->s, sizeof f->s);
    return 1;
}

/* Serialised: its size, then the state. */
static size_t ha_size(void)
{
    return sizeof(size_t) + sizeof(ha_state);
}

static int ha_serialise(ha_fmu *f, const void *saved, void *bytes, size_t size)
{
    const size_t length = sizeof(ha_state);
    if (saved == NULL || size < ha_size()) {
        return ha_refuse(f, "there is no state to serialise, or too little room for it");
    }
    memcpy(bytes, &length, sizeof length);
    memcpy((char *)bytes + sizeof length, saved, sizeof(ha_state));
    return 1;
}

static int ha_deserialise(ha_fmu *f, const void *bytes, size_t size, void **saved)
{
    size_t length = 0;
    if (size >= sizeof length) {
        memcpy(&length, bytes, sizeof length);
    }
    if (size != ha_size() || length != sizeof(ha_state)) {
        return ha_refuse(f, "this is no state of this model");
    }
    if (*saved == NULL) {
        *saved = f->allocate(1, sizeof(ha_state));
    }
    if (*saved == NULL) {
        return ha_refuse(f, "there is no memory for the state");
    }
    memcpy(*saved, (const char *)bytes + sizeof length, sizeof(ha_state));
    return 1;
}

static void ha_nominals(const ha_fmu *f, double *values)
{
    static const double nominals[] = {
$NOMINALS
    };
    int i;
//if modes
    $model_sizes(&f->s.m, values);
    for (i = 0; i < HA_NX; ++i) {
        values[i] = values[i] > 1e-9 * nominals[i] ? values[i] : nominals[i];
    }
//else
    (void)f;
    for (i = 0; i < HA_NX; ++i) {
        values[i] = nominals[i];
    }
//end
}

static ha_fmu *ha_new(const char *name, const char *token, void *(*allocate)(size_t, size_t), void (*release)(void *))
{
    ha_fmu *f;
    if (token == NULL || strcmp(token, "$TOKEN") != 0) {
        return NULL;
    }
    f = (ha_fmu *)allocate(1, sizeof *f);
    if (f == NULL) {
        return NULL;
    }
    memset(f, 0, sizeof *f);
    (void)snprintf(f->name, sizeof f->name, "%s", name == NULL ? "" : name);
    f->allocate = allocate;
    f->release = release;
    return f;
}
