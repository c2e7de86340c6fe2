
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

//item ha_restart
/* Forgets a run: the next crossing is its start. */
static void ha_restart(ha_model *m)
{
//if modes
    m->switched = 0;
//end
//if exchanges
    m->exchanged_at = (double)NAN;
    m->pivots_known = 0;
    m->exchange_due = 0;
    {
        int i;
        for (i = 0; i < $EXCHANGED; ++i) {
            m->taken_over[i] = 0;
        }
    }
//end
//if bounds
    m->gaps_at = (double)NAN;
    m->let_go_at = (double)NAN;
    m->last_step = 0.0;
    $ha_fill(m->floors, $0.0, $CONDITIONS);
    $ha_fill(m->most_beyond, $0.0, HA_NG);
    $ha_fill(m->most_margins, $0.0, $MOST_MARGINS);
    $ha_fill(m->most_groups, $0.0, $GROUPS_COMPARED);
    $ha_fill(m->most_values, $0.0, $SYMBOLS);
    $ha_fill(m->most_rates, $0.0, $SYMBOLS);
    $ha_fill(m->most_stored, $0.0, $SYMBOLS);
//end
    m->begun = 0;
    m->crossed = -HUGE_VAL;
//if clocks
    m->clock_hold = HA_FOLLOW;
//end
//if switches
    m->state_hold = HA_FOLLOW;
//end
//if newton
    $ha_forget_solutions(m);
    $ha_fill(m->memory, $0.0, $MEMORY);
//if sought_positions
    $ha_seek_positions(m);
//end
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

//public $model_reset
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

//public $model_set_parameter
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

