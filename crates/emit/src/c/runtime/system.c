
//section
/* ---- rates, outputs, jumps ---- */

//if held
//item ha_place
/* Puts what is delayed or sampled where it is read. */
static void ha_place(ha_model *m, double t)
{
//if delays
    static const int places[] = {$DELAY_PLACES};
    int d;
    for (d = 0; d < $DELAYS; ++d) {
        $real slope;
        m->z[places[d]] = $ha_delay_at(m, d, t, &slope);
    }
//end
//if samples
    {
        static const int held[] = {$SAMPLE_PLACES};
        int s;
        for (s = 0; s < $SAMPLES; ++s) {
            m->z[held[s]] = m->samples[s].value;
        }
    }
//end
//if only_samples
    (void)t;
//end
}

//end
//always
typedef int (*ha_code)(ha_model *m, double t, const $real *x, $real *out);

//item ha_run
/* Runs code with conditions as held. Beyond a switch the held branch may have no value any more: then the conditions are
 * followed instead. */
static int ha_run(ha_model *m, ha_code code, double t, const $real *x, $real *out, int n)
{
    int status;
//if assumptions
    if (m->broken) {
        return $ha_fail(m, $MODEL_STRUCTURE, m->broken - 1, ((double)NAN));
    }
//end
//if held
    $ha_place(m, t);
//end
    status = code(m, t, x, out);
//if switches
    if (m->state_hold != HA_KEEP || (status == $MODEL_OK && $ha_all_finite(out, n))) {
        return status;
    }
    m->state_hold = HA_FOLLOW;
    status = code(m, t, x, out);
    if (status != $MODEL_OK || !$ha_all_finite(out, n)) {
        m->state_hold = HA_KEEP;
        status = code(m, t, x, out);
    }
    m->state_hold = HA_KEEP;
    if (status == $MODEL_OK) {
        m->failure.code = $MODEL_OK;
    }
//else
    (void)n;
//end
    return status;
}

//if newton
//item ha_stay
/* Whether the solutions of these blocks are what they are when they are asked for again: those that are refined then are others. */
static int ha_stay(const ha_model *m, const int *blocks, int count)
{
    int i;
    for (i = 0; i < count; ++i) {
        if (!m->fresh[blocks[i]]) {
            return 0;
        }
    }
    return 1;
}

//end
//if looks_ahead
//item ha_is_known_ahead
/* Whether what is asked for at (t, x) has been found where a step ended there, but for what inputs move. */
static int ha_is_known_ahead(const ha_model *m, double t, const $real *x)
{
//if modes
    if (m->ahead_mode != m->mode) {
        return 0;
    }
//end
    return m->ahead_known && t == m->ahead_t && $ha_same(x, m->ahead_x, HA_NX);
}

//item ha_is_found_ahead
/* The same with the present inputs. */
static int ha_is_found_ahead(const ha_model *m, double t, const $real *x)
{
    return $ha_is_known_ahead(m, t, x) && $ha_same(m->u, m->ahead_u, HA_NU);
}

//item ha_forget_ahead
static void ha_forget_ahead(ha_model *m)
{
    m->ahead_known = 0;
}

//item ha_find_ahead
/* Where a step ends: operands of conditions, rates of positions and outputs, which are asked for next, and what the rates read that no
 * input moves, in one go, since they have most of it in common. */
static void ha_find_ahead(ha_model *m, double t, const $real *x)
{
    int status;
    m->ahead_known = 0;
//if assumptions
    if (m->broken) {
        return;
    }
//end
    status = $ha_ahead_code(m, t, x, m->ahead);
    if (status != $MODEL_OK || !$ha_all_finite(m->ahead, $AHEAD)) {
        m->failure.code = $MODEL_OK;
        return;
    }
//if ahead_newton
    {
        static const int blocks[] = {$AHEAD_BLOCKS};
        if (!$ha_stay(m, blocks, $AHEAD_BLOCK_COUNT)) {
            return;
        }
    }
//end
    $ha_copy(m->ahead_x, x, HA_NX);
    $ha_copy(m->ahead_u, m->u, HA_NU);
//if modes
    m->ahead_mode = m->mode;
//end
    m->ahead_t = t;
    m->ahead_known = 1;
}

//end
//if domains
//item ha_explain
/* The failure behind a value that is not a number: the first law without a value, if there is one. */
static int ha_explain(ha_model *m, double t, const $real *x, int code, int where)
{
    $real arguments[$DOMAINS];
    int i;
    $ha_fill(arguments, $0.0, $DOMAINS);
    if ($ha_domains_code(m, t, x, arguments) != $MODEL_OK) {
        return $ha_fail(m, code, where, t);
    }
    for (i = 0; i < $DOMAINS; ++i) {
        if ($ha_finite(arguments[i]) && !$ha_is_within(i, arguments[i])) {
            return $ha_fail(m, $MODEL_OUT_OF_DOMAIN, i, t);
        }
    }
    return $ha_fail(m, code, where, t);
}

//end
//public $model_rates
int $model_rates($model *m, double t, const $real *x, $real *dx)
{
    int status;
    int i;
//if looks_ahead
    if ($ha_is_known_ahead(m, t, x)) {
        if ($ha_rates_ahead_code(m, t, x, dx) == $MODEL_OK && $ha_all_finite(dx, HA_NX)) {
            return $MODEL_OK;
        }
        m->failure.code = $MODEL_OK;
    }
//end
//if knows_common
    status = $ha_run(m, $ha_common_code, t, x, m->rates_room, HA_NX);
    $ha_copy(dx, m->rates_room, HA_NX);
//else
    status = $ha_run(m, $ha_rates_code, t, x, dx, HA_NX);
//end
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        if (!$ha_finite(dx[i])) {
//if domains
            return $ha_explain(m, t, x, $MODEL_RATE_NOT_FINITE, i);
//else
            return $ha_fail(m, $MODEL_RATE_NOT_FINITE, i, t);
//end
        }
    }
    return $MODEL_OK;
}

//public $model_observe
int $model_observe($model *m, double t, const $real *x, $real *y)
{
//if outputs
    int status;
    int infinite = -1;
    int i;
//if shows_ahead
    if ($ha_is_found_ahead(m, t, x)) {
        $ha_copy(y, m->ahead + $AHEAD_SHOWN, HA_NY);
        return $MODEL_OK;
    }
//end
    status = $ha_run(m, $ha_observe_code, t, x, y, HA_NY);
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NY; ++i) {
        if (y[i] != y[i]) {
//if domains
            return $ha_explain(m, t, x, $MODEL_OUTPUT_NOT_FINITE, i);
//else
            return $ha_fail(m, $MODEL_OUTPUT_NOT_FINITE, i, t);
//end
        }
        if (!$ha_finite(y[i]) && infinite < 0) {
            infinite = i;
        }
    }
//if domains
    /* What a modeller computes for himself may be infinite, what a law gives may not. */
    return infinite < 0 ? $MODEL_OK : $ha_explain(m, t, x, $MODEL_OK, 0);
//else
    return $MODEL_OK;
//end
//else
    (void)m;
    (void)t;
    (void)x;
    (void)y;
    return $MODEL_OK;
//end
}

//if time_passes
//item ha_let_time_pass
/* Sets the direction of derivatives to that of time: what is delayed moves, states and inputs do not. */
static void ha_let_time_pass(ha_model *m, double t)
{
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    m->along[0] = $1.0;
//if delays
    {
        static const int places[] = {$DELAY_PLACES};
        int d;
        for (d = 0; d < $DELAYS; ++d) {
            (void)$ha_delay_at(m, d, t, &m->along[HA_HELD_AT + places[d]]);
        }
    }
//else
    (void)t;
//end
}

//end
//if directional_derivative
//always
/* Code for derivatives along e. */
typedef int ha_along_code(ha_model *m, double t, const $real *x, const $real *e, $real *out, $real *rates);

//item ha_slopes_at
/* Derivatives of the rates along m->along, by code for it, as they are at x. */
static int ha_slopes_at(ha_model *m, double t, const $real *x, ha_along_code *code, $real *dv)
{
    $real *e = m->along;
    $real *dx = m->along_out;
    int status = code(m, t, x, e, dx, dv);
//if switches
    if (m->state_hold == HA_KEEP && (status != $MODEL_OK || !$ha_all_finite(dv, HA_NX))) {
        m->state_hold = HA_FOLLOW;
        status = code(m, t, x, e, dx, dv);
        if (status != $MODEL_OK || !$ha_all_finite(dv, HA_NX)) {
            m->state_hold = HA_KEEP;
            status = code(m, t, x, e, dx, dv);
        }
        m->state_hold = HA_KEEP;
        if (status == $MODEL_OK) {
            m->failure.code = $MODEL_OK;
        }
    }
//end
    return status;
}

//item ha_derivative_along
/* The same; where the slope of a law is infinite it is that a little beside, on the way that the rates lead, for equal states
 * not equally far. */
static int ha_derivative_along(ha_model *m, double t, const $real *x, ha_along_code *code, $real *dv)
{
    const $real *dx = m->along_out;
    int status = $ha_slopes_at(m, t, x, code, dv);
    int i;
    if (status == $MODEL_OK && !$ha_all_finite(dv, HA_NX)) {
        for (i = 0; i < HA_NX; ++i) {
            const $real rate = $ha_finite(dx[i]) ? dx[i] : $0.0;
            const $real size = rate < $0.0 ? -$fabs(x[i]) : $fabs(x[i]);
            const $real way = $BESIDE * (size + rate);
            const $real farther = $1.0 + ($real)i / ($real)HA_NX;
            m->beside[i] = x[i] + farther * (way == $0.0 ? $BESIDE * $BESIDE : way);
        }
        status = $ha_slopes_at(m, t, m->beside, code, dv);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        if (!$ha_finite(dv[i])) {
            return $ha_fail(m, $MODEL_DERIVATIVE_NOT_FINITE, i, t);
        }
    }
    return $MODEL_OK;
}
//public $model_tangent
int $model_tangent($model *m, double t, const $real *x, const $real *v, $real *dv)
{
    $ha_fill(m->along, $0.0, HA_DIRECTION);
    $ha_copy(m->along + HA_STATES_AT, v, HA_NX);
//if held
    $ha_place(m, t);
//end
    return $ha_derivative_along(m, t, x, $ha_rates_along, dv);
}

//end
//if time_derivative
//item ha_time_derivative
/* Derivatives of the rates by time, states and inputs at rest. */
static int ha_time_derivative(ha_model *m, double t, const $real *x, $real *dv)
{
    $ha_let_time_pass(m, t);
//if held
    $ha_place(m, t);
//end
    return $ha_derivative_along(m, t, x, $ha_rates_by_time, dv);
}

//end
//if derivatives
//public $model_directional
int $model_directional($model *m, double t, const $real *x, const $real *v, const $real *w, $real *dv, $real *dy)
{
    $real *e = m->along;
    int status = $MODEL_OK;
    $ha_fill(e, $0.0, HA_DIRECTION);
    $ha_copy(e + HA_STATES_AT, v, HA_NX);
    $ha_copy(e + 1, w, HA_NU);
//if held
    $ha_place(m, t);
//end
    if (dv != NULL) {
        status = $ha_rates_along(m, t, x, e, m->along_out, dv);
    }
//if outputs
    if (status == $MODEL_OK && dy != NULL) {
        status = $ha_observe_along(m, t, x, e, m->along_out, dy);
    }
//else
    (void)dy;
//end
    return status;
}

//end
//if switches
//item ha_indicators_of_operands
/* Event indicators, of the operands of conditions at t. */
static void ha_indicators_of_operands(ha_model *m, double t, $real *g)
{
    static const int conditions[] = {$SWITCH_CONDITIONS};
    int next = 0;
    int i;
    for (i = 0; i < $SWITCHES; ++i) {
        double low;
        double high;
        if ($ha_kinds[conditions[i]] == 0) {
            g[next] = m->operands[i];
            /* Where sides have just been taken, an operand that rounding puts on the other one is on the side taken. */
//if bounds
            /* So is one that is zero and watched from further on. */
            if (t == m->signs_taken || (m->floors[conditions[i]] > $0.0 && $fabs(g[next]) <= m->floors[conditions[i]])) {
                const $real size = $ha_max($ha_max($fabs(g[next]), $DBL_MIN), m->floors[conditions[i]]);
                g[next] = m->held[conditions[i]] != 0.0 ? size : -size;
            }
//else
            if (t == m->signs_taken) {
                g[next] = m->held[conditions[i]] != 0.0 ? $ha_max($fabs(g[next]), $DBL_MIN) : -$fabs(g[next]);
            }
//end
            ++next;
            continue;
        }
        $ha_borders(m, conditions[i], &low, &high);
//if single
        g[next] = (float)(low - $widen m->operands[i]);
//else
        g[next] = low - $widen m->operands[i];
//end
//if single
        g[next + 1] = (float)($widen m->operands[i] - high);
//else
        g[next + 1] = $widen m->operands[i] - high;
//end
        next += 2;
    }
//if modes
    /* Other modes have more of them. */
    $ha_fill(g + HA_NG, $1.0, $MODEL_INDICATORS - HA_NG);
//end
}

//public $model_indicators
int $model_indicators($model *m, double t, const $real *x, $real *g)
{
    int status = $MODEL_OK;
//if looks_ahead
    if ($ha_is_found_ahead(m, t, x)) {
        $ha_copy(m->operands, m->ahead, $SWITCHES);
    } else {
        status = $ha_run(m, $ha_switching_code, t, x, m->operands, $SWITCHES);
    }
//else
    status = $ha_run(m, $ha_switching_code, t, x, m->operands, $SWITCHES);
//end
    if (status == $MODEL_OK) {
        $ha_indicators_of_operands(m, t, g);
    }
    return status;
}

//item ha_take_sides
/* Takes the sides at (t, x). */
static int ha_take_sides(ha_model *m, double t, const $real *x)
{
    static const int conditions[] = {$SWITCH_CONDITIONS};
    int status;
    int i;
//if bounds
    status = $ha_watch_margins(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    m->state_hold = HA_TAKE;
//if held
    $ha_place(m, t);
//end
    status = $ha_switching_code(m, t, x, m->operands);
    for (i = 0; i < $SWITCHES; ++i) {
        switch ($ha_kinds[conditions[i]]) {
//if sign_conditions
        case 0:
            (void)$ha_side(m, HA_TAKE, conditions[i], $widen m->operands[i]);
            break;
//end
//if floor_conditions
        case 1:
            (void)$ha_whole(m, HA_TAKE, conditions[i], $widen m->operands[i]);
            break;
//end
        default:
//if piece_conditions
            (void)$ha_piece(m, HA_TAKE, conditions[i], $ha_kinds[conditions[i]] - 2, $widen m->operands[i]);
//end
            break;
        }
    }
//if bounds
    (void)$ha_hold_ended(m);
//end
    m->state_hold = HA_KEEP;
    m->signs_taken = t;
    return status;
}

//public $model_switched
int $model_switched($model *m, double t, const $real *x, int *switched)
{
    const int status = $model_indicators(m, t, x, m->beyond);
    int i;
    *switched = 0;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NG; ++i) {
        if (m->beyond[i] != m->beyond[i]) {
            return $ha_fail(m, $MODEL_CONDITION_NOT_FINITE, i, t);
        }
//if bounds
        $ha_note(&m->most_beyond[i], m->beyond[i]);
//end
        if (m->sides[i] != (m->beyond[i] > $0.0)) {
            *switched = 1;
        }
    }
    return $MODEL_OK;
}

//end
