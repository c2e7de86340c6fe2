//if single
/* Whether a number computed in double precision fits single precision, with all its digits. */
static int ha_fits(ha_wide a)
{
    return HA_WIDE(!ha_finite(a) || a == 0.0 || (fabs(a) >= (double)FLT_MIN && fabs(a) <= (double)FLT_MAX));
}

//end
static int ha_all_finite(const double *a, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        if (!ha_finite(a[i])) {
            return 0;
        }
    }
    return 1;
}

static void ha_copy(double *to, const double *from, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        to[i] = from[i];
    }
}

static void ha_fill(double *to, double value, int n)
{
    int i;
    for (i = 0; i < n; ++i) {
        to[i] = value;
    }
}

/* Whether an entry can be divided by: not 0 to rounding, and finite. */
static int ha_is_pivot(double a)
{
    const double size = fabs(a);
    const double weight = size / (size > DBL_MIN ? size : DBL_MIN);
    return weight > DBL_EPSILON && ha_finite(weight);
}

/* Takes note of a failure. */
static int ha_fail(ha_model *m, int code, int where, ha_wide t)
{
    m->failure.code = code;
    m->failure.where = where;
    m->failure.time = t;
    return code;
}

/* The row of a matrix of n rows to bring to place k, and its weight there: the diagonal stays if it is good enough. */
static int ha_pivot_row(const double *a, const double *scale, int n, int k, double *weight)
{
    const double diagonal = fabs(a[k * n + k]) / scale[k];
    int best = k;
    int row;
    *weight = diagonal;
    for (row = k + 1; row < n; ++row) {
        const double other = fabs(a[row * n + k]) / scale[row];
        if (other > *weight || other != other) {
            best = row;
            *weight = other;
        }
    }
    if (diagonal >= 0.1 * *weight) {
        best = k;
        *weight = diagonal;
    }
    return best;
}
