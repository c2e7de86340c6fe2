//if impulses
//item ha_balance_impulses
/* What storages keep after the round. The impulses of one instant add up, of which this may be the first round. */
static int ha_balance_impulses(ha_model *m, double t, $real *x, int first)
{
    const int status = $ha_share_out(m, t, x);
//if resets
    int i;
    for (i = 0; i < m->asked && first && status == $MODEL_OK; ++i) {
        m->z[$ha_impulse_held[$ha_action_impulses[m->asked_actions[i]]]] = $0.0;
    }
    for (i = 0; i < m->asked && status == $MODEL_OK; ++i) {
        m->z[$ha_impulse_held[$ha_action_impulses[m->asked_actions[i]]]] += m->impulses[i];
    }
//else
    (void)first;
//end
    return status;
}

//if leaps_balanced
//item ha_balance_leaps
/* What storages keep after ratios have leapt. */
static int ha_balance_leaps(ha_model *m, double t, $real *x)
{
    int independent;
    int status;
//if clauses
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        m->clauses[i].fired = 0;
    }
//end
//if resets
    m->asked = 0;
//end
    status = $ha_solve_impulses(m, t, x, &independent);
    if (status == $MODEL_OK && !independent) {
        status = $ha_fail(m, $MODEL_RESET_DEPENDENT, $ha_reset_of_round(m), t);
    }
    return status;
}

//end
//if leaps
//item ha_take_stored
/* What storages keep before a condition changes, with the inputs of before. */
static int ha_take_stored(ha_model *m, double t, const $real *x)
{
    int status;
    int i;
    for (i = 0; i < HA_NU; ++i) {
        const $real now = m->u[i];
        m->u[i] = m->u_crossed[i];
        m->u_crossed[i] = now;
    }
//if held
    $ha_place(m, t);
//end
    status = $ha_stored_code(m, t, x, m->stored);
    for (i = 0; i < HA_NU; ++i) {
        const $real before = m->u[i];
        m->u[i] = m->u_crossed[i];
        m->u_crossed[i] = before;
    }
    return status;
}

//end
//end
//if constraints
//item ha_position_misses
/* By how much each constraint on displacements is missed. */
static int ha_position_misses(ha_model *m, double t, const $real *x, $real *misses)
{
    int status;
    int i;
//if held
    $ha_place(m, t);
//end
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    status = $ha_positions_along(m, t, x, m->along, misses, m->position_rates);
    for (i = 0; i < $POSITIONS; ++i) {
        misses[i] = $fabs(misses[i]);
    }
    return status;
}

//item ha_refuse_broken_positions
/* Refuses new positions that a constraint does not allow. */
static int ha_refuse_broken_positions(ha_model *m, double t, const $real *x)
{
    static const int starts[] = {$POSITION_STARTS};
    static const int reads[] = {$POSITION_READS};
    int status = $ha_position_misses(m, t, x, m->misses_after);
    int i;
    int k;
    for (i = 0; i < $POSITIONS && status == $MODEL_OK; ++i) {
        const $real before = $2.0 * m->misses[i];
        $real size = $0.0;
        if (m->misses_after[i] <= before) {
            continue;
        }
        for (k = starts[i]; k < starts[i + 1] && status == $MODEL_OK; ++k) {
            $ha_fill(m->along, $0.0, HA_DIRECTION);
            m->along[HA_STATES_AT + reads[k]] = $1.0;
            status = $ha_positions_along(m, t, x, m->along, m->position_out, m->position_rates);
            size += $fabs(m->position_rates[i] * x[reads[k]]);
        }
        if (status == $MODEL_OK && !(m->misses_after[i] <= before + $CLOSE_TO_ROUNDING * size)) {
            status = $ha_fail(m, $MODEL_CONSTRAINT_BROKEN, i, t);
        }
    }
    return status;
}

//end
//item ha_change
/* Changes what the round changes: discrete variables and signals, then what storages keep. */
static int ha_change(ha_model *m, double t, $real *x, int first)
{
    int status = $MODEL_OK;
    int i;
    int a;
//if impulses
//if switches
    int set = 0;
//end
//end
//if impulses
//if held
    $ha_place(m, t);
//end
    status = $ha_stored_code(m, t, x, m->stored);
    if (status != $MODEL_OK) {
        return status;
    }
//if resets
    $ha_take_asked(m);
//end
//end
//if constraints
    status = $ha_position_misses(m, t, x, m->misses);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    for (i = 0; i < $CLAUSES; ++i) {
        for (a = $ha_action_starts[i]; m->clauses[i].fired && a < $ha_action_starts[i + 1]; ++a) {
            const int place = $ha_action_places[a];
//if impulses
//if switches
            set = set || $ha_action_kinds[a] == HA_DISCRETE || $ha_action_kinds[a] == HA_SIGNAL;
//end
//end
            if ($ha_action_kinds[a] == HA_DISCRETE) {
                m->z[place] = m->new_values[a];
            } else if ($ha_action_kinds[a] == HA_SIGNAL) {
                x[place] = m->new_values[a];
//if single
                m->rest[place] = 0.0f;
//end
            }
        }
    }
//if impulses
//if switches
    /* What storages keep is shared out by the ratios that hold from now on, not by those of conditions that have changed. */
    if (set) {
        status = $ha_take_sides(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
    }
//end
    status = $ha_balance_impulses(m, t, x, first);
    if (status != $MODEL_OK) {
        return status;
    }
//else
    (void)first;
//end
//if constraints
    status = $ha_refuse_broken_positions(m, t, x);
//else
    (void)t;
    (void)x;
//end
    return status;
}

//entry ha_round
/* A round of what happens at an instant, of which it may be the first. */
static int ha_round(ha_model *m, double t, $real *x, int first)
{
    int status = $MODEL_OK;
//if conditional_clauses
    status = $ha_notice(m, t);
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if meets
    status = $ha_find_contacts(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    status = $ha_new_values(m, t, x);
    if (status == $MODEL_OK) {
        status = $ha_refuse_conflicts(m, t);
    }
    if (status == $MODEL_OK) {
        status = $ha_change(m, t, x, first);
    }
//if newton
    $ha_leave_solutions(m);
//end
//if leaps
    /* Ratios that leap with discrete variables act by impulses. */
    if (status == $MODEL_OK) {
//if held
        $ha_place(m, t);
//end
        status = $ha_stored_code(m, t, x, m->stored);
    }
//end
//if switches
    if (status == $MODEL_OK) {
        status = $ha_take_sides(m, t, x);
    }
//if leaps
    if (status == $MODEL_OK) {
        status = $ha_balance_leaps(m, t, x);
    }
    if (status == $MODEL_OK) {
        status = $ha_take_sides(m, t, x);
    }
//end
//end
    return status == $MODEL_OK ? $ha_find_fired(m, t, x) : status;
}

//if bounds
//if releases
//item ha_bound_of
/* The law and the branch beyond of each clause that is the end of a branch. */
static const int ha_bound_of[][2] = {
$BOUND_TABLE
};

//entry ha_resets
/* Whether something that happens takes an impulse. */
static int ha_resets(const ha_model *m)
{
    int i;
    int a;
    for (i = 0; i < $CLAUSES; ++i) {
        for (a = $ha_action_starts[i]; m->clauses[i].fired && a < $ha_action_starts[i + 1]; ++a) {
            if ($ha_action_kinds[a] == HA_MOVED || $ha_action_kinds[a] == HA_HELD_BY_BRANCH) {
                return 1;
            }
        }
    }
    return 0;
}

//entry ha_note_fired
/* Notes what happens, to go on with it in another mode: the clauses of the modeller, and which ends of branches. */
static int ha_note_fired(ha_model *m)
{
    int i;
    for (i = 0; i < $OWN_CLAUSES; ++i) {
        m->fired_before[i] = m->clauses[i].fired;
    }
    for (i = 0; i < $LAWS; ++i) {
        m->fired_ends[i] = 0;
    }
    for (i = $OWN_CLAUSES; i < $CLAUSES; ++i) {
        if (m->clauses[i].fired) {
            m->fired_ends[$ha_bound_of[i - $OWN_CLAUSES][0]] |= 1 << $ha_bound_of[i - $OWN_CLAUSES][1];
        }
    }
    return $MODEL_OK;
}

//entry ha_fire_again
/* The same happens in this mode. */
static int ha_fire_again(ha_model *m)
{
    int i;
    for (i = 0; i < $OWN_CLAUSES; ++i) {
        m->clauses[i].fired = m->fired_before[i];
    }
    for (i = $OWN_CLAUSES; i < $CLAUSES; ++i) {
        const int *bound = $ha_bound_of[i - $OWN_CLAUSES];
        m->clauses[i].fired = (m->fired_ends[bound[0]] >> bound[1]) & 1;
    }
    return $MODEL_OK;
}

//end
//else
//item ha_run_clauses
/* Lets happen what has been found to happen, and what follows from that at the same instant. */
static int ha_run_clauses(ha_model *m, double t, $real *x)
{
    int turn;
    for (turn = 0; turn < 200 && $ha_first_fired(m) >= 0; ++turn) {
        const int status = $ha_round(m, t, x, turn == 0);
        if (status != $MODEL_OK) {
            return status;
        }
    }
    return $ha_first_fired(m) < 0 ? $MODEL_OK : $ha_fail(m, $MODEL_ENDLESS_EVENTS, $ha_first_fired(m), t);
}

//end
