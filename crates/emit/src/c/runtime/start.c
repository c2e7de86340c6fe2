
/* ---- parameters and the start ---- */

static const double ha_start_states[] = {
START_STATES
};
//if conserved
static const double ha_start_conserved[] = {
START_CONSERVED
};
//end

/* What was kept for other parameters is forgotten. */
static int ha_parameters(ha_model *m)
{
    int status;
    int i;
//if linear_constant
    for (i = 0; i < FACTORED; ++i) {
        m->factored[i] = 0;
    }
//end
//if newton
    for (i = 0; i < BLOCKS; ++i) {
        m->following[i] = 0;
    }
    if (!m->begun) {
        ha_fill(m->memory, 0.0, MEMORY);
    }
//end
    status = ha_preamble_code(m);
//if domains_always
    if (status == MODEL_OK) {
        status = ha_check_domains(m);
    }
//end
    if (status != MODEL_OK) {
        return status;
    }
//if inputs
    {
        double defaults[HA_NU];
        ha_defaults_code(m, defaults);
        for (i = 0; i < HA_NU; ++i) {
            if (m->u[i] == m->u_default[i]) {
                m->u[i] = defaults[i];
            }
            m->u_default[i] = defaults[i];
        }
    }
//else
    (void)i;
//end
//if assumptions
    m->broken = ha_broken(m);
    if (m->broken) {
        return ha_fail(m, MODEL_STRUCTURE, m->broken - 1, HA_WIDE((double)NAN));
    }
//end
    return MODEL_OK;
}

/* Forgets a run: the next crossing is its start. */
static void ha_restart(ha_model *m)
{
    m->begun = 0;
    m->crossed = HA_WIDE(-HUGE_VAL);
//if clocks
    m->clock_hold = HA_FOLLOW;
//end
//if switches
    m->state_hold = HA_FOLLOW;
//end
//if newton
    {
        int i;
        for (i = 0; i < BLOCKS; ++i) {
            m->following[i] = 0;
        }
        ha_fill(m->memory, 0.0, MEMORY);
    }
//end
//if held
    {
        ha_wide times[HA_NZ];
        ha_times_code(m, times);
//if delays
        {
            static const int places[] = {DELAY_PLACES};
            int d;
            for (d = 0; d < DELAYS; ++d) {
                m->delays[d].time = times[places[d]];
                m->delays[d].start = HA_WIDE((double)NAN);
                m->delays[d].first = 0;
                m->delays[d].count = 0;
                m->delays[d].full = 0;
            }
        }
//end
//if samples
        {
            static const int held[] = {SAMPLE_PLACES};
            int s;
            for (s = 0; s < SAMPLES; ++s) {
                m->samples[s].period = times[held[s]];
                m->samples[s].value = 0.0;
                m->samples[s].next = HA_WIDE((double)NAN);
                m->samples[s].taken = HA_WIDE((double)NAN);
            }
        }
//end
    }
//end
}

int MODEL_reset(MODEL *m)
{
    memset(m, 0, sizeof *m);
    m->step = HA_WIDE(STEP_LENGTH);
//if newton
    m->most_evaluations = 2000;
//end
    return ha_parameters(m);
}

int MODEL_set_parameter(MODEL *m, int parameter, ha_wide value)
{
//if parameters
    static const unsigned char constant[] = {
CONSTANT_PARAMETERS
    };
    if (parameter < 0 || parameter >= HA_NP || constant[parameter] || !HA_WIDE(ha_finite(value))) {
        return ha_fail(m, MODEL_BAD_PARAMETER, parameter < 0 || parameter >= HA_NP ? 0 : parameter, m->t);
    }
//if single
    if (!ha_fits(value)) {
        return ha_fail(m, MODEL_OUT_OF_RANGE, parameter, m->t);
    }
    m->p_exact[parameter] = value;
//end
    m->p[parameter] = ha_narrow(value);
    m->set[parameter] = 1;
    m->changed = 1;
    m->cross_due = 1;
    m->failure.code = MODEL_OK;
    return ha_parameters(m);
//else
    (void)parameter;
    (void)value;
    return ha_fail(m, MODEL_BAD_PARAMETER, 0, m->t);
//end
}

//if solves_start
START_CODE
//end
/* The state at the start: as exported, or solved for other parameters, inputs or times. */
static int ha_start_values(ha_model *m, ha_wide t)
{
    int exported = HA_WIDE(t == 0.0) && !m->changed;
    int i;
    for (i = 0; i < HA_NU; ++i) {
        if (m->u[i] != m->u_default[i]) {
            exported = 0;
        }
    }
    if (exported) {
        ha_copy(m->x, ha_start_states, HA_NX);
//if conserved
        ha_copy(m->k, ha_start_conserved, HA_NK);
//end
        return MODEL_OK;
    }
//if solves_start
    return ha_solve_start(m, t);
//else
    ha_fill(m->x, 0.0, HA_NX);
    return MODEL_OK;
//end
}

int MODEL_start_from(MODEL *m, ha_wide t, const double *x)
{
    int status;
    ha_restart(m);
    m->failure.code = MODEL_OK;
    m->t = t;
    if (x != m->x) {
        ha_copy(m->x, x, HA_NX);
    }
    ha_ticks_from(m, t);
//if single
    ha_fill(m->rest, 0.0, HA_NX);
//end
    status = MODEL_cross(m, t, m->x);
    if (status == MODEL_OK) {
        status = MODEL_accept(m, t, m->x);
    }
    return status == MODEL_OK ? MODEL_observe(m, t, m->x, m->y) : status;
}

int MODEL_start(MODEL *m, ha_wide t)
{
    int status;
    m->failure.code = MODEL_OK;
    ha_restart(m);
//if assumptions
    if (m->broken) {
        return ha_fail(m, MODEL_STRUCTURE, m->broken - 1, HA_WIDE((double)NAN));
    }
//end
    status = ha_start_values(m, t);
    return status == MODEL_OK ? MODEL_start_from(m, t, m->x) : status;
}
