//item ha_start_values
/* The state at the start: as exported, or solved for other parameters, inputs or times. */
static int ha_start_values(ha_model *m, double t)
{
    int exported = (t == 0.0) && !m->changed;
    int i;
    for (i = 0; i < HA_NU; ++i) {
        if (m->u[i] != m->u_default[i]) {
            exported = 0;
        }
    }
    if (exported) {
        $ha_copy(m->x, $ha_start_states, HA_NX);
//if conserved
        $ha_copy(m->k, $ha_start_conserved, HA_NK);
//end
//if positions
        $ha_copy(m->positions, $ha_start_positions, HA_NQ);
//end
        return $MODEL_OK;
    }
//if solves_start
    return $ha_solve_start(m, t);
//else
    $ha_fill(m->x, $0.0, HA_NX);
    return $MODEL_OK;
//end
}

//if modes
//item ha_return
/* A run begins in the first mode. */
static int ha_return(ha_model *m)
{
    if (m->mode == 0) {
        return $MODEL_OK;
    }
    m->mode = 0;
    m->begun = 0;
    return $ha_parameters(m);
}

//end
//public $model_start_from
int $model_start_from($model *m, double t, const $real *x)
{
    int status;
//if modes
    status = $ha_return(m);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    $ha_restart(m);
    m->failure.code = $MODEL_OK;
    m->t = t;
    if (x != m->x) {
        $ha_copy(m->x, x, HA_NX);
    }
    $ha_ticks_from(m, t);
//if keeps_steps
    m->before_length = $1.0;
    $ha_forget_steps(m);
//end
//if single
    $ha_fill(m->rest, $0.0, HA_NX);
//end
    status = $model_cross(m, t, m->x);
//if relations
    if (status == $MODEL_OK) {
        status = $ha_begin_keeping(m, t, m->x);
    }
//end
    if (status == $MODEL_OK) {
        status = $model_accept(m, t, m->x);
    }
//if keeps_steps
    if (status == $MODEL_OK) {
        $ha_prepare(m);
    }
//end
    return status == $MODEL_OK ? $model_observe(m, t, m->x, m->y) : status;
}

//public $model_start
int $model_start($model *m, double t)
{
    int status;
    m->failure.code = $MODEL_OK;
//if modes
    status = $ha_return(m);
    if (status != $MODEL_OK) {
        return status;
    }
//end
    $ha_restart(m);
//if assumptions
    if (m->broken) {
        return $ha_fail(m, $MODEL_STRUCTURE, m->broken - 1, ((double)NAN));
    }
//end
    status = $ha_start_values(m, t);
    return status == $MODEL_OK ? $model_start_from(m, t, m->x) : status;
}
