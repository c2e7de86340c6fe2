
//section
/* ---- linear equations: a symmetric matrix that is definite as U'DU; all others with rows scaled, threshold
 * pivoting and one refinement; large sparse ones in an order that is fixed ---- */

//if sparse
//always
/* An order of elimination, and the entries of the factors: places are positions in it. */
typedef struct {
    int odd;
    const int *rows;
    const int *columns;
    const int *lower_starts;
    const int *lower;
    const int *upper_starts;
    const int *upper;
    const int *starts;
    const int *matrix;
    const int *positions;
    /* Of a matrix that is symmetric whatever its values: for each entry of lower the one of upper that mirrors it; else NULL. */
    const int *mirror;
    /* How many of the first places, two by two, have one entry of upper each, two places on: a chain from both its ends. */
    int paired;
} ha_order;

//end
//always
/* Where the entries of a matrix stand: for each row the first one, and the column of each. */
typedef struct {
    int n;
    const int *starts;
    const int *columns;
//if sparse
    /* NULL for a full one. */
    const ha_order *order;
//end
} ha_pattern;

//item ha_patterns
$PATTERNS

//always
typedef struct {
    int n;
    const ha_pattern *pattern;
    $real *matrix;
    $real *factors;
    $real *scale;
    $real *work;
    $real *rest;
//if single
    $real *columns;
//end
//if sparse
    /* Of a sparse one: the entries of the matrix and of the factors, inverse pivots and their weights, and a row. */
    $real *entries;
    $real *lower;
    $real *upper;
    $real *inverse;
    $real *weight;
    $real *row;
//end
    int *order;
} ha_lu;

//item ha_entries
/* The number of entries of a pattern. */
static int ha_entries(const ha_pattern *pattern)
{
    return pattern->starts[pattern->n];
}

//item ha_lu_at
/* Its parts in a row. */
static ha_lu ha_lu_at($real *place, int *order, const ha_pattern *pattern)
{
    const int n = pattern->n;
    ha_lu l;
    l.n = n;
    l.pattern = pattern;
//if sparse
    if (pattern->order != NULL) {
        l.entries = place;
        l.lower = l.entries + $ha_entries(pattern);
        l.upper = l.lower + pattern->order->lower_starts[n];
        l.inverse = l.upper + pattern->order->upper_starts[n];
        l.weight = l.inverse + n;
        l.row = l.weight + n;
        l.scale = l.row + n;
        l.work = l.scale + n;
        l.rest = l.work + n;
        place = l.rest + n;
//if single
        l.columns = place;
        place += n;
//end
        l.matrix = place;
        l.factors = n > $SPARSE_FULL_AT_MOST ? place : place + n * n;
        l.order = order;
        return l;
    }
//end
    l.matrix = place;
    l.factors = place + n * n;
    l.scale = l.factors + n * n;
    l.work = l.scale + n;
    l.rest = l.work + n;
//if single
    l.columns = l.rest + n;
//end
    l.order = order;
    return l;
}

//item ha_lu_pivot
/* The row to bring to place k, -1 if all are 0 to rounding. */
static int ha_lu_pivot(const ha_lu *l, int k)
{
    $real weight;
    const int best = $ha_pivot_row(l->factors, l->scale, l->n, k, &weight);
//if single
    weight /= l->columns[k];
//end
    return weight > $DBL_EPSILON * ($real)l->n && $ha_finite(weight) ? best : -1;
}

//item ha_lu_swap
static void ha_lu_swap(ha_lu *l, int a, int b)
{
    const int n = l->n;
    const $real scale = l->scale[a];
    const int order = l->order[a];
    int j;
    if (a == b) {
        return;
    }
    for (j = 0; j < n; ++j) {
        const $real entry = l->factors[a * n + j];
        l->factors[a * n + j] = l->factors[b * n + j];
        l->factors[b * n + j] = entry;
    }
    l->scale[a] = l->scale[b];
    l->scale[b] = scale;
    l->order[a] = l->order[b];
    l->order[b] = order;
}

//item ha_less_products
/* start - a.b: the sum of groups of four products, each of the four places apart, then the products that are left. */
static $real ha_less_products($real start, const $real *a, const $real *b, int n)
{
    $real result = start;
    int i = 0;
    int j;
    if (n >= 4) {
        $real sums[4] = {$0.0, $0.0, $0.0, $0.0};
        for (; i + 4 <= n; i += 4) {
            for (j = 0; j < 4; ++j) {
                const $real product = a[i + j] * b[i + j];
                sums[j] += product;
            }
        }
        result -= (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
    for (; i < n; ++i) {
        const $real product = a[i] * b[i];
        result -= product;
    }
    return result;
}

//item ha_less_scaled
/* a - factor b, four places at a time, for compilers that know vectors. */
static void ha_less_scaled($real *restrict a, const $real *restrict b, $real factor, int n)
{
    int i = 0;
    int j;
    for (; i + 4 <= n; i += 4) {
        $real products[4];
        for (j = 0; j < 4; ++j) {
            products[j] = factor * b[i + j];
        }
        for (j = 0; j < 4; ++j) {
            a[i + j] -= products[j];
        }
    }
    for (; i < n; ++i) {
        const $real product = factor * b[i];
        a[i] -= product;
    }
}

//item ha_lu_factor_definite
/* Factors a symmetric matrix that is definite: U above the diagonal and its mirror image below, the inverse of D in
 * scale, -1 as the first of the order. 0 if it is not such a matrix. */
static int ha_lu_factor_definite(ha_lu *l)
{
    const int n = l->n;
    const $real sign = $copysign($1.0, l->matrix[0]);
    int i;
    int j;
    int k;
    if (n < 2) {
        return 0;
    }
    for (i = 0; i < n; ++i) {
        for (j = 0; j < i; ++j) {
            if (l->matrix[i * n + j] != l->matrix[j * n + i]) {
                return 0;
            }
        }
    }
    $ha_copy(l->factors, l->matrix, n * n);
    for (k = 0; k < n; ++k) {
        const $real *row = l->factors + k * n;
        const $real pivot = row[k];
        const $real size = sign * pivot;
        $real inverse;
        if (!(size > $0.0 && size > $DBL_EPSILON * ($real)n * (sign * l->matrix[k * n + k]) && $ha_finite(size))) {
            return 0;
        }
        inverse = $1.0 / pivot;
        for (j = k + 1; j < n; ++j) {
            const $real factor = row[j] * inverse;
            l->factors[j * n + k] = factor;
            if (row[j] != $0.0) {
                $ha_less_scaled(l->factors + j * n + j, row + j, factor, n - j);
            }
        }
        for (j = k + 1; j < n; ++j) {
            l->factors[k * n + j] *= inverse;
        }
        l->scale[k] = inverse;
    }
    l->order[0] = -1;
    return 1;
}

//item ha_lu_solve_definite
static void ha_lu_solve_definite(const ha_lu *l, $real *b)
{
    const int n = l->n;
    int i;
    int k;
    for (i = 0; i < n; ++i) {
        b[i] += $0.0;
    }
    for (k = 0; k < n; ++k) {
        $ha_less_scaled(b + k + 1, l->factors + k * n + k + 1, b[k], n - k - 1);
    }
    for (k = 0; k < n; ++k) {
        const $real scaled = b[k] * l->scale[k];
        b[k] = scaled + $0.0;
    }
    for (k = n - 1; k >= 0; --k) {
        $ha_less_scaled(b, l->factors + k * n, b[k], k);
    }
}

