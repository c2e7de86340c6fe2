/* Start conditions in which one unknown is left, solved together: unknowns (states, then conserved constants) and code. */
typedef int (*ha_start_code)(ha_model *m, double t, const $real *x, const $real *e, $real *out, $real *rates);

typedef struct {
    int count;
    const int *unknowns;
    const int *conditions;
    ha_start_code code;
} ha_pass;

/* Start conditions that share unknowns; without code where all of them are solved one by one. */
typedef struct {
    int rows;
    int columns;
    const int *conditions;
    const int *unknowns;
    ha_start_code code;
    /* Conditions that are given; those after them say what freedom that remains is to be, and give way. */
    int given;
} ha_group;

//if guesses
//always
/* Where the search of an unknown begins: as far as one step of Newton tells, where the code gives 0. */
typedef struct {
    int unknown;
    ha_start_code code;
} ha_guess;

//end
//always
$START_TABLES

enum { HA_START_UNKNOWNS = HA_NX + HA_NK + HA_NQ, HA_MOST_AT_ONCE = $MOST_AT_ONCE, HA_MOST_ROWS = $MOST_ROWS, HA_MOST_COLUMNS = $MOST_COLUMNS };

//item ha_start_residuals
/* Residuals at z and their derivatives along the direction in m->along. */
static int ha_start_residuals(ha_model *m, double t, ha_start_code code, const $real *z, $real *out, $real *rates)
{
//if conserved
    $ha_copy(m->k, z + HA_NX, HA_NK);
//end
//if positions
    $ha_copy(m->positions, z + HA_NX + HA_NK, HA_NQ);
//end
//if held
    $ha_place(m, t);
//end
    return code(m, t, z, m->along, out, rates);
}

//item ha_along_unknown
static $real *ha_along_unknown(ha_model *m, int unknown)
{
//if positions
    if (unknown >= HA_NX + HA_NK) {
        return &m->along[HA_POSITIONS_AT + unknown - HA_NX - HA_NK];
    }
//end
    return &m->along[unknown < HA_NX ? HA_STATES_AT + unknown : HA_CONSERVED_AT + unknown - HA_NX];
}

//if guesses
//item ha_begin_search
/* Places the unknowns that are guessed. */
static void ha_begin_search(ha_model *m, double t, $real *z)
{
    int i;
    for (i = 0; i < $GUESSES; ++i) {
        const int unknown = ha_guesses[i].unknown;
        $real out;
        $real slope;
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        *$ha_along_unknown(m, unknown) = $1.0;
        if ($ha_start_residuals(m, t, ha_guesses[i].code, z, &out, &slope) == $MODEL_OK) {
            const $real place = z[unknown] - out / slope;
            z[unknown] = $ha_finite(place) ? place : z[unknown];
        }
    }
}

//end
//item ha_solve_each
/* Newton for each unknown of a pass by itself, from where it stands, or beside it where its slope is 0 there. */
static void ha_solve_each(ha_model *m, double t, const ha_pass *pass, $real *z, unsigned char *known, unsigned char *met)
{
    $real out[HA_MOST_AT_ONCE];
    $real slope[HA_MOST_AT_ONCE];
    $real least[HA_MOST_AT_ONCE];
    $real best[HA_MOST_AT_ONCE] = {$0.0};
    $real step[HA_MOST_AT_ONCE] = {$0.0};
    $real begin[HA_MOST_AT_ONCE] = {$0.0};
    static const $real guesses[] = {
        $0.0, $1e-6, $1e-3, $1.0, -$1.0, -$1e-3, $30.0, -$30.0, $1e3, -$1e3};
    const int most = 60 * (int)(sizeof guesses / sizeof guesses[0]);
    unsigned char done[HA_MOST_AT_ONCE];
    int iteration;
    int i;
    for (i = 0; i < pass->count; ++i) {
        least[i] = $HUGE_VAL;
        begin[i] = z[pass->unknowns[i]];
        best[i] = begin[i];
        step[i] = $0.0;
        done[i] = 0;
    }
    for (iteration = 0; iteration < most; ++iteration) {
        int all = 1;
        for (i = 0; iteration % 60 == 0 && i < pass->count; ++i) {
            if (!done[i]) {
                least[i] = $HUGE_VAL;
                best[i] = begin[i] + guesses[iteration / 60];
                step[i] = $0.0;
                z[pass->unknowns[i]] = best[i];
            }
        }
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        for (i = 0; i < pass->count; ++i) {
            *$ha_along_unknown(m, pass->unknowns[i]) = $1.0;
        }
        if ($ha_start_residuals(m, t, pass->code, z, out, slope) != $MODEL_OK) {
            iteration += 59 - iteration % 60;
            continue;
        }
        for (i = 0; i < pass->count; ++i) {
            $real *place = &z[pass->unknowns[i]];
            if (done[i]) {
                continue;
            }
            if ($fabs(out[i]) < least[i]) {
                least[i] = $fabs(out[i]);
                best[i] = *place;
                step[i] = -out[i] / slope[i];
            } else {
                step[i] *= $0.5;
            }
            done[i] = out[i] == $0.0 || $fabs(step[i]) <= $2.0 * $DBL_EPSILON * $fabs(best[i]);
            *place = done[i] || !$ha_finite(step[i]) ? best[i] : best[i] + step[i];
            all = all && done[i];
        }
        if (all) {
            break;
        }
    }
    for (i = 0; i < pass->count; ++i) {
        known[pass->unknowns[i]] = done[i];
        met[pass->conditions[i]] = done[i];
        if (!done[i]) {
            z[pass->unknowns[i]] = begin[i];
        }
    }
}

//if start_groups
//item ha_linearised
/* Residuals of a group and their derivatives, row by row, 0 for conditions that are left out; whether all are finite. */
static int ha_linearised(ha_model *m, double t, const ha_group *g, const unsigned char *left_out, const $real *z, $real *residual, $real *jacobian)
{
    $real rates[HA_MOST_ROWS];
    int i;
    int j;
    for (j = 0; j < (g->columns > 0 ? g->columns : 1); ++j) {
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        if (g->columns > 0) {
            *$ha_along_unknown(m, g->unknowns[j]) = $1.0;
        }
        if ($ha_start_residuals(m, t, g->code, z, residual, rates) != $MODEL_OK) {
            return 0;
        }
        for (i = 0; i < g->rows && g->columns > 0; ++i) {
            jacobian[i * g->columns + j] = left_out[i] ? $0.0 : rates[i];
        }
    }
    for (i = 0; i < g->rows; ++i) {
        residual[i] = left_out[i] ? $0.0 : residual[i];
    }
    return $ha_all_finite(residual, g->rows) && $ha_all_finite(jacobian, g->rows * g->columns);
}

//item ha_weights
/* The weights of rows, each by its greatest entry; entries that are rounding beside others in their column weigh as these. */
static void ha_weights(int rows, int columns, const $real *jacobian, $real *weights)
{
    $real greatest[HA_MOST_COLUMNS] = {$0.0};
    int i;
    int j;
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            greatest[j] = $ha_max(greatest[j], $fabs(jacobian[i * columns + j]));
        }
    }
    for (i = 0; i < rows; ++i) {
        $real most = $0.0;
        for (j = 0; j < columns; ++j) {
            const $real size = $fabs(jacobian[i * columns + j]);
            most = $ha_max(most, size > $0.0 && size <= $ROUNDING_OF_ENTRIES * greatest[j] ? greatest[j] : size);
        }
        weights[i] = most > $0.0 ? $1.0 / most : $1.0;
    }
}

//item ha_is_met
/* Whether all conditions of a group are met to rounding of the terms they are made of, and of what solving together leaves
 * of an unknown that should be 0, beside the greatest of the others. */
static int ha_is_met(ha_model *m, const ha_group *g, const $real *z, const $real *residual, const $real *jacobian)
{
    $real asked[$START_CONDITIONS];
    $real weights[HA_MOST_ROWS];
    $real greatest = $0.0;
    int i;
    int j;
    $ha_asked_code(m, asked);
    $ha_weights(g->rows, g->columns, jacobian, weights);
    /* Freedom that makes others grow without bounds is none, so its conditions are no rounding beside these. */
    for (i = g->given; i < g->rows; ++i) {
        $real most = $0.0;
        for (j = 0; j < g->columns; ++j) {
            most = $ha_max(most, $fabs(jacobian[i * g->columns + j]));
        }
        weights[i] = most > $0.0 ? $1.0 / most : $1.0;
    }
    for (j = 0; j < g->columns; ++j) {
        $real share = $0.0;
        for (i = 0; i < g->rows; ++i) {
            share = $ha_max(share, $fabs(jacobian[i * g->columns + j]) * weights[i]);
        }
        greatest = $ha_max(greatest, share * $fabs(z[g->unknowns[j]]));
    }
    for (i = 0; i < g->rows; ++i) {
        const $real rounding = $64.0 * $DBL_EPSILON * greatest / weights[i];
        $real size = $fabs(asked[g->conditions[i]]);
        for (j = 0; j < g->columns; ++j) {
            const $real term = jacobian[i * g->columns + j] * z[g->unknowns[j]];
            size += $fabs(term);
        }
        if (!($fabs(residual[i]) <= $CLOSE_TO_ROUNDING * size + rounding)) {
            return 0;
        }
    }
    return 1;
}

//item ha_shortest_step
/* The shortest of the steps that reduce jacobian * step + residual most, rows weighed, and columns so that the greatest
 * entry of each is 1: singular values by rotations of columns in pairs. */
static int ha_shortest_step(int rows, int columns, const $real *jacobian, const $real *residual, const $real *weights, $real *step)
{
    $real b[HA_MOST_ROWS * HA_MOST_COLUMNS];
    $real v[HA_MOST_ROWS * HA_MOST_ROWS];
    $real sizes[HA_MOST_COLUMNS] = {$0.0};
    $real right[HA_MOST_ROWS] = {$0.0};
    const int wide = rows < columns;
    const int n = wide ? rows : columns;
    const int length = wide ? columns : rows;
    $real greatest = $0.0;
    int sweep;
    int i;
    int j;
    int k;
    for (i = 0; i < rows; ++i) {
        right[i] = -residual[i] * weights[i];
    }
    for (j = 0; j < columns; ++j) {
        $real most = $0.0;
        for (i = 0; i < rows; ++i) {
            most = $ha_max(most, $fabs(jacobian[i * columns + j] * weights[i]));
        }
        sizes[j] = most > $0.0 ? $1.0 / most : $1.0;
    }
    for (i = 0; i < rows; ++i) {
        for (j = 0; j < columns; ++j) {
            const $real entry = jacobian[i * columns + j] * weights[i] * sizes[j];
            b[wide ? j * n + i : i * n + j] = entry;
        }
    }
    for (i = 0; i < n; ++i) {
        for (j = 0; j < n; ++j) {
            v[i * n + j] = i == j ? $1.0 : $0.0;
        }
    }
    for (sweep = 0; sweep < 60; ++sweep) {
        int turned = 0;
        for (i = 0; i + 1 < n; ++i) {
            for (j = i + 1; j < n; ++j) {
                $real a = $0.0;
                $real c = $0.0;
                $real d = $0.0;
                for (k = 0; k < length; ++k) {
                    a += b[k * n + i] * b[k * n + i];
                    c += b[k * n + j] * b[k * n + j];
                    d += b[k * n + i] * b[k * n + j];
                }
                if ($fabs(d) > $DBL_EPSILON * $sqrt(a * c) && d != $0.0) {
                    const $real zeta = (c - a) / ($2.0 * d);
                    const $real tangent = (zeta < $0.0 ? -$1.0 : $1.0) / ($fabs(zeta) + $sqrt($1.0 + zeta * zeta));
                    const $real cosine = $1.0 / $sqrt($1.0 + tangent * tangent);
                    const $real sine = cosine * tangent;
                    turned = 1;
                    for (k = 0; k < length; ++k) {
                        const $real one = b[k * n + i];
                        b[k * n + i] = cosine * one - sine * b[k * n + j];
                        b[k * n + j] = sine * one + cosine * b[k * n + j];
                    }
                    for (k = 0; k < n; ++k) {
                        const $real one = v[k * n + i];
                        v[k * n + i] = cosine * one - sine * v[k * n + j];
                        v[k * n + j] = sine * one + cosine * v[k * n + j];
                    }
                }
            }
        }
        if (!turned) {
            break;
        }
    }
    for (j = 0; j < n; ++j) {
        $real square = $0.0;
        for (k = 0; k < length; ++k) {
            square += b[k * n + j] * b[k * n + j];
        }
        greatest = $ha_max(greatest, square);
    }
    $ha_fill(step, $0.0, columns);
    for (j = 0; j < n; ++j) {
        $real square = $0.0;
        $real part = $0.0;
        for (k = 0; k < length; ++k) {
            square += b[k * n + j] * b[k * n + j];
        }
        if (!($sqrt(square) > $ROUNDING_OF_RANK * $sqrt(greatest))) {
            continue;
        }
        for (k = 0; k < rows; ++k) {
            part += (wide ? v[k * n + j] : b[k * n + j]) * right[k];
        }
        for (k = 0; k < columns; ++k) {
            step[k] += (wide ? b[k * n + j] : v[k * n + j]) * part / square;
        }
    }
    for (j = 0; j < columns; ++j) {
        step[j] *= sizes[j];
    }
    return $ha_all_finite(step, columns);
}

//item ha_weighed
static $real ha_weighed(const $real *residual, const $real *weights, int n)
{
    $real sum = $0.0;
    int i;
    for (i = 0; i < n; ++i) {
        const $real part = residual[i] * weights[i];
        sum += part * part;
    }
    return $sqrt(sum);
}

//item ha_nearer
/* One damped step of Gauss-Newton of minimum norm, of the unknowns that are not fixed; whether it helped. */
static int ha_nearer(ha_model *m, double t, const ha_group *g, const unsigned char *left_out, const unsigned char *fixed, $real *z, $real *residual, $real *jacobian)
{
    $real moving[HA_MOST_ROWS * HA_MOST_COLUMNS];
    $real weights[HA_MOST_ROWS];
    $real step[HA_MOST_COLUMNS];
    $real before[HA_MOST_COLUMNS] = {$0.0};
    $real next[HA_MOST_ROWS];
    $real next_jacobian[HA_MOST_ROWS * HA_MOST_COLUMNS];
    $real fraction = $1.0;
    $real norm;
    int moves = 0;
    int halving;
    int j;
    for (j = 0; j < g->rows * g->columns; ++j) {
        moving[j] = fixed[g->unknowns[j % g->columns]] ? $0.0 : jacobian[j];
    }
    $ha_weights(g->rows, g->columns, jacobian, weights);
    if (!$ha_shortest_step(g->rows, g->columns, moving, residual, weights, step)) {
        return 0;
    }
    norm = $ha_weighed(residual, weights, g->rows);
    for (j = 0; j < g->columns; ++j) {
        before[j] = z[g->unknowns[j]];
        moves = moves || $fabs(step[j]) > $4.0 * $DBL_EPSILON * $fabs(before[j]);
    }
    if (norm == $0.0 || !moves) {
        return 0;
    }
    for (halving = 0; halving < 30; ++halving) {
        for (j = 0; j < g->columns; ++j) {
            const $real move = fraction * step[j];
            z[g->unknowns[j]] = before[j] + move;
        }
        if ($ha_linearised(m, t, g, left_out, z, next, next_jacobian) && $ha_weighed(next, weights, g->rows) < norm) {
            $ha_copy(residual, next, g->rows);
            $ha_copy(jacobian, next_jacobian, g->rows * g->columns);
            return 1;
        }
        fraction *= $0.5;
    }
    for (j = 0; j < g->columns; ++j) {
        z[g->unknowns[j]] = before[j];
    }
    return 0;
}

//item ha_solve_from
/* From one beginning of the unknowns that are open: whether all conditions are met. */
static int ha_solve_from(ha_model *m, double t, const ha_group *g, const unsigned char *left_out, const unsigned char *open, const unsigned char *fixed, $real beginning, $real offset, $real *z)
{
    $real residual[HA_MOST_ROWS];
    $real jacobian[HA_MOST_ROWS * HA_MOST_COLUMNS];
    int i;
    for (i = 0; i < g->columns; ++i) {
        if (open[g->unknowns[i]]) {
//if guesses
            /* What is guessed begins there, or close beside it. */
            if ($fabs(beginning) > $1e-3 && ha_guessed[g->unknowns[i]]) {
                continue;
            }
//end
            z[g->unknowns[i]] += beginning * ($1.0 + offset * ($real)i);
        }
    }
    if (!$ha_linearised(m, t, g, left_out, z, residual, jacobian)) {
        return 0;
    }
    for (i = 0; i < 60; ++i) {
        if (!$ha_nearer(m, t, g, left_out, fixed, z, residual, jacobian)) {
            break;
        }
    }
    return $ha_is_met(m, g, z, residual, jacobian);
}

//item ha_solve_group
/* What is determined already stays, if the rest can be met so; then everything may move. */
static int ha_solve_group(ha_model *m, double t, const ha_group *g, const unsigned char *left_out, $real *z, unsigned char *known)
{
    static const $real beginnings[] = {$0.0, $1e-6, $1e-3, $1.0, -$1.0, -$1e-3, $30.0, -$30.0, $1e3, -$1e3};
    $real before[HA_START_UNKNOWNS + 1];
    unsigned char open[HA_START_UNKNOWNS + 1];
    unsigned char fixed[HA_START_UNKNOWNS + 1];
    int any = 0;
    int $round;
    int i;
    int j;
    $ha_copy(before, z, HA_START_UNKNOWNS);
    for (j = 0; j < HA_START_UNKNOWNS; ++j) {
        open[j] = !known[j];
        fixed[j] = known[j];
    }
    for (j = 0; j < g->columns; ++j) {
        any = any || open[g->unknowns[j]];
    }
    if (!any) {
        memset(fixed, 0, sizeof fixed);
    }
    for ($round = any ? 0 : 1; $round < 2; ++$round) {
        for (i = 0; i < (any ? 10 : 1); ++i) {
            $ha_copy(z, before, HA_START_UNKNOWNS);
            if ($ha_solve_from(m, t, g, left_out, open, fixed, beginnings[i], i < 4 ? $0.0 : $1.0 / $16.0, z)) {
                for (j = 0; j < g->columns; ++j) {
                    known[g->unknowns[j]] = 1;
                }
                return 1;
            }
        }
        memset(fixed, 0, sizeof fixed);
    }
    return 0;
}

//item ha_open
static void ha_open(const ha_group *g, unsigned char *known)
{
    int i;
    for (i = 0; i < g->columns; ++i) {
        known[g->unknowns[i]] = 0;
    }
}

//item ha_solve_with_freedom
/* A group with all that its freedom is to be; where that cannot be met, with as much of it as can, one after the other. */
static int ha_solve_with_freedom(ha_model *m, double t, const ha_group *g, unsigned char *left_out, $real *z, unsigned char *known)
{
    $real before[HA_START_UNKNOWNS + 1];
    $real found[HA_START_UNKNOWNS + 1];
    int i;
    $ha_copy(found, z, HA_START_UNKNOWNS);
    if ($ha_solve_group(m, t, g, left_out, z, known)) {
        return 1;
    }
    if (g->given == g->rows) {
        return 0;
    }
    for (i = g->given; i < g->rows; ++i) {
        left_out[i] = 1;
    }
    /* What was determined by freedom is open again. */
    $ha_fill(before, $0.0, HA_START_UNKNOWNS);
//if guesses
    $ha_begin_search(m, t, before);
//end
    for (i = 0; i < g->columns; ++i) {
        found[g->unknowns[i]] = before[g->unknowns[i]];
    }
    $ha_open(g, known);
    $ha_copy(before, found, HA_START_UNKNOWNS);
    $ha_copy(z, before, HA_START_UNKNOWNS);
    if (g->given > 0 && !$ha_solve_group(m, t, g, left_out, z, known)) {
        return 0;
    }
    $ha_copy(found, z, HA_START_UNKNOWNS);
    for (i = g->given; i < g->rows; ++i) {
        left_out[i] = 0;
        $ha_copy(z, before, HA_START_UNKNOWNS);
        $ha_open(g, known);
        if ($ha_solve_group(m, t, g, left_out, z, known)) {
            $ha_copy(found, z, HA_START_UNKNOWNS);
        } else {
            left_out[i] = 1;
        }
    }
    $ha_copy(z, found, HA_START_UNKNOWNS);
    for (i = 0; i < g->columns; ++i) {
        known[g->unknowns[i]] = 1;
    }
    return 1;
}

//end
//item ha_solve_start_once
/* What is given holds, the rest is solved for, remaining freedom is zero or what is guessed. */
static int ha_solve_start_once(ha_model *m, double t, $real *z)
{
    unsigned char known[HA_START_UNKNOWNS + 1];
    unsigned char met[$START_CONDITIONS + 1];
    int i;
    int j;
    memset(known, 0, sizeof known);
    memset(met, 0, sizeof met);
    $ha_fill(z, $0.0, HA_START_UNKNOWNS);
//if guesses
    $ha_begin_search(m, t, z);
//end
    for (i = 0; i < $PASSES; ++i) {
        $ha_solve_each(m, t, &ha_passes[i], z, known, met);
    }
    for (i = 0; i < $START_GROUPS; ++i) {
        const ha_group *g = &ha_groups[i];
        int all = 1;
        for (j = 0; j < g->rows; ++j) {
            all = all && met[g->conditions[j]];
        }
        if (all) {
            continue;
        }
//if start_groups
        if (g->code != NULL) {
            $real residual[HA_MOST_ROWS];
            $real jacobian[HA_MOST_ROWS * HA_MOST_COLUMNS];
            unsigned char left_out[HA_MOST_ROWS];
            int solved = 1;
            memset(left_out, 0, sizeof left_out);
            for (j = 0; j < g->columns; ++j) {
                solved = solved && known[g->unknowns[j]];
            }
            if (solved && $ha_linearised(m, t, g, left_out, z, residual, jacobian) && $ha_is_met(m, g, z, residual, jacobian)) {
                continue;
            }
            if ($ha_solve_with_freedom(m, t, g, left_out, z, known)) {
                continue;
            }
        }
//end
        return $ha_fail(m, $MODEL_NO_START, i, t);
    }
    $ha_copy(m->x, z, HA_NX);
//if conserved
    $ha_copy(m->k, z + HA_NX, HA_NK);
//end
//if positions
    $ha_copy(m->positions, z + HA_NX + HA_NK, HA_NQ);
//end
    m->failure.code = $MODEL_OK;
    return $MODEL_OK;
}

//item ha_solve_start
static int ha_solve_start(ha_model *m, double t)
{
//if held
    $real before[HA_START_UNKNOWNS + 1];
    $real z[HA_START_UNKNOWNS + 1];
    int $round;
    $ha_fill(before, $0.0, HA_START_UNKNOWNS);
    for ($round = 0; $round < 20; ++$round) {
        int same = 1;
        int i;
        int status = $ha_solve_start_once(m, t, z);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < HA_START_UNKNOWNS; ++i) {
            same = same && z[i] == before[i];
            before[i] = z[i];
        }
        if (same) {
            break;
        }
        /* Held signals start with what the start makes of them. */
        status = $ha_begin_held(m, t, m->x);
        if (status != $MODEL_OK) {
            return status;
        }
    }
    return $MODEL_OK;
//else
    $real z[HA_START_UNKNOWNS + 1];
    return $ha_solve_start_once(m, t, z);
//end
}
