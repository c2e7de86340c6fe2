
/* ---- an explicit Runge-Kutta method ---- */

/* From t to t + h: the end in m->trial. */
static int ha_method(ha_model *m, ha_wide t, double h, const double *x)
{
    static const double nodes[] = {NODES};
    static const double weights[][STAGES] = {WEIGHTS};
    int stage;
    for (stage = 0; stage < STAGES; ++stage) {
        const ha_wide part = ha_widen(nodes[stage] * h);
        int status;
        ha_advance(m, x, h, weights[stage], stage, m->trial);
        status = MODEL_rates(m, t + part, m->trial, m->stages + stage * HA_NX);
        if (status != MODEL_OK) {
            return status;
        }
    }
    ha_arrive(m, x, h, weights[STAGES]);
    return MODEL_OK;
}
