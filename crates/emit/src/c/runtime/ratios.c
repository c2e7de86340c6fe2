//if ratios

//section
/* ---- how fast variables move against those that are independent ---- */

//item ha_pivots_come_to
/* Whether something that ratios are divided by has come to less than this part of what it was when it was last looked at, or that is not
 * known. */
static int ha_pivots_come_to(ha_model *m, double t, const $real *x, $real least)
{
    $real now[$PIVOTS + 1];
    int come = !m->pivots_known;
    int i;
//if held
    $ha_place(m, t);
//end
    if ($ha_pivots_code(m, t, x, now) != $MODEL_OK) {
        m->failure.code = $MODEL_OK;
        return 1;
    }
    for (i = 0; i < $PIVOTS && !come; ++i) {
        const $real part = now[i] / m->pivots[i];
        come = part != part || part <= least;
    }
    if (come) {
        $ha_copy(m->pivots, now, $PIVOTS);
        m->pivots_known = 1;
    }
    return come;
}

//item ha_find_ratios
/* How the dependent variables move with the independent ones, a row for each, all in their weights; whether that has values. */
static int ha_find_ratios(ha_model *m, double t, const $real *x, $real *ratios)
{
    static const int told[] = {$TOLD};
    static const $real weights[] = {$RATIO_WEIGHTS};
    $real out[$INDEPENDENT + $DEPENDENT];
    $real rates[$INDEPENDENT + $DEPENDENT];
    $real matrix[$INDEPENDENT * $INDEPENDENT];
    $real right[$INDEPENDENT * $DEPENDENT];
    int row;
    int k;
    for (k = 0; k < $INDEPENDENT; ++k) {
        $ha_fill(m->along, $0.0, HA_DIRECTION);
        m->along[told[k]] = $1.0;
//if held
        $ha_place(m, t);
//end
        if ($ha_ratios_along(m, t, x, m->along, out, rates) != $MODEL_OK) {
            return 0;
        }
        for (row = 0; row < $INDEPENDENT; ++row) {
            matrix[k * $INDEPENDENT + row] = rates[row];
        }
        for (row = 0; row < $DEPENDENT; ++row) {
            right[k * $DEPENDENT + row] = rates[$INDEPENDENT + row];
        }
    }
    if (!$ha_solve_square(matrix, right, $INDEPENDENT, $DEPENDENT)) {
        return 0;
    }
    for (row = 0; row < $DEPENDENT; ++row) {
        for (k = 0; k < $INDEPENDENT; ++k) {
            const $real part = weights[$INDEPENDENT + row] / weights[k];
            ratios[row * $INDEPENDENT + k] = right[k * $DEPENDENT + row] * part;
        }
    }
    return $ha_all_finite(ratios, $INDEPENDENT * $DEPENDENT);
}

//item ha_greatest_ratio
/* The greatest ratio, and its place. */
static $real ha_greatest_ratio(const $real *ratios, int *place)
{
    $real most = $0.0;
    int i;
    *place = 0;
    for (i = 0; i < $INDEPENDENT * $DEPENDENT; ++i) {
        if ($fabs(ratios[i]) > most) {
            most = $fabs(ratios[i]);
            *place = i;
        }
    }
    return most;
}

//item ha_look_at_ratios
/* Looks at these ratios, where they may have grown: 1 if others should be independent, since one moves many times as fast or soon will; -1
 * if a position has been passed at which the independent ones do not tell the motion; else 0. A step from here has failed, or not. */
static int ha_look_at_ratios(ha_model *m, double t, const $real *x, int failed, $real *ratios)
{
    const $real before = m->steepest;
    const int at = m->steepest_at;
    const int known = m->steepest_known;
    int place;
    int passed;
    int grown;
    $real most;
    const int smaller = $ha_pivots_come_to(m, t, x, $0.95);
    if (!(failed || smaller || $ALWAYS)) {
        return 0;
    }
    m->steepest_known = 0;
    if (!$ha_find_ratios(m, t, x, ratios)) {
        m->failure.code = $MODEL_OK;
        return 0;
    }
    most = $ha_greatest_ratio(ratios, &place);
    passed = known && ratios[at] * before < $0.0 && $ha_min($fabs(ratios[at]), $fabs(before)) > $5.0;
    grown = known && place == at && ratios[place] * before > $0.0 && most >= $1.1 * $fabs(before);
//if modes
//if derivatives
    /* An importer that integrates controls the error of its steps. */
    grown = grown && !m->outside;
//end
//end
    m->steepest = ratios[place];
    m->steepest_at = place;
    m->steepest_known = 1;
    if (passed) {
        return -1;
    }
    return most > (failed || grown ? $1.2 : $10.0);
}

//end
//if watches
//entry ha_watch
/* Stops where a position has been passed at which the independent variables do not tell the motion: there are no others here. Of many
 * equations ratios are looked at only where what they are divided by has changed its sign. */
static int ha_watch(ha_model *m, double t, const $real *x)
{
    $real ratios[$INDEPENDENT * $DEPENDENT];
    const int known = m->pivots_known;
    int place;
    int passed = 0;
    if ($ALWAYS) {
        passed = $ha_look_at_ratios(m, t, x, 0, ratios) < 0;
    } else if ($ha_pivots_come_to(m, t, x, $0.0) && known) {
        passed = $ha_find_ratios(m, t, x, ratios) && $ha_greatest_ratio(ratios, &place) > $5.0;
        m->failure.code = $MODEL_OK;
    }
    return passed ? $ha_fail(m, $MODEL_PASSED, 0, t) : $MODEL_OK;
}

//end
