//section
/* ---- the matrix of an implicit step ---- */

//if bounds
//item ha_known_size
/* A typical magnitude of a state; 0 where none is known. */
static $real ha_known_size(const ha_model *m, int i)
{
    return i < HA_TRACKED ? m->most_values[$ha_tracked[i]] : $0.0;
}

//else
//item ha_scales
static const $real ha_scales[] = {
$SCALES
};
//item ha_known_size
/* A typical magnitude of a state; 0 where none is known. */
static $real ha_known_size(const ha_model *m, int i)
{
    (void)m;
    return $ha_scales[i];
}

//end
//item ha_group_starts
/* Columns of the Jacobian in groups: no two of a group have a nonzero in the same row. */
static const int ha_group_starts[] = {
$GROUP_STARTS
};
//item ha_group_columns
static const int ha_group_columns[] = {
$GROUP_COLUMNS
};
//item ha_column_starts
static const int ha_column_starts[] = {
$COLUMN_STARTS
};
//item ha_column_rows
static const int ha_column_rows[] = {
$COLUMN_ROWS
};
//item ha_dense_factor
/* Factors m->matrix in place; the column without pivot, or -1. */
static int ha_dense_factor(ha_model *m)
{
    $real *a = m->matrix;
    int row;
    int j;
    int k;
//if single
    /* The magnitudes of columns: few digits tell units from a singular matrix only if these are known. */
    for (j = 0; j < HA_NX; ++j) {
        m->matrix_columns[j] = $DBL_MIN;
        for (row = 0; row < HA_NX; ++row) {
            m->matrix_columns[j] = $ha_max(m->matrix_columns[j], $fabs(a[row * HA_NX + j]));
        }
    }
//end
    for (row = 0; row < HA_NX; ++row) {
        $real most = $DBL_MIN;
        for (j = 0; j < HA_NX; ++j) {
//if single
            const $real size = $fabs(a[row * HA_NX + j]) / m->matrix_columns[j];
//else
            const $real size = $fabs(a[row * HA_NX + j]);
//end
            if (size > most) {
                most = size;
            }
        }
        m->matrix_order[row] = row;
        m->matrix_scale[row] = most;
    }
    for (k = 0; k < HA_NX; ++k) {
        $real weight;
        const int best = $ha_pivot_row(a, m->matrix_scale, HA_NX, k, &weight);
//if single
        weight /= m->matrix_columns[k];
//end
        if (!(weight > $DBL_EPSILON * ($real)HA_NX)) {
            return k;
        }
        if (best != k) {
            const $real scale = m->matrix_scale[k];
            const int order = m->matrix_order[k];
            for (j = 0; j < HA_NX; ++j) {
                const $real entry = a[k * HA_NX + j];
                a[k * HA_NX + j] = a[best * HA_NX + j];
                a[best * HA_NX + j] = entry;
            }
            m->matrix_scale[k] = m->matrix_scale[best];
            m->matrix_scale[best] = scale;
            m->matrix_order[k] = m->matrix_order[best];
            m->matrix_order[best] = order;
        }
        for (row = k + 1; row < HA_NX; ++row) {
            const $real factor = a[row * HA_NX + k] / a[k * HA_NX + k];
            a[row * HA_NX + k] = factor;
            if (factor != $0.0) {
                for (j = k + 1; j < HA_NX; ++j) {
                    const $real product = factor * a[k * HA_NX + j];
                    a[row * HA_NX + j] -= product;
                }
            }
        }
    }
    return -1;
}

//item ha_dense_solve
static void ha_dense_solve(ha_model *m, $real *b)
{
    const $real *a = m->matrix;
    int row;
    int j;
    for (row = 0; row < HA_NX; ++row) {
        $real sum = -$0.0;
        for (j = 0; j < row; ++j) {
            const $real product = a[row * HA_NX + j] * m->matrix_work[j];
            sum += product;
        }
        m->matrix_work[row] = b[m->matrix_order[row]] - sum;
    }
    for (row = HA_NX - 1; row >= 0; --row) {
        $real sum = -$0.0;
        for (j = row + 1; j < HA_NX; ++j) {
            const $real product = a[row * HA_NX + j] * b[j];
            sum += product;
        }
        b[row] = (m->matrix_work[row] - sum) / a[row * HA_NX + row];
    }
}

//if step_order
//item ha_step_starts
/* The matrix with its whole diagonal: for each column its first entry, and the row of each entry. */
static const int ha_step_starts[] = {
$STEP_STARTS
};
//item ha_step_rows
static const int ha_step_rows[] = {
$STEP_ROWS
};
//item ha_step_diagonal
static const int ha_step_diagonal[] = {
$STEP_DIAGONAL
};
//item ha_step_places
/* For each entry of the Jacobian its place in the matrix. */
static const int ha_step_places[] = {
$STEP_PLACES
};
//item ha_step_from
/* The order of elimination: for each entry of a row in it where it stands in the matrix, and its column in the order. */
static const int ha_step_from[] = {
$STEP_FROM
};
//item ha_step_matrix_starts
static const int ha_step_matrix_starts[] = {
$STEP_MATRIX_STARTS
};
//item ha_step_matrix_columns
static const int ha_step_matrix_columns[] = {
$STEP_MATRIX
};
//item ha_step_lower_starts
static const int ha_step_lower_starts[] = {
$STEP_LOWER_STARTS
};
//item ha_step_lower
static const int ha_step_lower[] = {
$STEP_LOWER
};
//item ha_step_upper_starts
static const int ha_step_upper_starts[] = {
$STEP_UPPER_STARTS
};
//item ha_step_upper
static const int ha_step_upper[] = {
$STEP_UPPER
};
//item ha_step_order
/* The row in each place of the order, then the column in each. */
static const int ha_step_order[] = {
$STEP_ORDER
};
//item ha_fixed_factor
/* Factors m->step_entries in the fixed order; the place without pivot, or -1. */
static int ha_fixed_factor(ha_model *m)
{
    $real *row = m->step_row;
    int place;
    int e;
    int i;
    for (place = 0; place < HA_NX; ++place) {
        $real pivot;
        for (e = $ha_step_lower_starts[place]; e < $ha_step_lower_starts[place + 1]; ++e) {
            row[$ha_step_lower[e]] = $0.0;
        }
        for (e = $ha_step_upper_starts[place]; e < $ha_step_upper_starts[place + 1]; ++e) {
            row[$ha_step_upper[e]] = $0.0;
        }
        row[place] = $0.0;
        for (e = $ha_step_matrix_starts[place]; e < $ha_step_matrix_starts[place + 1]; ++e) {
            row[$ha_step_matrix_columns[e]] = m->step_entries[$ha_step_from[e]];
        }
        for (e = $ha_step_lower_starts[place]; e < $ha_step_lower_starts[place + 1]; ++e) {
            const int k = $ha_step_lower[e];
            const $real factor = row[k] * m->step_inverse[k];
            m->step_lower[e] = factor;
            for (i = $ha_step_upper_starts[k]; i < $ha_step_upper_starts[k + 1]; ++i) {
                const $real product = factor * m->step_upper[i];
                row[$ha_step_upper[i]] -= product;
            }
        }
        pivot = row[place];
        m->step_inverse[place] = $1.0 / pivot;
        for (e = $ha_step_upper_starts[place]; e < $ha_step_upper_starts[place + 1]; ++e) {
            m->step_upper[e] = row[$ha_step_upper[e]];
        }
        if (!($fabs(pivot) > $0.0 && $ha_finite(pivot))) {
            return place;
        }
    }
    return -1;
}

//item ha_fixed_solve
static void ha_fixed_solve(ha_model *m, $real *b)
{
    $real *row = m->step_row;
    int place;
    int e;
    for (place = 0; place < HA_NX; ++place) {
        $real left = b[$ha_step_order[place]];
        for (e = $ha_step_lower_starts[place]; e < $ha_step_lower_starts[place + 1]; ++e) {
            const $real product = m->step_lower[e] * row[$ha_step_lower[e]];
            left -= product;
        }
        row[place] = left;
    }
    for (place = HA_NX - 1; place >= 0; --place) {
        $real left = row[place];
        for (e = $ha_step_upper_starts[place]; e < $ha_step_upper_starts[place + 1]; ++e) {
            const $real product = m->step_upper[e] * row[$ha_step_upper[e]];
            left -= product;
        }
        row[place] = left * m->step_inverse[place];
        b[$ha_step_order[HA_NX + place]] = row[place];
    }
}

//item ha_fixed_holds
/* Tries the factors on equations of which ones are the solution: whether theirs leaves little of each. */
static int ha_fixed_holds(ha_model *m)
{
    $real *rest = m->step_rest;
    $real *size = m->step_rest + HA_NX;
    $real *trial = m->step_rest + 2 * HA_NX;
    int column;
    int e;
    $ha_fill(rest, $0.0, 2 * HA_NX);
    for (e = 0; e < $ha_step_starts[HA_NX]; ++e) {
        rest[$ha_step_rows[e]] += m->step_entries[e];
        size[$ha_step_rows[e]] += $fabs(m->step_entries[e]);
    }
    $ha_copy(trial, rest, HA_NX);
    $ha_fixed_solve(m, trial);
    for (column = 0; column < HA_NX; ++column) {
        for (e = $ha_step_starts[column]; e < $ha_step_starts[column + 1]; ++e) {
            const $real term = m->step_entries[e] * trial[column];
            rest[$ha_step_rows[e]] -= term;
            size[$ha_step_rows[e]] += $fabs(term);
        }
    }
    for (column = 0; column < HA_NX; ++column) {
        if (!($fabs(rest[column]) / size[column] <= $LEFT_OVER)) {
            return 0;
        }
    }
    return 1;
}

//item ha_step_factor
/* Factors the matrix: in the fixed order, or as a full one where its pivots do not do; the column without pivot, or -1. */
static int ha_step_factor(ha_model *m)
{
    int place = $ha_fixed_factor(m);
//if step_full
    int column;
    int e;
    m->step_full = 0;
    if (place < 0 && $ha_fixed_holds(m)) {
        return -1;
    }
    m->step_full = 1;
    $ha_fill(m->matrix, $0.0, HA_NX * HA_NX);
    for (column = 0; column < HA_NX; ++column) {
        for (e = $ha_step_starts[column]; e < $ha_step_starts[column + 1]; ++e) {
            m->matrix[$ha_step_rows[e] * HA_NX + column] = m->step_entries[e];
        }
    }
    place = $ha_dense_factor(m);
    return place;
//else
    if (place < 0) {
        return $ha_fixed_holds(m) ? -1 : 0;
    }
    return $ha_step_order[HA_NX + place];
//end
}

//item ha_step_solve
static void ha_step_solve(ha_model *m, $real *b)
{
//if step_full
    if (m->step_full) {
        $ha_dense_solve(m, b);
        return;
    }
//end
    $ha_fixed_solve(m, b);
}

//end
//item ha_matrix_solve
static void ha_matrix_solve(ha_model *m, $real *b)
{
//if step_order
    $ha_step_solve(m, b);
//else
    $ha_dense_solve(m, b);
//end
}

//item ha_set_unit
/* The matrix is that of ones. */
static void ha_set_unit(ha_model *m)
{
    int i;
//if step_order
    $ha_fill(m->step_entries, $0.0, $ha_step_starts[HA_NX]);
    for (i = 0; i < HA_NX; ++i) {
        m->step_entries[$ha_step_diagonal[i]] = $1.0;
    }
//else
    $ha_fill(m->matrix, $0.0, HA_NX * HA_NX);
    for (i = 0; i < HA_NX; ++i) {
        m->matrix[i * HA_NX + i] = $1.0;
    }
//end
}

//item ha_step_matrix
/* Factors 1 - factor * Jacobian at x; m->sizes takes up what its rows add up where the states are. */
static int ha_step_matrix(ha_model *m, double t, const $real *x, $real factor)
{
    int group;
    int i;
    int j;
    $ha_set_unit(m);
    for (group = 0; group < $GROUPS; ++group) {
        int status;
        $ha_fill(m->direction, $0.0, HA_NX);
        for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
            m->direction[$ha_group_columns[i]] = $1.0;
        }
        status = $model_tangent(m, t, x, m->direction, m->product);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
            const int column = $ha_group_columns[i];
            for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
                const int row = $ha_column_rows[j];
                const $real value = factor * m->product[row];
//if step_order
                m->step_entries[$ha_step_places[j]] += -factor * m->product[row];
//else
                m->matrix[row * HA_NX + column] += -factor * m->product[row];
//end
                m->sizes[row] += $fabs(value * x[column]);
            }
        }
    }
//if step_order
    i = $ha_step_factor(m);
//else
    i = $ha_dense_factor(m);
//end
    return i >= 0 ? $ha_fail(m, $MODEL_STEP_SINGULAR, i, t) : $MODEL_OK;
}
