
//section
/* ---- an explicit Runge-Kutta method ---- */

//item ha_method
/* From t to t + h: the end in m->trial. */
static int ha_method(ha_model *m, double t, $real h, const $real *x)
{
    static const $real nodes[] = {$NODES};
    static const $real weights[][$STAGES] = {$WEIGHTS};
    int stage;
    for (stage = 0; stage < $STAGES; ++stage) {
//if single
        const double part = (double)(nodes[stage] * h);
//else
        const double part = nodes[stage] * h;
//end
        int status;
        $ha_advance(m, x, h, weights[stage], stage, m->trial);
        status = $model_rates(m, t + part, m->trial, m->stages + stage * HA_NX);
        if (status != $MODEL_OK) {
            return status;
        }
    }
    $ha_arrive(m, x, h, weights[$STAGES]);
    return $MODEL_OK;
}
