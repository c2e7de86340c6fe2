
/* ---- stages of a step ---- */

/* out = x + h * sum of weight * rates. */
static void ha_advance(const ha_model *m, const double *x, double h, const double *weights, int stages, double *out)
{
    int stage;
    int i;
    for (i = 0; i < HA_NX; ++i) {
        double sum = -0.0;
        for (stage = 0; stage < stages; ++stage) {
            const double part = weights[stage] * m->stages[stage * HA_NX + i];
            sum += part;
        }
        sum *= h;
        out[i] = x[i] + sum;
    }
}
