
//section
/* ---- parameters and the start ---- */

//item ha_start_states
static const $real ha_start_states[] = {
$START_STATES
};
//if conserved
//item ha_start_conserved
static const $real ha_start_conserved[] = {
$START_CONSERVED
};
//end
//if positions
//item ha_start_positions
static const $real ha_start_positions[] = {
$START_POSITIONS
};
//end

//if sought_positions
//item ha_seek_positions
/* Of several positions that fit, the one of the start comes next. */
static void ha_seek_positions(ha_model *m)
{
    static const int sought[] = {$SOUGHT};
    static const int places[] = {$SOUGHT_PLACES};
    int i;
    for (i = 0; i < $SOUGHT_COUNT; ++i) {
        m->memory[places[i]] = m->positions[sought[i]];
    }
}

//end
//item ha_parameters
/* What was kept for other parameters is forgotten. */
static int ha_parameters(ha_model *m)
{
    int status;
    int i;
//if linear_constant
    for (i = 0; i < $FACTORED; ++i) {
        m->factored[i] = 0;
    }
//end
//if newton
    for (i = 0; i < $BLOCKS; ++i) {
        m->following[i] = 0;
//if sought_positions
        m->motion_known[i] = 0;
//end
    }
    if (!m->begun) {
        $ha_fill(m->memory, $0.0, $MEMORY);
//if sought_positions
        $ha_seek_positions(m);
//end
    }
//end
    status = $ha_preamble_code(m);
//if domains_always
    if (status == $MODEL_OK) {
        status = $ha_check_domains(m);
    }
//end
    if (status != $MODEL_OK) {
        return status;
    }
//if inputs
    {
        $real defaults[HA_NU];
        $ha_defaults_code(m, defaults);
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
    m->broken = $ha_broken(m);
    if (m->broken) {
        return $ha_fail(m, $MODEL_STRUCTURE, m->broken - 1, ((double)NAN));
    }
//end
    return $MODEL_OK;
}

//item ha_restart
/* Forgets a run: the next crossing is its start. */
static void ha_restart(ha_model *m)
{
    m->begun = 0;
    m->crossed = -HUGE_VAL;
//if clocks
    m->clock_hold = HA_FOLLOW;
//end
//if switches
    m->state_hold = HA_FOLLOW;
//end
//if newton
    {
        int i;
        for (i = 0; i < $BLOCKS; ++i) {
            m->following[i] = 0;
//if sought_positions
            m->motion_known[i] = 0;
//end
        }
        $ha_fill(m->memory, $0.0, $MEMORY);
//if sought_positions
        $ha_seek_positions(m);
//end
    }
//end
//if switches
    m->signs_taken = (double)NAN;
//end
//if discretes
    {
        static const int places[] = {$DISCRETE_PLACES};
        $real starts[$DISCRETES];
        int i;
        $ha_discretes_code(m, starts);
        for (i = 0; i < $DISCRETES; ++i) {
            m->z[places[i]] = starts[i];
        }
    }
//end
//if clauses
    {
        int i;
        for (i = 0; i < $CLAUSES; ++i) {
            m->clauses[i].next = HUGE_VAL;
            m->clauses[i].holds = 0;
            m->clauses[i].fired = 0;
        }
    }
//end
//if periodic_clauses
    {
        static const int periodic[] = {$PERIODIC};
        double periods[$PERIODICS];
        int i;
        $ha_periods_code(m, periods);
        for (i = 0; i < $PERIODICS; ++i) {
            m->clauses[periodic[i]].period = periods[i];
        }
    }
//end
//if held
    {
        double times[HA_NZ];
        $ha_times_code(m, times);
//if delays
        {
            static const int places[] = {$DELAY_PLACES};
            int d;
            for (d = 0; d < $DELAYS; ++d) {
                m->delays[d].time = times[places[d]];
                m->delays[d].start = (double)NAN;
                m->delays[d].first = 0;
                m->delays[d].count = 0;
                m->delays[d].full = 0;
            }
        }
//end
//if samples
        {
            static const int held[] = {$SAMPLE_PLACES};
            int s;
            for (s = 0; s < $SAMPLES; ++s) {
                m->samples[s].period = times[held[s]];
                m->samples[s].value = $0.0;
                m->samples[s].next = (double)NAN;
                m->samples[s].taken = (double)NAN;
            }
        }
//end
    }
//end
}

//always
int $model_reset($model *m)
{
    memset(m, 0, sizeof *m);
    m->step = $STEP_LENGTH;
//if newton
    m->most_evaluations = 2000;
//end
//if positions
    $ha_copy(m->positions, $ha_start_positions, HA_NQ);
//end
    return $ha_parameters(m);
}

int $model_set_parameter($model *m, int parameter, double value)
{
//if parameters
    static const unsigned char constant[] = {
$CONSTANT_PARAMETERS
    };
    if (parameter < 0 || parameter >= HA_NP || constant[parameter] || !$$ha_finite(value)) {
        return $ha_fail(m, $MODEL_BAD_PARAMETER, parameter < 0 || parameter >= HA_NP ? 0 : parameter, m->t);
    }
//if single
    if (!$ha_fits(value)) {
        return $ha_fail(m, $MODEL_OUT_OF_RANGE, parameter, m->t);
    }
    m->p_exact[parameter] = value;
//end
    m->p[parameter] = $narrow value;
    m->set[parameter] = 1;
    m->changed = 1;
    m->cross_due = 1;
    m->failure.code = $MODEL_OK;
    return $ha_parameters(m);
//else
    (void)parameter;
    (void)value;
    return $ha_fail(m, $MODEL_BAD_PARAMETER, 0, m->t);
//end
}

