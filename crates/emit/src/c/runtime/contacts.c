
//if impulses

//section
/* ---- impulses that are shared out ---- */

//if meets
//item ha_impulse_of
/* The impulse of a contact in what has been solved last. */
static $real ha_impulse_of(const ha_model *m, int clause)
{
    int k;
    for (k = 0; k < m->asked && m->clauses[clause].fired; ++k) {
        if ($ha_action_impulses[m->asked_actions[k]] == $ha_action_impulses[$ha_action_starts[clause]]) {
            return m->impulses[k];
        }
    }
    return $0.0;
}

//item ha_gives_way
/* By how much a contact gives way after what has been solved last, beyond rounding. */
static $real ha_gives_way(const ha_model *m, int clause)
{
    const int action = $ha_action_starts[clause];
    const $real flow = m->jump_out[HA_FIRST_MOVED + $ha_action_places[action]];
    const $real rounding = $HA_CLOSE * $ha_greatest_rate(m, clause);
    return $ha_max(m->new_values[action] - flow - rounding, $0.0);
}

//item ha_noise_of_impulses
/* An impulse that is rounding. */
static $real ha_noise_of_impulses(const ha_model *m)
{
    $real most = $0.0;
    $real kept = $0.0;
    int i;
    for (i = 0; i < m->asked; ++i) {
        most = $ha_max(most, $fabs(m->impulses[i]));
    }
    for (i = 0; i < HA_BALANCES; ++i) {
        kept = $ha_max(kept, m->jump_sizes[i]);
    }
    most *= $CLOSE_TO_ROUNDING;
    kept *= $HA_CLOSE;
    return most + kept;
}

//item ha_begin_again
/* What storages kept before anything was shared out. */
static void ha_begin_again(ha_model *m, $real *x)
{
    $ha_copy(x, m->shared_from, HA_NX);
//if conserved
    $ha_copy(m->k, m->shared_from + HA_NX, HA_NK);
//end
}

//item ha_worst_contact
/* The contact that gives way most, or -1. */
static int ha_worst_contact(const ha_model *m)
{
    $real most = $0.0;
    int worst = -1;
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        if (m->contact[i] && !m->clauses[i].fired && !m->contact_held[i]) {
            const $real by = $ha_gives_way(m, i);
            if (by > most) {
                most = by;
                worst = i;
            }
        }
    }
    return worst;
}

//item ha_let_go
/* Goes from what is shared out to what is wanted as far as no contact pulls; whether one does, which is let go. */
static int ha_let_go(ha_model *m)
{
    const $real noise = $ha_noise_of_impulses(m);
    $real part = $0.0;
    int first = -1;
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        m->wanted[i] = m->contact[i] ? $ha_impulse_of(m, i) : $0.0;
        if (m->contact[i] && m->clauses[i].fired && m->wanted[i] < -noise) {
            const $real way = m->shared[i] / (m->shared[i] - m->wanted[i]);
            if (first < 0 || way < part) {
                part = way;
                first = i;
            }
        }
    }
    if (first < 0) {
        return 0;
    }
    for (i = 0; i < $CLAUSES; ++i) {
        if (m->contact[i]) {
            const $real way = part * (m->wanted[i] - m->shared[i]);
            m->shared[i] += way;
            if (m->clauses[i].fired && (i == first || m->shared[i] <= $0.0)) {
                m->shared[i] = $0.0;
                m->clauses[i].fired = 0;
            }
        }
    }
    return 1;
}

//item ha_let_act
/* Lets a contact act beside the others, and lets go those that would pull. */
static int ha_let_act(ha_model *m, double t, $real *x, int added)
{
    int turn;
    int i;
    m->clauses[added].fired = 1;
    for (turn = 0; turn < 2 * $CLAUSES + 2; ++turn) {
        int independent;
        int status;
        $ha_begin_again(m, x);
        $ha_take_asked(m);
        status = $ha_solve_impulses(m, t, x, &independent);
        if (status != $MODEL_OK) {
            return status;
        }
        if (!independent && (m->contact_held[added] || !m->clauses[added].fired)) {
            return $ha_fail(m, $MODEL_RESET_DEPENDENT, $ha_reset_of_round(m), t);
        }
        if (!independent) {
            /* The others hold it to rounding. */
            m->contact_held[added] = 1;
            m->clauses[added].fired = 0;
            continue;
        }
        if (m->clauses[added].fired && m->shared[added] == $0.0 && $ha_impulse_of(m, added) <= $0.0) {
            /* What it gives way by is rounding. */
            m->contact_held[added] = 1;
            m->clauses[added].fired = 0;
            continue;
        }
        if ($ha_let_go(m)) {
            continue;
        }
        for (i = 0; i < $CLAUSES; ++i) {
            m->shared[i] = m->wanted[i];
            m->contact_held[i] = m->contact_held[i] && !m->clauses[added].fired;
        }
        return $MODEL_OK;
    }
    return $ha_fail(m, $MODEL_RESET_UNMET, $ha_reset_of_round(m), t);
}

//end
//item ha_share_out
/* Shares out the impulses of resets and of contacts: of each contact none pulls, and where one acts it gives way no more. That is the
 * least kinetic energy of what the impulses change, found by letting act the contact that gives way most. */
static int ha_share_out(ha_model *m, double t, $real *x)
{
    int independent;
    int status;
//if meets
    int turn;
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        m->clauses[i].fired = m->clauses[i].fired && !m->contact[i];
        m->contact_held[i] = 0;
        m->shared[i] = $0.0;
    }
    $ha_copy(m->shared_from, x, HA_NX);
//if conserved
    $ha_copy(m->shared_from + HA_NX, m->k, HA_NK);
//end
    $ha_take_asked(m);
//end
    status = $ha_solve_impulses(m, t, x, &independent);
    if (status == $MODEL_OK && !independent) {
        status = $ha_fail(m, $MODEL_RESET_DEPENDENT, $ha_reset_of_round(m), t);
    }
//if meets
    for (turn = 0; turn < 8 * ($CLAUSES + 1) && status == $MODEL_OK; ++turn) {
        const int worst = $ha_worst_contact(m);
        if (worst < 0) {
            return $MODEL_OK;
        }
        status = $ha_let_act(m, t, x, worst);
    }
    if (status == $MODEL_OK && $ha_worst_contact(m) >= 0) {
        status = $ha_fail(m, $MODEL_RESET_UNMET, $ha_reset_of_round(m), t);
    }
//end
    return status;
}

//end
