//if tables

//section
/* ---- tables: on each piece a cubic in the distance from its first point ---- */

//always
typedef struct {
    int n;
    /* Beyond the ends: 0 no value, 1 the value at the end, 2 the piece goes on. */
    int outside;
    const double *x;
    const $real *y;
    const $real (*pieces)[4];
} ha_table;

//item ha_tables
$TABLES

//item ha_piece_of
/* The piece that x is in: number of points not above it. */
static int ha_piece_of(const ha_table *table, double x)
{
    int low = 0;
    int high = table->n;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (table->x[middle] <= x) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

//item ha_table_on
/* Value and three derivatives on a piece. */
static void ha_table_on(const ha_table *table, int piece, double x, $real out[4])
{
    const int n = table->n;
    const int end = piece == 0 ? 0 : (piece >= n ? n - 1 : -1);
    const int start = piece < 1 ? 0 : (piece - 1 < n - 1 ? piece - 1 : n - 1);
    const $real *c = table->pieces[start];
    $real d;
    $real a;
    if (end >= 0) {
        const int beyond = piece == 0 ? x < table->x[0] : x > table->x[n - 1];
        if (table->outside == 1) {
            out[0] = table->y[end];
            out[1] = $0.0;
            out[2] = $0.0;
            out[3] = $0.0;
            return;
        }
        if (table->outside == 0 && beyond) {
            out[0] = ($real)NAN;
            out[1] = ($real)NAN;
            out[2] = ($real)NAN;
            out[3] = ($real)NAN;
            return;
        }
    }
//if single
    d = (float)(x - table->x[start]);
//else
    d = x - table->x[start];
//end
    a = c[3] * d;
    a = (a + c[2]) * d;
    a = (a + c[1]) * d;
    out[0] = a + c[0];
    a = $3.0 * c[3] * d;
    a = (a + $2.0 * c[2]) * d;
    out[1] = a + c[1];
    a = $6.0 * c[3] * d;
    out[2] = a + $2.0 * c[2];
    out[3] = $6.0 * c[3];
}

//end
