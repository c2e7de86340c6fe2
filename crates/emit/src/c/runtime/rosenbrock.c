
/* ---- a linearly implicit method: one matrix and a fixed number of stages ---- */

/* From t to t + h: the end in m->trial. */
static int ha_method(ha_model *m, ha_wide t, double h, const double *x)
{
    static const double nodes[] = {NODES};
    static const double time_weights[] = {TIME_WEIGHTS};
    static const int repeats[] = {REPEATS};
    static const double states[][STAGES] = {WEIGHTS};
    static const double right[][STAGES] = {RIGHT_WEIGHTS};
    const double scale = h * GAMMA;
    int status = ha_time_derivative(m, t, x, m->correction);
    int stage;
    int i;
    int j;
    if (status == MODEL_OK) {
        ha_fill(m->sizes, 0.0, HA_NX);
        status = ha_step_matrix(m, t, x, scale);
    }
    if (status != MODEL_OK) {
        return status;
    }
    for (stage = 0; stage < STAGES; ++stage) {
        double *own = m->stages + stage * HA_NX;
        if (!repeats[stage]) {
            const ha_wide part = ha_widen(nodes[stage] * h);
            ha_advance(m, x, 1.0, states[stage], stage, m->trial);
            status = MODEL_rates(m, t + part, m->trial, m->middle);
            if (status != MODEL_OK) {
                return status;
            }
        }
        for (i = 0; i < HA_NX; ++i) {
            const double by_time = time_weights[stage] * h * m->correction[i];
            const double rate = scale * (m->middle[i] + by_time);
            double sum = -0.0;
            for (j = 0; j < stage; ++j) {
                const double part = right[stage][j] * m->stages[j * HA_NX + i];
                sum += part;
            }
            sum *= GAMMA;
            own[i] = rate + sum;
        }
        ha_dense_solve(m, own);
    }
    ha_arrive(m, x, 1.0, states[STAGES]);
    return MODEL_OK;
}
