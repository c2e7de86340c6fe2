//if returns
//item ha_returning
/* The clauses whose condition is the sign of one number. */
static const int ha_returning[] = {$RETURNING};

//item ha_note_returns
/* Notes which conditions have made something happen at t and are about to hold no longer: a ball that has hit the floor leaves it. */
static int ha_note_returns(ha_model *m, double t, const $real *x)
{
    int status;
    int i;
    m->returns_due = 0;
    m->returns_since = t;
    for (i = 0; i < $RETURNS; ++i) {
        const $model_clause *c = &m->clauses[$ha_returning[i]];
        m->returning[i] = c->holds && c->last == t;
        m->returns_due = m->returns_due || m->returning[i];
    }
    if (!m->returns_due) {
        return $MODEL_OK;
    }
    status = $model_rates(m, t, x, m->dx);
    if (status == $MODEL_OK) {
//if held
        $ha_place(m, t);
//end
        $ha_let_time_pass(m, t);
        $ha_copy(m->along + HA_STATES_AT, m->dx, HA_NX);
        status = $ha_returns_along(m, t, x, m->along, m->returning_from, m->returning_way);
    }
    m->returns_due = 0;
    for (i = 0; i < $RETURNS; ++i) {
        const $real way = m->returning_way[i];
        m->returning[i] = m->returning[i] && way != $0.0 && m->returning_from[i] * way <= $0.0;
        m->returning_way[i] = way > $0.0 ? $1.0 : -$1.0;
        m->returns_due = m->returns_due || m->returning[i];
    }
    return status;
}

//item ha_watch_returns
/* What was about to return and is further beyond at the end of a step has been lost. */
static int ha_watch_returns(ha_model *m, double t, const $real *x)
{
    int status;
    int i;
    if (!m->returns_due || m->returns_since == t) {
        return $MODEL_OK;
    }
//if held
    $ha_place(m, t);
//end
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    status = $ha_returns_along(m, t, x, m->along, m->returning_out, m->returning_rates);
    for (i = 0; i < $RETURNS && status == $MODEL_OK; ++i) {
        const $real value = m->returning_out[i];
        if (m->returning[i] && value * m->returning_way[i] < $0.0 && $fabs(value) > $fabs(m->returning_from[i])) {
            status = $ha_fail(m, $MODEL_LOST, $ha_returning[i], t);
        }
    }
    m->returns_due = 0;
    return status;
}

//end
