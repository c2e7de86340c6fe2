//item ha_distance_from_first_correction
/* Scaled norm of the difference between w->simplified and the first correction. */
static $real ha_distance_from_first_correction(const ha_newton *w)
{
    $real most = $0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        const $real first = w->first_correction[i];
        most = $ha_greatest(most, $fabs(w->simplified[i] - first) * w->weight[i]);
    }
    return most;
}

//item ha_all_zero
static int ha_all_zero(const $real *a, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        if (a[i] != $0.0) {
            return 0;
        }
    }
    return 1;
}

//item ha_is_continuation
/* Whether the root found is without doubt the continuation of the start: the first, undamped step contracted, and the first
 * correction would be much the same with the Jacobian at the root. */
static int ha_is_continuation(ha_newton *w)
{
    const int n = w->n;
    $real most = $CLOSE_TO_ROUNDING;
    $real off;
    int i;
    int e;
    if (!w->contracts || w->rests || $ha_all_zero(w->first_correction, n)) {
        return w->contracts;
    }
    $ha_weigh(w, w->first_correction);
    for (i = 0; i < n; ++i) {
        most = $ha_greatest(most, $fabs(w->first_correction[i]) * w->weight[i]);
        w->simplified[i] = w->x[i] - w->start[i];
    }
    off = $ha_distance_from_first_correction(w);
    /* What the first correction would have been with the last Jacobian; with the first one it is itself. */
    if (!w->first_factors) {
        $ha_copy(w->simplified, w->first_right, n);
        $ha_lu_solve_once(&w->lu, w->simplified);
        off = $ha_max(off, $ha_distance_from_first_correction(w));
    }
    w->regular = off <= $0.01 * most;
    if (!w->following) {
        return off <= $0.5 * most;
    }
    /* And that of the Jacobian at the root where the iteration started. */
    for (i = 0; i < n; ++i) {
        $real sum = -$0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            const $real product = w->start_jacobian[e] * w->first_correction[w->columns[e]];
            sum += product;
        }
        w->simplified[i] = sum;
    }
    $ha_lu_solve_once(&w->lu, w->simplified);
    off = $ha_max(off, $ha_distance_from_first_correction(w));
    w->regular = off <= $0.01 * most;
    return off <= $0.5 * most;
}

//item ha_moves_little
static int ha_moves_little(const ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        if (!($fabs(w->x[i] - w->start[i]) <= $1e-2 * w->magnitude[i])) {
            return 0;
        }
    }
    return 1;
}

//item ha_path_is_regular_at
/* Whether the natural level function falls all the way from the start to the root, and the determinant of the Jacobian keeps
 * its sign: no fold and no pole lies between them. */
static int ha_path_is_regular_at(ha_model *m, ha_newton *w, int points)
{
    $real before = $HUGE_VAL;
    int sign = -1;
    int point;
    /* Measured by the Jacobian at the root, or where that is singular by that at the start. */
    if (!($ha_evaluate_on_path(m, w, $1.0) && $ha_newton_factor(w))
        && !($ha_evaluate_on_path(m, w, $0.0) && $ha_newton_factor(w))) {
        return 0;
    }
    $ha_weigh(w, w->correction);
    for (point = 0; point <= points; ++point) {
        $real level;
        if (!$ha_evaluate_on_path(m, w, ($real)point / ($real)points)) {
            return 0;
        }
        level = $ha_simplified_correction_norm(w, 1);
        if (level != level || level > before * ($1.0 + $CLOSE_TO_ROUNDING) + $CLOSE_TO_ROUNDING) {
            return 0;
        }
        before = level;
    }
    /* The sign at the start, where that is a solution followed, and regular. */
    if (w->following && $ha_lu_factor(&w->lu, w->start_jacobian)) {
        sign = $ha_lu_is_positive(&w->lu);
    }
    for (point = 0; point <= points; ++point) {
        /* A point at which the Jacobian is singular, such as 0 of a cube, is no fold unless the sign changes there. */
        if ($ha_evaluate_on_path(m, w, ($real)point / ($real)points) && $ha_newton_factor(w)) {
            const int here = $ha_lu_is_positive(&w->lu);
            if (sign < 0) {
                sign = here;
            }
            if (sign != here) {
                return 0;
            }
        }
    }
    return 1;
}

//item ha_path_is_regular
static int ha_path_is_regular(ha_model *m, ha_newton *w, int points)
{
    const int regular = $ha_path_is_regular_at(m, w, points);
    return $ha_evaluate(m, w, w->x) && regular;
}

//item ha_is_unique_near_path
/* Whether the root found is without doubt the only one near the line to it. */
static int ha_is_unique_near_path(ha_model *m, ha_newton *w)
{
    const int only = $ha_is_linear_on_path(m, w) || $ha_path_is_regular_at(m, w, 64);
    return $ha_evaluate(m, w, w->x) && only;
}

//item ha_set_path_parameter
/* Sets what the block reads, or the offset of its residuals, to their values at s. */
static void ha_set_path_parameter(ha_newton *w, $real s)
{
    int i;
    if (!w->following) {
        for (i = 0; i < w->n; ++i) {
            w->offset[i] = ($1.0 - s) * w->previous_residual[i];
        }
        return;
    }
    for (i = 0; i < w->block->reads; ++i) {
        const $real way = s * (w->outer[i] - w->previous_outer[i]);
        w->present[i] = s == $1.0 ? w->outer[i] : w->previous_outer[i] + way;
    }
}

//item ha_continue_in_steps
/* Follows a path of roots from the previous solution, in steps short enough to tell the root. */
static int ha_continue_in_steps(ha_model *m, ha_newton *w)
{
    $real s = $0.0;
    $real path_step = $0.25;
    $ha_start_at_previous(w);
    $ha_copy(w->x, w->previous, w->n);
    if (!w->following && !$ha_evaluate(m, w, w->x)) {
        return 0;
    }
    $ha_copy(w->previous_residual, w->right, w->n);
    while (path_step > $1e-6 && w->evaluations < w->limit) {
        const $real next = s + path_step < $1.0 ? s + path_step : $1.0;
        const int is_short = path_step <= $1e-3;
        int found;
        $ha_set_path_parameter(w, next);
        found = $ha_iterate(m, w, is_short ? HA_BRIEF : HA_LOCAL);
        found = found && ($ha_is_continuation(w) || (is_short && $ha_moves_little(w) && $ha_path_is_regular(m, w, 8)));
        if (found || $ha_floats(m, w)) {
            if (next == $1.0) {
                return 1;
            }
            $ha_copy(w->jacobian, w->matrix, w->entries);
            $ha_copy(w->start, w->x, w->n);
            $ha_copy(w->start_jacobian, w->jacobian, w->entries);
            s = next;
            path_step = $2.0 * path_step;
        } else {
            path_step *= $0.5;
        }
    }
    $ha_set_path_parameter(w, $1.0);
    return 0;
}

//item ha_previous_is_root
/* Whether the previous solution still solves the equations to rounding: where an unknown is 0 but for the rounding of
 * others, no correction is small against it. */
static int ha_previous_is_root(ha_model *m, ha_newton *w)
{
    const $real rounding = $2.0 * $DBL_EPSILON;
    int i;
    int j;
    int e;
    if (!$ha_evaluate(m, w, w->previous)) {
        /* Where a derivative is infinite, as that of a root at 0, there is no correction: the residuals tell. */
        int vanishes = 1;
        for (i = 0; i < w->n; ++i) {
            vanishes = vanishes && w->right[i] == $0.0;
        }
        $ha_copy(w->x, w->previous, w->n);
        return vanishes;
    }
    for (i = 0; i < w->n; ++i) {
        $real terms = $0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            terms += $fabs(w->matrix[e] * w->previous[w->columns[e]]);
        }
        w->previous_residual[i] = w->right[i];
        w->magnitude[i] = rounding * terms;
    }
    /* Change of the residuals by the last digits of what the block reads. */
    for (j = 0; j < w->block->reads; ++j) {
        const $real value = w->present[j];
        const $real digits = rounding * value;
        int finite;
        w->present[j] = value + digits;
        finite = $ha_evaluate(m, w, w->previous);
        w->present[j] = value;
        if (!finite) {
            return 0;
        }
        for (i = 0; i < w->n; ++i) {
            w->magnitude[i] += $fabs(w->right[i] - w->previous_residual[i]);
        }
    }
    for (i = 0; i < w->n; ++i) {
        if ($fabs(w->previous_residual[i]) > w->magnitude[i]) {
            return 0;
        }
    }
    $ha_copy(w->x, w->previous, w->n);
    return $ha_evaluate(m, w, w->previous);
}

//item ha_find_floors
/* The part of each unknown that is rounding of residuals at the previous solution, as the scale of which that is close to
 * rounding; whether one of them is greater than its unknown. */
static int ha_find_floors(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    int hidden = 0;
    int i;
    int j;
    $ha_copy(w->x, w->previous, n);
    if (w->evaluations >= w->limit || !$ha_evaluate(m, w, w->x) || !$ha_newton_factor(w)) {
        return 0;
    }
    w->block->terms(m, w->present, w->x, w->terms);
    $ha_fill(w->floor, $0.0, n);
    for (j = 0; j < n; ++j) {
        $ha_fill(w->simplified, $0.0, n);
        w->simplified[j] = $8.0 * $DBL_EPSILON * w->terms[j];
        $ha_lu_solve(&w->lu, w->simplified);
        for (i = 0; i < n; ++i) {
            w->floor[i] += $fabs(w->simplified[i]);
        }
    }
    for (i = 0; i < n; ++i) {
        w->floor[i] /= $CLOSE_TO_ROUNDING;
        if (w->floor[i] > w->magnitude[i]) {
            hidden = 1;
        }
        w->magnitude[i] = $ha_max(w->magnitude[i], w->floor[i]);
    }
    if (!hidden || !$ha_all_finite(w->floor, n)) {
        $ha_fill(w->floor, $0.0, n);
        return 0;
    }
    return 1;
}

//item ha_continue_above_rounding
/* The continuation, where an unknown that is 0 but for the rounding of others hides it: corrections of such an unknown are
 * never small against it, but they are against the rounding it is made of. */
static int ha_continue_above_rounding(ha_model *m, ha_newton *w)
{
    if (!w->following || !$ha_find_floors(m, w)) {
        return 0;
    }
    $ha_start_at_previous(w);
    if (($ha_iterate(m, w, HA_DAMPED) && ($ha_is_continuation(w) || $ha_is_unique_near_path(m, w)))
        || $ha_continue_in_steps(m, w)) {
        return 1;
    }
    $ha_fill(w->floor, $0.0, w->n);
    return 0;
}

//if sought_positions
//item ha_between
static $real ha_between(const $real *a, const $real *b, int n)
{
    $real sum = -$0.0;
    int i;
    for (i = 0; i < n; ++i) {
        const $real way = a[i] - b[i];
        const $real square = way * way;
        sum += square;
    }
    return $sqrt(sum);
}

//item ha_change_on_way
/* By how much the way from the previous solution to the root is missed by the Jacobian there in place of that at the root. By
 * the way's length: how much longer that is than the distance of the root from where the Jacobian is singular. */
static $real ha_change_on_way(ha_newton *w)
{
    $real sum = -$0.0;
    int i;
    int e;
    for (i = 0; i < w->n; ++i) {
        $real terms = -$0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            const int column = w->columns[e];
            const $real product = (w->matrix[e] - w->previous_jacobian[e]) * (w->x[column] - w->previous[column]);
            terms += product;
        }
        w->simplified[i] = terms;
    }
    $ha_lu_solve(&w->lu, w->simplified);
    for (i = 0; i < w->n; ++i) {
        const $real square = w->simplified[i] * w->simplified[i];
        sum += square;
    }
    sum = $sqrt(sum);
    return $ha_finite(sum) ? sum : $HUGE_VAL;
}

//item ha_follow_motion
/* Positions that constraints determine go where their motion leads, if that can be told from others through the same position:
 * E. L. Allgower, K. Georg, "Introduction to Numerical Continuation Methods", chapter 8. */
static int ha_follow_motion(ha_model *m, ha_newton *w, int number)
{
    const $real gone = $narrow(m->sought_at - m->motion_time[number]);
    $real size = $0.05;
    $real way;
    $real strayed;
    $real change;
    $real distance;
    int found;
    int i;
    for (i = 0; i < w->n; ++i) {
        const $real bend = $0.5 * gone * w->bends[i];
        const $real on = gone * (w->rates[i] + bend);
        w->expected[i] = w->previous[i] + on;
        w->start[i] = w->expected[i];
    }
    $ha_fill(w->offset, $0.0, w->n);
    /* A position that is 0 is so against its size. */
    $ha_fill(w->floor, $0.05, w->n);
    found = $ha_iterate(m, w, HA_DAMPED);
    $ha_fill(w->floor, $0.0, w->n);
    if (!found || !$ha_newton_factor(w)) {
        return 0;
    }
    for (i = 0; i < w->n; ++i) {
        size = $ha_max(size, $fabs(w->x[i]));
    }
    way = $ha_between(w->x, w->previous, w->n);
    strayed = $ha_between(w->x, w->expected, w->n);
    change = $ha_change_on_way(w);
    /* A whole turn would end at the same Jacobian. */
    w->regular = change <= $0.01 * way;
    m->motion_short[number] = way <= $CLOSE_TO_ROUNDING * size
        || (change <= $0.5 * way && (way <= $0.25 * (size < $1.0 ? size : $1.0) || strayed <= $0.5 * way));
    if (m->motion_short[number]) {
        return 1;
    }
    /* From where the Jacobian is singular: near it rates are rounding. */
    distance = way * (way / change);
    if (distance < $ha_max(way / $50.0, $CLOSE_TO_SINGULAR * $sqrt(size)) && gone > $0.0) {
        return 0;
    }
    return strayed <= $0.25 * distance;
}

//item ha_turns
/* Whether rates of positions are others than those with which they came, over a way that is not short. */
static int ha_turns(const ha_newton *w, int is_short, $real passed, const $real *rates)
{
    $real turned = $0.0;
    $real before = $0.0;
    $real after = $0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        const $real bend = passed * w->bends[i];
        const $real off = rates[i] - w->rates[i] - bend;
        const $real square = off * off;
        const $real old = w->rates[i] * w->rates[i];
        const $real new = rates[i] * rates[i];
        turned += square;
        before += old;
        after += new;
    }
    return !(is_short || turned <= $0.0625 * $ha_max(before, after));
}

//end
//item ha_continue_far
/* The same by corrections of which ever so little is taken: from where all laws are all but flat. */
static int ha_continue_far(ha_model *m, ha_newton *w)
{
    if (!w->following || w->positions) {
        return 0;
    }
    $ha_start_at_previous(w);
    return $ha_iterate(m, w, HA_FAR) && $ha_is_unique_near_path(m, w);
}

//item ha_stays
/* Whether the root found is the previous one. */
static int ha_stays(const ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        if (w->x[i] != w->previous[i]) {
            return 0;
        }
    }
    return 1;
}

//item ha_continue_root
/* The root that continues the previous solution: 0, or why there is none. */
static int ha_continue_root(ha_model *m, ha_newton *w, int number)
{
    int why = $MODEL_NO_CONVERGENCE;
    int i;
//if sought_positions
    m->motion_short[number] = 1;
    if (w->following && m->motion_known[number] && m->motion_time[number] != m->sought_at) {
        return $ha_follow_motion(m, w, number) ? $MODEL_OK : $MODEL_OFF_MOTION;
    }
//else
    (void)number;
//end
    $ha_start_at_previous(w);
    if ($ha_iterate(m, w, HA_DAMPED)) {
        if ($ha_stays(w) || $ha_is_continuation(w) || (w->following && $ha_is_unique_near_path(m, w))) {
            return $MODEL_OK;
        }
        why = $MODEL_BRANCH;
    }
    if ($ha_previous_is_root(m, w) || $ha_floats(m, w)) {
        return $MODEL_OK;
    }
    for (i = 0; i < w->n; ++i) {
        w->magnitude[i] = $ha_max($fabs(w->x[i]), $fabs(w->previous[i]));
    }
    if ($ha_continue_in_steps(m, w) || $ha_continue_above_rounding(m, w) || $ha_continue_far(m, w)) {
        w->regular = 0;
        return $MODEL_OK;
    }
    return why == $MODEL_NO_CONVERGENCE && w->evaluations >= w->limit ? $MODEL_BOUND : why;
}

