
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
//entry ha_parameters
/* What was kept for other parameters is forgotten. */
static int ha_parameters(ha_model *m)
{
    int status;
    int i;
//if looks_ahead
    $ha_forget_ahead(m);
//end
//if linear_constant
    for (i = 0; i < $FACTORED; ++i) {
        m->factored[i] = 0;
    }
//end
//if newton
    $ha_forget_solutions(m);
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
