
//section
/* ---- what happens at events: all that happens at one instant happens in rounds, which read what there is before them ---- */

//always
enum {
    /* What an action changes. */
    HA_DISCRETE,
    HA_SIGNAL,
    HA_MOVED,
    /* What a branch holds: another mode changes it. */
    HA_HELD_BY_BRANCH
};

//item ha_action_starts
/* Where the actions of each clause begin; of each action what it changes, and the impulse that does it. */
static const int ha_action_starts[] = {
$ACTION_STARTS
};
//item ha_action_kinds
static const int ha_action_kinds[] = {
$ACTION_KINDS
};
//item ha_action_places
static const int ha_action_places[] = {
$ACTION_PLACES
};
//if resets
//item ha_action_impulses
static const int ha_action_impulses[] = {
$ACTION_IMPULSES
};
//end

//item ha_clause_code
/* The new values that a clause gives. */
static int ha_clause_code(ha_model *m, int clause, double t, const $real *x, $real *out)
{
    switch (clause) {
$CLAUSE_CASES
    default:
        return $MODEL_OK;
    }
}

//entry ha_find_fired
/* Which clauses happen: those whose condition, as held, has become true, and those whose period is over. */
static int ha_find_fired(ha_model *m, double t, const $real *x)
{
    int i;
//if conditional_clauses
    {
        static const int conditional[] = {$CONDITIONAL};
        int status;
//if held
        $ha_place(m, t);
//end
        status = $ha_becomes_code(m, t, x, m->becomes);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < $CONDITIONALS; ++i) {
            $model_clause *c = &m->clauses[conditional[i]];
            const int holds = m->becomes[i] != $0.0;
            c->fired = holds && !c->holds;
            c->holds = holds;
        }
    }
//else
    (void)x;
//end
//if meets
    {
        const int status = $ha_find_meeting(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
    }
//end
//if periodic_clauses
    {
        static const int periodic[] = {$PERIODIC};
        for (i = 0; i < $PERIODICS; ++i) {
            $model_clause *c = &m->clauses[periodic[i]];
            int k;
            c->fired = t >= c->next * c->period;
            if (c->fired) {
                c->next = $$ha_max(c->next + 1.0, floor(t / c->period) - 1.0);
            }
            for (k = 0; k < 4 && t >= c->next * c->period; ++k) {
                c->next += 1.0;
            }
        }
    }
//else
    (void)t;
//end
    return $MODEL_OK;
}

//item ha_begin_clauses
/* A run begins: conditions that hold have not become true, multiples of periods count from time 0. */
static int ha_begin_clauses(ha_model *m, double t, const $real *x)
{
    int status = $ha_find_fired(m, t, x);
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        m->clauses[i].fired = 0;
        m->clauses[i].start = t;
        m->clauses[i].last = -HUGE_VAL;
        m->clauses[i].interval = HUGE_VAL;
        m->clauses[i].faster = 0;
//if returns
        m->returning[i] = 0;
//end
    }
//if periodic_clauses
    {
        static const int periodic[] = {$PERIODIC};
        for (i = 0; i < $PERIODICS; ++i) {
            $model_clause *c = &m->clauses[periodic[i]];
            c->next = floor(t / c->period);
            c->next += c->next * c->period < t ? 1.0 : 0.0;
            c->fired = t >= c->next * c->period;
            c->next += c->fired ? 1.0 : 0.0;
        }
    }
//end
//if meets
    if (status == $MODEL_OK) {
        status = $ha_find_meeting(m, t, x);
    }
//end
    return status;
}

//entry ha_first_fired
/* The first clause that happens now, or -1. */
static int ha_first_fired(const ha_model *m)
{
    int i;
    for (i = 0; i < $CLAUSES; ++i) {
        if (m->clauses[i].fired) {
            return i;
        }
    }
    return -1;
}

//if conditional_clauses
//item ha_accumulates
/* Takes notice that a clause with a condition happens; whether its events come ever faster towards an instant beyond which nothing is
 * known. */
static int ha_accumulates($model_clause *c, double t, double step)
{
    const double interval = t - c->last;
    const double before = c->interval;
    const double passed = t - c->start;
    const double ratio = interval / before;
//if single
    /* Within a step single precision tells no shorter intervals apart. */
    const double near = $$ha_max(1e-10 * passed, 4e-6 * step);
//else
    const double near = 1e-10 * passed;
//end
    double left = 0.0;
    (void)step;
    if (t <= c->last) {
        return 0;
    }
    c->last = t;
    c->interval = interval;
    c->faster = interval < before || interval <= 1e-13 * passed ? c->faster + 1 : 0;
    if (ratio < 1.0) {
        left = interval * ratio / (1.0 - ratio);
    }
    return left <= near && interval <= near && c->faster >= (ratio <= 0.1 ? 3 : 8);
}

//item ha_notice
/* Looks whether events accumulate. */
static int ha_notice(ha_model *m, double t)
{
    static const int conditional[] = {$CONDITIONAL};
    int i;
//if meets
    for (i = 0; i < $CLAUSES; ++i) {
        m->at_rest[i] = 0;
    }
//end
    for (i = 0; i < $CONDITIONALS; ++i) {
        $model_clause *c = &m->clauses[conditional[i]];
        if (c->fired && $ha_accumulates(c, t, m->step)) {
//if meets
            if ($ha_is_gap(conditional[i])) {
                m->at_rest[conditional[i]] = 1;
                continue;
            }
//end
            return $ha_fail(m, $MODEL_ACCUMULATION, conditional[i], t);
        }
    }
    return $MODEL_OK;
}

//end
//item ha_new_values
/* The new values of the clauses of the round, from what there is before it. */
static int ha_new_values(ha_model *m, double t, const $real *x)
{
    int status = $MODEL_OK;
    int i;
    int a;
//if held
    $ha_place(m, t);
//end
    for (i = 0; i < $CLAUSES && status == $MODEL_OK; ++i) {
//if meets
        if (!(m->clauses[i].fired || m->contact[i])) {
            continue;
        }
        status = $ha_clause_code(m, i, t, x, m->clause_values);
        for (a = $ha_action_starts[i]; a < $ha_action_starts[i + 1]; ++a) {
            /* Behind the new values of a contact stands that with which it is at rest. */
            const int still = $ha_is_gap(i) && m->at_rest[i];
            m->new_values[a] = m->clause_values[(still ? $ha_action_starts[i + 1] : a) - $ha_action_starts[i]];
        }
//else
        if (!m->clauses[i].fired) {
            continue;
        }
        status = $ha_clause_code(m, i, t, x, m->new_values + $ha_action_starts[i]);
//end
        for (a = $ha_action_starts[i]; a < $ha_action_starts[i + 1] && status == $MODEL_OK; ++a) {
            if (!$ha_finite(m->new_values[a])) {
                status = $ha_fail(m, $MODEL_EVENT_NOT_FINITE, a, t);
            }
        }
    }
    return status;
}

//item ha_same_target
/* Whether two actions change the same. */
static int ha_same_target(int a, int b)
{
    return $ha_action_kinds[a] == $ha_action_kinds[b] && $ha_action_places[a] == $ha_action_places[b];
}

//item ha_refuse_conflicts
/* Two clauses may change one thing if they give it one value. */
static int ha_refuse_conflicts(ha_model *m, double t)
{
    int i;
    int j;
    int a;
    int b;
    for (i = 1; i < $CLAUSES; ++i) {
        for (j = 0; m->clauses[i].fired && j < i; ++j) {
            for (a = $ha_action_starts[i]; m->clauses[j].fired && a < $ha_action_starts[i + 1]; ++a) {
                for (b = $ha_action_starts[j]; b < $ha_action_starts[j + 1]; ++b) {
                    if ($ha_same_target(a, b) && m->new_values[a] != m->new_values[b]) {
                        return $ha_fail(m, $MODEL_CONFLICT, a, t);
                    }
                }
            }
        }
    }
    return $MODEL_OK;
}
