//if newton_single
//item ha_scan_distances
/* Distances from tiny to huge. */
static const $real ha_scan_distances[] = {
$DISTANCES
};

//item ha_residual_at
/* The residual of one equation at a point; whether it is finite. */
static int ha_residual_at(ha_model *m, ha_newton *w, $real at, $real *residual)
{
    int finite;
    w->trial[0] = at;
    finite = $ha_evaluate(m, w, w->trial);
    *residual = w->right[0];
    return finite;
}

//item ha_bisect_residual
/* Bisects an interval at whose ends the residual differs in sign. A pole is no root. */
static int ha_bisect_residual(ha_model *m, ha_newton *w, $real a, $real ra, $real b, $real rb)
{
    const $real jump = $fabs(ra) < $fabs(rb) ? $fabs(ra) : $fabs(rb);
    int halving;
    for (halving = 0; halving < 200; ++halving) {
        const $real middle = $0.5 * (a + b);
        $real r;
        if (middle == a || middle == b) {
            break;
        }
        if (!$ha_residual_at(m, w, middle, &r)) {
            return 0;
        }
        if ($ha_is_below(r) == $ha_is_below(ra)) {
            a = middle;
            ra = r;
        } else {
            b = middle;
            rb = r;
        }
    }
    if (!($fabs(ra) < $fabs(rb))) {
        a = b;
        ra = rb;
    }
    if ($fabs(ra) > jump) {
        return 0;
    }
    w->start[0] = a;
    w->evaluations = 0;
    return $ha_iterate(m, w, HA_DAMPED);
}

//item ha_scan
/* One equation in one unknown: a root anywhere, those near the previous solution first. */
static int ha_scan(ha_model *m, ha_newton *w)
{
    const int points = (int)(sizeof $ha_scan_distances / sizeof $ha_scan_distances[0]);
    const $real middle = w->previous[0];
    $real at[2] = {$0.0, $0.0};
    $real residual[2] = {$0.0, $0.0};
    int there[2] = {0, 0};
    int i;
    int side;
    $ha_fill(w->offset, $0.0, w->n);
    for (i = 0; i < points; ++i) {
        for (side = 0; side < 2; ++side) {
            const $real way = side == 0 ? $ha_scan_distances[i] : -$ha_scan_distances[i];
            const $real here = middle + way;
            $real r;
            const int finite = $ha_residual_at(m, w, here, &r);
            const int before = there[side];
            const $real a = at[side];
            const $real ra = residual[side];
            at[side] = here;
            residual[side] = r;
            there[side] = finite;
            if (finite && before && $ha_is_below(r) != $ha_is_below(ra) && $ha_bisect_residual(m, w, a, ra, here, r)) {
                return 1;
            }
        }
    }
    return 0;
}

//end
//item ha_left_of_equations
/* The greatest residual at the point evaluated last, by the magnitudes of their rows where they were balanced last. */
static $real ha_left_of_equations(const ha_newton *w)
{
    $real most = $0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        most = $ha_greatest(most, $fabs(w->right[i] - w->offset[i]) / w->terms[i]);
    }
    return most;
}

//item ha_balance
/* The linearised equations at the point evaluated last: rows and columns with greatest entries of 1, in units of what is
 * rounding. */
static void ha_balance(ha_newton *w)
{
    const int n = w->n;
    $real *rows = w->terms;
    $real *most = w->simplified;
    int round;
    int i;
    int e;
    for (i = 0; i < n; ++i) {
        w->units[i] = $1.0;
        w->order[i] = ($real)i;
    }
    for (round = 0; round < 3; ++round) {
        $ha_fill(most, $0.0, n);
        for (i = 0; i < n; ++i) {
            rows[i] = $0.0;
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                rows[i] = $ha_greatest(rows[i], $fabs(w->matrix[e]) * w->units[w->columns[e]]);
            }
            if (rows[i] == $0.0) {
                rows[i] = $1.0;
            }
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                const int j = w->columns[e];
                most[j] = $ha_greatest(most[j], $fabs(w->matrix[e]) / rows[i]);
            }
        }
        for (i = 0; i < n; ++i) {
            if (most[i] > $0.0) {
                w->units[i] = $1.0 / most[i];
            }
        }
    }
    $ha_fill(w->loose, $0.0, n * n);
    for (i = 0; i < n; ++i) {
        w->rest[i] = (w->offset[i] - w->right[i]) / rows[i] / ($4096.0 * $DBL_EPSILON);
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            w->loose[i * n + w->columns[e]] = w->matrix[e] * w->units[w->columns[e]] / rows[i] / ($4096.0 * $DBL_EPSILON);
        }
    }
}

//item ha_iterate_by_least_norm
/* Steps of least norm from w->start to where the equations tell all unknowns, and the damped iteration from there: far up an
 * exponential law what other equations say is lost in its rounding. */
static int ha_iterate_by_least_norm(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    int step;
    int i;
    $ha_copy(w->x, w->start, n);
    if (n == 1 || w->loose == NULL || !$ha_evaluate(m, w, w->x)) {
        return 0;
    }
    for (step = 0; step < 2000; ++step) {
        $real damping = $1.0;
        $real before;
        int rank;
        int found = 0;
        $ha_balance(w);
        rank = $ha_eliminate(w);
        if (rank == n) {
            $ha_copy(w->start, w->x, n);
            return step > 0 && $ha_iterate(m, w, HA_DAMPED);
        }
        before = $ha_left_of_equations(w);
        $ha_shortest(w, rank);
        for (i = 0; i < n; ++i) {
            const int unknown = (int)w->order[i];
            w->correction[unknown] = w->rest[i] * w->units[unknown];
        }
        while (!found && damping >= $1e-6 && w->evaluations < w->limit) {
            for (i = 0; i < n; ++i) {
                const $real move = damping * w->correction[i];
                w->trial[i] = w->x[i] + move;
            }
            found = $ha_evaluate(m, w, w->trial) && $ha_left_of_equations(w) < before;
            damping *= $0.5;
        }
        if (!found) {
            return 0;
        }
        $ha_accept_trial(w);
    }
    return 0;
}

//item ha_search_from
/* A root by an iteration that begins at w->start. */
static int ha_search_from(ha_model *m, ha_newton *w)
{
    return $ha_iterate(m, w, HA_DAMPED) || $ha_floats(m, w) || $ha_iterate_by_least_norm(m, w);
}

//item ha_search_at
/* The same from where all unknowns but these are 0, on up to half the evaluations. */
static int ha_search_at(ha_model *m, ha_newton *w, int one, $real way, int other, $real beside)
{
    if (w->evaluations > w->limit / 2) {
        return 0;
    }
    $ha_fill(w->start, $0.0, w->n);
    w->start[other] = beside;
    w->start[one] = way;
    $ha_copy(w->trial, w->start, w->n);
    return $ha_evaluate(m, w, w->trial) && $ha_search_from(m, w);
}

//item ha_search_apart
/* Where the laws have no value at any of the starts so far, as an exponential that overflows: one unknown elsewhere, in small
 * steps, then two of them. */
static int ha_search_apart(ha_model *m, ha_newton *w)
{
    static const $real starts[] = {$1.0, $3.0, $10.0, $20.0, $40.0, $70.0, $100.0, $200.0, $400.0, $1e3};
    const int count = 2 * (int)(sizeof starts / sizeof starts[0]);
    int one;
    int other;
    int i;
    int j;
    for (one = 0; one < w->n; ++one) {
        $real distance = $1.0;
        while (distance < $1e4) {
            if ($ha_search_at(m, w, one, distance, one, distance) || $ha_search_at(m, w, one, -distance, one, -distance)) {
                return 1;
            }
            distance *= $1.05;
        }
    }
    for (one = 0; one < w->n; ++one) {
        for (other = one + 1; other < w->n; ++other) {
            for (i = 0; i < count; ++i) {
                for (j = 0; j < count; ++j) {
                    const $real way = i % 2 == 0 ? starts[i / 2] : -starts[i / 2];
                    const $real beside = j % 2 == 0 ? starts[j / 2] : -starts[j / 2];
                    if ($ha_search_at(m, w, one, way, other, beside)) {
                        return 1;
                    }
                }
            }
        }
    }
    return 0;
}

//item ha_search
/* Any root. */
static int ha_search(ha_model *m, ha_newton *w)
{
    static const $real starts[] = {$0.0, $1e-3, -$1e-3, $1.0, -$1.0, $1e3, -$1e3};
    int i;
    $ha_copy(w->start, w->previous, w->n);
    if ($ha_search_from(m, w)) {
        return 1;
    }
    for (i = 0; i < 7; ++i) {
        $ha_fill(w->start, starts[i], w->n);
        if ($ha_search_from(m, w)) {
            return 1;
        }
    }
    /* Each unknown at another value: between equal ones, laws such as that of an orifice have infinite slopes. */
    for (i = 1; i < 7 && w->n > 1; ++i) {
        int j;
        for (j = 0; j < w->n; ++j) {
            const $real part = ($real)(j + 1) / ($real)w->n;
            w->start[j] = starts[i] * part;
        }
        if ($ha_search_from(m, w)) {
            return 1;
        }
    }
    if (!w->valued && w->n > 1 && $ha_search_apart(m, w)) {
        return 1;
    }
//if newton_single
    return w->n == 1 && $ha_scan(m, w);
//else
    return 0;
//end
}

//item ha_has_root
/* Whether the root is known: that found last, or the previous solution, where the block reads what it read then. */
static int ha_has_root(ha_model *m, const ha_kept *k, int number, const $real *o)
{
    const int reads = k->block->reads;
    if (m->fresh[number] && $ha_same(o, k->outer, reads)) {
        return 1;
    }
    if (!m->settled[number] || !$ha_same(o, k->previous_outer, reads)) {
        return 0;
    }
    $ha_copy(k->x, k->previous, k->n);
    $ha_copy(k->outer, k->previous_outer, reads);
    $ha_copy(k->jacobian, k->previous_jacobian, k->entries);
    m->fresh[number] = 1;
//if sought_positions
    m->motion_short[number] = 1;
    m->motion_regular[number] = 1;
//end
    return 1;
}

//item ha_find_root
/* The root of a block that continues its previous solution, at a start or an event any root; o: what the block reads. */
static int ha_find_root(ha_model *m, int number, const $real *o, $real *x)
{
    const ha_kept kept = $ha_kept_of(m, number);
    ha_newton w;
    int status;
    if ($ha_has_root(m, &kept, number, o)) {
        $ha_copy(x, kept.x, kept.n);
        return $MODEL_OK;
    }
    w = $ha_newton_of(m, number);
    m->fresh[number] = 0;
//if sought_positions
    m->motion_regular[number] = 0;
//end
    $ha_copy(w.outer, o, w.block->reads);
    $ha_copy(w.present, o, w.block->reads);
    $ha_fill(w.floor, $0.0, w.n);
    status = $ha_continue_root(m, &w, number);
//if newton_single
    /* One equation, so steep on the way that no correction leads to its root: is it the only one there? */
    if ((status == $MODEL_NO_CONVERGENCE || status == $MODEL_BRANCH) && w.following && w.n == 1 && $ha_scan(m, &w)) {
        $ha_start_at_previous(&w);
        status = $ha_is_unique_near_path(m, &w) ? $MODEL_OK : $MODEL_BRANCH;
    }
//end
    if (status != $MODEL_OK && (w.following || !$ha_search(m, &w))) {
        return status;
    }
    $ha_copy(w.jacobian, w.matrix, w.entries);
    $ha_copy(x, w.x, w.n);
    m->fresh[number] = !w.block->conditions;
//if sought_positions
    m->motion_regular[number] = w.regular;
//end
    return $MODEL_OK;
}

//if newton
//item ha_root_along
/* The same with the rates of the unknowns, by the implicit function theorem; e: rates of what the block reads. */
static int ha_root_along(ha_model *m, int number, const $real *o, const $real *e, $real *x, $real *dx)
{
    const int status = $ha_find_root(m, number, o, x);
    ha_newton w;
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    w = $ha_newton_of(m, number);
    w.block->code(m, o, x, w.right, w.matrix);
    w.block->along(m, o, e, x, w.right);
    if (!$ha_lu_factor(&w.lu, w.matrix)) {
        return $MODEL_SINGULAR;
    }
    for (i = 0; i < w.n; ++i) {
        dx[i] = -w.right[i];
    }
    $ha_lu_solve(&w.lu, dx);
    return $MODEL_OK;
}

//end
