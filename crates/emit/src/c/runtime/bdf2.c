
//section
/* ---- the linearly implicit BDF method of two steps, with a Jacobian that is kept ---- */

//item ha_leave_steps
/* Something happens where the run stands: earlier steps tell nothing of what comes. */
static void ha_leave_steps(ha_model *m)
{
    m->before_counts = 0;
    m->last_counts = 0;
    m->jacobian_doubted = 1;
}

//item ha_forget_steps
/* The equations are others. */
static void ha_forget_steps(ha_model *m)
{
    $ha_leave_steps(m);
    m->jacobian_doubted = 0;
    m->jacobian_known = 0;
    m->jacobian_part = 0;
    m->jacobian_steps = 0;
}

//item ha_ends_at
/* Whether a step of this length ended at t. */
static int ha_ends_at(double end, $real length, double t)
{
    return fabs(t - end) <= $widen($CLOSE_TO_ROUNDING * length);
}

//if compares_rates
//item ha_beside
/* How far beside a state the rates are looked at. */
static $real ha_beside(const ha_model *m, $real h, const $real *x, int i)
{
    const $real known = $ha_known_size(m, i);
    const $real size = $ha_max($fabs(x[i]), $fabs(h * m->last_rates[i]));
    return $HALF_OF_DIGITS * $ha_max(size, known > $0.0 ? known : $1e-4);
}

//end
//item ha_take_part
/* Finds a group of columns of the Jacobian anew. Where there are no derivatives, or no rates beside the state, they stay as they
 * are. */
static void ha_take_part(ha_model *m, double t, $real h, const $real *x, int group)
{
    int status;
    int i;
    int j;
    m->jacobian_scale = $0.0;
//if compares_rates
    $ha_copy(m->point, x, HA_NX);
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        const int column = $ha_group_columns[i];
        m->point[column] += $ha_beside(m, h, x, column);
    }
    status = $model_rates(m, t, m->point, m->product);
//else
    (void)h;
    $ha_fill(m->point, $0.0, HA_NX);
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        m->point[$ha_group_columns[i]] = $1.0;
    }
    status = $model_tangent(m, t, x, m->point, m->product);
//end
    if (status != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return;
    }
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        const int column = $ha_group_columns[i];
        for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
            const int row = $ha_column_rows[j];
//if compares_rates
            m->jacobian[j] = (m->product[row] - m->last_rates[row]) / (m->point[column] - x[column]);
//else
            m->jacobian[j] = m->product[row];
//end
        }
    }
}

//item ha_is_another
/* Whether the Jacobian along the rates is so much another one that the move of a step would be. */
static int ha_is_another(ha_model *m, double t, $real h, const $real *x)
{
    int status;
    int column;
    int i;
    int j;
//if compares_rates
    const $real way = $ALONG_RATES * h;
    for (i = 0; i < HA_NX; ++i) {
        const $real move = way * m->last_rates[i];
        m->point[i] = x[i] + move;
    }
    status = $model_rates(m, t, m->point, m->product);
    for (i = 0; i < HA_NX; ++i) {
        m->product[i] = (m->product[i] - m->last_rates[i]) / way;
    }
//else
    status = $model_tangent(m, t, x, m->last_rates, m->product);
//end
    if (status != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return 1;
    }
    for (column = 0; column < HA_NX; ++column) {
        for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
            const $real term = m->jacobian[j] * m->last_rates[column];
            m->product[$ha_column_rows[j]] -= term;
        }
    }
    for (i = 0; i < HA_NX; ++i) {
        const $real counts = $ha_max($fabs(h * m->last_rates[i]), $0.01 * $fabs(x[i]));
        if ($fabs(h * (h * m->product[i])) > $0.5 * counts) {
            return 1;
        }
    }
    return 0;
}

//item ha_renew
/* Finds anew what is due of the Jacobian. */
static void ha_renew(ha_model *m, double t, $real h, const $real *x, int goes_on)
{
    const int all = !m->jacobian_known || (m->jacobian_doubted && $ha_is_another(m, t, h, x));
    int group;
    m->jacobian_doubted = 0;
    if (all) {
        if (!m->jacobian_known) {
            $ha_fill(m->jacobian, $0.0, $NONZEROS);
        }
        for (group = 0; group < $GROUPS; ++group) {
            $ha_take_part(m, t, h, x, group);
        }
        m->jacobian_known = 1;
        m->jacobian_part = 0;
        m->jacobian_steps = 0;
    } else if (goes_on) {
        ++m->jacobian_steps;
        if (m->jacobian_steps == 8) {
            $ha_take_part(m, t, h, x, m->jacobian_part);
            m->jacobian_part = m->jacobian_part + 1 < $GROUPS ? m->jacobian_part + 1 : 0;
            m->jacobian_steps = 0;
        }
    }
}

//item ha_factor_kept
/* Factors 1 - m->jacobian_scale * Jacobian. */
static int ha_factor_kept(ha_model *m, double t)
{
    int column;
    int i;
    int j;
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
    for (column = 0; column < HA_NX; ++column) {
        for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
//if step_order
            m->step_entries[$ha_step_places[j]] += -m->jacobian_scale * m->jacobian[j];
//else
            m->matrix[$ha_column_rows[j] * HA_NX + column] += -m->jacobian_scale * m->jacobian[j];
//end
        }
    }
//if step_order
    i = $ha_step_factor(m);
//else
    i = $ha_dense_factor(m);
//end
    if (i >= 0) {
        m->jacobian_scale = $0.0;
        return $ha_fail(m, $MODEL_STEP_SINGULAR, i, t);
    }
    return $MODEL_OK;
}

//item ha_solve_step
/* The move from x beyond that of the step before, in m->correction, and this one, in m->move_on. */
static int ha_solve_step(ha_model *m, double t, $real h, const $real *x)
{
    const int continues = m->before_counts && $ha_ends_at(m->before_end, m->before_length, t);
    const $real longer = h / m->before_length;
    const $real ratio = continues && longer <= $2.0 ? longer : $0.0;
    const $real twice = $2.0 * ratio;
    const $real own = ($1.0 + twice) / ($1.0 + ratio);
    const $real scale = h / own;
    int status = $MODEL_OK;
    int i;
    if (!($fabs(m->jacobian_scale - scale) <= $CLOSE_TO_ROUNDING * scale)) {
        m->jacobian_scale = scale;
        status = $ha_factor_kept(m, t);
    }
    if (status == $MODEL_OK && ratio == $0.0) {
        status = $model_rates(m, t + $widen(h), x, m->product);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        if (ratio == $0.0) {
            m->move_on[i] = $0.0;
            m->correction[i] = h * m->product[i];
        } else {
            const $real now = ($1.0 + ratio) * m->last_rates[i];
            const $real then = ratio * m->before_rates[i];
            const $real way = h * (now - then);
            m->move_on[i] = ratio * (x[i] - m->before_from[i]);
            m->correction[i] = (way - m->move_on[i]) / own;
        }
    }
//if step_order
    $ha_step_solve(m, m->correction);
//else
    $ha_dense_solve(m, m->correction);
//end
    return $MODEL_OK;
}

//item ha_method
/* From t to t + h: the end in m->trial. The step that ended at t has been accepted. */
static int ha_method(ha_model *m, double t, $real h, const $real *x)
{
    const int goes_on = m->last_counts && $ha_ends_at(m->last_end, m->last_length, t);
    int status;
    int i;
    if (goes_on) {
        $ha_copy(m->before_from, m->last_from, HA_NX);
        $ha_copy(m->before_rates, m->last_rates, HA_NX);
        m->before_end = m->last_end;
        m->before_length = m->last_length;
        m->before_counts = 1;
    } else if (m->before_counts) {
        m->before_counts = $ha_ends_at(m->before_end, m->before_length, t);
    }
    m->last_counts = 0;
    status = $model_rates(m, t, x, m->last_rates);
    if (status == $MODEL_OK) {
        $ha_renew(m, t, h, x, goes_on);
        status = $ha_solve_step(m, t, h, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        m->trial[i] = x[i] + (m->move_on[i] + m->correction[i]);
    }
    $ha_copy(m->last_from, x, HA_NX);
    m->last_end = t + $widen(h);
    m->last_length = h;
    m->last_counts = 1;
    return $MODEL_OK;
}
