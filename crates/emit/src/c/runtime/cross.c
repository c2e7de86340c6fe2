//entry ha_cross_begin
/* The run stands at a jump, at a switch, or at its beginning: conditions are taken anew, samples taken, and it is found out what
 * happens. */
static int ha_cross_begin(ha_model *m, double t, $real *x)
{
    int status = $MODEL_OK;
//if clauses
    const int first = !m->begun;
//end
//if leaps
    const int leaps = m->begun;
//end
//if assumptions
    if (m->broken) {
        return $ha_fail(m, $MODEL_STRUCTURE, m->broken - 1, ((double)NAN));
    }
//end
//if leaps
    if (leaps) {
        status = $ha_take_stored(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
    }
//end
    m->crossed = t;
//if ratios
    /* Positions may be others after it. */
    m->steepest_known = 0;
//end
//if watches
    m->pivots_known = 0;
//end
//if looks_ahead
    $ha_forget_ahead(m);
//end
    $ha_copy(m->u_crossed, m->u, HA_NU);
//if switches
    m->state_hold = HA_FOLLOW;
//end
//if newton
    /* A solution may leap where something jumps. */
    $ha_leave_solutions(m);
//end
//if clocks
    $ha_clock_cross(m, t);
//end
//if leaps
    status = leaps ? $ha_balance_leaps(m, t, x) : $MODEL_OK;
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if held
    if (!m->begun) {
        status = $ha_begin_held(m, t, x);
//if samples
    } else {
        status = $ha_take_samples(m, t, x);
//end
    }
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if leaps
    status = leaps ? $ha_balance_leaps(m, t, x) : $MODEL_OK;
    if (status != $MODEL_OK) {
        return status;
    }
//end
    m->begun = 1;
    m->cross_due = 0;
//if bounds
    if (first) {
        status = $ha_note_compared(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
    }
//end
//if switches
    status = $ha_take_sides(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//if leaps
    status = leaps ? $ha_balance_leaps(m, t, x) : $MODEL_OK;
    if (status == $MODEL_OK && leaps) {
        status = $ha_take_sides(m, t, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
//end
//end
//if gaps
    status = first ? $ha_begin_contacts(m, t, x) : $MODEL_OK;
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if clauses
    status = first ? $ha_begin_clauses(m, t, x) : $ha_find_fired(m, t, x);
//end
    (void)x;
    return status;
}

//entry ha_hold_sides
/* The sides of indicators that the run is on from here. */
static int ha_hold_sides(ha_model *m, double t, const $real *x)
{
//if switches
    int status = $MODEL_OK;
    int i;
//if moves
    status = $model_indicators(m, t, x, m->beyond);
//else
    /* Operands are those of which sides have just been taken. */
    $ha_indicators_of_operands(m, t, m->beyond);
    (void)x;
//end
    for (i = 0; i < HA_NG && status == $MODEL_OK; ++i) {
        m->sides[i] = m->beyond[i] > $0.0;
    }
//if bounds
    $ha_copy(m->seen + HA_START * HA_NG, m->beyond, HA_NG);
    m->last_step = 0.0;
//end
    return status;
//else
    (void)m;
    (void)t;
    (void)x;
    return $MODEL_OK;
//end
}

//entry ha_cross_end
/* What has happened is over: delays, solutions and indicators go on from here. */
static int ha_cross_end(ha_model *m, double t, const $real *x)
{
    int status = $MODEL_OK;
//if delays
    static const int places[] = {$DELAY_PLACES};
    int d;
    status = $ha_sources(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    for (d = 0; d < $DELAYS; ++d) {
        $ha_delay_jump(m, d, t, m->source[places[d]], m->source_rate[places[d]]);
        if (m->delays[d].full) {
            return $ha_fail(m, $MODEL_NO_ROOM, d, t);
        }
    }
//end
//if returns
    status = $ha_note_returns(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if follows
    status = $ha_follow_solutions(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if locates
    m->handled = 1;
//end
//if switches
    status = $ha_hold_sides(m, t, x);
//end
    (void)m;
    (void)t;
    (void)x;
    return status;
}

//public $model_cross
int $model_cross($model *m, double t, $real *x)
{
    int status = $ha_cross_begin(m, t, x);
//if bounds
    if (status == $MODEL_OK) {
        status = $ha_settle_all(m, t, x);
    }
//else
//if clauses
    if (status == $MODEL_OK) {
        status = $ha_run_clauses(m, t, x);
    }
//end
//end
    return status == $MODEL_OK ? $ha_cross_end(m, t, x) : status;
}
