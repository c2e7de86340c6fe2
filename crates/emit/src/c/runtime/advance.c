
//section
/* ---- stages of a step ---- */

//item ha_advance
/* out = x + h * sum of weight * rates. */
static void ha_advance(const ha_model *m, const $real *x, $real h, const $real *weights, int stages, $real *out)
{
    int stage;
    int i;
    for (i = 0; i < HA_NX; ++i) {
        $real sum = -$0.0;
        for (stage = 0; stage < stages; ++stage) {
            const $real part = weights[stage] * m->stages[stage * HA_NX + i];
            sum += part;
        }
        sum *= h;
        out[i] = x[i] + sum;
    }
}

//if single
//item ha_move
/* Adds a move to a state; what is less than its last digit is carried on to the next step. */
static void ha_move(ha_model *m, const $real *x, int i, $real move)
{
    const $real all = move + m->rest[i];
    const $real end = x[i] + all;
    m->trial[i] = end;
    m->trial_rest[i] = all - (end - x[i]);
}

//end
//item ha_arrive
/* The end of the step, in m->trial. */
static void ha_arrive(ha_model *m, const $real *x, $real h, const $real *weights)
{
//if single
    int i;
    $ha_fill(m->beside, $0.0, HA_NX);
    $ha_advance(m, m->beside, h, weights, $STAGES, m->dx);
    for (i = 0; i < HA_NX; ++i) {
        $ha_move(m, x, i, m->dx[i]);
    }
//else
    $ha_advance(m, x, h, weights, $STAGES, m->trial);
//end
}
