enum { HA_DAMPED, HA_FAR, HA_BRIEF, HA_LOCAL };
enum { HA_CONVERGED, HA_ACCEPTED, HA_REJECTED };

//item ha_jacobian_change
/* How far the Jacobian evaluated last is from the one stored, relative to the entries of a row. */
static $real ha_jacobian_change(const ha_newton *w)
{
    const int n = w->n;
    $real change = $0.0;
    int i;
    int e;
    for (i = 0; i < n; ++i) {
        $real most = $DBL_MIN;
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            most = $ha_max(most, $fabs(w->jacobian[e]));
        }
        for (e = w->starts[i]; e < w->starts[i + 1]; ++e) {
            change = $ha_max(change, $fabs(w->matrix[e] - w->jacobian[e]) / most);
        }
    }
    return change;
}

//item ha_crosses_nonsmooth_point
/* Goes along the correction, which is norm long, to just beyond where the Jacobian jumps: where the derivative of a law jumps,
 * Newton's model ends. Ends with an evaluation of the trial point, or at w->x. */
static int ha_crosses_nonsmooth_point(ha_model *m, ha_newton *w, $real norm)
{
    $real before = $0.0;
    $real beyond = $1.0;
    int halving;
    int i;
    if (!$ha_evaluate(m, w, w->x)) {
        return 0;
    }
    $ha_copy(w->jacobian, w->matrix, w->entries);
    for (halving = 0; halving < 60; ++halving) {
        int finite;
        $real change;
        for (i = 0; i < w->n; ++i) {
            const $real move = beyond * w->correction[i];
            w->trial[i] = w->x[i] + move;
        }
        finite = $ha_evaluate(m, w, w->trial);
        change = finite ? $ha_jacobian_change(w) : $HUGE_VAL;
        if (change > $0.5) {
            if (finite && beyond - before <= $1e-3 * beyond
                && $ha_simplified_correction_norm(w, 0) <= ($1.0 - $0.25 * beyond) * norm) {
                return 1;
            }
            beyond = $0.5 * (before + beyond);
        } else if (change > $1e-3 || (before == $0.0 && beyond == $1.0)) {
            /* No nonsmooth point: the Jacobian changes little by little, or not at all. */
            break;
        } else {
            const $real end = beyond;
            beyond += beyond - before;
            before = end;
        }
    }
    (void)$ha_evaluate(m, w, w->x);
    return 0;
}

//item ha_damped_step
/* Takes the correction with the greatest damping factor 1, 1/2, 1/4 ... that passes the restricted natural monotonicity
 * test: the simplified correction behind it is at most 1 - damping / 4 times as long. contracts: whether the undamped
 * step does. */
static int ha_damped_step(ha_model *m, ha_newton *w, $real norm, int globalization, int *contracts)
{
    const int is_bounded = w->following && globalization != HA_FAR;
    const $real least_damping = globalization == HA_BRIEF ? $0.1 : (is_bounded ? $1e-6 : $LEAST_DAMPING);
    $real damping = $1.0;
    int halving;
    int i;
    *contracts = 0;
    for (halving = 0; halving < 50; ++halving) {
        for (i = 0; i < w->n; ++i) {
            const $real move = damping * w->correction[i];
            w->trial[i] = w->x[i] + move;
        }
        if ($ha_evaluate(m, w, w->trial)) {
            const $real simplified = $ha_simplified_correction_norm(w, 0);
            if (simplified <= ($1.0 - $0.25 * damping) * norm || norm <= $2.0 * $DBL_EPSILON) {
                $ha_accept_trial(w);
                *contracts = damping == $1.0 && (simplified <= $0.25 * norm || norm <= $CLOSE_TO_ROUNDING);
                if (*contracts && simplified * simplified <= $0.125 * $DBL_EPSILON * norm) {
                    $ha_go_on(w, w->simplified);
                    return HA_CONVERGED;
                }
                return norm <= $4.0 * $DBL_EPSILON ? HA_CONVERGED : HA_ACCEPTED;
            }
        }
        if (norm <= $CLOSE_TO_ROUNDING) {
            /* Rounding keeps the correction from getting shorter: it is as good as it gets. */
            (void)$ha_evaluate(m, w, w->x);
            *contracts = 1;
            return HA_CONVERGED;
        }
        damping *= $0.5;
        if (damping < least_damping || w->evaluations >= w->limit) {
            break;
        }
    }
    if ((globalization == HA_DAMPED || globalization == HA_FAR) && $ha_crosses_nonsmooth_point(m, w, norm)) {
        $ha_accept_trial(w);
        *contracts = 0;
        return HA_ACCEPTED;
    }
    *contracts = ($ha_stagnates_at_rounding(m, w) && $ha_is_near_rounding(m, w)) || $ha_is_at_rounding(m, w);
    return *contracts ? HA_CONVERGED : HA_REJECTED;
}

//item ha_iterate
/* Newton's method from w->start; whether it found a root. */
static int ha_iterate(ha_model *m, ha_newton *w, int globalization)
{
    const int n = w->n;
    const int most = globalization == HA_BRIEF ? 10 : (w->following ? 100 : 2000);
    const int last_evaluation = w->evaluations + w->limit / 4;
    int iteration;
    int i;
    $ha_copy(w->x, w->start, n);
    w->contracts = 1;
    w->rests = 0;
    $ha_fill(w->first_correction, $0.0, n);
    $ha_fill(w->first_right, $0.0, n);
    for (i = 0; i < n; ++i) {
        w->scale[i] = $ha_max($fabs(w->x[i]), w->floor[i]);
    }
    if (!$ha_evaluate(m, w, w->x)) {
        return 0;
    }
    w->valued = 1;
    for (iteration = 0; iteration < most; ++iteration) {
        $real norm;
        int contracts;
        int outcome;
        if ($ha_vanishes(w)) {
            return 1;
        }
        if (w->evaluations >= w->limit || w->evaluations > last_evaluation) {
            return 0;
        }
        if (!$ha_newton_factor(w)) {
            $ha_perturb(w, iteration);
            if (!$ha_evaluate(m, w, w->x)) {
                return 0;
            }
            continue;
        }
        $ha_newton_correction(w);
        w->first_factors = iteration == 0;
        if (iteration == 0) {
            $ha_copy(w->first_correction, w->correction, n);
            for (i = 0; i < n; ++i) {
                w->first_right[i] = w->offset[i] - w->right[i];
            }
            $ha_scale_unknowns_at_rest(w);
        }
        norm = $ha_correction_norm(w);
        if (!$ha_finite(norm)) {
            return 0;
        }
        if (norm <= $4.0 * $DBL_EPSILON && !w->positions) {
            w->rests = iteration == 0;
            $ha_go_on(w, w->correction);
            return 1;
        }
        outcome = $ha_damped_step(m, w, norm, globalization, &contracts);
        w->contracts = w->contracts && (iteration > 0 || contracts);
        if (globalization == HA_LOCAL && !w->contracts) {
            return 0;
        }
        if (outcome != HA_ACCEPTED) {
            return outcome == HA_CONVERGED;
        }
    }
    return 0;
}

