
//if relations
//section
/* ---- positions that only speeds keep ---- */

//item ha_relation_starts
/* Where the value of each relation stands among what is computed; its slopes follow, by these states. */
static const int ha_relation_starts[] = {
$RELATION_STARTS
};
//item ha_relation_states
static const int ha_relation_states[] = {
$RELATION_STATES
};
//item ha_relation_vanishes
/* Whether it is a constraint, which vanishes. */
static const unsigned char ha_relation_vanishes[] = {
$RELATION_VANISHES
};

//item ha_relations
/* The relations and their slopes. */
static int ha_relations(ha_model *m, double t, const $real *x)
{
    return $ha_run(m, $ha_relations_code, t, x, m->relation_out, $RELATION_OUT);
}

//item ha_keep
/* The relations are kept from here on as they are now, where positions have drifted as far from them as they have. */
static int ha_keep(ha_model *m, double t, const $real *x)
{
    const int status = $ha_relations(m, t, x);
    int k;
    for (k = 0; k < $RELATIONS; ++k) {
        m->kept[k] = $ha_relation_vanishes[k] ? $0.0 : m->relation_out[$ha_relation_starts[k]] - m->drift[k];
    }
    return status;
}

//item ha_begin_keeping
static int ha_begin_keeping(ha_model *m, double t, const $real *x)
{
    $ha_fill(m->drift, $0.0, $RELATIONS);
    $ha_fill(m->relation_sizes, $0.0, HA_NX);
    $ha_fill(m->relation_slopes, $0.0, $RELATIONS * HA_NX);
    return $ha_keep(m, t, x);
}

//item ha_cross_keeping
/* Handles an event: the relations keep what it makes of them. */
static int ha_cross_keeping(ha_model *m, double t, $real *x)
{
    int status = $ha_relations(m, t, x);
    int k;
    for (k = 0; k < $RELATIONS; ++k) {
        m->relation_before[k] = m->relation_out[$ha_relation_starts[k]];
    }
    if (status == $MODEL_OK) {
        status = $model_cross(m, t, x);
    }
    if (status == $MODEL_OK) {
        status = $ha_relations(m, t, x);
    }
    for (k = 0; k < $RELATIONS && status == $MODEL_OK; ++k) {
        if (!$ha_relation_vanishes[k]) {
            m->kept[k] += m->relation_out[$ha_relation_starts[k]] - m->relation_before[k];
        }
    }
    return status;
}

//item ha_missed
/* How far the relations are from what they keep, the most of them in units of the last place of what they are sums of, and their
 * slopes. */
static int ha_missed(ha_model *m, double t, const $real *x, $real *most)
{
    const int status = $ha_relations(m, t, x);
    int k;
    *most = $0.0;
    for (k = 0; k < $RELATIONS && status == $MODEL_OK; ++k) {
        const int at = $ha_relation_starts[k];
        const int count = $ha_relation_starts[k + 1] - at - 1;
        const int *states = $ha_relation_states + at - k;
        const $real value = m->relation_out[at];
        $real size = $fabs(value) + $fabs(m->kept[k]);
        $real places = $0.0;
        int j;
        m->drift[k] = value - m->kept[k];
        for (j = 0; j < count; ++j) {
            const $real slope = m->relation_out[at + 1 + j];
            const $real part = slope * x[states[j]];
            m->relation_slopes[k * HA_NX + states[j]] = slope;
            if ($fabs(slope) > m->relation_sizes[states[j]]) {
                m->relation_sizes[states[j]] = $fabs(slope);
            }
            size += $fabs(part);
        }
        if (m->drift[k] != $0.0) {
            const $real unit = $DBL_EPSILON * size;
            places = $fabs(m->drift[k]) / unit;
        }
        if (!(places <= *most)) {
            *most = places;
        }
    }
    return status;
}

//item ha_row_product
static $real ha_row_product(const $real *a, const $real *b)
{
    $real sum = $0.0;
    int i;
    for (i = 0; i < HA_NX; ++i) {
        const $real part = a[i] * b[i];
        sum += part;
    }
    return sum;
}

//item ha_take_row
/* Goes along a row as far as it asks for, and takes its direction out of those that are left. */
static void ha_take_row(ha_model *m, int row, $real length)
{
    $real *own = m->relation_rows + row * HA_NX;
    const $real wanted = m->relation_missing[row] / length;
    int other;
    int i;
    m->relation_taken[row] = 1;
    for (i = 0; i < HA_NX; ++i) {
        $real part;
        own[i] /= length;
        part = wanted * own[i];
        m->relation_step[i] += part;
    }
    for (other = 0; other < $RELATIONS; ++other) {
        $real *left = m->relation_rows + other * HA_NX;
        int pass;
        for (pass = 0; pass < 2 && !m->relation_taken[other]; ++pass) {
            const $real along = $ha_row_product(own, left);
            const $real met = along * wanted;
            for (i = 0; i < HA_NX; ++i) {
                const $real part = along * own[i];
                left[i] -= part;
            }
            m->relation_missing[other] -= met;
        }
    }
}

//item ha_least_change
/* The least change of the states by which the relations are met as far as their slopes tell, each state counting in parts of its
 * size: rows are made orthogonal one after the other, the longest first. Whether there is one. */
static int ha_least_change(ha_model *m)
{
    int k;
    int i;
    if (!$ha_all_finite(m->relation_slopes, $RELATIONS * HA_NX) || !$ha_all_finite(m->drift, $RELATIONS)) {
        return 0;
    }
    for (k = 0; k < $RELATIONS; ++k) {
        $real *row = m->relation_rows + k * HA_NX;
        $real length;
        $real weight;
        for (i = 0; i < HA_NX; ++i) {
            const $real size = m->relation_sizes[i] > $0.0 ? $1.0 / m->relation_sizes[i] : $1.0;
            row[i] = m->relation_slopes[k * HA_NX + i] * size;
        }
        length = $sqrt($ha_row_product(row, row));
        weight = length > $0.0 ? $1.0 / length : $0.0;
        for (i = 0; i < HA_NX; ++i) {
            row[i] *= weight;
        }
        m->relation_missing[k] = -m->drift[k] * weight;
        m->relation_taken[k] = 0;
    }
    $ha_fill(m->relation_step, $0.0, HA_NX);
    for (i = 0; i < $RELATIONS; ++i) {
        $real most = $0.0;
        int longest = -1;
        for (k = 0; k < $RELATIONS; ++k) {
            const $real *row = m->relation_rows + k * HA_NX;
            const $real length = m->relation_taken[k] ? $0.0 : $sqrt($ha_row_product(row, row));
            if (length > most) {
                most = length;
                longest = k;
            }
        }
        if (most <= $1e-11) {
            break;
        }
        $ha_take_row(m, longest, most);
    }
    for (i = 0; i < HA_NX; ++i) {
        m->relation_step[i] *= m->relation_sizes[i] > $0.0 ? $1.0 / m->relation_sizes[i] : $1.0;
    }
    return 1;
}

//item ha_put_back
/* Puts the positions back onto what their speeds keep, by the least change that does it. */
static int ha_put_back(ha_model *m, double t, $real *x)
{
    $real missed;
    int status = $ha_missed(m, t, x, &missed);
    int round;
    int i;
    for (round = 0; round < 12 && status == $MODEL_OK && missed > $8.0 && $ha_least_change(m); ++round) {
        $real now;
        $ha_copy(m->relation_from, x, HA_NX);
        for (i = 0; i < HA_NX; ++i) {
            x[i] += m->relation_step[i];
        }
        status = $ha_missed(m, t, x, &now);
        if (status == $MODEL_OK && !(now < missed)) {
            $ha_copy(x, m->relation_from, HA_NX);
            status = $ha_missed(m, t, x, &missed);
            break;
        }
        missed = now;
    }
    if (status == $MODEL_OK && !(missed <= $1e6)) {
        status = $ha_fail(m, $MODEL_NOT_PUT_BACK, 0, t);
    }
    return status;
}

//end
