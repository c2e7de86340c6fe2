
//section
/* ---- a linearly implicit method: one matrix and a fixed number of stages ---- */

//item ha_method
/* From t to t + h: the end in m->trial. */
static int ha_method(ha_model *m, double t, $real h, const $real *x)
{
    static const $real nodes[] = {$NODES};
    static const $real time_weights[] = {$TIME_WEIGHTS};
    static const int repeats[] = {$REPEATS};
    static const $real states[][$STAGES] = {$WEIGHTS};
    static const $real right[][$STAGES] = {$RIGHT_WEIGHTS};
    const $real scale = h * $GAMMA;
    int status = $ha_time_derivative(m, t, x, m->correction);
    int stage;
    int i;
    int j;
    if (status == $MODEL_OK) {
        $ha_fill(m->sizes, $0.0, HA_NX);
        status = $ha_step_matrix(m, t, x, scale);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    for (stage = 0; stage < $STAGES; ++stage) {
        $real *own = m->stages + stage * HA_NX;
        if (!repeats[stage]) {
//if single
            const double part = (double)(nodes[stage] * h);
//else
            const double part = nodes[stage] * h;
//end
            $ha_advance(m, x, $1.0, states[stage], stage, m->trial);
            status = $model_rates(m, t + part, m->trial, m->middle);
            if (status != $MODEL_OK) {
                return status;
            }
        }
        for (i = 0; i < HA_NX; ++i) {
            const $real by_time = time_weights[stage] * h * m->correction[i];
            const $real rate = scale * (m->middle[i] + by_time);
            $real sum = -$0.0;
            for (j = 0; j < stage; ++j) {
                const $real part = right[stage][j] * m->stages[j * HA_NX + i];
                sum += part;
            }
            sum *= $GAMMA;
            own[i] = rate + sum;
        }
        $ha_matrix_solve(m, own);
    }
    $ha_arrive(m, x, $1.0, states[$STAGES]);
    return $MODEL_OK;
}
