
//section
/* ---- what is held at jumps, and followed from one step to the next ---- */

//if held
//item ha_sources
/* Values and rates of what is delayed or sampled. */
static int ha_sources(ha_model *m, double t, const $real *x)
{
    const int status = $model_rates(m, t, x, m->dx);
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_let_time_pass(m, t);
    $ha_copy(m->along + HA_STATES_AT, m->dx, HA_NX);
    return $ha_sources_along(m, t, x, m->along, m->source, m->source_rate);
}

//item ha_begin_held
/* Held signals at the start of a run. They may read each other: passes until nothing changes. */
static int ha_begin_held(ha_model *m, double t, const $real *x)
{
    int pass;
    for (pass = 0; pass < HA_NZ; ++pass) {
        const int status = $ha_sources(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
//if delays
        {
            static const int places[] = {$DELAY_PLACES};
            int d;
            for (d = 0; d < $DELAYS; ++d) {
                $ha_delay_begin(m, d, t, m->source[places[d]], m->source_rate[places[d]]);
            }
        }
//end
//if samples
        {
            static const int held[] = {$SAMPLE_PLACES};
            int s;
            for (s = 0; s < $SAMPLES; ++s) {
                m->samples[s].value = m->source[held[s]];
                m->samples[s].taken = t;
                m->samples[s].next = floor(t / m->samples[s].period);
                $ha_sample_pass(m, s, t);
            }
        }
//end
    }
    return $MODEL_OK;
}

//end
//if samples
//item ha_take_samples
/* Takes the samples that are due, in order: each sees those taken before it. One that was taken at this very instant is
 * taken again if an input or a parameter has changed. */
static int ha_take_samples(ha_model *m, double t, const $real *x)
{
    static const int held[] = {$SAMPLE_PLACES};
    int s;
    for (s = 0; s < $SAMPLES; ++s) {
        if (t >= $ha_sample_next(m, s) || (m->cross_due && t == m->samples[s].taken)) {
            const int status = $ha_sources(m, t, x);
            if (status != $MODEL_OK) {
                return status;
            }
            m->samples[s].value = m->source[held[s]];
            m->samples[s].taken = t;
            $ha_sample_pass(m, s, t);
        }
    }
    return $MODEL_OK;
}

//end
//if moving_positions
//item ha_note_motion
/* Notes how the positions of some blocks move at (t, x), where they have been accepted, by code that computes so many rates. */
static int ha_note_motion(ha_model *m, double t, const $real *x, ha_code code, int first, int last, int count)
{
    static const int blocks[] = {$MOTION_BLOCKS};
    const $real *rates = m->moves;
    int status;
    int b;
    int i;
    for (b = first; b < last; ++b) {
        m->motion_passed[blocks[b]] = t - m->motion_time[blocks[b]];
        m->motion_time[blocks[b]] = t;
    }
    status = $MODEL_OK;
//if moves_ahead
    if (first == 0 && $ha_is_found_ahead(m, t, x)) {
        $ha_copy(m->moves, m->ahead + $SWITCHES, count);
    } else {
        status = $ha_run(m, code, t, x, m->moves, count);
    }
//else
    status = $ha_run(m, code, t, x, m->moves, count);
//end
    if (status != $MODEL_OK) {
        return status;
    }
    for (b = first; b < last; ++b) {
        const int number = blocks[b];
        const ha_newton w = $ha_newton_of(m, number);
        const $real passed = $narrow(m->motion_passed[number]);
        const int known = m->motion_known[number];
        m->motion_known[number] = $ha_all_finite(rates, w.n);
        if (m->motion_known[number]) {
            const int turns = known && m->motion_passed[number] != 0.0
                && $ha_turns(&w, m->motion_short[number], passed, rates);
            for (i = 0; i < w.n; ++i) {
                if (!known) {
                    w.bends[i] = $0.0;
                } else if (m->motion_passed[number] != 0.0) {
                    w.bends[i] = (rates[i] - w.rates[i]) / passed;
                }
                w.rates[i] = rates[i];
            }
            if (turns) {
                static const int origins[] = {$MOTION_ORIGINS};
                return $ha_fail(m, $MODEL_OFF_MOTION, origins[b], t);
            }
        }
        rates += w.n;
    }
    return $MODEL_OK;
}

//end
//if newton
//item ha_leave_solutions
/* Any solution may come next. */
static void ha_leave_solutions(ha_model *m)
{
    int i;
    for (i = 0; i < $BLOCKS; ++i) {
        m->following[i] = 0;
        m->fresh[i] = 0;
//if sought_positions
        m->motion_known[i] = 0;
//end
    }
}

//end
//if newton
//item ha_forget_solutions
/* Any solution may come next, and the previous one may be none. */
static void ha_forget_solutions(ha_model *m)
{
    int i;
    $ha_leave_solutions(m);
    for (i = 0; i < $BLOCKS; ++i) {
        m->settled[i] = 0;
    }
}

//end
//if rates_newton
//item ha_solve
/* The solutions of the Newton blocks that rates read, at (t, x). */
static int ha_solve(ha_model *m, double t, const $real *x)
{
    return $ha_run(m, $ha_solutions_code, t, x, m->solutions, $SOLUTIONS_OF_RATES);
}

//end
//if follows
//item ha_follow_solutions
/* Goes on with the Newton solutions at (t, x). */
static int ha_follow_solutions(ha_model *m, double t, const $real *x)
{
    int status = $MODEL_OK;
//if rates_newton
    {
        static const int blocks[] = {$RATES_BLOCKS};
        int i;
        status = $ha_solve(m, t, x);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < $RATES_BLOCK_COUNT; ++i) {
            $ha_newton_accept(m, blocks[i]);
//if looks_ahead
            if (!m->fresh[blocks[i]]) {
                $ha_forget_ahead(m);
            }
//end
        }
//if rates_motion
        status = $ha_note_motion(m, t, x, $ha_motion_code, 0, $MOTION_OF_RATES, $MOTION_COUNT);
        if (status != $MODEL_OK) {
            return status;
        }
//end
    }
//end
//if shown_newton
    {
        static const int blocks[] = {$SHOWN_BLOCKS};
        int i;
        status = $ha_run(m, $ha_observe_code, t, x, m->shown, HA_NY);
        if (status != $MODEL_OK) {
            return status;
        }
        for (i = 0; i < $SHOWN_BLOCK_COUNT; ++i) {
            $ha_newton_accept(m, blocks[i]);
        }
//if shown_motion
        status = $ha_note_motion(m, t, x, $ha_shown_motion_code, $MOTION_OF_RATES, $MOTION_BLOCK_COUNT, $SHOWN_MOTION_COUNT);
//end
    }
//end
    return status;
}

//end
//public $model_accept
int $model_accept($model *m, double t, const $real *x)
{
    int status = $MODEL_OK;
//if delays
    static const int places[] = {$DELAY_PLACES};
    int d;
//end
//if returns
    status = $ha_watch_returns(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
//end
//if delays
    status = $ha_sources(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    for (d = 0; d < $DELAYS; ++d) {
        $ha_delay_append(m, d, t, m->source[places[d]], m->source_rate[places[d]]);
        if (m->delays[d].full) {
            return $ha_fail(m, $MODEL_NO_ROOM, d, t);
        }
    }
//end
//if follows
    status = $ha_follow_solutions(m, t, x);
//end
    (void)m;
    (void)t;
    (void)x;
    return status;
}

//public $model_next_jump
double $model_next_jump($model *m, double t)
{
    double next = HUGE_VAL;
    (void)m;
    (void)t;
//if delays
    {
        int d;
        for (d = 0; d < $DELAYS; ++d) {
            const double at = $ha_delay_next(m, d, t);
            if (at > t && at < next) {
                next = at;
            }
        }
    }
//end
//if samples
    {
        int s;
        for (s = 0; s < $SAMPLES; ++s) {
            const double at = $ha_sample_next(m, s);
            if (at > t && at < next) {
                next = at;
            }
        }
    }
//end
//if periodic_clauses
    {
        static const int periodic[] = {$PERIODIC};
        int i;
        for (i = 0; i < $PERIODICS; ++i) {
            const $model_clause *c = &m->clauses[periodic[i]];
            const double at = c->next * c->period;
            if (at > t && at < next) {
                next = at;
            }
        }
    }
//end
//if clocks
    if (m->clock_next > t && m->clock_next < next) {
        next = m->clock_next;
    }
//end
    return next;
}

//if rates_motion
//public $model_follow
/* An importer may not tell of every step: positions are followed from each point at which it asks for rates, which have just
 * been found. */
int $model_follow($model *m, double t, const $real *x)
{
    static const int blocks[] = {$MOTION_BLOCKS};
    const $real *rates = m->moves;
    int status = $ha_run(m, $ha_motion_code, t, x, m->moves, $MOTION_COUNT);
    int b;
    if (status != $MODEL_OK) {
        return status;
    }
    for (b = 0; b < $MOTION_OF_RATES; ++b) {
        static const int origins[] = {$MOTION_ORIGINS};
        const int number = blocks[b];
        const ha_newton w = $ha_newton_of(m, number);
        if (m->motion_known[number] && m->motion_time[number] != t
            && $ha_turns(&w, m->motion_short[number], $narrow(t - m->motion_time[number]), rates)) {
            return $ha_fail(m, $MODEL_OFF_MOTION, origins[b], t);
        }
        rates += w.n;
    }
    rates = m->moves;
    for (b = 0; b < $MOTION_OF_RATES; ++b) {
        const int number = blocks[b];
        const ha_newton w = $ha_newton_of(m, number);
        $ha_newton_accept(m, number);
        m->motion_known[number] = $ha_all_finite(rates, w.n);
        m->motion_time[number] = t;
        $ha_copy(w.rates, rates, w.n);
        $ha_fill(w.bends, $0.0, w.n);
        rates += w.n;
    }
    return $MODEL_OK;
}

//end
