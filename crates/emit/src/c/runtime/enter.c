//if modes

//section
/* ---- from one mode to the next ---- */

//entry ha_leave
/* Notes the variables of the machine at (t, x), and what storages keep there. */
static int ha_leave(ha_model *m, double t, const $real *x)
{
    static const int symbols[] = {$VALUE_SYMBOLS};
    int status;
    int i;
    for (i = 0; i < $SYMBOLS; ++i) {
        m->left_values[i] = ($real)NAN;
        m->left_stored[i] = ($real)NAN;
    }
//if held
    $ha_place(m, t);
//end
    status = $ha_values_code(m, t, x, m->carried);
    for (i = 0; i < $VALUES && status == $MODEL_OK; ++i) {
        m->left_values[symbols[i]] = m->carried[i];
    }
//if bounds
    if (status == $MODEL_OK) {
        status = $ha_stored_code(m, t, x, m->stored);
    }
    if (status == $MODEL_OK) {
        static const int storages[] = {$STORAGE_SYMBOLS};
        for (i = 0; i < HA_STORED; ++i) {
            m->left_stored[storages[i]] = m->stored[i];
        }
    }
//end
    return status;
}

//if bounds
//entry ha_find_apart
/* The contacts whose sides are apart, which no force closes; by how much storages may change where contacts that would fly for no time keep
 * a rate that is rounding. */
static int ha_find_apart(ha_model *m, double t, const $real *x)
{
    const int status = $ha_stand(m, t, x);
    int i;
    for (i = 0; i < $LAWS; ++i) {
        m->apart[i] = 0;
    }
    m->no_leap = $HA_NO_LEAP;
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const $real rate = $fabs(m->margin_rate[i]);
        const int parts = rate > m->margin_still[i] && !m->margin_brief[i];
        if ($ha_bounds[i].gap && (m->margin_value[i] > m->margin_zero[i] || parts)) {
            m->apart[$ha_bounds[i].law] = 1;
        }
        if (m->margin_brief[i]) {
            const $real part = rate / $ha_greatest_rate(m, $ha_bounds[i].clause);
            m->no_leap = $ha_max(m->no_leap, $HA_NO_FLIGHT * part);
        }
    }
    return status;
}

//end

//item ha_carry
/* States and constants of this mode from the variables that were left; what storages kept. Whether all are known. */
static int ha_carry(ha_model *m, $real *x)
{
    int i;
    $ha_fill(x, $0.0, HA_NX);
    for (i = 0; i < HA_TRACKED; ++i) {
        const $real value = m->left_values[$ha_tracked[i]];
        x[i] = $ha_finite(value) ? value : $0.0;
    }
//if conserved
    {
        static const int replaced[] = {$REPLACED};
        for (i = 0; i < HA_NK; ++i) {
            const $real value = m->left_values[replaced[i]];
            m->k[i] = $ha_finite(value) ? value : $0.0;
        }
    }
//end
//if newton
    {
        /* Solutions of laws, and positions, are sought from where they are: places in the memory, and variables. */
        static const int starts[][2] = {
$SOLUTION_TABLE
        };
        $ha_forget_solutions(m);
        $ha_fill(m->memory, $0.0, $MEMORY);
        for (i = 0; i < $SOLUTIONS; ++i) {
            const $real value = m->left_values[starts[i][1]];
            if ($ha_finite(value)) {
                m->memory[starts[i][0]] = value;
            }
        }
    }
//end
//if bounds
    for (i = 0; i < HA_STORED; ++i) {
        static const int storages[] = {$STORAGE_SYMBOLS};
        /* A spring whose displacement follows from others keeps nothing by itself, but has a displacement. */
        const $real kept = m->left_stored[storages[i]];
        m->stored[i] = kept == kept ? kept : m->left_values[storages[i]];
        if (m->stored[i] != m->stored[i]) {
            return 0;
        }
    }
//end
    return 1;
}

//if bounds
//item ha_begin_bounds
/* Clauses of another mode: those of the modeller go on, bounds begin anew. */
static int ha_begin_bounds(ha_model *m, double t, const $real *x)
{
    static const int conditional[] = {$CONDITIONAL};
    int status;
    int i;
//if held
    $ha_place(m, t);
//end
    status = $ha_becomes_code(m, t, x, m->becomes);
    for (i = $OWN_CLAUSES; i < $CLAUSES; ++i) {
        m->clauses[i].fired = 0;
        m->clauses[i].start = t;
        m->clauses[i].last = -HUGE_VAL;
        m->clauses[i].interval = HUGE_VAL;
        m->clauses[i].next = HUGE_VAL;
        m->clauses[i].faster = 0;
    }
    for (i = 0; i < $CONDITIONALS; ++i) {
        if (conditional[i] >= $OWN_CLAUSES) {
            m->clauses[conditional[i]].holds = m->becomes[i] != $0.0;
        }
    }
    return status;
}

//entry ha_enter
/* Goes on in this mode from what storages kept in the one that was left: the state there, and by how much storages leap. */
static int ha_enter(ha_model *m, double t, $real *x, $real *leap)
{
    static const int storages[] = {$STORAGE_SYMBOLS};
    int status;
    int i;
    *leap = $0.0;
    m->failure.code = $MODEL_OK;
//if exchanges
    m->pivots_known = 0;
    m->steepest_known = 0;
//end
    $ha_fill(m->floors, $0.0, $CONDITIONS);
    status = $ha_parameters(m);
    if (status != $MODEL_OK) {
        return status;
    }
    m->state_hold = HA_FOLLOW;
//if clocks
    $ha_clock_cross(m, m->crossed);
//end
    if (!$ha_carry(m, x)) {
        return $ha_fail(m, $MODEL_NO_MODE, 0, t);
    }
    for (i = 0; i < HA_STORED; ++i) {
        m->entered[i] = m->stored[i];
    }
    status = $ha_balance_leaps(m, t, x);
//if switches
    if (status == $MODEL_OK) {
        status = $ha_take_sides(m, t, x);
    }
//end
//if follows
    if (status == $MODEL_OK) {
        status = $ha_follow_solutions(m, t, x);
    }
//end
    if (status == $MODEL_OK) {
//if held
        $ha_place(m, t);
//end
        status = $ha_stored_code(m, t, x, m->stored);
    }
    for (i = 0; i < HA_STORED && status == $MODEL_OK; ++i) {
        const $real before = m->entered[i];
        const $real after = m->stored[i];
        const $real size = $ha_max($ha_max(m->most_stored[storages[i]], $fabs(before)), $fabs(after));
        const $real change = $fabs(after - before);
        *leap = size == $0.0 ? *leap : $ha_max(*leap, change / size);
    }
    return status == $MODEL_OK ? $ha_begin_bounds(m, t, x) : status;
}

//end
//if exchanges
//item ha_take_open
/* States and constants that are no variables of the machine: those at which these have the values that were left, by Newton's method.
 * Whether there are such. */
static int ha_take_open(ha_model *m, double t, $real *x)
{
    static const int places[] = {$OPEN_PLACES};
    static const int symbols[] = {$OPEN_SYMBOLS};
    $real out[$OPEN + 1];
    $real rates[$OPEN + 1];
    $real matrix[$OPEN * $OPEN + 1];
    $real step[$OPEN + 1];
    int iteration;
    int row;
    int column;
    for (iteration = 0; iteration < 20; ++iteration) {
        int met = 1;
        int moved = 0;
        for (column = 0; column < $OPEN; ++column) {
            $ha_fill(m->along, $0.0, HA_DIRECTION);
            m->along[places[column]] = $1.0;
//if held
            $ha_place(m, t);
//end
            if ($ha_open_along(m, t, x, m->along, out, rates) != $MODEL_OK) {
                return 0;
            }
            for (row = 0; row < $OPEN; ++row) {
                matrix[row * $OPEN + column] = rates[row];
            }
        }
        for (row = 0; row < $OPEN; ++row) {
            const $real wanted = m->left_values[symbols[row]];
            step[row] = wanted - out[row];
            met = met && $fabs(step[row]) <= $4.0 * $DBL_EPSILON * $fabs(wanted);
        }
        if (met) {
            return 1;
        }
        if (!$ha_solve_square(matrix, step, $OPEN, 1)) {
            return 0;
        }
        for (row = 0; row < $OPEN; ++row) {
            const int place = places[row];
//if conserved
            $real *value = place >= HA_STATES_AT ? &x[place - HA_STATES_AT] : &m->k[place - HA_CONSERVED_AT];
//else
            $real *value = &x[place - HA_STATES_AT];
//end
            moved = moved || $fabs(step[row]) > $4.0 * $DBL_EPSILON * $fabs(*value);
            *value += step[row];
        }
        if (!moved) {
            return 1;
        }
    }
    return 0;
}

//entry ha_enter_at
/* Goes on in this mode where the variables of the machine have the values that were left. */
static int ha_enter_at(ha_model *m, double t, $real *x)
{
    int status;
    m->failure.code = $MODEL_OK;
    m->pivots_known = 0;
    m->steepest_known = 0;
//if bounds
    $ha_fill(m->floors, $0.0, $CONDITIONS);
//end
    status = $ha_parameters(m);
    if (status != $MODEL_OK) {
        return status;
    }
//if holds
    m->state_hold = HA_FOLLOW;
//end
//if clocks
    $ha_clock_cross(m, m->crossed);
//end
    if (!$ha_carry(m, x) || !$ha_take_open(m, t, x)) {
        return $ha_fail(m, $MODEL_SINGULAR, 0, t);
    }
//if switches
    status = $ha_take_sides(m, t, x);
//end
//if follows
    if (status == $MODEL_OK) {
        status = $ha_follow_solutions(m, t, x);
    }
//end
    return status;
}

//if ratios
//item ha_exchange_ratios
/* The variables of a row and a column change places. */
static void ha_exchange_ratios($real *ratios, int row, int column)
{
    const $real pivot = ratios[row * $INDEPENDENT + column];
    int i;
    int k;
    for (i = 0; i < $DEPENDENT; ++i) {
        const $real factor = ratios[i * $INDEPENDENT + column] / pivot;
        for (k = 0; k < $INDEPENDENT && i != row; ++k) {
            const $real part = factor * ratios[row * $INDEPENDENT + k];
            const $real left = ratios[i * $INDEPENDENT + k] - part;
            const int rounding = $fabs(left) <= $1e-12 * $fabs(ratios[i * $INDEPENDENT + k]);
            ratios[i * $INDEPENDENT + k] = k == column ? factor : (rounding ? $0.0 : left);
        }
    }
    for (k = 0; k < $INDEPENDENT; ++k) {
        const $real part = ratios[row * $INDEPENDENT + k] / pivot;
        ratios[row * $INDEPENDENT + k] = k == column ? $1.0 / pivot : -part;
    }
}

//end
//entry ha_find_wanted
/* Which variables should be independent instead of those that are: 1 if any should, 0 if not, -1 where a position has been passed at
 * which these do not tell the motion. A step from here has failed, or not. */
static int ha_find_wanted(ha_model *m, double t, const $real *x, int failed, unsigned char *wanted)
{
//if ratios
    static const int symbols[] = {$RATIO_SYMBOLS};
    $real ratios[$INDEPENDENT * $DEPENDENT];
    int inside[$INDEPENDENT];
    int outside[$DEPENDENT];
    int place;
    int turn;
    int i;
    const int due = $ha_look_at_ratios(m, t, x, failed, ratios);
    if (due <= 0) {
        return due;
    }
    for (i = 0; i < $INDEPENDENT; ++i) {
        inside[i] = symbols[i];
    }
    for (i = 0; i < $DEPENDENT; ++i) {
        outside[i] = symbols[$INDEPENDENT + i];
    }
    for (turn = 0; turn < 4 * ($INDEPENDENT + $DEPENDENT); ++turn) {
        const $real most = $ha_greatest_ratio(ratios, &place);
        const int row = place / $INDEPENDENT;
        const int column = place % $INDEPENDENT;
        const int kept = outside[row];
        if (!(most > $1.1)) {
            break;
        }
        $ha_exchange_ratios(ratios, row, column);
        outside[row] = inside[column];
        inside[column] = kept;
    }
    for (i = 0; i < $EXCHANGED; ++i) {
        wanted[i] = 0;
    }
    for (i = 0; i < $INDEPENDENT; ++i) {
        wanted[inside[i]] = 1;
    }
    return 1;
//else
    (void)m;
    (void)t;
    (void)x;
    (void)failed;
    (void)wanted;
    return 0;
//end
}

//end
//end
