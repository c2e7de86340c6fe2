
//if bounds

//section
/* ---- which branches have ended, which contacts meet ---- */

//entry ha_ended
/* The branches that have ended at (t, x), by margins and by commands: of each law the one beyond, or -1. */
static int ha_ended(ha_model *m, double t, const $real *x, int *next)
{
    static const int commands[][3] = {
$COMMAND_TABLE
    };
    const int hold = m->state_hold;
    int status;
    int i;
    for (i = 0; i < $LAWS; ++i) {
        next[i] = -1;
    }
    m->state_hold = HA_FOLLOW;
//if held
    $ha_place(m, t);
//end
    status = $ha_becomes_code(m, t, x, m->becomes);
    m->state_hold = hold;
    if (status == $MODEL_OK) {
        status = $ha_stand(m, t, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_MARGINS; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        if (m->margin_ended[i] && (next[margin->law] < 0 || margin->next < next[margin->law])) {
            next[margin->law] = margin->next;
        }
    }
    for (i = 0; i < $COMMANDS; ++i) {
        const int law = commands[i][1];
        if (m->becomes[commands[i][0]] != $0.0 && (next[law] < 0 || commands[i][2] < next[law])) {
            next[law] = commands[i][2];
        }
    }
    return $MODEL_OK;
}

//item ha_greatest_rate
/* The greatest rate that the gap of a contact has had. */
static $real ha_greatest_rate(const ha_model *m, int clause)
{
    int i;
    for (i = 0; i < HA_MARGINS; ++i) {
        if ($ha_bounds[i].clause == clause) {
            return m->most_margins[3 * $ha_bounds[i].key + 1];
        }
    }
    return $0.0;
}

//if meets
//item ha_is_gap
/* Whether a clause is that of a contact. */
static int ha_is_gap(int clause)
{
    int i;
    for (i = 0; i < HA_MARGINS; ++i) {
        if ($ha_bounds[i].clause == clause) {
            return $ha_bounds[i].gap;
        }
    }
    return 0;
}

//item ha_find_meeting
/* Contacts take an impact where their sides meet, whatever the sign of a gap that is zero. */
static int ha_find_meeting(ha_model *m, double t, const $real *x)
{
    int status = $ha_weigh_margins(m, t, x);
    int any = 0;
    int i;
    for (i = 0; i < $LAWS; ++i) {
        m->short_flight[i] = 0;
    }
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        if ($ha_bounds[i].meets) {
            const int met = m->margin_value[i] <= m->margin_zero[i] && m->margin_rate[i] < -m->margin_still[i];
            m->clauses[$ha_bounds[i].clause].fired = met;
            any = any || met;
        }
    }
    if (status != $MODEL_OK || !any) {
        return status;
    }
    status = $ha_changes_of_margins(m, t, x);
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        if (margin->meets && m->clauses[margin->clause].fired) {
            /* A flight that begins with the rate at most with which it ends. */
            m->short_flight[margin->law] = $ha_is_short(m, i, t, -m->margin_changes[margin->place + 1]);
        }
    }
    return status;
}

//item ha_find_contacts
/* The clauses of contacts whose gap is closed, or was before the round: what an impulse may act through. */
static int ha_find_contacts(ha_model *m, double t, const $real *x)
{
    const int status = $ha_weigh_margins(m, t, x);
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        m->contact[i] = 0;
    }
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        const int closed = m->margin_value[i] <= m->margin_zero[i] || m->clauses[margin->clause].fired;
        if (margin->meets && (closed || $ha_lets_go(m, t, margin->law))) {
            const $real most = m->most_margins[3 * margin->key + 1];
            if ($fabs(m->margin_rate[i]) <= $HA_AT_REST * most || m->short_flight[margin->law]) {
                m->at_rest[margin->clause] = 1;
            }
            m->contact[margin->clause] = 1;
        }
    }
    return status;
}

//end
//if gaps
//entry ha_begin_contacts
/* A run begins: sides of contacts that overlap there are refused. */
static int ha_begin_contacts(ha_model *m, double t, const $real *x)
{
    const int status = $ha_weigh_margins(m, t, x);
    int i;
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const $real value = m->margin_value[i];
        const $real over = $HA_OVERLAP * m->margin_present[$ha_bounds[i].place];
        if ($ha_bounds[i].gap && value < -m->margin_zero[i] && value < -over) {
            return $ha_fail(m, $MODEL_OVERLAP, $ha_bounds[i].law, t);
        }
    }
    return status;
}

//end

//end
