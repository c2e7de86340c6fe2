
//section
/* ---- nonlinear equations: Newton's method, damped by the restricted natural monotonicity test, and continuation, which
 * keeps a run on one solution. P. Deuflhard, "Newton Methods for Nonlinear Problems", 2004, chapters 3 and 5. ---- */

//always
typedef struct {
    /* Where the entries of the Jacobian stand, and the number of values read from outside. */
    const ha_pattern *pattern;
    int reads;
    /* First place of its memory in m->memory. */
    int memory;
    /* Whether its code reads conditions, which may be held or not. */
    int conditions;
//if sought_positions
    /* Whether its unknowns are positions that constraints determine. */
    int position;
//end
    void (*code)(ha_model *m, const $real *o, const $real *g, $real *right, $real *matrix);
    /* Of what the residuals are the sums, in magnitude. */
    void (*terms)(ha_model *m, const $real *o, const $real *g, $real *terms);
//if newton
    void (*along)(ha_model *m, const $real *o, const $real *e, const $real *g, $real *rates);
//end
} ha_block;

//item ha_blocks
$BLOCK_TABLE

//always
/* What a solution is sought with: parts of the memory and of the workspace of the model. */
typedef struct {
    const ha_block *block;
    int n;
    /* For each row of the Jacobian its first entry, for each entry its column, and the number of entries. */
    const int *starts;
    const int *columns;
    int entries;
    int following;
    int limit;
    int evaluations;
    /* Whether the first step, undamped, contracted by 1/4. */
    int contracts;
    /* Whether its unknowns are positions that constraints determine. */
    int positions;
    /* Whether the factors at hand are those of the first correction. */
    int first_factors;
    /* Whether the root is where the iteration began, but for a first correction that is rounding. */
    int rests;
    /* Whether the way was a small part of the distance from where the Jacobian is singular. */
    int regular;
    /* Whether the laws had a value where an iteration began. */
    int valued;
    /* The previous solution, what the block read there, and its Jacobian. */
    $real *previous;
    $real *previous_outer;
    $real *previous_jacobian;
    /* The solution found last, what the block read there, and its Jacobian. */
    $real *x;
    $real *outer;
    $real *jacobian;
    /* Newton correction at x, trial point, and simplified correction there: with the Jacobian at x. */
    $real *correction;
    $real *trial;
    $real *simplified;
    /* Scale of norms: greatest magnitude of each unknown so far; its inverse, as far as a correction is no greater. */
    $real *scale;
    $real *weight;
    /* What is subtracted from the residuals: the Newton homotopy F(x) = (1 - s) F(previous). */
    $real *offset;
    $real *previous_residual;
    /* Where the iteration starts: the last root on the path; its Jacobian is start_jacobian. */
    $real *start;
    $real *saved_start;
    /* The first correction, and its right-hand side. */
    $real *first_correction;
    $real *first_right;
    /* Magnitudes of the unknowns. */
    $real *magnitude;
    $real *right;
    $real *present;
    $real *start_jacobian;
    $real *matrix;
    /* For unknowns that no equation determines: see ha_floats. */
    $real *terms;
    $real *units;
    $real *loose;
    $real *order;
    $real *rest;
    $real *unseen;
    /* Least scales, below which unknowns are rounding; 0 unless a solution is sought that is not found without them. */
    $real *floor;
//if sought_positions
    /* Of positions: their rates at the previous solution, and the rates of these. */
    $real *rates;
    $real *bends;
    /* Where they lead. */
    $real *expected;
//end
    ha_lu lu;
} ha_newton;

//item ha_take
static $real *ha_take($real **place, int n)
{
    $real *taken = *place;
    *place += n;
    return taken;
}

//always
/* What is kept of a block: the previous solution, what the block read there, and its Jacobian; the same of the solution found
 * last; and the first place behind them. */
typedef struct {
    const ha_block *block;
    int n;
    int entries;
    $real *previous;
    $real *previous_outer;
    $real *previous_jacobian;
    $real *x;
    $real *outer;
    $real *jacobian;
    $real *end;
} ha_kept;

//item ha_kept_of
static ha_kept ha_kept_of(ha_model *m, int number)
{
    const ha_block *block = &$ha_blocks[number];
    ha_kept k;
    k.block = block;
    k.n = block->pattern->n;
    k.entries = $ha_entries(block->pattern);
    k.previous = m->memory + block->memory;
    k.previous_outer = k.previous + k.n;
    k.previous_jacobian = k.previous_outer + block->reads;
    k.x = k.previous_jacobian + k.entries;
    k.outer = k.x + k.n;
    k.jacobian = k.outer + block->reads;
    k.end = k.jacobian + k.entries;
    return k;
}

//item ha_newton_of
static ha_newton ha_newton_of(ha_model *m, int number)
{
    const ha_kept kept = $ha_kept_of(m, number);
    const ha_block *block = kept.block;
    const int n = kept.n;
    const int entries = kept.entries;
    const int reads = block->reads;
    $real *place = kept.end;
    ha_newton w;
    w.block = block;
    w.n = n;
    w.starts = block->pattern->starts;
    w.columns = block->pattern->columns;
    w.entries = entries;
    w.following = m->following[number];
    w.limit = w.following ? m->most_evaluations : 20000;
    w.evaluations = 0;
    w.contracts = 0;
    w.first_factors = 0;
    w.rests = 0;
    w.regular = 0;
//if sought_positions
    w.positions = w.block->position;
//else
    w.positions = 0;
//end
    w.valued = 0;
    w.previous = kept.previous;
    w.previous_outer = kept.previous_outer;
    w.previous_jacobian = kept.previous_jacobian;
    w.x = kept.x;
    w.outer = kept.outer;
    w.jacobian = kept.jacobian;
//if sought_positions
    w.rates = NULL;
    w.bends = NULL;
    if (block->position) {
        w.rates = $ha_take(&place, n);
        w.bends = $ha_take(&place, n);
    }
//end
    place = m->work;
    w.correction = $ha_take(&place, n);
    w.trial = $ha_take(&place, n);
    w.simplified = $ha_take(&place, n);
    w.scale = $ha_take(&place, n);
    w.weight = $ha_take(&place, n);
    w.offset = $ha_take(&place, n);
    w.previous_residual = $ha_take(&place, n);
    w.start = $ha_take(&place, n);
    w.saved_start = $ha_take(&place, n);
    w.first_correction = $ha_take(&place, n);
    w.first_right = $ha_take(&place, n);
    w.magnitude = $ha_take(&place, n);
    w.right = $ha_take(&place, n);
    w.present = $ha_take(&place, reads);
    w.start_jacobian = $ha_take(&place, entries);
    w.matrix = $ha_take(&place, entries);
    w.terms = $ha_take(&place, n);
    w.units = $ha_take(&place, n);
    w.order = $ha_take(&place, n);
    w.rest = $ha_take(&place, n);
    w.floor = $ha_take(&place, n);
//if sought_positions
    w.expected = $ha_take(&place, n);
//end
    w.loose = NULL;
    w.unseen = NULL;
//if sparse
    /* Large sparse blocks are not searched for unknowns that float. */
    if (block->pattern->order == NULL || n <= $SPARSE_FULL_AT_MOST) {
        w.loose = $ha_take(&place, n * n);
        w.unseen = $ha_take(&place, n * n);
    }
//else
    w.loose = $ha_take(&place, n * n);
    w.unseen = $ha_take(&place, n * n);
//end
    w.lu = $ha_lu_at(place, m->order, block->pattern);
    return w;
}

//item ha_newton_accept
/* The solution found last becomes the previous one, and is followed. */
static void ha_newton_accept(ha_model *m, int number)
{
    const ha_kept k = $ha_kept_of(m, number);
    $ha_copy(k.previous, k.x, k.n);
    $ha_copy(k.previous_outer, k.outer, k.block->reads);
    $ha_copy(k.previous_jacobian, k.jacobian, k.entries);
//if single
    /* Of so few digits, it is refined where it is sought again. */
    m->fresh[number] = 0;
    m->settled[number] = 0;
//else
    /* Where the block reads the same, it goes on from itself; positions are refined, and their way is looked at, once more where
     * the Jacobian may be singular near by. */
//if sought_positions
    m->fresh[number] = m->fresh[number] && (m->motion_regular[number] || !k.block->position);
//end
    m->settled[number] = m->fresh[number];
//end
    m->following[number] = 1;
//if sought_positions
    m->motion_short[number] = 1;
//end
}

