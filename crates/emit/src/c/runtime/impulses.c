
//section
/* ---- impulses: what storages keep after an event, from what they kept before it ---- */

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
    int stays = 0;
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
        /* What is nothing but rounding never settles; then its equations hold to that. */
        for (i = 0; i < rows && stays; ++i) {
            stays = $fabs(m->jump_residual[i]) <= $1e-11 * m->jump_sizes[i];
        }
        met = met || stays;
        if (met) {
            break;
        }
        rank = $ha_solve_balances(m, rows, columns);
        if (rank < 0) {
            break;
        }
        if (rank < columns) {
            *independent = 0;
            return $MODEL_OK;
        }
        length = $ha_move_unknowns(m, x);
        met = length <= $4.0 * $DBL_EPSILON || (length < $CLOSE_TO_ROUNDING && length >= $0.5 * last);
        stays = length >= $0.5 * last;
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

//end
