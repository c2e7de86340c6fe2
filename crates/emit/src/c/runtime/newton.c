
/* ---- nonlinear equations: damped Newton that follows one solution ---- */

typedef struct {
    /* The matrix of its derivatives, and the number of values read from outside. */
    const ha_pattern *pattern;
    int reads;
    /* First place of its memory in m->memory. */
    int memory;
    void (*code)(ha_model *m, const double *o, const double *g, double *right, double *matrix);
    /* Of what the residuals are the sums, in magnitude. */
    void (*terms)(ha_model *m, const double *o, const double *g, double *terms);
//if newton
    void (*along)(ha_model *m, const double *o, const double *e, const double *g, double *rates);
//end
} ha_block;

BLOCK_TABLE
/* What a solution is sought with: parts of the memory and of the work space of the model. */
typedef struct {
    const ha_block *block;
    int n;
    /* Where the entries of the Jacobian stand, and how many there are. */
    const int *starts;
    const int *columns;
    int entries;
    int following;
    int limit;
    int evaluations;
    int near;
    double *memory;
    double *outer_memory;
    double *jacobian_memory;
    double *x;
    double *outer;
    double *jacobian;
    double *step;
    double *trial;
    double *next;
    double *size;
    double *offset;
    double *first;
    double *kept;
    double *began;
    double *lead;
    double *opening;
    double *span;
    double *right;
    double *present;
    double *base;
    double *matrix;
    /* Where nothing tells an unknown: see ha_floats. */
    double *terms;
    double *units;
    double *loose;
    double *order;
    double *rest;
    double *unseen;
    /* Magnitudes below which unknowns are rounding; 0 unless a solution is sought that is not found without them. */
    double *floor;
    ha_lu lu;
} ha_newton;

static double *ha_take(double **place, int n)
{
    double *taken = *place;
    *place += n;
    return taken;
}

static ha_newton ha_newton_of(ha_model *m, int number)
{
    const ha_block *block = &ha_blocks[number];
    const int n = block->pattern->n;
    const int entries = ha_entries(block->pattern);
    const int reads = block->reads;
    double *place = m->memory + block->memory;
    ha_newton w;
    w.block = block;
    w.n = n;
    w.starts = block->pattern->starts;
    w.columns = block->pattern->columns;
    w.entries = entries;
    w.following = m->following[number];
    w.limit = w.following ? m->most_evaluations : 20000;
    w.evaluations = 0;
    w.near = 0;
    w.memory = ha_take(&place, n);
    w.outer_memory = ha_take(&place, reads);
    w.jacobian_memory = ha_take(&place, entries);
    w.x = ha_take(&place, n);
    w.outer = ha_take(&place, reads);
    w.jacobian = ha_take(&place, entries);
    place = m->work;
    w.step = ha_take(&place, n);
    w.trial = ha_take(&place, n);
    w.next = ha_take(&place, n);
    w.size = ha_take(&place, n);
    w.offset = ha_take(&place, n);
    w.first = ha_take(&place, n);
    w.kept = ha_take(&place, n);
    w.began = ha_take(&place, n);
    w.lead = ha_take(&place, n);
    w.opening = ha_take(&place, n);
    w.span = ha_take(&place, n);
    w.right = ha_take(&place, n);
    w.present = ha_take(&place, reads);
    w.base = ha_take(&place, entries);
    w.matrix = ha_take(&place, entries);
    w.terms = ha_take(&place, n);
    w.units = ha_take(&place, n);
    w.order = ha_take(&place, n);
    w.rest = ha_take(&place, n);
    w.floor = ha_take(&place, n);
    w.loose = ha_take(&place, n * n);
    w.unseen = ha_take(&place, n * n);
    w.lu = ha_lu_at(place, m->order, block->pattern);
    return w;
}

/* Goes on with the solution found last. */
static void ha_newton_accept(ha_model *m, int number)
{
    const ha_newton w = ha_newton_of(m, number);
    ha_copy(w.memory, w.x, w.n);
    ha_copy(w.outer_memory, w.outer, w.block->reads);
    ha_copy(w.jacobian_memory, w.jacobian, w.entries);
    m->following[number] = 1;
}

/* Runs the code at a point; whether residuals and Jacobian are finite. */
static int ha_look_at(ha_model *m, ha_newton *w, const double *point)
{
    ++w->evaluations;
    w->block->code(m, w->present, point, w->right, w->matrix);
    return ha_all_finite(w->right, w->n) && ha_all_finite(w->matrix, w->entries);
}

/* Evaluates a point on the way from where the attempt began (0) to the root (1). */
static int ha_look(ha_model *m, ha_newton *w, double part)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        const double way = part * (w->x[i] - w->kept[i]);
        w->trial[i] = w->kept[i] + way;
    }
    return ha_look_at(m, w, w->trial);
}

/* Greatest residual at the point evaluated last. */
static double ha_residual(const ha_newton *w)
{
    double most = 0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        most = ha_max(most, fabs(w->right[i] - w->offset[i]));
    }
    return most;
}

static int ha_newton_factor(ha_newton *w)
{
    return ha_lu_factor(&w->lu, w->matrix);
}

static void ha_newton_step(ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        w->step[i] = w->offset[i] - w->right[i];
    }
    ha_lu_solve(&w->lu, w->step);
}

/* Greatest component of the step against its unknown. */
static double ha_relative_step(const ha_newton *w)
{
    double most = 0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        const double size = fabs(w->step[i]);
        if (!ha_finite(size)) {
            return HUGE_VAL;
        }
        most = ha_max(most, size / ha_max(ha_max(w->size[i], size), DBL_MIN));
    }
    return most;
}

/* What the next step would be with the present Jacobian, measured as the step is. */
static double ha_next_step(ha_newton *w)
{
    double most = 0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        w->next[i] = w->offset[i] - w->right[i];
    }
    ha_lu_solve(&w->lu, w->next);
    for (i = 0; i < w->n; ++i) {
        const double size = ha_max(ha_max(w->size[i], fabs(w->step[i])), DBL_MIN);
        const double next = fabs(w->next[i]) / size;
        most = next != next ? HUGE_VAL : ha_max(most, next);
    }
    return most;
}

/* Gives an unknown that is 0, and stays so in the first step, the magnitude at which it would count in one of the
 * equations: what little it moves afterwards is no failure of the step. */
static void ha_weigh_what_rests(ha_newton *w)
{
    const int n = w->n;
    int i;
    int j;
    int e;
    for (j = 0; j < n; ++j) {
        double least = HUGE_VAL;
        if (w->size[j] != 0.0 || w->step[j] != 0.0) {
            continue;
        }
        for (i = 0; i < n; ++i) {
            double own = 0.0;
            double others = 0.0;
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                const int k = w->columns[e];
                if (k == j) {
                    own = fabs(w->matrix[e]);
                } else {
                    const double term = fabs(w->matrix[e]) * ha_max(w->size[k], fabs(w->step[k]));
                    others += term;
                }
            }
            if (own > 0.0 && others > 0.0) {
                least = others / own < least ? others / own : least;
            }
        }
        if (ha_finite(least)) {
            w->size[j] = least;
        }
    }
}

/* Leaves a point at which the Jacobian is singular. */
static void ha_nudge(ha_newton *w, int iteration)
{
    int i;
    w->near = 0;
    for (i = 0; i < w->n; ++i) {
        const double away = 1e-3 * (1.0 + (double)iteration) * ha_max(w->size[i], 1.0);
        const double move = i % 2 == iteration % 2 ? away : 0.5 * away;
        w->x[i] += move;
    }
}

static void ha_accept_trial(ha_newton *w)
{
    int i;
    ha_copy(w->x, w->trial, w->n);
    for (i = 0; i < w->n; ++i) {
        w->size[i] = ha_max(w->size[i], fabs(w->x[i]));
    }
}

/* Takes the step that would come next, with the Jacobian as it was before the last one. */
static void ha_take_next_step(ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        w->x[i] += w->next[i];
        w->size[i] = ha_max(w->size[i], fabs(w->x[i]));
    }
}

/* Whether the Jacobian is the same all the way from where the attempt began to x: what differs is rounding. */
static int ha_is_linear(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    int same = 1;
    int look;
    int i;
    int e;
    for (look = 0; look <= 8; ++look) {
        if (!ha_look(m, w, (double)look / 8.0)) {
            same = 0;
        }
        if (look == 0) {
            ha_copy(w->jacobian, w->matrix, w->entries);
        }
        for (i = 0; i < n; ++i) {
            double most = 0.0;
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                most = ha_max(most, fabs(w->jacobian[e]));
            }
            for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
                if (!(fabs(w->matrix[e] - w->jacobian[e]) <= CLOSE_TO_ROUNDING * most)) {
                    same = 0;
                }
            }
        }
    }
    return same;
}

/* Whether the Jacobian is the same at x and a whole step from there: that the step does not help is rounding. */
static int ha_is_rounding(ha_model *m, ha_newton *w)
{
    int linear;
    int i;
    ha_copy(w->began, w->kept, w->n);
    for (i = 0; i < w->n; ++i) {
        w->kept[i] = w->x[i] + w->step[i];
    }
    linear = ha_is_linear(m, w);
    ha_copy(w->kept, w->began, w->n);
    return ha_look_at(m, w, w->x) && linear;
}

/* Right side and matrix at w->x, evaluated last: rows in units of their rounding, columns in magnitudes of unknowns. */
static void ha_measure(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    double largest = 0.0;
    int i;
    int j;
    int e;
    w->block->terms(m, w->present, w->x, w->terms);
    for (i = 0; i < n; ++i) {
        largest = ha_max(largest, fabs(w->x[i]));
    }
    for (i = 0; i < n; ++i) {
        largest = ha_max(largest, fabs(w->memory[i]));
    }
    for (j = 0; j < n; ++j) {
        const double size = ha_max(fabs(w->x[j]), fabs(w->memory[j]));
        w->units[j] = size > 0.0 ? size : (largest > 0.0 ? largest : 1.0);
        w->order[j] = (double)j;
    }
    ha_fill(w->loose, 0.0, n * n);
    for (i = 0; i < n; ++i) {
        const double rounding = 8.0 * DBL_EPSILON * w->terms[i];
        w->terms[i] = rounding > 0.0 ? rounding : DBL_MIN;
        w->rest[i] = (w->offset[i] - w->right[i]) / w->terms[i];
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            w->loose[i * n + w->columns[e]] = w->matrix[e] * w->units[w->columns[e]] / w->terms[i];
        }
    }
}

/* Greatest residual in units of its rounding; infinite if something is not finite. */
static double ha_rest(const ha_newton *w)
{
    double most = 0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        most = ha_finite(w->rest[i]) ? ha_max(most, fabs(w->rest[i])) : HUGE_VAL;
    }
    return most;
}

/* Whether the residuals at w->x, evaluated last, are rounding. */
static int ha_is_at_rounding(ha_model *m, ha_newton *w)
{
    ha_measure(m, w);
    return ha_rest(w) <= 1.0;
}

/* Whether they are not far above that: rounding that came from elsewhere. */
static int ha_is_near_rounding(ha_model *m, ha_newton *w)
{
    ha_measure(m, w);
    return ha_rest(w) <= BORROWED_ROUNDING;
}

static void ha_swap(double *a, double *b)
{
    const double was = *a;
    *a = *b;
    *b = was;
}

/* Eliminates with the greatest pivots there are, down to those at rounding; how many there are. */
static int ha_eliminate(ha_newton *w)
{
    const int n = w->n;
    double *a = w->loose;
    int k;
    int i;
    int j;
    for (k = 0; k < n; ++k) {
        double most = 1.0;
        int row = k;
        int column = k;
        for (i = k; i < n; ++i) {
            for (j = k; j < n; ++j) {
                const double size = fabs(a[i * n + j]);
                if (size > most) {
                    row = i;
                    column = j;
                    most = size;
                }
            }
        }
        if (most <= 1.0) {
            return k;
        }
        for (j = 0; j < n; ++j) {
            ha_swap(&a[k * n + j], &a[row * n + j]);
        }
        for (i = 0; i < n; ++i) {
            ha_swap(&a[i * n + k], &a[i * n + column]);
        }
        ha_swap(&w->rest[k], &w->rest[row]);
        ha_swap(&w->order[k], &w->order[column]);
        for (i = k + 1; i < n; ++i) {
            const double factor = a[i * n + k] / a[k * n + k];
            double part;
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

/* Solves the triangle of the first places. */
static void ha_back(const ha_newton *w, int rank, double *b)
{
    int i;
    int j;
    for (i = rank - 1; i >= 0; --i) {
        for (j = i + 1; j < rank; ++j) {
            const double part = w->loose[i * w->n + j] * b[j];
            b[i] -= part;
        }
        b[i] /= w->loose[i * w->n + i];
    }
}

static double ha_dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    int i;
    for (i = 0; i < n; ++i) {
        const double part = a[i] * b[i];
        sum += part;
    }
    return sum;
}

/* Takes off what lies along a direction of length 1. */
static void ha_take_off(double *from, const double *along, int n)
{
    const double share = ha_dot(from, along, n);
    int i;
    for (i = 0; i < n; ++i) {
        const double part = share * along[i];
        from[i] -= part;
    }
}

/* Replaces the right side by the shortest step, in places. */
static void ha_shortest(ha_newton *w, int rank)
{
    const int n = w->n;
    int place;
    int i;
    ha_fill(w->rest + rank, 0.0, n - rank);
    ha_back(w, rank, w->rest);
    for (place = rank; place < n; ++place) {
        double *direction = w->unseen + (place - rank) * n;
        double length;
        ha_fill(direction, 0.0, n);
        for (i = 0; i < rank; ++i) {
            direction[i] = -w->loose[i * n + place];
        }
        ha_back(w, rank, direction);
        direction[place] = 1.0;
        for (i = 0; i < place - rank; ++i) {
            ha_take_off(direction, w->unseen + i * n, n);
        }
        length = sqrt(ha_dot(direction, direction, n));
        for (i = 0; i < n; ++i) {
            direction[i] /= length;
        }
        ha_take_off(w->rest, direction, n);
    }
}

/* From w->kept in steps by what the equations tell of the unknowns, to where the residuals are rounding; only as long as
 * something is hardly told, such as a node between diodes that block. */
static int ha_floats(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    double before = HUGE_VAL;
    int step;
    int i;
    ha_copy(w->x, w->kept, n);
    for (step = 0; step < 30; ++step) {
        double rest;
        int rank;
        if (w->evaluations >= w->limit || !ha_look_at(m, w, w->x)) {
            return 0;
        }
        ha_measure(m, w);
        rest = ha_rest(w);
        if (!ha_all_finite(w->loose, n * n) || (rest > 0.75 * before && rest > 1.0)) {
            return 0;
        }
        rank = ha_eliminate(w);
        if (rank == n && !(fabs(w->loose[n * n - 1]) < 1.0 / CLOSE_TO_ROUNDING)) {
            return 0;
        }
        ha_shortest(w, rank);
        if (rest <= 1.0) {
            return 1;
        }
        for (i = 0; i < n; ++i) {
            const int unknown = (int)w->order[i];
            const double part = w->rest[i] * w->units[unknown];
            w->x[unknown] += part;
        }
        before = rest;
    }
    return 0;
}

enum { HA_DAMPED, HA_KINK, HA_CONTRACTION };
enum { HA_DONE, HA_MOVED, HA_STUCK };

/* How far the Jacobian evaluated last is from the one kept, relative to the entries of a row. */
static double ha_change_of_slope(const ha_newton *w)
{
    const int n = w->n;
    double change = 0.0;
    int i;
    int e;
    for (i = 0; i < n; ++i) {
        double most = DBL_MIN;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            most = ha_max(most, fabs(w->jacobian[e]));
        }
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            change = ha_max(change, fabs(w->matrix[e] - w->jacobian[e]) / most);
        }
    }
    return change;
}

/* Whether no residual evaluated last is greater than those kept in w->next, and one is less. */
static int ha_has_less_left(const ha_newton *w)
{
    int less = 0;
    int i;
    for (i = 0; i < w->n; ++i) {
        const double now = fabs(w->right[i] - w->offset[i]);
        if (!(now <= w->next[i])) {
            return 0;
        }
        less = less || now < w->next[i];
    }
    return less;
}

/* Goes along the step to just beyond where the Jacobian changes, if no residual grows on that way: where a law has a
 * kink, its slope before tells nothing of the way behind. Ends with an evaluation of the trial point, or at w->x. */
static int ha_crosses_kink(ha_model *m, ha_newton *w)
{
    double before = 0.0;
    double beyond = 1.0;
    int halving;
    int i;
    if (!ha_look_at(m, w, w->x)) {
        return 0;
    }
    ha_copy(w->jacobian, w->matrix, w->entries);
    for (i = 0; i < w->n; ++i) {
        w->next[i] = fabs(w->right[i] - w->offset[i]);
    }
    for (halving = 0; halving < 60; ++halving) {
        int finite;
        double change;
        for (i = 0; i < w->n; ++i) {
            const double move = beyond * w->step[i];
            w->trial[i] = w->x[i] + move;
        }
        finite = ha_look_at(m, w, w->trial);
        change = finite ? ha_change_of_slope(w) : HUGE_VAL;
        if (change > 0.5) {
            if (beyond - before <= 1e-3 * beyond && finite && ha_has_less_left(w)) {
                return 1;
            }
            beyond = 0.5 * (before + beyond);
        } else if (change > 1e-3 || (before == 0.0 && beyond == 1.0)) {
            /* No kink: the slope changes little by little, or not at all. */
            break;
        } else {
            const double end = beyond;
            beyond += beyond - before;
            before = end;
        }
    }
    (void)ha_look_at(m, w, w->x);
    return 0;
}

/* Takes the step, or as much of it as makes the next one shorter; near: whether all of it left little to do. */
static int ha_damped(ha_model *m, ha_newton *w, double size, int trust, int *near)
{
    const double shortest = trust == HA_KINK ? 0.1 : (w->following ? 1e-6 : 1e-12);
    double fraction = 1.0;
    int halving;
    int i;
    *near = 0;
    for (halving = 0; halving < 50; ++halving) {
        for (i = 0; i < w->n; ++i) {
            const double move = fraction * w->step[i];
            w->trial[i] = w->x[i] + move;
        }
        if (ha_look_at(m, w, w->trial)) {
            const double next = ha_next_step(w);
            if (next <= (1.0 - 0.25 * fraction) * size || size <= 2.0 * DBL_EPSILON) {
                ha_accept_trial(w);
                *near = fraction == 1.0 && (next <= 0.25 * size || size <= CLOSE_TO_ROUNDING);
                if (*near && next * next <= 0.125 * DBL_EPSILON * size) {
                    ha_take_next_step(w);
                    return HA_DONE;
                }
                return size <= 4.0 * DBL_EPSILON ? HA_DONE : HA_MOVED;
            }
        }
        if (size <= CLOSE_TO_ROUNDING) {
            /* Rounding keeps the step from shrinking: it is as good as it gets. */
            (void)ha_look_at(m, w, w->x);
            *near = 1;
            return HA_DONE;
        }
        fraction *= 0.5;
        if (fraction < shortest || w->evaluations >= w->limit) {
            break;
        }
    }
    if (trust == HA_DAMPED && ha_crosses_kink(m, w)) {
        ha_accept_trial(w);
        *near = 0;
        return HA_MOVED;
    }
    *near = (ha_is_rounding(m, w) && ha_is_near_rounding(m, w)) || ha_is_at_rounding(m, w);
    return *near ? HA_DONE : HA_STUCK;
}

/* Newton from w->kept; whether it found a root. */
static int ha_attempt(ha_model *m, ha_newton *w, int trust)
{
    const int n = w->n;
    const int most = trust == HA_KINK ? 10 : (w->following ? 100 : 2000);
    const int last = w->evaluations + w->limit / 4;
    int iteration;
    int i;
    ha_copy(w->x, w->kept, n);
    w->near = 1;
    ha_fill(w->lead, 0.0, n);
    ha_fill(w->opening, 0.0, n);
    for (i = 0; i < n; ++i) {
        w->size[i] = ha_max(fabs(w->x[i]), w->floor[i]);
    }
    if (!ha_look_at(m, w, w->x)) {
        return 0;
    }
    for (iteration = 0; iteration < most; ++iteration) {
        double size;
        int near;
        int damped;
        if (ha_residual(w) == 0.0) {
            return 1;
        }
        if (w->evaluations >= w->limit || w->evaluations > last) {
            return 0;
        }
        if (!ha_newton_factor(w)) {
            ha_nudge(w, iteration);
            if (!ha_look_at(m, w, w->x)) {
                return 0;
            }
            continue;
        }
        ha_newton_step(w);
        if (iteration == 0) {
            ha_copy(w->lead, w->step, n);
            for (i = 0; i < n; ++i) {
                w->opening[i] = w->offset[i] - w->right[i];
            }
            ha_weigh_what_rests(w);
        }
        size = ha_relative_step(w);
        if (!ha_finite(size)) {
            return 0;
        }
        damped = ha_damped(m, w, size, trust, &near);
        w->near = w->near && (iteration > 0 || near);
        if (trust == HA_CONTRACTION && !w->near) {
            return 0;
        }
        if (damped != HA_MOVED) {
            return damped == HA_DONE;
        }
    }
    return 0;
}

/* How far w->next is from the first step, measured as steps are. */
static double ha_off_the_lead(const ha_newton *w)
{
    double most = 0.0;
    int i;
    for (i = 0; i < w->n; ++i) {
        const double lead = w->lead[i];
        const double off = fabs(w->next[i] - lead);
        const double size = ha_max(ha_max(w->size[i], fabs(lead)), DBL_MIN);
        most = off != off ? HUGE_VAL : ha_max(most, off / size);
    }
    return most;
}

/* Whether the root found is without doubt the one that goes on from where the attempt began: the first step, taken
 * whole, came near to it, and the Jacobian there is much the same as at the beginning. */
static int ha_goes_on(ha_newton *w)
{
    const int n = w->n;
    double most = CLOSE_TO_ROUNDING;
    double off;
    int still = 1;
    int i;
    int e;
    for (i = 0; i < n; ++i) {
        if (w->lead[i] != 0.0) {
            still = 0;
        }
    }
    if (!w->near || still) {
        return w->near;
    }
    for (i = 0; i < n; ++i) {
        const double lead = fabs(w->lead[i]);
        most = ha_max(most, lead / ha_max(ha_max(w->size[i], lead), DBL_MIN));
        w->next[i] = w->x[i] - w->kept[i];
    }
    off = ha_off_the_lead(w);
    /* What the first step would have been with the last Jacobian. */
    ha_copy(w->next, w->opening, n);
    ha_lu_solve(&w->lu, w->next);
    off = ha_max(off, ha_off_the_lead(w));
    if (!w->following) {
        return off <= 0.5 * most;
    }
    /* And that of the Jacobian at the root where it began. */
    for (i = 0; i < n; ++i) {
        double sum = -0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            const double product = w->base[e] * w->lead[w->columns[e]];
            sum += product;
        }
        w->next[i] = sum;
    }
    ha_lu_solve(&w->lu, w->next);
    return ha_max(off, ha_off_the_lead(w)) <= 0.5 * most;
}

static int ha_moves_little(const ha_newton *w)
{
    int i;
    for (i = 0; i < w->n; ++i) {
        if (!(fabs(w->x[i] - w->kept[i]) <= 1e-2 * w->span[i])) {
            return 0;
        }
    }
    return 1;
}

/* Whether the residuals shrink all the way from where the attempt began to the root, and the Jacobian never changes its
 * orientation: no fold and no pole lies between them. */
static int ha_is_straight_at(ha_model *m, ha_newton *w, int looks)
{
    double before = HUGE_VAL;
    int orientation = -1;
    int look;
    /* Measured by the Jacobian at the root, or where that is singular at the beginning. */
    if (!(ha_look(m, w, 1.0) && ha_newton_factor(w)) && !(ha_look(m, w, 0.0) && ha_newton_factor(w))) {
        return 0;
    }
    for (look = 0; look <= looks; ++look) {
        double rest;
        if (!ha_look(m, w, (double)look / (double)looks)) {
            return 0;
        }
        rest = ha_next_step(w);
        if (rest != rest || rest > before * (1.0 + CLOSE_TO_ROUNDING) + CLOSE_TO_ROUNDING) {
            return 0;
        }
        before = rest;
    }
    /* The orientation at the root from which the way leads, where that is followed and regular. */
    if (w->following && ha_lu_factor(&w->lu, w->base)) {
        orientation = ha_lu_is_positive(&w->lu);
    }
    for (look = 0; look <= looks; ++look) {
        /* A point at which the Jacobian is singular, such as 0 of a cube, is no fold unless its sign changes there. */
        if (ha_look(m, w, (double)look / (double)looks) && ha_newton_factor(w)) {
            const int here = ha_lu_is_positive(&w->lu);
            if (orientation < 0) {
                orientation = here;
            }
            if (orientation != here) {
                return 0;
            }
        }
    }
    return 1;
}

static int ha_is_straight(ha_model *m, ha_newton *w, int looks)
{
    const int straight = ha_is_straight_at(m, w, looks);
    return ha_look_at(m, w, w->x) && straight;
}

/* Whether the root found is without doubt the only one near the way to it. */
static int ha_is_the_only_one(ha_model *m, ha_newton *w)
{
    const int only = ha_is_linear(m, w) || ha_is_straight_at(m, w, 64);
    return ha_look_at(m, w, w->x) && only;
}

/* Sets what the block reads, or what is taken off its residuals, to a part of the way. */
static void ha_go_to(ha_newton *w, double part)
{
    int i;
    if (!w->following) {
        for (i = 0; i < w->n; ++i) {
            w->offset[i] = (1.0 - part) * w->first[i];
        }
        return;
    }
    for (i = 0; i < w->block->reads; ++i) {
        const double way = part * (w->outer[i] - w->outer_memory[i]);
        w->present[i] = part == 1.0 ? w->outer[i] : w->outer_memory[i] + way;
    }
}

/* Goes from the memory in strides, each short enough to tell the root. */
static int ha_approach(ha_model *m, ha_newton *w)
{
    double s = 0.0;
    double stride = 0.25;
    ha_fill(w->offset, 0.0, w->n);
    ha_copy(w->kept, w->memory, w->n);
    ha_copy(w->base, w->jacobian_memory, w->entries);
    ha_copy(w->x, w->memory, w->n);
    if (!w->following && !ha_look_at(m, w, w->x)) {
        return 0;
    }
    ha_copy(w->first, w->right, w->n);
    while (stride > 1e-6 && w->evaluations < w->limit) {
        const double next = s + stride < 1.0 ? s + stride : 1.0;
        const int is_short = stride <= 1e-3;
        int found;
        ha_go_to(w, next);
        found = ha_attempt(m, w, is_short ? HA_KINK : HA_CONTRACTION);
        found = found && (ha_goes_on(w) || (is_short && ha_moves_little(w) && ha_is_straight(m, w, 8)));
        if (found || ha_floats(m, w)) {
            if (next == 1.0) {
                return 1;
            }
            ha_copy(w->jacobian, w->matrix, w->entries);
            ha_copy(w->kept, w->x, w->n);
            ha_copy(w->base, w->jacobian, w->entries);
            s = next;
            stride = 2.0 * stride;
        } else {
            stride *= 0.5;
        }
    }
    ha_go_to(w, 1.0);
    return 0;
}

/* Whether the memory still solves the equations to rounding: where an unknown is 0 but for the rounding of others, no
   step is small against it. */
static int ha_stays(ha_model *m, ha_newton *w)
{
    const double rounding = 2.0 * DBL_EPSILON;
    int i;
    int j;
    int e;
    if (!ha_look_at(m, w, w->memory)) {
        /* Where a slope is infinite, as that of a root at 0, no step tells: the residuals do if they vanish. */
        int vanishes = 1;
        for (i = 0; i < w->n; ++i) {
            vanishes = vanishes && w->right[i] == 0.0;
        }
        ha_copy(w->x, w->memory, w->n);
        return vanishes;
    }
    for (i = 0; i < w->n; ++i) {
        double terms = 0.0;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            terms += fabs(w->matrix[e] * w->memory[w->columns[e]]);
        }
        w->first[i] = w->right[i];
        w->span[i] = rounding * terms;
    }
    /* What the last digits of what the block reads make of the residuals. */
    for (j = 0; j < w->block->reads; ++j) {
        const double value = w->present[j];
        const double digits = rounding * value;
        int finite;
        w->present[j] = value + digits;
        finite = ha_look_at(m, w, w->memory);
        w->present[j] = value;
        if (!finite) {
            return 0;
        }
        for (i = 0; i < w->n; ++i) {
            w->span[i] += fabs(w->right[i] - w->first[i]);
        }
    }
    for (i = 0; i < w->n; ++i) {
        if (fabs(w->first[i]) > w->span[i]) {
            return 0;
        }
    }
    ha_copy(w->x, w->memory, w->n);
    return ha_look_at(m, w, w->memory);
}

/* What the rounding of residuals at the memory makes of each unknown, as the magnitude of which that is settled; whether one
 * of them is greater than its unknown. */
static int ha_find_floors(ha_model *m, ha_newton *w)
{
    const int n = w->n;
    int hidden = 0;
    int i;
    int j;
    ha_copy(w->x, w->memory, n);
    if (w->evaluations >= w->limit || !ha_look_at(m, w, w->x) || !ha_newton_factor(w)) {
        return 0;
    }
    w->block->terms(m, w->present, w->x, w->terms);
    ha_fill(w->floor, 0.0, n);
    for (j = 0; j < n; ++j) {
        ha_fill(w->next, 0.0, n);
        w->next[j] = 8.0 * DBL_EPSILON * w->terms[j];
        ha_lu_solve(&w->lu, w->next);
        for (i = 0; i < n; ++i) {
            w->floor[i] += fabs(w->next[i]);
        }
    }
    for (i = 0; i < n; ++i) {
        w->floor[i] /= CLOSE_TO_ROUNDING;
        if (w->floor[i] > w->span[i]) {
            hidden = 1;
        }
        w->span[i] = ha_max(w->span[i], w->floor[i]);
    }
    if (!hidden || !ha_all_finite(w->floor, n)) {
        ha_fill(w->floor, 0.0, n);
        return 0;
    }
    return 1;
}

/* The root that goes on from the memory, where an unknown that is 0 but for the rounding of others hides it: steps of such an
 * unknown are never small against it, but they are against what rounding leaves of it. */
static int ha_follows_above_rounding(ha_model *m, ha_newton *w)
{
    if (!w->following || !ha_find_floors(m, w)) {
        return 0;
    }
    ha_fill(w->offset, 0.0, w->n);
    ha_copy(w->kept, w->memory, w->n);
    ha_copy(w->base, w->jacobian_memory, w->entries);
    if ((ha_attempt(m, w, HA_DAMPED) && (ha_goes_on(w) || ha_is_the_only_one(m, w))) || ha_approach(m, w)) {
        return 1;
    }
    ha_fill(w->floor, 0.0, w->n);
    return 0;
}

/* The root that goes on from the memory: 0, or why there is none. */
static int ha_follow(ha_model *m, ha_newton *w)
{
    int why = MODEL_NO_CONVERGENCE;
    int i;
    ha_fill(w->offset, 0.0, w->n);
    ha_copy(w->kept, w->memory, w->n);
    ha_copy(w->base, w->jacobian_memory, w->entries);
    if (ha_attempt(m, w, HA_DAMPED)) {
        if (ha_goes_on(w) || (w->following && ha_is_the_only_one(m, w))) {
            return MODEL_OK;
        }
        why = MODEL_BRANCH;
    }
    if (ha_stays(m, w) || ha_floats(m, w)) {
        return MODEL_OK;
    }
    for (i = 0; i < w->n; ++i) {
        w->span[i] = ha_max(fabs(w->x[i]), fabs(w->memory[i]));
    }
    if (ha_approach(m, w) || ha_follows_above_rounding(m, w)) {
        return MODEL_OK;
    }
    return why == MODEL_NO_CONVERGENCE && w->evaluations >= w->limit ? MODEL_BOUND : why;
}

//if newton_single
/* Distances from tiny to huge. */
static const double ha_distances[] = {
DISTANCES
};

/* The residual of one equation at a point; whether it is finite. */
static int ha_residual_at(ha_model *m, ha_newton *w, double at, double *residual)
{
    int finite;
    w->trial[0] = at;
    finite = ha_look_at(m, w, w->trial);
    *residual = w->right[0];
    return finite;
}

static int ha_is_below(double a)
{
    return a < 0.0 || (a == 0.0 && 1.0 / a < 0.0);
}

/* Halves an interval at whose ends the residual differs in sign. A pole is no root. */
static int ha_between(ha_model *m, ha_newton *w, double a, double ra, double b, double rb)
{
    const double jump = fabs(ra) < fabs(rb) ? fabs(ra) : fabs(rb);
    int halving;
    for (halving = 0; halving < 200; ++halving) {
        const double middle = 0.5 * (a + b);
        double r;
        if (middle == a || middle == b) {
            break;
        }
        if (!ha_residual_at(m, w, middle, &r)) {
            return 0;
        }
        if (ha_is_below(r) == ha_is_below(ra)) {
            a = middle;
            ra = r;
        } else {
            b = middle;
            rb = r;
        }
    }
    if (!(fabs(ra) < fabs(rb))) {
        a = b;
        ra = rb;
    }
    if (fabs(ra) > jump) {
        return 0;
    }
    w->kept[0] = a;
    w->evaluations = 0;
    return ha_attempt(m, w, HA_DAMPED);
}

/* One equation in one unknown: a root anywhere, those near the memory first. */
static int ha_scan(ha_model *m, ha_newton *w)
{
    const int points = (int)(sizeof ha_distances / sizeof ha_distances[0]);
    const double middle = w->memory[0];
    double at[2] = {0.0, 0.0};
    double residual[2] = {0.0, 0.0};
    int there[2] = {0, 0};
    int i;
    int side;
    ha_fill(w->offset, 0.0, w->n);
    for (i = 0; i < points; ++i) {
        for (side = 0; side < 2; ++side) {
            const double way = side == 0 ? ha_distances[i] : -ha_distances[i];
            const double here = middle + way;
            double r;
            const int finite = ha_residual_at(m, w, here, &r);
            const int before = there[side];
            const double a = at[side];
            const double ra = residual[side];
            at[side] = here;
            residual[side] = r;
            there[side] = finite;
            if (finite && before && ha_is_below(r) != ha_is_below(ra) && ha_between(m, w, a, ra, here, r)) {
                return 1;
            }
        }
    }
    return 0;
}

//end
/* Any root. */
static int ha_search(ha_model *m, ha_newton *w)
{
    static const double starts[] = {0.0, 1e-3, -1e-3, 1.0, -1.0, 1e3, -1e3};
    int i;
    ha_copy(w->kept, w->memory, w->n);
    if (ha_attempt(m, w, HA_DAMPED) || ha_floats(m, w)) {
        return 1;
    }
    for (i = 0; i < 7; ++i) {
        ha_fill(w->kept, starts[i], w->n);
        if (ha_attempt(m, w, HA_DAMPED) || ha_floats(m, w)) {
            return 1;
        }
    }
//if newton_single
    return w->n == 1 && ha_scan(m, w);
//else
    return 0;
//end
}

/* The root of a block that goes on from its memory, at a start or a jump any root; o: what the block reads. */
static int ha_find_root(ha_model *m, int number, const double *o, double *x)
{
    ha_newton w = ha_newton_of(m, number);
    int status;
    ha_copy(w.outer, o, w.block->reads);
    ha_copy(w.present, o, w.block->reads);
    ha_fill(w.floor, 0.0, w.n);
    status = ha_follow(m, &w);
    if (status != MODEL_OK && w.following) {
//if newton_single
        /* Is there a solution elsewhere, or none at all? */
        if (status == MODEL_NO_CONVERGENCE && w.n == 1 && ha_scan(m, &w)) {
            status = MODEL_BRANCH;
        }
//end
        return status;
    }
    if (status != MODEL_OK && !ha_search(m, &w)) {
        return status;
    }
    ha_copy(w.jacobian, w.matrix, w.entries);
    ha_copy(x, w.x, w.n);
    return MODEL_OK;
}

//if newton
/* The same with the rates of the unknowns, by the implicit function theorem; e: rates of what the block reads. */
static int ha_root_along(ha_model *m, int number, const double *o, const double *e, double *x, double *dx)
{
    const int status = ha_find_root(m, number, o, x);
    ha_newton w;
    int i;
    if (status != MODEL_OK) {
        return status;
    }
    w = ha_newton_of(m, number);
    w.block->code(m, o, x, w.right, w.matrix);
    w.block->along(m, o, e, x, w.right);
    if (!ha_lu_factor(&w.lu, w.matrix)) {
        return MODEL_SINGULAR;
    }
    for (i = 0; i < w.n; ++i) {
        dx[i] = -w.right[i];
    }
    ha_lu_solve(&w.lu, dx);
    return MODEL_OK;
}

//end
