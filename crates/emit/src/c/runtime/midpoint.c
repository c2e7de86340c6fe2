
//section
/* ---- the implicit midpoint rule: Newton with the exact Jacobian ---- */

//item ha_correct
/* One Newton iteration on the midpoint. */
static int ha_correct(ha_model *m, double t, $real half, const $real *x)
{
    int status = $model_rates(m, t, m->middle, m->stages);
    int i;
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        m->sizes[i] = $fabs(x[i]);
    }
    status = $ha_step_matrix(m, t, m->middle, half);
    if (status != $MODEL_OK) {
        return status;
    }
    for (i = 0; i < HA_NX; ++i) {
        const $real move = half * m->stages[i];
//if single
        m->correction[i] = move - m->half_way[i];
//else
        const $real end = x[i] + move;
        m->correction[i] = end - m->middle[i];
//end
    }
    $ha_matrix_solve(m, m->correction);
    for (i = 0; i < HA_NX; ++i) {
//if single
        m->half_way[i] += m->correction[i];
        m->middle[i] = x[i] + m->half_way[i];
//else
        m->middle[i] += m->correction[i];
//end
    }
    return $MODEL_OK;
}

//item ha_relative_correction
/* The greatest correction, each relative to its state or to what its equation adds up. */
static $real ha_relative_correction(const ha_model *m)
{
    $real most = $0.0;
    int i;
    for (i = 0; i < HA_NX; ++i) {
        const $real size = $ha_max($ha_max($fabs(m->middle[i]), m->sizes[i]), $ha_known_size(m, i));
        const $real relative = m->correction[i] == $0.0 ? $0.0 : $fabs(m->correction[i]) / size;
        if (relative > most || relative != relative) {
            most = relative;
        }
    }
    return most;
}

//item ha_method
/* From t to t + h: the end in m->trial. */
static int ha_method(ha_model *m, double t, $real h, const $real *x)
{
    const double middle_time = t + $widen($0.5 * h);
    int iteration;
    int i;
    $ha_copy(m->middle, x, HA_NX);
//if single
    $ha_fill(m->half_way, $0.0, HA_NX);
//end
    for (iteration = 0; iteration < 20; ++iteration) {
        const int status = $ha_correct(m, middle_time, $0.5 * h, x);
        if (status != $MODEL_OK) {
            return status;
        }
        if ($ha_relative_correction(m) <= $CLOSE_TO_ROUNDING) {
            for (i = 0; i < HA_NX; ++i) {
//if single
                $ha_move(m, x, i, $2.0 * m->half_way[i]);
//else
                m->trial[i] = $2.0 * m->middle[i] - x[i];
//end
            }
            return $MODEL_OK;
        }
    }
    return $ha_fail(m, $MODEL_NO_STEP, 0, middle_time);
}
