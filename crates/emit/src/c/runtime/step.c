
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

//item ha_step_to
/* From m->t to a target, without a jump between them. */
static int ha_step_to(ha_model *m, double target, int jumps)
{
    int switched = 0;
    int status = $ha_method(m, m->t, $narrow(target - m->t), m->x);
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        if (!$ha_finite(m->trial[i])) {
            return $ha_fail(m, $MODEL_STATE_NOT_FINITE, i, target);
        }
    }
    $ha_copy(m->x, m->trial, HA_NX);
//if single
    $ha_copy(m->rest, m->trial_rest, HA_NX);
//end
//if switches
    status = $model_switched(m, target, m->x, &switched);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    m->t = target;
    status = $model_accept(m, target, m->x);
    if (status == $MODEL_OK && (switched || jumps)) {
        status = $model_cross(m, target, m->x);
    }
    return status;
}

//always
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
        if (m->u[i] != m->u_crossed[i]) {
            m->cross_due = 1;
        }
    }
    if (m->cross_due) {
        status = $model_cross(m, m->t, m->x);
    }
    for (i = 0; i <= $MODEL_MOST_JUMPS && status == $MODEL_OK && m->t + slack < end; ++i) {
        const double jump = $model_next_jump(m, m->t);
        const int jumps = jump <= end + slack;
        status = $ha_step_to(m, jumps ? jump : end, jumps);
    }
    if (status == $MODEL_OK && m->t + slack < end) {
        status = $ha_fail(m, $MODEL_TOO_MANY_JUMPS, 0, m->t);
    }
    return status == $MODEL_OK ? $model_observe(m, m->t, m->x, m->y) : status;
}

int $model_step($model *m)
{
    $ha_ticks_pass(m, m->t);
    return $model_step_until(m, m->tick_next);
}

void $model_align($model *m)
{
    $ha_ticks_from(m, m->t);
}
