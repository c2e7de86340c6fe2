
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
    m->jacobian_steps = 0;
//if finds_by_parts
    m->next_steps = 0;
    m->next_waits = 0;
//end
}

//item ha_ends_at
/* Whether a step of this length ended at t. */
static int ha_ends_at(double end, $real length, double t)
{
    return fabs(t - end) <= $widen($CLOSE_TO_ROUNDING * length);
}

//if compares_rates
//item ha_size_at_least
/* The size of a state as far as it is known. That of a speed that is 0 may be rounding. */
static $real ha_size_at_least(const ha_model *m, int i)
{
    const $real known = $ha_known_size(m, i);
    return known > $0.0 ? $ha_max(known, $1e-6) : $1e-4;
}

//item ha_beside
/* How far beside m->at the rates are looked at. */
static $real ha_beside(const ha_model *m, $real h, int i)
{
    const $real size = $ha_max($fabs(m->at[i]), $fabs(h * m->rates_at[i]));
    return $PART_BESIDE * $ha_max(size, $ha_size_at_least(m, i));
}

//end
//if knows_common
//item ha_find_common
/* Computes the rates at m->at, and what those beside it have in common. It is known where all of that is a number, and what it is
 * solved from is no other solution where it is sought again. */
static void ha_find_common(ha_model *m, double t)
{
    int status;
    m->common_known = 0;
//if assumptions
    if (m->broken) {
        return;
    }
//end
//if held
    $ha_place(m, t);
//end
    status = $ha_common_code(m, t, m->at, m->common);
    m->common_known = status == $MODEL_OK && $ha_all_finite(m->common, $COMMON);
    m->failure.code = $MODEL_OK;
//if common_newton
    {
        static const int blocks[] = {$COMMON_BLOCKS};
        m->common_known = m->common_known && $ha_stay(m, blocks, $COMMON_BLOCK_COUNT);
    }
//end
}

//item ha_part_code
/* The rates at a state beside m->at, where others of its numbers than those of a part are the same. */
static int ha_part_code(ha_model *m, int part, double t, const $real *x, $real *out)
{
    switch (part) {
$PART_CASES
    default:
        return $MODEL_OK;
    }
}

//item ha_group_parts
/* The part by which rates are computed of each group of columns; -1 where nearly all of them is another one. */
static const int ha_group_parts[] = {
$GROUP_PARTS
};

//end
//if compares_rates
//item ha_rates_beside
/* The rates at m->point, where numbers of a group of columns are others than at m->at: in m->product. */
static int ha_rates_beside(ha_model *m, double t, int group)
{
//if knows_common
    const int part = $ha_group_parts[group];
    if (m->common_known && part >= 0) {
        if ($ha_part_code(m, part, t, m->point, m->product) == $MODEL_OK && $ha_all_finite(m->product, HA_NX)) {
            return $MODEL_OK;
        }
        m->failure.code = $MODEL_OK;
    }
//else
    (void)group;
//end
    return $model_rates(m, t, m->point, m->product);
}

//end
//item ha_find_columns
/* Finds a group of columns of the Jacobian at m->at. Whether there were derivatives, or rates beside it. */
static int ha_find_columns(ha_model *m, double t, $real h, int group, $real *values)
{
    int status;
    int i;
    int j;
//if compares_rates
    $ha_copy(m->point, m->at, HA_NX);
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        const int column = $ha_group_columns[i];
        const $real beside = $ha_beside(m, h, column);
        /* Away from zero, so that what is the mirror image of something is compared on its mirror image. */
        m->point[column] += m->at[column] < $0.0 ? -beside : beside;
    }
    status = $ha_rates_beside(m, t, group);
//else
    (void)h;
    $ha_fill(m->point, $0.0, HA_NX);
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        m->point[$ha_group_columns[i]] = $1.0;
    }
    status = $model_tangent(m, t, m->at, m->point, m->product);
//end
    if (status != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return 0;
    }
    for (i = $ha_group_starts[group]; i < $ha_group_starts[group + 1]; ++i) {
        const int column = $ha_group_columns[i];
        for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
            const int row = $ha_column_rows[j];
//if compares_rates
            values[j] = (m->product[row] - m->rates_at[row]) / (m->point[column] - m->at[column]);
//else
            values[j] = m->product[row];
//end
        }
    }
    return 1;
}

//item ha_change_along
/* What has become of the Jacobian along the rates: 0 where it serves, 1 where steps would swing up with time, 2 where the next one
 * goes elsewhere. */
static int ha_change_along(ha_model *m, double t, $real h, const $real *x)
{
    int change = 0;
    int status;
    int column;
    int i;
    int j;
    if (m->jacobian_scale == $0.0) {
        return 2;
    }
    for (i = 0; i < HA_NX; ++i) {
        m->way[i] = h * m->last_rates[i];
    }
//if compares_rates
    for (i = 0; i < HA_NX; ++i) {
        const $real move = $PART_ALONG * m->way[i];
        m->point[i] = x[i] + move;
    }
    status = $model_rates(m, t, m->point, m->product);
    for (i = 0; i < HA_NX; ++i) {
        m->product[i] = (m->product[i] - m->last_rates[i]) / $PART_ALONG;
    }
//else
    status = $model_tangent(m, t, x, m->way, m->product);
//end
    if (status != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return 2;
    }
    /* Beside what moves a state, where that is another one by a part of all that pushes and pulls. */
    $ha_fill(m->point, $0.0, HA_NX);
    for (column = 0; column < HA_NX; ++column) {
        for (j = $ha_column_starts[column]; j < $ha_column_starts[column + 1]; ++j) {
            const $real term = m->jacobian[j] * m->way[column];
            m->product[$ha_column_rows[j]] -= term;
            m->point[$ha_column_rows[j]] += $fabs(term);
        }
    }
    for (i = 0; i < HA_NX; ++i) {
        m->point[i] = $fabs(m->product[i]) > $0.1 * m->point[i] ? $1.0 : $0.0;
        m->product[i] *= m->jacobian_scale;
    }
    $ha_matrix_solve(m, m->product);
    for (i = 0; i < HA_NX; ++i) {
//if compares_rates
        const $real size = $ha_max($fabs(x[i]), $ha_size_at_least(m, i));
//else
        const $real size = $fabs(x[i]);
//end
        const $real other = $fabs(m->product[i]);
        if (other <= $0.2 * $ha_max($fabs(m->way[i]), $1e-4 * size)) {
            continue;
        }
        if (!$ha_finite(other) || (other > $0.1 * size && m->point[i] != $0.0)) {
            return 2;
        }
        change = 1;
    }
    return change;
}

//item ha_find_all
/* Finds the Jacobian at once. Where there are no derivatives, or no rates beside the state, columns stay as they are. */
static void ha_find_all(ha_model *m, double t, $real h, const $real *x)
{
    int group;
    if (!m->jacobian_known) {
        $ha_fill(m->jacobian, $0.0, $NONZEROS);
    }
    $ha_copy(m->at, x, HA_NX);
//if compares_rates
    $ha_copy(m->rates_at, m->last_rates, HA_NX);
//end
//if knows_common
    $ha_find_common(m, t);
//end
    for (group = 0; group < $GROUPS; ++group) {
        (void)$ha_find_columns(m, t, h, group, m->jacobian);
    }
    m->jacobian_scale = $0.0;
    m->jacobian_known = 1;
    m->jacobian_steps = 0;
//if finds_by_parts
    m->next_steps = 0;
//end
}

//if finds_by_parts
//item ha_want_next
/* From now on a Jacobian at this state is found, unless one is. */
static void ha_want_next(ha_model *m, const $real *x)
{
    if (!m->next_steps) {
        m->next_steps = $STEPS_TO_FIND;
        $ha_copy(m->next_at, x, HA_NX);
    }
}

//if compares_rates
//item ha_find_rates_at
/* Computes the rates at m->at. Whether there are any. */
static int ha_find_rates_at(ha_model *m, double t)
{
//if knows_common
    if (m->common_known) {
        $ha_copy(m->rates_at, m->common, HA_NX);
        return 1;
    }
//end
    if ($model_rates(m, t, m->at, m->rates_at) != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return 0;
    }
    return 1;
}

//end
//item ha_find_some
/* Finds some columns of the Jacobian that is to follow, which takes the place of the present one where it is whole. */
static void ha_find_some(ha_model *m, double t, $real h)
{
    const int begin = ($STEPS_TO_FIND - m->next_steps) * $GROUPS;
    const int end = begin + $GROUPS;
    int group;
    $ha_copy(m->at, m->next_at, HA_NX);
//if knows_common
    $ha_find_common(m, t);
//end
//if compares_rates
    if (!$ha_find_rates_at(m, t)) {
        m->next_steps = 0;
        return;
    }
//end
    /* Neighbours, which are computed by the same code. */
    for (group = (begin + $STEPS_TO_FIND - 1) / $STEPS_TO_FIND; group * $STEPS_TO_FIND < end; ++group) {
        if (!$ha_find_columns(m, t, h, group, m->next_jacobian)) {
            m->next_steps = 0;
            return;
        }
    }
    m->next_steps -= 1;
    if (m->next_steps == 0) {
        $ha_copy(m->jacobian, m->next_jacobian, $NONZEROS);
        m->jacobian_scale = $0.0;
        m->jacobian_steps = 0;
    }
}

//end
//item ha_look_along
/* Looks at the Jacobian, and sees to another one where it is due. Whether it has been found at once. */
static int ha_look_along(ha_model *m, double t, $real h, const $real *x)
{
    const int change = $ha_change_along(m, t, h, x);
//if finds_by_parts
    if (change == 1) {
        $ha_want_next(m, x);
        return 0;
    }
//end
    if (change) {
        $ha_find_all(m, t, h, x);
    }
    return change;
}

//item ha_renew
/* Finds the Jacobian anew where it is due. */
static void ha_renew(ha_model *m, double t, $real h, const $real *x, int goes_on)
{
//if finds_by_parts
    const int follows = m->next_steps > 0;
    const int looks = m->jacobian_doubted || (!follows && m->jacobian_steps + goes_on >= 8);
    const int finds = follows && (m->next_waits || !(looks || !m->before_counts));
    m->next_waits = follows && !finds;
//else
    const int looks = m->jacobian_doubted || m->jacobian_steps + goes_on >= 8;
//end
    m->jacobian_doubted = 0;
    m->jacobian_steps += goes_on;
    if (!m->jacobian_known) {
        $ha_find_all(m, t, h, x);
    } else if (looks) {
        m->jacobian_steps = 0;
        (void)$ha_look_along(m, t, h, x);
    }
//if finds_by_parts
    if (finds && m->next_steps) {
        $ha_find_some(m, t, h);
    }
//end
}

//item ha_factor_kept
/* Factors 1 - scale * Jacobian, unless it has been. */
static int ha_factor_kept(ha_model *m, double t, $real scale)
{
    int column;
    int i;
    int j;
    if ($fabs(m->jacobian_scale - scale) <= $CLOSE_TO_ROUNDING * scale) {
        return $MODEL_OK;
    }
    m->jacobian_scale = scale;
    $ha_set_unit(m);
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

//item ha_solve_on
/* What is added to the move that goes on as the step before did, m->move_on: in m->correction. */
static int ha_solve_on(ha_model *m, double t, $real h, $real ratio, const $real *x)
{
    const $real twice = $2.0 * ratio;
    const $real own = ($1.0 + twice) / ($1.0 + ratio);
    const int status = $ha_factor_kept(m, t, h / own);
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        const $real now = ($1.0 + ratio) * m->last_rates[i];
        const $real then = ratio * m->before_rates[i];
        const $real way = h * (now - then);
        m->move_on[i] = ratio * (x[i] - m->before_from[i]);
        m->correction[i] = (way - m->move_on[i]) / own;
    }
    $ha_matrix_solve(m, m->correction);
    return $MODEL_OK;
}

//item ha_is_doubtful
/* Whether the end of a step is far from where the one before leads. */
static int ha_is_doubtful(const ha_model *m, const $real *x)
{
    int i;
    for (i = 0; i < HA_NX; ++i) {
        const $real added = $fabs(m->correction[i]);
        if (!$ha_finite(added) || (added > $2.0 * $fabs(m->move_on[i]) && added > $0.1 * $fabs(x[i]))) {
            return 1;
        }
    }
    return 0;
}

//item ha_begin
/* The end of a step without one before it, in m->trial: of order 1, or of order 2. */
static int ha_begin(ha_model *m, double t, $real h, int order, const $real *x)
{
    const double end = t + $widen(h);
    int status = $ha_factor_kept(m, t, h);
    int i;
    if (status == $MODEL_OK) {
        status = $model_rates(m, end, x, m->product);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        m->way[i] = h * m->product[i];
    }
    $ha_matrix_solve(m, m->way);
    for (i = 0; i < HA_NX; ++i) {
        m->trial[i] = x[i] + m->way[i];
    }
    if (order == 1) {
        return $MODEL_OK;
    }
    if ($model_rates(m, end, m->trial, m->point) != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return $MODEL_OK;
    }
    for (i = 0; i < HA_NX; ++i) {
        const $real beyond = h * (m->point[i] - (m->product[i] - m->last_rates[i]));
        const $real twice = $2.0 * m->way[i];
        m->point[i] = beyond - twice;
    }
    $ha_matrix_solve(m, m->point);
    for (i = 0; i < HA_NX; ++i) {
        const $real first = $1.5 * m->way[i];
        const $real second = $0.5 * m->point[i];
        m->trial[i] = x[i] + (first + second);
    }
    return $MODEL_OK;
}

//item ha_solve_step
/* The end of the step, in m->trial; where it is doubtful, once more with a new Jacobian. */
static int ha_solve_step(ha_model *m, double t, $real h, const $real *x)
{
    const $real ratio = h / m->before_length;
    int i;
    if (m->before_counts && $ha_ends_at(m->before_end, m->before_length, t) && ratio <= $20.0) {
        const int status = $ha_solve_on(m, t, h, ratio, x);
        if (status != $MODEL_OK) {
            return status;
        }
        if ($ha_is_doubtful(m, x) && $ha_look_along(m, t, h, x)) {
            return $ha_begin(m, t, h, 1, x);
        }
        for (i = 0; i < HA_NX; ++i) {
            m->trial[i] = x[i] + (m->move_on[i] + m->correction[i]);
        }
        return $MODEL_OK;
    }
    return $ha_begin(m, t, h, 2, x);
}

//item ha_method
/* From t to t + h: the end in m->trial. The step that ended at t has been accepted. */
static int ha_method(ha_model *m, double t, $real h, const $real *x)
{
    const int goes_on = m->last_counts && $ha_ends_at(m->last_end, m->last_length, t);
    int status;
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
    $ha_copy(m->last_from, x, HA_NX);
    m->last_end = t + $widen(h);
    m->last_length = h;
    m->last_counts = 1;
    return $MODEL_OK;
}

//entry ha_prepare
/* Finds the Jacobian where a run begins, and factors it, so that the first step does not. Where there are no rates, or no factors, that
 * step tells. */
static void ha_prepare(ha_model *m)
{
    const $real h = $narrow(m->step);
    if ($model_rates(m, m->t, m->x, m->last_rates) == $MODEL_OK) {
        $ha_renew(m, m->t, h, m->x, 0);
        (void)$ha_factor_kept(m, m->t, h);
    }
    m->failure.code = $MODEL_OK;
}
