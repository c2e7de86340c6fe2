//item ha_evaluate
/* Runs the code at a point; whether residuals and Jacobian are finite. */
static int ha_evaluate(ha_model *m, ha_newton *w, const $real *point)
{
    ++w->evaluations;
    w->block->code(m, w->present, point, w->right, w->matrix);
    return $ha_all_finite(w->right, w->n) && $ha_all_finite(w->matrix, w->entries);
}

//item ha_start_at_previous
/* The next iteration starts at the previous solution. */
static void ha_start_at_previous(ha_newton *w)
{
    $ha_fill(w->offset, $0.0, w->n);
    $ha_copy(w->start, w->previous, w->n);
    $ha_copy(w->start_jacobian, w->previous_jacobian, w->entries);
}

//item ha_evaluate_on_path
/* Evaluates a point on the line from the start (0) to the root (1). */
static int ha_evaluate_on_path(ha_model *m, ha_newton *w, $real part)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        const $real way = part * (w->x[i] - w->start[i]);
        /* The root itself, and not what rounding makes of the way to it. */
        w->trial[i] = part == $1.0 ? w->x[i] : w->start[i] + way;
    }
    return $ha_evaluate(m, w, w->trial);
}

//item ha_vanishes
/* Whether all residuals at the point evaluated last are 0. */
static int ha_vanishes(const ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        if (w->right[i] != w->offset[i]) {
            return 0;
        }
    }
    return 1;
}

//item ha_newton_factor
static int ha_newton_factor(ha_newton *w)
{
    return $ha_lu_factor(&w->lu, w->matrix);
}

//item ha_newton_correction
static void ha_newton_correction(ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        w->correction[i] = w->offset[i] - w->right[i];
    }
    $ha_lu_solve_once(&w->lu, w->correction);
}

//item ha_greatest
/* The greater one, infinite where the second is no number. A branch that is seldom taken waits for nothing. */
static $real ha_greatest($real most, $real size)
{
    if (!(size <= most)) {
        return size != size ? $HUGE_VAL : size;
    }
    return most;
}

//item ha_weigh
/* Scales unknowns by their magnitudes so far, or by these steps where they are greater. */
static void ha_weigh(ha_newton *w, const $real *steps)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        w->weight[i] = $1.0 / $ha_max($ha_max(w->scale[i], $fabs(steps[i])), $DBL_MIN);
    }
}

//item ha_correction_norm
/* Scaled maximum norm of the correction; what its unknowns are scaled by is kept. */
static $real ha_correction_norm(ha_newton *w)
{
    $real most = $0.0;
    int i;
    $ha_weigh(w, w->correction);
    for (i = 0; i < w->n; ++i) {
        most = $ha_greatest(most, $fabs(w->correction[i]) * w->weight[i]);
    }
    return most;
}

//item ha_simplified_correction_norm
/* The simplified correction at the point evaluated last, by the Jacobian factored last, and its norm, scaled as
 * ha_weigh has said. */
static $real ha_simplified_correction_norm(ha_newton *w, int refined)
{
    $real most = $0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        w->simplified[i] = w->offset[i] - w->right[i];
    }
    if (refined) {
        $ha_lu_solve(&w->lu, w->simplified);
    } else {
        $ha_lu_solve_once(&w->lu, w->simplified);
    }
    for (i = 0; i < w->n; ++i) {
        const $real size = $fabs(w->simplified[i]) * w->weight[i];
        most = $ha_greatest(most, size);
    }
    return most;
}

//item ha_scale_unknowns_at_rest
/* Gives an unknown that is 0, and stays so in the first correction, the magnitude at which it would count in one of the
 * equations: small changes of it afterwards are no failure of the step. */
static void ha_scale_unknowns_at_rest(ha_newton *w)
{
    const int n = w->n;
    $real *least = w->simplified;
    $real *size = w->weight;
    int i = 0;
    int e;
    while (i < n && (w->scale[i] != $0.0 || w->correction[i] != $0.0)) {
        ++i;
    }
    if (i == n) {
        return;
    }
    for (i = 0; i < n; ++i) {
        size[i] = $ha_max(w->scale[i], $fabs(w->correction[i]));
        least[i] = $HUGE_VAL;
    }
    for (i = 0; i < n; ++i) {
        /* What rests adds nothing. */
        $real others = $0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            const $real term = $fabs(w->matrix[e]) * size[w->columns[e]];
            others += term;
        }
        if (others > $0.0) {
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                const int k = w->columns[e];
                const $real own = $fabs(w->matrix[e]);
                if (own > $0.0) {
                    least[k] = others / own < least[k] ? others / own : least[k];
                }
            }
        }
    }
    for (i = 0; i < n; ++i) {
        if (w->scale[i] == $0.0 && w->correction[i] == $0.0 && $ha_finite(least[i])) {
            w->scale[i] = least[i];
        }
    }
}

//item ha_perturb
/* Leaves a point at which the Jacobian is singular. */
static void ha_perturb(ha_newton *w, int iteration)
{
    int i;
    w->contracts = 0;
    for (i = 0; i < w->n; ++i) {
        const $real away = $1e-3 * ($1.0 + ($real)iteration) * $ha_max(w->scale[i], $1.0);
        const $real move = i % 2 == iteration % 2 ? away : $0.5 * away;
        w->x[i] += move;
    }
}

//item ha_accept_trial
static void ha_accept_trial(ha_newton *w)
{
    int i;
    $ha_copy(w->x, w->trial, w->n);
    for (i = 0; i < w->n; ++i) {
        w->scale[i] = $ha_max(w->scale[i], $fabs(w->x[i]));
    }
}

//item ha_go_on
/* Adds steps, with the magnitudes to which they lead. */
static void ha_go_on(ha_newton *w, const $real *steps)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        w->x[i] += steps[i];
        w->scale[i] = $ha_max(w->scale[i], $fabs(w->x[i]));
    }
}

//item ha_is_linear_on_path
/* Whether the Jacobian is the same all the way from the start to x: what differs is rounding. */
static int ha_is_linear_on_path(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    int same = 1;
    int point;
    int i;
    int e;
    for (point = 0; point <= 8; ++point) {
        if (!$ha_evaluate_on_path(m, w, ($real)point / $8.0)) {
            same = 0;
        }
        if (point == 0) {
            $ha_copy(w->jacobian, w->matrix, w->entries);
        }
        for (i = 0; i < n; ++i) {
            $real most = $0.0;
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                most = $ha_max(most, $fabs(w->jacobian[e]));
            }
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                if (!($fabs(w->matrix[e] - w->jacobian[e]) <= $CLOSE_TO_ROUNDING * most)) {
                    same = 0;
                }
            }
        }
    }
    return same;
}

//item ha_stagnates_at_rounding
/* Whether the Jacobian is the same at x and a whole correction from there: that it does not help is rounding. */
static int ha_stagnates_at_rounding(ha_model *m, ha_newton *w)
{
    int linear;
    int i;
    $ha_copy(w->saved_start, w->start, w->n);
    for (i = 0; i < w->n; ++i) {
        w->start[i] = w->x[i] + w->correction[i];
    }
    linear = $ha_is_linear_on_path(m, w);
    $ha_copy(w->start, w->saved_start, w->n);
    return $ha_evaluate(m, w, w->x) && linear;
}

