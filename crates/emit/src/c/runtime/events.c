
//section
/* ---- what happens at events: all that happens at one instant happens in rounds, which read what there is before them ---- */

//always
enum {
    /* What an action changes. */
    HA_DISCRETE,
    HA_SIGNAL,
    HA_MOVED
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

//if impulses
//item ha_reset_of_round
/* The first action of the round that resets something; if there is none, one more than there are. */
static int ha_reset_of_round(const ha_model *m)
{
//if clauses
    int i;
    int a;
    for (i = 0; i < $CLAUSES; ++i) {
        for (a = $ha_action_starts[i]; m->clauses[i].fired && a < $ha_action_starts[i + 1]; ++a) {
            if ($ha_action_kinds[a] != HA_DISCRETE) {
                return a;
            }
        }
    }
//else
    (void)m;
//end
    return $ACTIONS;
}

//item ha_balance_starts
/* Where the terms of each balance begin, and of each what is kept, which has a factor there. */
static const int ha_balance_starts[] = {
$BALANCE_STARTS
};
//item ha_balance_terms
static const int ha_balance_terms[] = {
$BALANCE_TERMS
};
//if resets
//item ha_impulse_starts
/* Where the balances begin in which each impulse stands; what tells it. */
static const int ha_impulse_starts[] = {
$IMPULSE_STARTS
};
//item ha_impulse_rows
static const int ha_impulse_rows[] = {
$IMPULSE_ROWS
};
//item ha_impulse_held
static const int ha_impulse_held[] = {
$IMPULSE_HELD
};
//end
//item ha_jump_unknowns
static const int ha_jump_unknowns[] = {
$JUMP_UNKNOWN_LIST
};

//if resets
//item ha_take_asked
/* The resets of the round, each thing once. */
static void ha_take_asked(ha_model *m)
{
    int i;
    int a;
    int k;
    m->asked = 0;
    for (i = 0; i < $CLAUSES; ++i) {
        for (a = $ha_action_starts[i]; m->clauses[i].fired && a < $ha_action_starts[i + 1]; ++a) {
            int known = $ha_action_kinds[a] != HA_MOVED;
            for (k = 0; k < m->asked; ++k) {
                known = known || $ha_same_target(m->asked_actions[k], a);
            }
            if (!known) {
                m->asked_actions[m->asked] = a;
                m->impulses[m->asked] = $0.0;
                ++m->asked;
            }
        }
    }
}

//item ha_add_impulses
/* What impulses take of balances, with derivatives by one unknown, and by themselves. */
static void ha_add_impulses(ha_model *m, int column)
{
    const int columns = HA_UNKNOWNS + m->asked;
    int i;
    int k;
    for (i = 0; i < HA_IMPULSES; ++i) {
        int place = -1;
        for (k = m->asked - 1; k >= 0; --k) {
            place = $ha_action_impulses[m->asked_actions[k]] == i ? k : place;
        }
        for (k = $ha_impulse_starts[i]; place >= 0 && k < $ha_impulse_starts[i + 1]; ++k) {
            const int row = $ha_impulse_rows[k];
            const int factor = HA_STORED + $BALANCE_FACTORS + k;
            const $real part = m->jump_out[factor] * m->impulses[place];
            m->jump_residual[row] -= part;
            m->jump_sizes[row] += $fabs(part);
            m->jump_matrix[row * columns + HA_UNKNOWNS + place] = -m->jump_out[factor];
            if (column < HA_UNKNOWNS) {
                const $real slope = m->jump_rates[factor] * m->impulses[place];
                m->jump_matrix[row * columns + column] -= slope;
            }
        }
    }
}

//end
//item ha_balanced
/* Residuals of balances and resets, with their derivatives by the unknowns and by the impulses, and with what they add up. */
static int ha_balanced(ha_model *m, double t, const $real *x)
{
//if resets
    const int columns = HA_UNKNOWNS + m->asked;
    const int rows = HA_BALANCES + m->asked;
//else
    const int columns = HA_UNKNOWNS;
    const int rows = HA_BALANCES;
//end
//if bounds
    static const int storages[] = {$STORAGE_SYMBOLS};
//end
    int column;
    int row;
    int k;
    $ha_fill(m->jump_matrix, $0.0, rows * columns);
    for (column = 0; column < HA_UNKNOWNS || column == 0; ++column) {
        int status;
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        if (column < HA_UNKNOWNS) {
            const int unknown = $ha_jump_unknowns[column];
            m->along[unknown < HA_NX ? HA_STATES_AT + unknown : HA_CONSERVED_AT + unknown - HA_NX] = $1.0;
        }
//if held
        $ha_place(m, t);
//end
        status = $ha_impulses_along(m, t, x, m->along, m->jump_out, m->jump_rates);
        if (status != $MODEL_OK) {
            return status;
        }
        for (row = 0; row < HA_BALANCES; ++row) {
            $real sum = $0.0;
            $real slope = $0.0;
            $real size = $0.0;
            for (k = $ha_balance_starts[row]; k < $ha_balance_starts[row + 1]; ++k) {
                const $real factor = m->jump_out[HA_STORED + k];
                const $real now = m->jump_out[$ha_balance_terms[k]];
                const $real before = m->stored[$ha_balance_terms[k]];
                const $real jump = now - before;
                const $real part = factor * jump;
                const $real direct = factor * m->jump_rates[$ha_balance_terms[k]];
                const $real turned = m->jump_rates[HA_STORED + k] * jump;
                const $real both = direct + turned;
//if bounds
                const $real nothing = $HA_NOTHING * factor * m->most_stored[storages[$ha_balance_terms[k]]];
                const $real magnitude = $fabs(factor * now) + $fabs(factor * before) + $fabs(nothing);
//else
                const $real magnitude = $fabs(factor * now) + $fabs(factor * before);
//end
                sum += part;
                slope += both;
                size += magnitude;
            }
            m->jump_residual[row] = sum;
            m->jump_sizes[row] = size;
            if (column < HA_UNKNOWNS) {
                m->jump_matrix[row * columns + column] = slope;
            }
        }
//if resets
        $ha_add_impulses(m, column);
        for (k = 0; k < m->asked; ++k) {
            const int output = HA_FIRST_MOVED + $ha_action_places[m->asked_actions[k]];
            const $real wanted = m->new_values[m->asked_actions[k]];
            row = HA_BALANCES + k;
            m->jump_residual[row] = m->jump_out[output] - wanted;
            m->jump_sizes[row] = $ha_max($fabs(m->jump_out[output]), $fabs(wanted));
            if (column < HA_UNKNOWNS) {
                m->jump_matrix[row * columns + column] = m->jump_rates[output];
            }
//if bounds
            /* What is reset may be a small difference of what storages keep. */
            if (column < HA_UNKNOWNS) {
                const int unknown = $ha_jump_unknowns[column];
//if conserved
                const $real value = unknown < HA_NX ? x[unknown] : m->k[unknown - HA_NX];
//else
                const $real value = x[unknown];
//end
                const $real part = $fabs(m->jump_rates[output] * value);
                const $real been = $fabs($HA_NOTHING * m->jump_rates[output] * m->jump_been[column]);
                m->jump_greatest[k] = $ha_max($ha_max(m->jump_greatest[k], part), been);
            }
//end
        }
//end
    }
//if bounds
//if resets
    for (k = 0; k < m->asked; ++k) {
        m->jump_sizes[HA_BALANCES + k] = $ha_max(m->jump_sizes[HA_BALANCES + k], m->jump_greatest[k]);
    }
//end
//end
    return $MODEL_OK;
}

//item ha_weigh_balances
/* Weighs rows and columns so that the greatest entry of each is 1, and turns what is missed into what is to be gained. */
static void ha_weigh_balances(ha_model *m, int rows, int columns)
{
    int i;
    int j;
    for (i = 0; i < rows; ++i) {
        $real weight = $0.0;
        for (j = 0; j < columns; ++j) {
            weight = $ha_max(weight, $fabs(m->jump_matrix[i * columns + j]));
        }
        weight = weight > $0.0 ? $1.0 / weight : $1.0;
        for (j = 0; j < columns; ++j) {
            m->jump_matrix[i * columns + j] *= weight;
        }
        m->jump_residual[i] = -m->jump_residual[i] * weight;
    }
    for (j = 0; j < columns; ++j) {
        $real size = $0.0;
        for (i = 0; i < rows; ++i) {
            size = $ha_max(size, $fabs(m->jump_matrix[i * columns + j]));
        }
        size = size > $0.0 ? $1.0 / size : $1.0;
        for (i = 0; i < rows; ++i) {
            m->jump_matrix[i * columns + j] *= size;
        }
        m->jump_columns[j] = size;
        m->jump_order[j] = j;
    }
}

//item ha_jump_pivot
/* Brings the greatest entry from place k on there, rows and columns exchanged; its size. */
static $real ha_jump_pivot(ha_model *m, int rows, int columns, int k)
{
    $real most = $0.0;
    $real kept;
    int row = k;
    int column = k;
    int i;
    int j;
    for (i = k; i < rows; ++i) {
        for (j = k; j < columns; ++j) {
            if ($fabs(m->jump_matrix[i * columns + j]) > most) {
                most = $fabs(m->jump_matrix[i * columns + j]);
                row = i;
                column = j;
            }
        }
    }
    for (j = 0; j < columns && k < rows; ++j) {
        kept = m->jump_matrix[k * columns + j];
        m->jump_matrix[k * columns + j] = m->jump_matrix[row * columns + j];
        m->jump_matrix[row * columns + j] = kept;
    }
    for (i = 0; i < rows; ++i) {
        kept = m->jump_matrix[i * columns + k];
        m->jump_matrix[i * columns + k] = m->jump_matrix[i * columns + column];
        m->jump_matrix[i * columns + column] = kept;
    }
    if (k < rows) {
        kept = m->jump_residual[k];
        m->jump_residual[k] = m->jump_residual[row];
        m->jump_residual[row] = kept;
    }
    i = m->jump_order[k];
    m->jump_order[k] = m->jump_order[column];
    m->jump_order[column] = i;
    return most;
}

//item ha_solve_balances
/* The step that the linear equations tell, by elimination with the greatest pivot there is; the rank, below 0 if something is not
 * finite. */
static int ha_solve_balances(ha_model *m, int rows, int columns)
{
    $real greatest = $0.0;
    int i;
    int j;
    int k;
    if (!$ha_all_finite(m->jump_matrix, rows * columns) || !$ha_all_finite(m->jump_residual, rows)) {
        return -1;
    }
    $ha_weigh_balances(m, rows, columns);
    for (k = 0; k < columns; ++k) {
        const $real pivot = $ha_jump_pivot(m, rows, columns, k);
        greatest = k == 0 ? pivot : greatest;
        if (pivot <= $ROUNDING_OF_RANK * greatest) {
            return k;
        }
        for (i = k + 1; i < rows; ++i) {
            const $real factor = m->jump_matrix[i * columns + k] / m->jump_matrix[k * columns + k];
            const $real right = factor * m->jump_residual[k];
            for (j = k + 1; j < columns; ++j) {
                const $real part = factor * m->jump_matrix[k * columns + j];
                m->jump_matrix[i * columns + j] -= part;
            }
            m->jump_residual[i] -= right;
        }
    }
    for (i = columns - 1; i >= 0; --i) {
        $real sum = m->jump_residual[i];
        for (j = i + 1; j < columns; ++j) {
            const $real part = m->jump_matrix[i * columns + j] * m->jump_residual[j];
            sum -= part;
        }
        m->jump_residual[i] = sum / m->jump_matrix[i * columns + i];
        m->jump_step[m->jump_order[i]] = m->jump_residual[i] * m->jump_columns[m->jump_order[i]];
    }
    return columns;
}

//item ha_move_unknowns
/* Makes the step; its greatest part, each relative to the unknown that it moves. */
static $real ha_move_unknowns(ha_model *m, $real *x)
{
    $real length = $0.0;
    int i;
    for (i = 0; i < HA_UNKNOWNS; ++i) {
        const int unknown = $ha_jump_unknowns[i];
//if conserved
        $real *value = unknown < HA_NX ? &x[unknown] : &m->k[unknown - HA_NX];
//else
        $real *value = &x[unknown];
//end
        const $real step = m->jump_step[i];
//if bounds
        const $real size = $ha_max($ha_max($fabs(*value), $fabs(step)), $DBL_MIN);
        m->jump_been[i] = $ha_max(m->jump_been[i], $fabs(step));
        if ($fabs(step) > $CLOSE_TO_ROUNDING * $HA_NOTHING * m->jump_been[i]) {
            length = $ha_max(length, $fabs(step) / size);
        }
//else
        length = $ha_max(length, $fabs(step) / $ha_max($ha_max($fabs(*value), $fabs(step)), $DBL_MIN));
//end
        *value += step;
//if single
        if (unknown < HA_NX) {
            m->rest[unknown] = 0.0f;
        }
//end
    }
//if resets
    for (i = 0; i < m->asked; ++i) {
        m->impulses[i] += m->jump_step[HA_UNKNOWNS + i];
    }
//end
    return length;
}

//item ha_solve_impulses
/* What storages keep after the round: Newton on states, constants and impulses. Whether what is asked for is independent. */
static int ha_solve_impulses(ha_model *m, double t, $real *x, int *independent)
{
//if resets
    const int rows = HA_BALANCES + m->asked;
    const int columns = HA_UNKNOWNS + m->asked;
//else
    const int rows = HA_BALANCES;
    const int columns = HA_UNKNOWNS;
//end
    $real last = $HUGE_VAL;
    int met = columns == 0;
    int iteration;
    int status;
    int i;
//if bounds
    int fits;
//end
    *independent = 1;
//if bounds
    for (i = 0; i < HA_UNKNOWNS; ++i) {
        const int unknown = $ha_jump_unknowns[i];
//if conserved
        const $real value = unknown < HA_NX ? x[unknown] : m->k[unknown - HA_NX];
//else
        const $real value = x[unknown];
//end
        const $real been = unknown < HA_TRACKED ? m->most_values[$ha_tracked[unknown]] : $0.0;
        m->jump_been[i] = $ha_max(been, $fabs(value));
    }
//if resets
    $ha_fill(m->jump_greatest, $0.0, m->asked);
    $ha_fill(m->impulses, $0.0, m->asked);
//end
//end
    for (iteration = 0; iteration < 50 && !met; ++iteration) {
        $real length;
        int rank;
        status = $ha_balanced(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
        met = 1;
        for (i = 0; i < rows; ++i) {
            met = met && m->jump_residual[i] == $0.0;
        }
        if (met) {
            break;
        }
//if bounds
        fits = 1;
        for (i = 0; i < rows; ++i) {
            fits = fits && $fabs(m->jump_residual[i]) <= $HA_CLOSE * m->jump_sizes[i];
        }
//end
        rank = $ha_solve_balances(m, rows, columns);
        if (rank < 0) {
            break;
        }
        if (rank < columns) {
            *independent = 0;
            return $MODEL_OK;
        }
        length = $ha_move_unknowns(m, x);
//if bounds
        /* What is nothing but rounding never settles; then its equations do. */
        met = length <= $4.0 * $DBL_EPSILON || ((length < $CLOSE_TO_ROUNDING || fits) && length >= $0.5 * last);
//else
        met = length <= $4.0 * $DBL_EPSILON || (length < $CLOSE_TO_ROUNDING && length >= $0.5 * last);
//end
        last = length;
    }
    if (columns > 0) {
        status = $ha_balanced(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < rows; ++i) {
            met = met && $fabs(m->jump_residual[i]) <= $CLOSE_TO_ROUNDING * m->jump_sizes[i];
        }
    }
    return met ? $MODEL_OK : $ha_fail(m, $MODEL_RESET_UNMET, $ha_reset_of_round(m), t);
}

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
//if contacts
//item ha_bound_of
/* The law and the branch beyond of each clause that is the end of a branch. */
static const int ha_bound_of[][2] = {
$BOUND_TABLE
};

//entry ha_resets
/* Whether something that happens takes an impulse. */
static int ha_resets(const ha_model *m)
{
//if resets
    int i;
    int a;
    for (i = 0; i < $CLAUSES; ++i) {
        for (a = $ha_action_starts[i]; m->clauses[i].fired && a < $ha_action_starts[i + 1]; ++a) {
            if ($ha_action_kinds[a] == HA_MOVED) {
                return 1;
            }
        }
    }
//else
    (void)m;
//end
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
