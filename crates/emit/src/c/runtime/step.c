
//section
/* ---- steps ---- */

//item ha_ticks_pass
/* The times from + i * step, walked through in order; each is the nearest number to what is meant where 1 / step is whole. */
static void ha_ticks_pass(ha_model *m, double t)
{
    const double slack = 1e-9 * m->step;
    int i;
    for (i = 0; i < 4 && m->tick_next <= t + slack; ++i) {
        m->tick_index = $$ha_max(m->tick_index + 1.0, floor((t - m->tick_from) / m->step));
        if ((m->tick_rate > 0.0)) {
            m->tick_next = m->tick_from + m->tick_index / m->tick_rate;
        } else {
            const double way = m->tick_index * m->step;
            m->tick_next = m->tick_from + way;
        }
    }
}

//item ha_ticks_from
static void ha_ticks_from(ha_model *m, double t)
{
    const double rate = round(1.0 / m->step);
    m->tick_from = t;
    m->tick_next = t;
    m->tick_index = 0.0;
    m->tick_rate = rate >= 1.0 && 1.0 / rate == m->step ? rate : 0.0;
}

//item ha_try
/* Makes the step from m->t to a time, in m->trial. */
static int ha_try(ha_model *m, double t)
{
    int status = $ha_method(m, m->t, $narrow(t - m->t), m->x);
    int i;
    for (i = 0; i < HA_NX && status == $MODEL_OK; ++i) {
        if (!$ha_finite(m->trial[i])) {
            status = $ha_fail(m, $MODEL_STATE_NOT_FINITE, i, t);
        }
    }
//if rates_motion
    if (status == $MODEL_OK) {
        status = $ha_solve(m, t, m->trial);
    }
//end
//if shown_motion
    if (status == $MODEL_OK) {
        status = $ha_run(m, $ha_shown_motion_code, t, m->trial, m->moves, $SHOWN_MOTION_COUNT);
    }
//end
    return status;
}

//item ha_reach
/* Makes the step from m->t to *end, or where positions cannot be followed to there, beside one through which another motion
 * leads, to a time before it. */
static int ha_reach(ha_model *m, double *end)
{
    int status = $ha_try(m, *end);
//if moving_positions
    static const double shorter[] = {0.5, 0.7, 0.3, 0.1};
    const double way = *end - m->t;
    int i;
    for (i = 0; i < 4 && status == $MODEL_OFF_MOTION; ++i) {
        const $model_failure failure = m->failure;
        const double part = shorter[i] * way;
        const double sooner = m->t + part;
        m->failure.code = $MODEL_OK;
        if (sooner > m->t && $ha_try(m, sooner) == $MODEL_OK) {
            *end = sooner;
            return $MODEL_OK;
        }
        m->failure = failure;
    }
//end
//if looks_ahead
    if (status == $MODEL_OK) {
        $ha_find_ahead(m, *end, m->trial);
    }
//end
    return status;
}

//if locates
//item ha_look
/* Makes the step from m->t to a time, in m->trial; whether an event indicator has another sign there than that held. */
static int ha_look(ha_model *m, double t, int *crossed)
{
    int status = $MODEL_OK;
    *crossed = 0;
    if (t > m->t) {
        status = $ha_try(m, t);
    } else {
        $ha_copy(m->trial, m->x, HA_NX);
//if single
        $ha_copy(m->trial_rest, m->rest, HA_NX);
//end
    }
    return status == $MODEL_OK ? $model_switched(m, t, m->trial, crossed) : status;
}

//item ha_bracket
/* Halves the bracket of a crossing until it is as short as times can be told apart, or as a part of the step within which
 * crossings are not. */
static int ha_bracket(ha_model *m, double before, double after, double finest, double *end)
{
    int halving;
    for (halving = 0; halving < 80; ++halving) {
        const double half = 0.5 * (after - before);
        const double middle = before + half;
        int crossed;
        int status;
        if (middle <= before || middle >= after || after - before <= finest) {
            break;
        }
        status = $ha_look(m, middle, &crossed);
        if (status != $MODEL_OK) {
            return status;
        }
        if (crossed) {
            after = middle;
        } else {
            before = middle;
        }
    }
    *end = after;
    return $MODEL_OK;
}

//if bounds
//else
//item ha_extremum
/* Where, in parts from the middle one, the last three values of an indicator turn round on their way to 0, judged by the parabola
 * through them; beyond 1 if they do not. */
static double ha_extremum(const ha_model *m, int indicator, int part)
{
    const double a = $widen m->seen[(part - 2) % 3 * HA_NG + indicator];
    const double b = $widen m->seen[(part - 1) % 3 * HA_NG + indicator];
    const double c = $widen m->seen[part % 3 * HA_NG + indicator];
    const double slope = 0.5 * (c - a);
    const double twice = 2.0 * b;
    const double bend = a - twice + c;
    return bend * b > 0.0 ? -slope / bend : 2.0;
}

//end
//item ha_part_of
/* The end of one of the parts of a step at whose ends signs are looked at. */
static double ha_part_of(double start, double end, double part)
{
    const double way = (end - start) * part / 4.0;
    return start + way;
}

//if bounds
//item ha_keep_values
/* The values of indicators at a point of a step are kept in a place. */
static void ha_keep_values(ha_model *m, int place)
{
    $ha_copy(m->seen + place * HA_NG, m->beyond, HA_NG);
}

//item ha_keep_as
/* What is kept in one place is kept in another one as well. */
static void ha_keep_as(ha_model *m, int from, int to)
{
    $ha_copy(m->seen + to * HA_NG, m->seen + from * HA_NG, HA_NG);
}

//item ha_may_hide
/* Whether an indicator may have been zero twice between two points, as one between them tells: it bends there by more than half of its least
 * magnitude. */
static int ha_may_hide(const ha_model *m, int before, int middle, int after)
{
    int i;
    for (i = 0; i < HA_NG; ++i) {
        const $real a = m->seen[before * HA_NG + i];
        const $real b = m->seen[middle * HA_NG + i];
        const $real c = m->seen[after * HA_NG + i];
        const $real straight = $0.5 * (a + c);
        const $real bend = $fabs(b - straight);
        const $real least = $0.5 * $ha_min($ha_min($fabs(a), $fabs(b)), $fabs(c));
        if (bend > least && bend > $HA_ZERO * m->most_beyond[i]) {
            return 1;
        }
    }
    return 0;
}

//item ha_may_hide_in_step
/* Whether an indicator may have been zero twice in a step of this length, whose end has the present values: on the way from the begin of the
 * step before, it bends by more than half of its least magnitude. */
static int ha_may_hide_in_step(const ha_model *m, double length)
{
    const double part = m->last_step / (m->last_step + length);
    int i;
    for (i = 0; i < HA_NG && m->last_step > 0.0; ++i) {
        const $real a = m->seen[HA_BEFORE * HA_NG + i];
        const $real b = m->seen[HA_START * HA_NG + i];
        const $real c = m->beyond[i];
        const $real way = $narrow part * (c - a);
        const $real bend = $fabs(b - a - way);
        const $real least = $0.5 * $ha_min($fabs(b), $fabs(c));
        if (bend > least && bend > $HA_ZERO * m->most_beyond[i]) {
            return 1;
        }
    }
    return 0;
}

//item ha_step_ended
/* A step of this length has ended, whose values are the present ones. */
static void ha_step_ended(ha_model *m, double length)
{
    $ha_keep_as(m, HA_START, HA_BEFORE);
    $ha_keep_values(m, HA_START);
    m->last_step = length;
}

//item ha_hidden
/* A crossing inside a part of a step at whose ends there is none, found by halving the part wherever an indicator may hide one: it lies
 * between the two times. */
static int ha_hidden(ha_model *m, int part, double begin, double end, int *looks, double *before, double *after, int *crossed)
{
    double ends[HA_INSIDE];
    int open = HA_FIRST;
    int turn;
    *before = begin;
    ends[HA_FIRST] = end;
    $ha_keep_as(m, part - 1, HA_BEGIN);
    $ha_keep_as(m, part, HA_FIRST);
    for (turn = 0; turn < 600 && open >= HA_FIRST; ++turn) {
        const double half = 0.5 * (ends[open] - *before);
        const double middle = *before + half;
        const int inside = middle > *before && middle < ends[open] && *looks < 240;
        if (inside) {
            int status;
            ++*looks;
            status = $ha_look(m, middle, crossed);
            if (status != $MODEL_OK || *crossed) {
                *after = middle;
                return status;
            }
            $ha_keep_values(m, HA_MIDDLE);
        }
        if (inside && open + 1 < HA_INSIDE && $ha_may_hide(m, HA_BEGIN, HA_MIDDLE, open)) {
            ++open;
            $ha_keep_as(m, HA_MIDDLE, open);
            ends[open] = middle;
        } else {
            *before = ends[open];
            $ha_keep_as(m, open, HA_BEGIN);
            --open;
        }
    }
    return $MODEL_OK;
}

//item ha_first_crossing
/* The first time after m->t, up to *end, at which an event indicator has another sign than that held: if there is one, *end is
 * it then, a rounding error behind the crossing. Two crossings of one function inside one part of the step are found by halving the part
 * until its values do not bend so any more. */
static int ha_first_crossing(ha_model *m, double *end, int *crossed)
{
    const double start = m->t;
    const double finest = 2.168404344971009e-19 * (*end - start);
    int status = $ha_look(m, start, crossed);
    int looks = 0;
    int part;
    $ha_keep_values(m, 0);
    for (part = 1; part <= 4 && status == $MODEL_OK; ++part) {
        double before = $ha_part_of(start, *end, (double)(part - 1));
        double at = part == 4 ? *end : $ha_part_of(start, *end, (double)part);
        status = $ha_look(m, at, crossed);
        if (status == $MODEL_OK && !*crossed) {
            $ha_keep_values(m, part);
            status = $ha_hidden(m, part, before, at, &looks, &before, &at, crossed);
        }
        if (status == $MODEL_OK && *crossed) {
            return $ha_bracket(m, before, at, finest, end);
        }
    }
    return status;
}

//else
//item ha_first_crossing
/* The first time after m->t, up to *end, at which an event indicator has another sign than that held: if there is one, *end is
 * it then, a rounding error behind the crossing. Two crossings of one function inside one part of the step are found where its values bend
 * towards 0 there. */
static int ha_first_crossing(ha_model *m, double *end, int *crossed)
{
    const double start = m->t;
    const double finest = 2.168404344971009e-19 * (*end - start);
    int status = $ha_look(m, start, crossed);
    int part;
    int i;
    $ha_copy(m->seen, m->beyond, HA_NG);
    for (part = 1; part <= 4 && status == $MODEL_OK; ++part) {
        const double before = $ha_part_of(start, *end, (double)(part - 1));
        const double at = part == 4 ? *end : $ha_part_of(start, *end, (double)part);
        status = $ha_look(m, at, crossed);
        if (status == $MODEL_OK && *crossed) {
            return $ha_bracket(m, before, at, finest, end);
        }
        $ha_copy(m->seen + part % 3 * HA_NG, m->beyond, HA_NG);
        for (i = 0; part >= 2 && i < HA_NG && status == $MODEL_OK; ++i) {
            const double turn = $ha_extremum(m, i, part);
            if (fabs(turn) <= 1.0) {
                const double there = (double)(part - 1) + turn;
                const double extremum = $ha_part_of(start, *end, there);
                status = $ha_look(m, extremum, crossed);
                if (status == $MODEL_OK && *crossed) {
                    return $ha_bracket(m, there < (double)(part - 1) ? $ha_part_of(start, *end, (double)(part - 2)) : before, extremum, finest, end);
                }
            }
        }
    }
    return status;
}

//end
//entry ha_step_to
/* From m->t to a target, without a jump between them, or to the first crossing of an event indicator on the way. After an event the
 * inside of the step is looked at as well: what has been changed there may come back at once. */
static int ha_step_to(ha_model *m, double target, int jumps)
{
    const int handled = m->handled;
    double end = target;
    int switched = 0;
    int status = $ha_reach(m, &end);
    if (status == $MODEL_OK) {
        status = $model_switched(m, end, m->trial, &switched);
    }
    m->handled = 0;
//if bounds
    if (status == $MODEL_OK && (handled || switched || $ha_may_hide_in_step(m, end - m->t))) {
//else
    if (status == $MODEL_OK && (handled || switched)) {
//end
        int same;
        status = $ha_first_crossing(m, &end, &switched);
        if (status == $MODEL_OK) {
            status = $ha_look(m, end, &same);
        }
    }
//if bounds
    if (status == $MODEL_OK) {
        $ha_step_ended(m, end - m->t);
    }
//end
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_copy(m->x, m->trial, HA_NX);
//if single
    $ha_copy(m->rest, m->trial_rest, HA_NX);
//end
    m->t = end;
//if relations
    status = $ha_put_back(m, end, m->x);
    if (status == $MODEL_OK) {
        status = $model_accept(m, end, m->x);
    }
    if (status == $MODEL_OK && (switched || (jumps && end == target))) {
        status = $ha_cross_keeping(m, end, m->x);
//if keeps_steps
        $ha_leave_steps(m);
//end
    }
//else
    status = $model_accept(m, end, m->x);
    if (status == $MODEL_OK && (switched || (jumps && end == target))) {
        status = $model_cross(m, end, m->x);
//if keeps_steps
        $ha_leave_steps(m);
//end
    }
//end
    return status;
}

//else
//entry ha_step_to
/* From m->t to a target, without a jump between them. */
static int ha_step_to(ha_model *m, double target, int jumps)
{
    double end = target;
    int switched = 0;
    int status = $ha_reach(m, &end);
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_copy(m->x, m->trial, HA_NX);
//if single
    $ha_copy(m->rest, m->trial_rest, HA_NX);
//end
//if switches
    status = $model_switched(m, end, m->x, &switched);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    m->t = end;
//if relations
    status = $ha_put_back(m, end, m->x);
    if (status == $MODEL_OK) {
        status = $model_accept(m, end, m->x);
    }
    if (status == $MODEL_OK && (switched || (jumps && end == target))) {
        status = $ha_cross_keeping(m, end, m->x);
//if keeps_steps
        $ha_leave_steps(m);
//end
    }
//else
    status = $model_accept(m, end, m->x);
    if (status == $MODEL_OK && (switched || (jumps && end == target))) {
        status = $model_cross(m, end, m->x);
//if keeps_steps
        $ha_leave_steps(m);
//end
    }
//end
    return status;
}

//end
//public $model_step_until
int $model_step_until($model *m, double end)
{
    const double slack = 1e-9 * m->step;
    int i;
    int status = m->failure.code;
    if (status != $MODEL_OK) {
        return status;
    }
    if (!m->begun) {
        return $ha_fail(m, $MODEL_NOT_STARTED, 0, m->t);
    }
    for (i = 0; i < HA_NU; ++i) {
        if (!$ha_finite(m->u[i])) {
            return $ha_fail(m, $MODEL_INPUT_NOT_FINITE, i, m->t);
        }
//if inputs_jump
        if (m->u[i] != m->u_crossed[i]) {
            m->cross_due = 1;
        }
//end
    }
    if (m->cross_due) {
        status = $model_cross(m, m->t, m->x);
//if relations
        if (status == $MODEL_OK) {
            status = $ha_keep(m, m->t, m->x);
        }
//end
//if modes
        if (status == $MODEL_OK) {
            status = $model_go_on(m, m->t, m->x);
        }
//end
//if watches
        if (status == $MODEL_OK) {
            status = $ha_watch(m, m->t, m->x);
        }
//end
    }
    for (i = 0; i <= $MODEL_MOST_JUMPS && status == $MODEL_OK && m->t + slack < end; ++i) {
        const double jump = $model_next_jump(m, m->t);
        const int jumps = jump <= end + slack;
//if exchanges
        const double from = m->t;
//end
        status = $ha_step_to(m, jumps ? jump : end, jumps);
//if exchanges
        if (status != $MODEL_OK) {
            status = $ha_go_on_from(m, from, m->x);
            continue;
        }
//end
//if modes
        if (status == $MODEL_OK) {
            status = $model_go_on(m, m->t, m->x);
        }
//end
//if watches
        if (status == $MODEL_OK) {
            status = $ha_watch(m, m->t, m->x);
        }
//end
//if derivatives
        if (status == $MODEL_OK && m->stops && m->crossed == m->t) {
            return $model_observe(m, m->t, m->x, m->y);
        }
//end
    }
    if (status == $MODEL_OK && m->t + slack < end) {
        status = $ha_fail(m, $MODEL_TOO_MANY_JUMPS, 0, m->t);
    }
    return status == $MODEL_OK ? $model_observe(m, m->t, m->x, m->y) : status;
}

//public $model_step
int $model_step($model *m)
{
    $ha_ticks_pass(m, m->t);
    return $model_step_until(m, m->tick_next);
}

//public $model_align
void $model_align($model *m)
{
    $ha_ticks_from(m, m->t);
}
