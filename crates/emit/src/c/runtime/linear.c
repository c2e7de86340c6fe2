//item ha_lu_factor_full
/* Factors a full matrix; 0 if no pivot is left, or if an entry is not finite. */
static int ha_lu_factor_full(ha_lu *l)
{
    const int n = l->n;
    int row;
    int j;
    int k;
    if ($ha_lu_factor_definite(l)) {
        return 1;
    }
//if two_equations
    if (n == 2) {
        return $ha_lu_factor_2(l);
    }
//end
//if three_equations
    if (n == 3) {
        return $ha_lu_factor_3(l);
    }
//end
//if four_equations
    if (n == 4) {
        return $ha_lu_factor_4(l);
    }
//end
//if single
    /* The magnitudes of columns: few digits tell units from a singular matrix only if these are known. */
    for (j = 0; j < n; ++j) {
        l->columns[j] = $DBL_MIN;
        for (row = 0; row < n; ++row) {
            l->columns[j] = $ha_max(l->columns[j], $fabs(l->matrix[row * n + j]));
        }
    }
//end
    for (row = 0; row < n; ++row) {
        $real most = $DBL_MIN;
        for (j = 0; j < n; ++j) {
//if single
            const $real size = $fabs(l->matrix[row * n + j]) / l->columns[j];
//else
            const $real size = $fabs(l->matrix[row * n + j]);
//end
            l->factors[row * n + j] = l->matrix[row * n + j];
            if (size > most) {
                most = size;
            }
        }
        l->order[row] = row;
        l->scale[row] = most;
    }
    for (k = 0; k < n; ++k) {
        const int pivot = $ha_lu_pivot(l, k);
        if (pivot < 0) {
            return 0;
        }
        $ha_lu_swap(l, k, pivot);
        for (row = k + 1; row < n; ++row) {
            if (l->factors[row * n + k] != $0.0) {
                const $real factor = l->factors[row * n + k] / l->factors[k * n + k];
                l->factors[row * n + k] = factor;
                for (j = k + 1; j < n; ++j) {
                    const $real product = factor * l->factors[k * n + j];
                    l->factors[row * n + j] -= product;
                }
            }
        }
    }
    return 1;
}

//item ha_lu_substitute
static void ha_lu_substitute(ha_lu *l, $real *b)
{
    const int n = l->n;
    int row;
    for (row = 0; row < n; ++row) {
        l->work[row] = $ha_less_products(b[l->order[row]], l->factors + row * n, l->work, row);
    }
    for (row = n - 1; row >= 0; --row) {
        const $real *factors = l->factors + row * n;
        const $real left = $ha_less_products(l->work[row], factors + row + 1, b + row + 1, n - row - 1);
        b[row] = left / factors[row];
    }
}

//if sparse
//item ha_sparse_row
/* Factors the row in a place of the order; 0 if a pivot does not do. */
static int ha_sparse_row(ha_lu *l, int place)
{
    const ha_order *o = l->pattern->order;
    $real scale = $DBL_MIN;
    $real weight;
    int i;
    int j;
    for (i = o->lower_starts[place]; i < o->lower_starts[place + 1]; ++i) {
        l->row[o->lower[i]] = $0.0;
    }
    for (i = o->upper_starts[place]; i < o->upper_starts[place + 1]; ++i) {
        l->row[o->upper[i]] = $0.0;
    }
    l->row[place] = $0.0;
    for (i = o->starts[place]; i < o->starts[place + 1]; ++i) {
//if single
        const $real size = $fabs(l->entries[i]) / l->columns[o->matrix[i]];
//else
        const $real size = $fabs(l->entries[i]);
//end
        l->row[o->matrix[i]] = l->entries[i];
        scale = $ha_max(scale, size);
    }
    for (i = o->lower_starts[place]; i < o->lower_starts[place + 1]; ++i) {
        const int k = o->lower[i];
        const $real factor = l->row[k] * l->inverse[k];
        if (!($1e-3 * $fabs(l->row[k]) <= l->weight[k] * scale)) {
            return 0;
        }
        l->lower[i] = factor;
        for (j = o->upper_starts[k]; j < o->upper_starts[k + 1]; ++j) {
            const $real product = factor * l->upper[j];
            l->row[o->upper[j]] -= product;
        }
    }
    weight = $fabs(l->row[place]) / scale;
    l->weight[place] = weight;
//if single
    weight /= l->columns[place];
//end
    if (!(weight > $DBL_EPSILON * ($real)l->n && $ha_finite(weight))) {
        return 0;
    }
    l->inverse[place] = $1.0 / l->row[place];
    for (i = o->upper_starts[place]; i < o->upper_starts[place + 1]; ++i) {
        l->upper[i] = l->row[o->upper[i]];
    }
    return 1;
}

//item ha_sparse_definite
/* Factors a sparse symmetric matrix that is definite: what l->upper keeps is D U. 0 if it is not such a matrix. */
static int ha_sparse_definite(ha_lu *l)
{
    const ha_order *o = l->pattern->order;
    $real sign = $1.0;
    int place;
    int i;
    int j;
    for (place = 0; place < l->n; ++place) {
        const int after = o->upper_starts[place];
        const int end = o->upper_starts[place + 1];
        $real entry = $0.0;
        $real pivot;
        $real size;
        for (i = after; i < end; ++i) {
            l->row[o->upper[i]] = $0.0;
        }
        for (i = o->starts[place]; i < o->starts[place + 1]; ++i) {
            const int column = o->matrix[i];
            if (column == place) {
                entry = l->entries[i];
            } else if (column > place) {
                l->row[column] = l->entries[i];
            }
        }
        if (place == 0) {
            sign = $copysign($1.0, entry);
        }
        pivot = entry;
        for (i = o->lower_starts[place]; i < o->lower_starts[place + 1]; ++i) {
            const int k = o->lower[i];
            const int e = o->mirror[i];
            const $real factor = l->upper[e] * l->inverse[k];
            const $real square = factor * l->upper[e];
            pivot -= square;
            for (j = e + 1; j < o->upper_starts[k + 1]; ++j) {
                const $real product = factor * l->upper[j];
                l->row[o->upper[j]] -= product;
            }
        }
        size = sign * pivot;
        if (!(size > $0.0 && size > $DBL_EPSILON * ($real)l->n * (sign * entry) && $ha_finite(size))) {
            return 0;
        }
        l->inverse[place] = $1.0 / pivot;
        for (i = after; i < end; ++i) {
            l->upper[i] = l->row[o->upper[i]];
        }
    }
    return 1;
}

//item ha_sparse_substitute_back
/* From the last place on: each unknown by the entries right of the diagonal and the inverse of its pivot. l->work holds what
 * is left of the right side. */
static void ha_sparse_substitute_back(const ha_lu *l, $real *b)
{
    const ha_order *o = l->pattern->order;
    int place;
    int i;
    for (place = l->n - 1; place >= o->paired; --place) {
        $real left = l->work[place];
        for (i = o->upper_starts[place]; i < o->upper_starts[place + 1]; ++i) {
            const $real product = l->upper[i] * l->work[o->upper[i]];
            left -= product;
        }
        l->work[place] = left * l->inverse[place];
        b[o->columns[place]] = l->work[place];
    }
    if (o->paired > 0) {
        /* What is found last stays in registers. */
        $real one = l->work[o->paired];
        $real other = l->work[o->paired + 1];
        for (place = o->paired - 2; place >= 0; place -= 2) {
            const $real of_one = l->upper[place] * one;
            const $real of_other = l->upper[place + 1] * other;
            const $real left = l->work[place] - of_one;
            const $real right = l->work[place + 1] - of_other;
            one = left * l->inverse[place];
            other = right * l->inverse[place + 1];
            b[o->columns[place]] = one;
            b[o->columns[place + 1]] = other;
        }
    }
}

//item ha_sparse_pairs
/* The first places of a chain, from both its ends at once: what is left of the right side stays in registers. */
static void ha_sparse_pairs(const ha_lu *l)
{
    const int paired = l->pattern->order->paired;
    $real one = l->work[0];
    $real other = l->work[1];
    int place;
    for (place = 0; place < paired; place += 2) {
        const $real done = one * l->inverse[place];
        const $real done_too = other * l->inverse[place + 1];
        const $real of_one = l->upper[place] * done;
        const $real of_other = l->upper[place + 1] * done_too;
        l->work[place] = one;
        l->work[place + 1] = other;
        one = l->work[place + 2] - of_one;
        other = l->work[place + 3] - of_other;
    }
    l->work[paired] = one;
    l->work[paired + 1] = other;
}

//item ha_sparse_solve_definite
static void ha_sparse_solve_definite(const ha_lu *l, $real *b)
{
    const ha_order *o = l->pattern->order;
    int place;
    int i;
    for (place = 0; place < l->n; ++place) {
        l->work[place] = b[o->rows[place]];
    }
    if (o->paired > 0) {
        $ha_sparse_pairs(l);
    }
    for (place = o->paired; place < l->n; ++place) {
        const $real done = l->work[place] * l->inverse[place];
        for (i = o->upper_starts[place]; i < o->upper_starts[place + 1]; ++i) {
            const $real product = l->upper[i] * done;
            l->work[o->upper[i]] -= product;
        }
    }
    $ha_sparse_substitute_back(l, b);
}

//item ha_sparse_factor
/* Factors a sparse matrix, as a definite one if it is symmetric; where the pivots of its order do not do, as a full one if
 * it is not too large. */
static int ha_sparse_factor(ha_lu *l)
{
    const ha_order *o = l->pattern->order;
    const int n = l->n;
    int place;
    int i;
    if (o->mirror != NULL && $ha_sparse_definite(l)) {
        l->order[n] = 2;
        return 1;
    }
//if single
    $ha_fill(l->columns, $DBL_MIN, n);
    for (i = 0; i < o->starts[n]; ++i) {
        const int column = o->matrix[i];
        l->columns[column] = $ha_max(l->columns[column], $fabs(l->entries[i]));
    }
//end
    l->order[n] = 0;
    for (place = 0; place < n; ++place) {
        if (!$ha_sparse_row(l, place)) {
            break;
        }
    }
    if (place == n) {
        return 1;
    }
    if (n > $SPARSE_FULL_AT_MOST) {
        return 0;
    }
    l->order[n] = 1;
    $ha_fill(l->matrix, $0.0, n * n);
    for (place = 0; place < n; ++place) {
        for (i = o->starts[place]; i < o->starts[place + 1]; ++i) {
            l->matrix[o->rows[place] * n + o->columns[o->matrix[i]]] = l->entries[i];
        }
    }
    return $ha_lu_factor_full(l);
}

//item ha_sparse_substitute
static void ha_sparse_substitute(ha_lu *l, $real *b)
{
    const ha_order *o = l->pattern->order;
    int place;
    int i;
    for (place = 0; place < l->n; ++place) {
        $real left = b[o->rows[place]];
        for (i = o->lower_starts[place]; i < o->lower_starts[place + 1]; ++i) {
            const $real product = l->lower[i] * l->work[o->lower[i]];
            left -= product;
        }
        l->work[place] = left;
    }
    $ha_sparse_substitute_back(l, b);
}

//item ha_sparse_solve
static void ha_sparse_solve(ha_lu *l, $real *b)
{
    const ha_order *o = l->pattern->order;
    const int n = l->n;
    int place;
    int i;
    if (l->order[n] == 2) {
        $ha_sparse_solve_definite(l, b);
        return;
    }
    $ha_copy(l->rest, b, n);
    $ha_sparse_substitute(l, b);
    for (place = 0; place < n; ++place) {
        $real left = l->rest[o->rows[place]];
        for (i = o->starts[place]; i < o->starts[place + 1]; ++i) {
            const $real product = l->entries[i] * b[o->columns[o->matrix[i]]];
            left -= product;
        }
        l->rest[o->rows[place]] = left;
    }
    $ha_sparse_substitute(l, l->rest);
    for (i = 0; i < n; ++i) {
        if ($ha_finite(l->rest[i])) {
            b[i] += l->rest[i];
        }
    }
}

//end
//item ha_lu_factor
/* Takes up the entries of a matrix and factors it; 0 if no pivot is left, or if an entry is not finite. */
static int ha_lu_factor(ha_lu *l, const $real *entries)
{
    const ha_pattern *p = l->pattern;
    int i;
    int e;
//if sparse
    if (p->order != NULL) {
        for (e = 0; e < $ha_entries(p); ++e) {
            l->entries[p->order->positions[e]] = entries[e];
        }
        return $ha_sparse_factor(l);
    }
//end
    if ($ha_entries(p) == l->n * l->n) {
        $ha_copy(l->matrix, entries, l->n * l->n);
        return $ha_lu_factor_full(l);
    }
    $ha_fill(l->matrix, $0.0, l->n * l->n);
    for (i = 0; i < l->n; ++i) {
        for (e = p->starts[i]; e < p->starts[i + 1]; ++e) {
            l->matrix[i * l->n + p->columns[e]] = entries[e];
        }
    }
    return $ha_lu_factor_full(l);
}

//item ha_lu_solve
/* Replaces b by the solution. */
static void ha_lu_solve(ha_lu *l, $real *b)
{
    const int n = l->n;
    int row;
    int j;
//if sparse
    if (l->pattern->order != NULL && l->order[n] != 1) {
        $ha_sparse_solve(l, b);
        return;
    }
//end
    if (n == 1) {
        b[0] /= l->factors[0];
        return;
    }
    if (l->order[0] < 0) {
        $ha_lu_solve_definite(l, b);
        return;
    }
//if two_equations
    if (n == 2) {
        $ha_lu_solve_2(l, b);
        return;
    }
//end
//if three_equations
    if (n == 3) {
        $ha_lu_solve_3(l, b);
        return;
    }
//end
//if four_equations
    if (n == 4) {
        $ha_lu_solve_4(l, b);
        return;
    }
//end
    $ha_copy(l->rest, b, n);
    $ha_lu_substitute(l, b);
    for (row = 0; row < n; ++row) {
        for (j = 0; j < n; ++j) {
            const $real product = l->matrix[row * n + j] * b[j];
            l->rest[row] -= product;
        }
    }
    $ha_lu_substitute(l, l->rest);
    for (row = 0; row < n; ++row) {
        /* A refinement that is no small correction is none: the equations are not finite. */
        if ($ha_finite(l->rest[row])) {
            b[row] += l->rest[row];
        }
    }
}

//item ha_lu_solve_once
/* The same, of a sparse matrix without refinement: for Newton's method, whose next correction refines this one. A float has too
 * few digits for that. */
static void ha_lu_solve_once(ha_lu *l, $real *b)
{
//if single
    $ha_lu_solve(l, b);
//else
//if sparse
    if (l->pattern->order != NULL && l->order[l->n] == 0) {
        $ha_sparse_substitute(l, b);
        return;
    }
//end
    $ha_lu_solve(l, b);
//end
}

//item ha_lu_is_positive
/* Whether the determinant of the factored matrix is above zero. */
static int ha_lu_is_positive(const ha_lu *l)
{
    const int n = l->n;
    int changes = 0;
    int j;
    int k;
//if sparse
    if (l->pattern->order != NULL && l->order[n] == 2) {
        return n % 2 == 0 || l->inverse[0] > $0.0;
    }
    if (l->pattern->order != NULL && l->order[n] == 0) {
        changes = l->pattern->order->odd;
        for (k = 0; k < n; ++k) {
            changes += l->inverse[k] > $0.0 ? 0 : 1;
        }
        return changes % 2 == 0;
    }
//end
    if (l->order[0] < 0) {
        return n % 2 == 0 || l->scale[0] > $0.0;
    }
    for (k = 0; k < n; ++k) {
        if (l->factors[k * n + k] < $0.0) {
            ++changes;
        }
        for (j = k + 1; j < n; ++j) {
            if (l->order[j] < l->order[k]) {
                ++changes;
            }
        }
    }
    return changes % 2 == 0;
}

//item ha_linear
/* a x = b with a matrix that varies: the solution in x, the factors in a place. 0 if there is none or more than one. */
static int ha_linear($real *place, int *order, const ha_pattern *pattern, const $real *a, const $real *b, $real *x)
{
    ha_lu l = $ha_lu_at(place, order, pattern);
    if (!$ha_lu_factor(&l, a)) {
        return 0;
    }
    $ha_copy(x, b, l.n);
    $ha_lu_solve(&l, x);
    return 1;
}

//item ha_linear_borrowed
/* The same with the matrix whose factors stand in a place. */
static void ha_linear_borrowed($real *place, int *order, const ha_pattern *pattern, const $real *b, $real *x)
{
    ha_lu l = $ha_lu_at(place, order, pattern);
    $ha_copy(x, b, l.n);
    $ha_lu_solve(&l, x);
}

//item ha_linear_constant
/* The same with a matrix of parameters alone, factored once for a set of parameters. */
static int ha_linear_constant(ha_model *m, int number, int place, int order, const ha_pattern *pattern, const $real *a, const $real *b, $real *x)
{
    ha_lu l = $ha_lu_at(m->factors + place, m->factors_order + order, pattern);
    if (!m->factored[number]) {
        m->factored[number] = $ha_lu_factor(&l, a);
    }
    if (!m->factored[number]) {
        return 0;
    }
    $ha_copy(x, b, l.n);
    $ha_lu_solve(&l, x);
    return 1;
}

//item ha_linear_rate
/* The rate of the solution, once it has been computed with the matrix whose factors stand in a place. */
static void ha_linear_rate($real *place, int *order, const ha_pattern *p, const $real *da, const $real *db, const $real *x, $real *dx)
{
    ha_lu l = $ha_lu_at(place, order, p);
    int i;
    int e;
    for (i = 0; i < l.n; ++i) {
        $real moved = -$0.0;
        for (e = p->starts[i]; e < p->starts[i + 1]; ++e) {
            const $real product = da[e] * x[p->columns[e]];
            moved += product;
        }
        dx[i] = db[i] - moved;
    }
    $ha_lu_solve(&l, dx);
}
