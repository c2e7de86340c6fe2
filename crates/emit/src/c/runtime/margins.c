//if modes
//always
enum {
    /* States that do not stand still. */
    HA_TRACKED = $TRACKED_COUNT
};

//item ha_tracked
/* Of each state the variable that it is. */
static const int ha_tracked[] = {
$TRACKED
};

//public $model_sizes
void $model_sizes(const $model *m, $real *sizes)
{
    int i;
    for (i = 0; i < HA_NX; ++i) {
//if bounds
        sizes[i] = i < HA_TRACKED ? m->most_values[$ha_tracked[i]] : $0.0;
//else
        sizes[i] = m->mode == 0 ? $0.0 : $fabs(m->x[i]);
//end
    }
}

//end
//if bounds

//section
/* ---- set-valued laws: where their branches end ---- */

//always
enum {
    HA_MARGINS = $MARGINS,
    /* The same, with the rates of gaps. */
    HA_MARGIN_VALUES = $MARGIN_VALUES
};

//always
/* The end of a branch: its clause, its place among what is computed, the law and the branch beyond, the condition that tells it or -1,
 * what is remembered of it, the group that it is compared with, whether it is a gap, whether impulses act where its sides meet. */
typedef struct {
    int clause, place, law, next, condition, key, group, gap, meets;
} ha_bound;

//always
enum {
    /* Places in m->seen: ends of the parts of a step, points between them, where the present step begins, and the one before. */
    HA_BEGIN = 5,
    HA_MIDDLE = 6,
    HA_FIRST = 7,
    HA_INSIDE = 18,
    HA_BEFORE = 18,
    HA_START = 19
};

//item ha_bounds
static const ha_bound ha_bounds[] = {
$MARGIN_TABLE
};

//item ha_run_margins
/* Margins, and how they move along m->along. */
static int ha_run_margins(ha_model *m, double t, const $real *x)
{
//if held
    $ha_place(m, t);
//end
    return $ha_margins_along(m, t, x, m->along, m->margin_values, m->margin_rates);
}

//item ha_sizes_of_margins
/* How great the terms are that margins are the sum of, one for each state moved by its way. */
static int ha_sizes_of_margins(ha_model *m, double t, const $real *x, const $real *way, $real *sizes)
{
    int state;
    int i;
    $ha_fill(sizes, $0.0, HA_MARGIN_VALUES);
    for (state = 0; state < HA_TRACKED; ++state) {
        int status;
        if (way[state] == $0.0) {
            continue;
        }
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        m->along[HA_STATES_AT + state] = way[state];
        status = $ha_run_margins(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < HA_MARGIN_VALUES; ++i) {
            sizes[i] = $ha_max(sizes[i], $fabs(m->margin_rates[i]));
        }
    }
    return $MODEL_OK;
}

//item ha_weigh_margins
/* The margins at (t, x), with what is zero beside them: the greatest effort or flow in the same unit, what the terms add up to, what
 * the margin has been. */
static int ha_weigh_margins(ha_model *m, double t, const $real *x)
{
    int status;
    int i;
    for (i = 0; i < HA_TRACKED; ++i) {
        m->margin_way[i] = $ha_max(m->most_values[$ha_tracked[i]], $fabs(x[i]));
    }
    status = $ha_sizes_of_margins(m, t, x, m->margin_way, m->margin_sizes);
    if (status == $MODEL_OK) {
        status = $ha_sizes_of_margins(m, t, x, x, m->margin_present);
    }
    if (status == $MODEL_OK) {
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        status = $ha_run_margins(m, t, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_MARGINS; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        const $real *most = &m->most_margins[3 * margin->key];
        const $real group = m->most_groups[margin->group];
        const $real finest = $HA_SHORT * $HA_ROUNDING * $narrow fabs(t) * most[1];
        const $real rounding = $HA_ROUNDING * m->margin_present[margin->place];
        const $real size = $ha_max(most[0], m->margin_sizes[margin->place]);
        $real zero = $HA_ZERO * (margin->gap ? size : $ha_max(size, group));
        m->margin_still[i] = $0.0;
        m->margin_rate[i] = $0.0;
        if (margin->gap) {
            const $real rate = $ha_max(most[1], m->margin_sizes[margin->place + 1]);
            m->margin_still[i] = $HA_MEETS * $ha_max(rate, group);
            m->margin_rate[i] = m->margin_values[margin->place + 1];
        }
        zero = $ha_max($ha_max(zero, rounding), finest);
//if derivatives
        /* Sides overlap by what an importer has located an impact too late, until they have parted. */
        if (m->outside && margin->gap && margin->condition >= 0) {
            zero = $ha_max(zero, m->floors[margin->condition]);
        }
//end
        if (margin->gap && m->gaps_at == t && m->gap_known[margin->law]) {
            zero = m->gap_zero[margin->law];
        }
        m->margin_zero[i] = zero;
        m->margin_rounding[i] = rounding;
        m->margin_value[i] = m->margin_values[margin->place];
        m->margin_ended[i] = 0;
        m->margin_brief[i] = 0;
    }
    return $MODEL_OK;
}

//item ha_lets_go
/* Whether impulses of this instant have opened a contact. */
static int ha_lets_go(const ha_model *m, double t, int law)
{
    return m->let_go_at == t && m->let_go[law];
}

//item ha_is_short
/* Whether a flight that begins with the rate of a gap, and is pulled back, is too short to be told from rounding. */
static int ha_is_short(const ha_model *m, int i, double t, $real back)
{
    const $real rate = $fabs(m->margin_rate[i]);
//if derivatives
    /* An importer locates impacts less sharply: sides overlap by what it is late. */
    const $real parts = m->outside ? $1e5 : $HA_SHORT;
    const $real late = m->outside ? $fabs(m->margin_value[i]) : $0.0;
    const $real rounding = $ha_max(m->margin_rounding[i], late);
//else
    const $real parts = $HA_SHORT;
    const $real rounding = m->margin_rounding[i];
//end
    const $real brief = parts * $HA_ROUNDING * $narrow fabs(t) * back;
    const $real height = $2.0 * back * parts * rounding;
    return back > $0.0 && (rate * rate <= height || rate <= brief);
}

//item ha_changes_of_margins
/* How margins, and the rates of gaps, change along the run. */
static int ha_changes_of_margins(ha_model *m, double t, const $real *x)
{
    int status = $model_rates(m, t, x, m->dx);
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_let_time_pass(m, t);
    $ha_copy(m->along + HA_STATES_AT, m->dx, HA_NX);
    status = $ha_run_margins(m, t, x);
    $ha_copy(m->margin_changes, m->margin_rates, HA_MARGIN_VALUES);
    return status;
}

//item ha_is_open
/* Whether how a margin changes tells whether its branch has ended. */
static int ha_is_open(const ha_model *m, double t, int i)
{
    const int parts = $ha_bounds[i].gap && m->margin_rate[i] > m->margin_still[i];
    const int kept = !parts || $ha_lets_go(m, t, $ha_bounds[i].law);
    return !m->margin_ended[i] && m->margin_value[i] <= m->margin_zero[i] && kept;
}

//item ha_stand
/* How the margins stand at (t, x), and which branches have ended: where a margin is below zero, or is zero and falls; a gap ends where its
 * rate is below zero as well, or zero, and that falls. */
static int ha_stand(ha_model *m, double t, const $real *x)
{
    int status = $ha_weigh_margins(m, t, x);
    int open = 0;
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_MARGINS; ++i) {
        const $real value = m->margin_value[i];
        const int met = $ha_bounds[i].gap && value <= m->margin_zero[i] && m->margin_rate[i] < -m->margin_still[i];
        m->margin_ended[i] = value != value || value < -m->margin_zero[i] || met;
        open = open || $ha_is_open(m, t, i);
    }
    if (!open) {
        return $MODEL_OK;
    }
    status = $ha_changes_of_margins(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_TRACKED; ++i) {
        m->margin_way[i] = $ha_max(m->most_rates[$ha_tracked[i]], $fabs(m->dx[i]));
    }
    status = $ha_sizes_of_margins(m, t, x, m->margin_way, m->margin_sizes);
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        if ($ha_is_open(m, t, i)) {
            const int place = margin->place + margin->gap;
            const $real change = m->margin_changes[place];
            $real *most = &m->most_margins[3 * margin->key + 1 + margin->gap];
            /* What would not show soon in what it changes is none yet. */
            const $real below = margin->gap ? m->margin_still[i] : m->margin_zero[i];
            const $real slow = t == 0.0 ? $0.0 : below / ($HA_SOON * $narrow fabs(t));
            const $real rounding = $HA_ZERO * m->margin_sizes[place];
            if (margin->gap && m->margin_rate[i] > m->margin_still[i]) {
                /* A contact that impulses have opened would fly for no time. */
                m->margin_brief[i] = $ha_is_short(m, i, t, -change);
                m->margin_ended[i] = m->margin_brief[i];
                continue;
            }
            *most = $ha_max(*most, $fabs(change));
            m->margin_ended[i] = change < -$ha_max($ha_max($HA_STEADY * *most, rounding), slow);
        }
    }
    return status;
}

//entry ha_watch_margins
/* From where on margins are watched: those that are zero from below what is zero. */
static int ha_watch_margins(ha_model *m, double t, const $real *x)
{
    const int status = $ha_stand(m, t, x);
    int i;
    for (i = 0; i < HA_MARGINS && status == $MODEL_OK; ++i) {
        const int condition = $ha_bounds[i].condition;
        if (condition >= 0) {
            /* What rises from a gap that is zero is watched from where it is. */
            const int rises = $ha_bounds[i].gap && m->margin_rate[i] > m->margin_still[i];
            const int touches = !m->margin_ended[i] && m->margin_value[i] <= m->margin_zero[i];
            const $real low = $ha_max(-m->margin_value[i], $0.0) + m->margin_rounding[i];
            const $real floor = rises ? low : $2.0 * m->margin_zero[i];
            m->floors[condition] = touches ? floor : $0.0;
        }
    }
    return status;
}

//entry ha_hold_ended
/* What stands at the end of a branch is on the side to which it moves. */
static int ha_hold_ended(ha_model *m)
{
    int i;
    for (i = 0; i < HA_MARGINS; ++i) {
        if ($ha_bounds[i].condition >= 0) {
            m->held[$ha_bounds[i].condition] = m->margin_ended[i] ? 1.0 : 0.0;
        }
    }
    return $MODEL_OK;
}

//item ha_note_margins
/* Keeps in mind how great margins, states and what storages keep have been. */
static int ha_note_margins(ha_model *m, double t, const $real *x)
{
    static const int storages[] = {$STORAGE_SYMBOLS};
    int status;
    int i;
//if held
    $ha_place(m, t);
//end
    status = $ha_stored_code(m, t, x, m->stored);
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    status = $ha_run_margins(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_MARGINS; ++i) {
        const ha_bound *margin = &$ha_bounds[i];
        $real *most = &m->most_margins[3 * margin->key];
        most[0] = $ha_max(most[0], $fabs(m->margin_values[margin->place]));
        if (margin->gap) {
            most[1] = $ha_max(most[1], $fabs(m->margin_values[margin->place + 1]));
            /* What has risen is watched from zero on again. */
            if (margin->condition >= 0 && m->margin_values[margin->place] > m->floors[margin->condition]) {
                m->floors[margin->condition] = $0.0;
            }
        }
    }
    for (i = 0; i < HA_TRACKED; ++i) {
        $ha_note(&m->most_values[$ha_tracked[i]], x[i]);
    }
    for (i = 0; i < HA_STORED; ++i) {
        $ha_note(&m->most_stored[storages[i]], m->stored[i]);
    }
    return $MODEL_OK;
}

//entry ha_note_compared
/* Keeps in mind how great the efforts and flows are with which margins are compared, and the rates of states. */
static int ha_note_compared(ha_model *m, double t, const $real *x)
{
    static const int groups[] = {$COMPARED_GROUPS};
    const $model_failure failure = m->failure;
    int status = $ha_note_margins(m, t, x);
    int moves;
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < $LAWS; ++i) {
        m->gap_known[i] = 0;
    }
    status = $ha_weigh_margins(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    m->gaps_at = t;
    for (i = 0; i < HA_MARGINS; ++i) {
        if ($ha_bounds[i].gap) {
            m->gap_known[$ha_bounds[i].law] = 1;
            m->gap_zero[$ha_bounds[i].law] = m->margin_zero[i];
//if derivatives
            if (m->outside) {
                m->gap_zero[$ha_bounds[i].law] = $ha_max(m->margin_zero[i], -m->margin_value[i]);
            }
//end
        }
    }
    /* What has no value in a mode that may not hold is compared with nothing. */
    moves = $model_rates(m, t, x, m->dx) == $MODEL_OK;
//if held
    $ha_place(m, t);
//end
    if ($ha_compared_code(m, t, x, m->compared) == $MODEL_OK) {
        for (i = 0; i < $COMPARED; ++i) {
            $ha_note(&m->most_groups[groups[i]], m->compared[i]);
        }
    }
    for (i = 0; i < HA_TRACKED && moves; ++i) {
        $ha_note(&m->most_rates[$ha_tracked[i]], m->dx[i]);
    }
    m->failure = failure;
    return $MODEL_OK;
}

//entry ha_is_margin_below
/* Whether a margin is below zero where no event has told it. */
static int ha_is_margin_below(ha_model *m, double t, const $real *x, int *ended)
{
    int status = $ha_note_margins(m, t, x);
    int any = 0;
    int i;
    *ended = 0;
    for (i = 0; i < HA_MARGINS; ++i) {
        any = any || !(m->margin_values[$ha_bounds[i].place] >= $0.0);
    }
    if (status != $MODEL_OK || !any) {
        return status;
    }
    status = $ha_weigh_margins(m, t, x);
    for (i = 0; i < HA_MARGINS; ++i) {
        const $real value = m->margin_value[i];
        *ended = *ended || value != value || value < -m->margin_zero[i];
    }
    return status;
}

//end
