//if bounds

//section
/* ---- from one mode to the next ---- */

//entry ha_leave
/* Notes the variables of the machine at (t, x), what storages keep there, and the contacts whose sides are apart. */
static int ha_leave(ha_model *m, double t, const $real *x)
{
    static const int storages[] = {$STORAGE_SYMBOLS};
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
    status = $ha_stored_code(m, t, x, m->stored);
    if (status == $MODEL_OK) {
        status = $ha_values_code(m, t, x, m->carried);
    }
    if (status == $MODEL_OK) {
        for (i = 0; i < HA_STORED; ++i) {
            m->left_stored[storages[i]] = m->stored[i];
        }
        for (i = 0; i < $VALUES; ++i) {
            m->left_values[symbols[i]] = m->carried[i];
        }
        status = $ha_weigh_margins(m, t, x);
    }
    for (i = 0; i < $LAWS; ++i) {
        m->apart[i] = 0;
    }
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const int still = m->margin_value[i] <= m->margin_zero[i] && $fabs(m->margin_rate[i]) <= m->margin_still[i];
        if ($ha_bounds[i].gap && !still) {
            m->apart[$ha_bounds[i].law] = 1;
        }
    }
    return status;
}

//item ha_carry
/* States and constants of this mode from the variables that were left; what storages kept. Whether all are known. */
static int ha_carry(ha_model *m, $real *x)
{
    static const int storages[] = {$STORAGE_SYMBOLS};
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
        $ha_fill(m->memory, $0.0, $MEMORY);
        for (i = 0; i < $SOLUTIONS; ++i) {
            const $real value = m->left_values[starts[i][1]];
            if ($ha_finite(value)) {
                m->memory[starts[i][0]] = value;
            }
        }
    }
//end
    for (i = 0; i < HA_STORED; ++i) {
        /* A spring whose displacement follows from others keeps nothing by itself, but has a displacement. */
        const $real kept = m->left_stored[storages[i]];
        m->stored[i] = kept == kept ? kept : m->left_values[storages[i]];
        if (m->stored[i] != m->stored[i]) {
            return 0;
        }
    }
    return 1;
}

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
    $ha_fill(m->floors, $0.0, $CONDITIONS);
    status = $ha_parameters(m);
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < $LAWS; ++i) {
        m->released[i] = 0;
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
