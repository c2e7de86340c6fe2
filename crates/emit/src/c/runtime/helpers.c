//if single
//item ha_fits
/* Whether a number computed in double precision fits single precision, with all its digits. */
static int ha_fits(double a)
{
    return !$$ha_finite(a) || a == 0.0 || (fabs(a) >= (double)FLT_MIN && fabs(a) <= (double)FLT_MAX);
}

//end
//item ha_all_finite
static int ha_all_finite(const $real *a, int n)
{
    /* What is finite less itself is 0. */
    $real rest[4] = {$0.0, $0.0, $0.0, $0.0};
    int i = 0;
    int j;
    for (; i + 4 <= n; i += 4) {
        for (j = 0; j < 4; ++j) {
            rest[j] += a[i + j] - a[i + j];
        }
    }
    for (; i < n; ++i) {
        rest[0] += a[i] - a[i];
    }
    return rest[0] + rest[1] + rest[2] + rest[3] == $0.0;
}

//item ha_is_below
static int ha_is_below($real a)
{
    return a < $0.0 || (a == $0.0 && $1.0 / a < $0.0);
}

//item ha_same
/* Whether values are the same, zeros with their signs. */
static int ha_same(const $real *a, const $real *b, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        if (!(a[i] == b[i]) || $ha_is_below(a[i]) != $ha_is_below(b[i])) {
            return 0;
        }
    }
    return 1;
}

//item ha_copy
static void ha_copy($real *to, const $real *from, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        to[i] = from[i];
    }
}

//item ha_fill
static void ha_fill($real *to, $real value, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        to[i] = value;
    }
}

//item ha_note
/* The greatest magnitude of something. */
static void ha_note($real *most, $real value)
{
    if ($ha_finite(value)) {
        *most = $ha_max(*most, $fabs(value));
    }
}

//item ha_is_pivot
/* Whether an entry can be divided by: not 0 to rounding, and finite. */
static int ha_is_pivot($real a)
{
    const $real size = $fabs(a);
    const $real weight = size / (size > $DBL_MIN ? size : $DBL_MIN);
    return weight > $DBL_EPSILON && $ha_finite(weight);
}

//item ha_fail
/* Takes note of a failure. */
static int ha_fail(ha_model *m, int code, int where, double t)
{
    m->failure.code = code;
    m->failure.where = where;
    m->failure.time = t;
    return code;
}

//if may_pass
//item ha_solve_square
/* Solves n equations for several right sides, in place, by elimination with the greatest pivot of a column; whether all pivots are more
 * than rounding. */
static int ha_solve_square($real *a, $real *b, int n, int sides)
{
    int i;
    int j;
    int k;
    for (k = 0; k < n; ++k) {
        int best = k;
        for (i = k + 1; i < n; ++i) {
            best = $fabs(a[i * n + k]) > $fabs(a[best * n + k]) ? i : best;
        }
        if (!$ha_finite(a[best * n + k]) || a[best * n + k] == $0.0) {
            return 0;
        }
        for (j = 0; j < n; ++j) {
            const $real kept = a[k * n + j];
            a[k * n + j] = a[best * n + j];
            a[best * n + j] = kept;
        }
        for (j = 0; j < sides; ++j) {
            const $real kept = b[k * sides + j];
            b[k * sides + j] = b[best * sides + j];
            b[best * sides + j] = kept;
        }
        for (i = 0; i < n; ++i) {
            const $real factor = a[i * n + k] / a[k * n + k];
            for (j = k + 1; j < n && i != k; ++j) {
                const $real part = factor * a[k * n + j];
                a[i * n + j] -= part;
            }
            for (j = 0; j < sides && i != k; ++j) {
                const $real part = factor * b[k * sides + j];
                b[i * sides + j] -= part;
            }
        }
    }
    for (i = 0; i < n; ++i) {
        for (j = 0; j < sides; ++j) {
            b[i * sides + j] /= a[i * n + i];
        }
    }
    return 1;
}

//end
//item ha_pivot_row
/* The row of a matrix of n rows to bring to place k, and its weight there: the diagonal stays if it is good enough. */
static int ha_pivot_row(const $real *a, const $real *scale, int n, int k, $real *weight)
{
    const $real diagonal = $fabs(a[k * n + k]) / scale[k];
    int best = k;
    int row;
    *weight = diagonal;
    for (row = k + 1; row < n; ++row) {
        const $real other = $fabs(a[row * n + k]) / scale[row];
        if (other > *weight || other != other) {
            best = row;
            *weight = other;
        }
    }
    if (diagonal >= $0.1 * *weight) {
        best = k;
        *weight = diagonal;
    }
    return best;
}
