
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

//if single
/* Adds a move to a state; what is less than its last digit is carried on to the next step. */
static void ha_move(ha_model *m, const double *x, int i, double move)
{
    const double all = move + m->rest[i];
    const double end = x[i] + all;
    m->trial[i] = end;
    m->trial_rest[i] = all - (end - x[i]);
}

//end
/* The end of the step, in m->trial. */
static void ha_arrive(ha_model *m, const double *x, double h, const double *weights)
{
//if single
    int i;
    ha_fill(m->beside, 0.0, HA_NX);
    ha_advance(m, m->beside, h, weights, STAGES, m->dx);
    for (i = 0; i < HA_NX; ++i) {
        ha_move(m, x, i, m->dx[i]);
    }
//else
    ha_advance(m, x, h, weights, STAGES, m->trial);
//end
}
