
//always
int $model_cross($model *m, double t, $real *x)
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
    $ha_copy(m->u_crossed, m->u, HA_NU);
//if switches
    m->state_hold = HA_FOLLOW;
//end
//if newton
    {
        /* A solution may leap where something jumps. */
        int i;
        for (i = 0; i < $BLOCKS; ++i) {
            m->following[i] = 0;
//if sought_positions
            m->motion_known[i] = 0;
//end
        }
    }
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
//if clauses
    status = first ? $ha_begin_clauses(m, t, x) : $ha_find_fired(m, t, x);
    if (status == $MODEL_OK) {
        status = $ha_run_clauses(m, t, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if delays
    {
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
    status = $model_indicators(m, t, x, m->beyond);
    if (status == $MODEL_OK) {
        int i;
        for (i = 0; i < HA_NG; ++i) {
            m->sides[i] = m->beyond[i] > $0.0;
        }
    }
//else
    (void)x;
//end
    return status;
}
