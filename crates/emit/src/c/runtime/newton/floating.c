//item ha_measure
/* Right side and matrix at w->x, evaluated last: rows in units of their rounding, columns in magnitudes of unknowns. */
static void ha_measure(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    $real largest = $0.0;
    int i;
    int j;
    int e;
    w->block->terms(m, w->present, w->x, w->terms);
    for (i = 0; i < n; ++i) {
        largest = $ha_max(largest, $fabs(w->x[i]));
    }
    for (i = 0; i < n; ++i) {
        largest = $ha_max(largest, $fabs(w->previous[i]));
    }
    for (j = 0; j < n; ++j) {
        const $real size = $ha_max($fabs(w->x[j]), $fabs(w->previous[j]));
        w->units[j] = size > $0.0 ? size : (largest > $0.0 ? largest : $1.0);
        w->order[j] = ($real)j;
    }
    if (w->loose != NULL) {
        $ha_fill(w->loose, $0.0, n * n);
    }
    for (i = 0; i < n; ++i) {
        const $real rounding = $8.0 * $DBL_EPSILON * w->terms[i];
        w->terms[i] = rounding > $0.0 ? rounding : $DBL_MIN;
        w->rest[i] = (w->offset[i] - w->right[i]) / w->terms[i];
        for (e = w->starts[i]; w->loose != NULL && e < w->starts[i + 1]; ++e) {
            w->loose[i * n + w->columns[e]] = w->matrix[e] * w->units[w->columns[e]] / w->terms[i];
        }
    }
}

//item ha_rest
/* Greatest residual in units of its rounding; infinite if something is not finite. */
static $real ha_rest(const ha_newton *w)
{
    $real most = $0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        most = $ha_finite(w->rest[i]) ? $ha_max(most, $fabs(w->rest[i])) : $HUGE_VAL;
    }
    return most;
}

//item ha_is_at_rounding
/* Whether the residuals at w->x, evaluated last, are rounding. */
static int ha_is_at_rounding(ha_model *m, ha_newton *w)
{
    $ha_measure(m, w);
    return $ha_rest(w) <= $1.0;
}

//item ha_is_near_rounding
/* Whether they are not far above that: rounding that came from elsewhere. */
static int ha_is_near_rounding(ha_model *m, ha_newton *w)
{
    $ha_measure(m, w);
    return $ha_rest(w) <= $BORROWED_ROUNDING;
}

//item ha_swap
static void ha_swap($real *a, $real *b)
{
    const $real was = *a;
    *a = *b;
    *b = was;
}

//item ha_eliminate
/* Eliminates with the greatest pivots there are, down to those at rounding; how many there are. */
static int ha_eliminate(ha_newton *w)
{
    const int n = w->n;
    $real *a = w->loose;
    int k;
    int i;
    int j;
    for (k = 0; k < n; ++k) {
        $real most = $1.0;
        int row = k;
        int column = k;
        for (i = k; i < n; ++i) {
            for (j = k; j < n; ++j) {
                const $real size = $fabs(a[i * n + j]);
                if (size > most) {
                    row = i;
                    column = j;
                    most = size;
                }
            }
        }
        if (most <= $1.0) {
            return k;
        }
        for (j = 0; j < n; ++j) {
            $ha_swap(&a[k * n + j], &a[row * n + j]);
        }
        for (i = 0; i < n; ++i) {
            $ha_swap(&a[i * n + k], &a[i * n + column]);
        }
        $ha_swap(&w->rest[k], &w->rest[row]);
        $ha_swap(&w->order[k], &w->order[column]);
        for (i = k + 1; i < n; ++i) {
            const $real factor = a[i * n + k] / a[k * n + k];
            $real part;
            for (j = k + 1; j < n; ++j) {
                part = factor * a[k * n + j];
                a[i * n + j] -= part;
            }
            part = factor * w->rest[k];
            w->rest[i] -= part;
        }
    }
    return n;
}

//item ha_back
/* Solves the triangle of the first places. */
static void ha_back(const ha_newton *w, int rank, $real *b)
{
    int i;
    int j;
    for (i = rank - 1; i >= 0; --i) {
        for (j = i + 1; j < rank; ++j) {
            const $real part = w->loose[i * w->n + j] * b[j];
            b[i] -= part;
        }
        b[i] /= w->loose[i * w->n + i];
    }
}

//item ha_dot
static $real ha_dot(const $real *a, const $real *b, int n)
{
    $real sum = $0.0;
    int i;
    for (i = 0; i < n; ++i) {
        const $real part = a[i] * b[i];
        sum += part;
    }
    return sum;
}

//item ha_take_off
/* Takes off what lies along a direction of length 1. */
static void ha_take_off($real *from, const $real *along, int n)
{
    const $real share = $ha_dot(from, along, n);
    int i;
    for (i = 0; i < n; ++i) {
        const $real part = share * along[i];
        from[i] -= part;
    }
}

//item ha_shortest
/* Replaces the right side by the shortest step, in places. */
static void ha_shortest(ha_newton *w, int rank)
{
    const int n = w->n;
    int place;
    int i;
    $ha_fill(w->rest + rank, $0.0, n - rank);
    $ha_back(w, rank, w->rest);
    for (place = rank; place < n; ++place) {
        $real *direction = w->unseen + (place - rank) * n;
        $real length;
        $ha_fill(direction, $0.0, n);
        for (i = 0; i < rank; ++i) {
            direction[i] = -w->loose[i * n + place];
        }
        $ha_back(w, rank, direction);
        direction[place] = $1.0;
        for (i = 0; i < place - rank; ++i) {
            $ha_take_off(direction, w->unseen + i * n, n);
        }
        length = $sqrt($ha_dot(direction, direction, n));
        for (i = 0; i < n; ++i) {
            direction[i] /= length;
        }
        $ha_take_off(w->rest, direction, n);
    }
}

//item ha_floats
/* From w->start in steps by what the equations tell of the unknowns, to where the residuals are rounding; only as long as
 * something is hardly told, such as a node between diodes that block. */
static int ha_floats(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    $real before = $HUGE_VAL;
    int step;
    int i;
    $ha_copy(w->x, w->start, n);
    if (w->loose == NULL) {
        return 0;
    }
    for (step = 0; step < 30; ++step) {
        $real rest;
        int rank;
        if (w->evaluations >= w->limit || !$ha_evaluate(m, w, w->x)) {
            return 0;
        }
        $ha_measure(m, w);
        rest = $ha_rest(w);
        if (!$ha_all_finite(w->loose, n * n) || (rest > $0.75 * before && rest > $1.0)) {
            return 0;
        }
        rank = $ha_eliminate(w);
        if (rank == n && !($fabs(w->loose[n * n - 1]) < $1.0 / $CLOSE_TO_ROUNDING)) {
            return 0;
        }
        $ha_shortest(w, rank);
        if (rest <= $1.0) {
            return 1;
        }
        for (i = 0; i < n; ++i) {
            const int unknown = (int)w->order[i];
            const $real part = w->rest[i] * w->units[unknown];
            w->x[unknown] += part;
        }
        before = rest;
    }
    return 0;
}

