//section
/* ---- the matrix of an implicit step ---- */

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

//item ha_step_matrix
/* Puts 1 - factor * Jacobian at x into m->matrix; m->sizes takes up what its rows add up where the states are. */
static int ha_step_matrix(ha_model *m, double t, const $real *x, $real factor)
{
    int group;
    int i;
    int j;
    $ha_fill(m->matrix, $0.0, HA_NX * HA_NX);
    for (i = 0; i < HA_NX; ++i) {
        m->matrix[i * HA_NX + i] = $1.0;
    }
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
                m->matrix[row * HA_NX + column] += -factor * m->product[row];
                m->sizes[row] += $fabs(value * x[column]);
            }
        }
    }
    i = $ha_dense_factor(m);
    return i >= 0 ? $ha_fail(m, $MODEL_STEP_SINGULAR, i, t) : $MODEL_OK;
}
