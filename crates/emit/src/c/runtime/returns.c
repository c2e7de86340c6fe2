//if returns
//item ha_returning
/* The clauses of the modeller whose condition is the sign of one number of the state. */
static const int ha_returning[] = {$RETURNING};

//item ha_note_returns
/* Notes which conditions have made something happen at t and are about to hold no longer: a ball that has hit the floor leaves it. Where
 * none has, what is to return from before is watched further on. */
static int ha_note_returns(ha_model *m, double t, const $real *x)
{
    int happened = 0;
    int status;
    int i;
    for (i = 0; i < $RETURNS; ++i) {
        const $model_clause *c = &m->clauses[$ha_returning[i]];
        happened = happened || (c->holds && c->last == t);
    }
    if (!happened) {
        return $MODEL_OK;
    }
    status = $model_rates(m, t, x, m->dx);
    if (status == $MODEL_OK) {
//if held
        $ha_place(m, t);
//end
        $ha_let_time_pass(m, t);
        $ha_copy(m->along + HA_STATES_AT, m->dx, HA_NX);
        status = $ha_returns_along(m, t, x, m->along, m->returns_out, m->returns_rates);
    }
    for (i = 0; i < $CLAUSES; ++i) {
        m->returning[i] = 0;
    }
    m->returns_since = t;
    for (i = 0; i < $RETURNS; ++i) {
        const int clause = $ha_returning[i];
        const $model_clause *c = &m->clauses[clause];
        const $real rate = m->returns_rates[i];
        m->returning[clause] = c->holds && c->last == t && rate != $0.0 && m->returns_out[i] * rate <= $0.0;
        m->returning_from[clause] = m->returns_out[i];
        m->returning_way[clause] = rate > $0.0 ? $1.0 : -$1.0;
    }
    return status;
}

//item ha_watch_returns
/* What was about to return and is further beyond at the end of a step has been lost. What has not moved at all is watched further on. */
static int ha_watch_returns(ha_model *m, double t, const $real *x)
{
    int due = 0;
    int status;
    int i;
    for (i = 0; i < $RETURNS; ++i) {
        due = due || m->returning[$ha_returning[i]];
    }
    if (!due || m->returns_since == t) {
        return $MODEL_OK;
    }
//if held
    $ha_place(m, t);
//end
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    status = $ha_returns_along(m, t, x, m->along, m->returns_out, m->returns_rates);
    for (i = 0; i < $RETURNS && status == $MODEL_OK; ++i) {
        const int clause = $ha_returning[i];
        const $real value = m->returns_out[i];
        if (m->returning[clause] && value * m->returning_way[clause] < $0.0 && $fabs(value) > $fabs(m->returning_from[clause])) {
            status = $ha_fail(m, $MODEL_LOST, clause, t);
        }
        m->returning[clause] = m->returning[clause] && value == m->returning_from[clause];
    }
    return status;
}

//end
