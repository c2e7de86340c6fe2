
//section
/* ---- conditions that time alone moves: when they change next ---- */

//item ha_clock_conditions
/* Which conditions, and whether their operands run along straight lines. */
static const int ha_clock_conditions[] = {
$CLOCK_CONDITIONS
};
//item ha_clock_lines
static const int ha_clock_lines[] = {
$CLOCK_LINES
};

//item ha_clock_at
/* Operands and their rates at t. */
static void ha_clock_at(ha_model *m, double t)
{
    /* Time alone is read: no block can fail that has not failed for the parameters. */
    (void)$ha_clock_code(m, t, m->clock_operand, m->clock_rate);
}

//item ha_next_on_lines
/* Straight lines: where each meets the border it runs towards, computed from time zero so that the result does not
 * depend on when it is asked for. */
static double ha_next_on_lines(ha_model *m, double t)
{
    double next = HUGE_VAL;
    int i;
    $ha_clock_at(m, 0.0);
    for (i = 0; i < $CLOCKS; ++i) {
        const double start = m->clock_operand[i];
        const double slope = m->clock_rate[i];
        double low;
        double high;
        double change;
        if (!$ha_clock_lines[i] || slope == 0.0) {
            continue;
        }
        $ha_borders(m, $ha_clock_conditions[i], &low, &high);
        change = ((slope > 0.0 ? high : low) - start) / slope;
        if ($$ha_finite(change) && change > t && change < next) {
            next = change;
        }
    }
    return next;
}

//if curves
//item ha_margin
/* How far the operand of a condition is from the nearest border, below 0 once it is beyond, and the rate of that. */
static double ha_margin(ha_model *m, int i, double t, double *rate)
{
    double low;
    double high;
    $ha_clock_at(m, t);
    $ha_borders(m, $ha_clock_conditions[i], &low, &high);
    *rate = m->clock_rate[i];
    if (m->clock_operand[i] - low < high - m->clock_operand[i]) {
        return m->clock_operand[i] - low;
    }
    *rate = -*rate;
    return high - m->clock_operand[i];
}

//item ha_bisect
/* The first instant, to rounding, at which the margin (or its rate) has changed its sign; it has at high, not at low. */
static double ha_bisect(ha_model *m, int i, int by_rate, double low, double high)
{
    int halving;
    for (halving = 0; halving < 2200; ++halving) {
        const double middle = 0.5 * (low + high);
        double rate;
        double margin;
        if (middle <= low || middle >= high) {
            break;
        }
        margin = $ha_margin(m, i, middle, &rate);
        if (by_rate ? rate > 0.0 : margin < 0.0) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return high;
}

//always
/* The way of a margin since it was last seen not beyond the border: when that was, and the greatest rate since. */
typedef struct {
    double from;
    double margin;
    double fastest;
} ha_way;

//item ha_is_dip
/* Whether a curve that is shallow between first and its lowest point is a parabola there, and not rounding. */
static int ha_is_dip(ha_model *m, int i, double first, double lowest, double depth)
{
    int quarter;
    for (quarter = 1; quarter < 4; ++quarter) {
        const double part = 0.25 * quarter;
        const double square = part * part;
        const double way = (first - lowest) * part;
        const double wanted = depth * (1.0 - square);
        double rate;
        const double margin = $ha_margin(m, i, lowest + way, &rate);
        if (!(fabs(margin - wanted) <= -0.25 * depth)) {
            return 0;
        }
    }
    return 1;
}

//item ha_change_between
/* The change between two points, if the second is beyond a border or the way to it leads there; else infinity. */
static double ha_change_between(ha_model *m, int i, double a, double margin_a, double rate_a, double b, double margin_b, double rate_b, ha_way *way)
{
    way->fastest = $$ha_max(way->fastest, fabs(rate_b));
    if (margin_b < 0.0) {
        const double told = (b - way->from) * way->fastest;
        return told >= 0.5 * (way->margin - margin_b) ? $ha_bisect(m, i, 0, way->from, b) : HUGE_VAL;
    }
    way->from = b;
    way->margin = margin_b;
    way->fastest = fabs(rate_b);
    if (margin_a >= 0.0 && rate_a < 0.0 && rate_b > 0.0) {
        const double lowest = $ha_bisect(m, i, 1, a, b);
        double rate;
        const double depth = $ha_margin(m, i, lowest, &rate);
        if (depth < 0.0) {
            const double first = $ha_bisect(m, i, 0, a, lowest);
            if (-depth > 1e-9 * $$ha_max(margin_a, margin_b) || $ha_is_dip(m, i, first, lowest, depth)) {
                return first;
            }
        }
    }
    return HUGE_VAL;
}

//item ha_next_on_curve
/* Searches a curve with steps in which a cubic follows it, or a straight line its rate, as beside a double zero, where values
 * are all rounding, or in which it cannot come to its border; gives the change, or where the search ended. A value beyond the border counts where the rates on the way there tell of it: what they do not
 * explain is rounding, as beside a double zero, which is no change. */
static double ha_next_on_curve(ha_model *m, int i, double from, double until)
{
    double t = from;
    double h = 1e-9 * $$ha_max(fabs(from), 1.0);
    double rate;
    double here = $ha_margin(m, i, t, &rate);
    ha_way way;
    int search;
    way.from = t;
    way.margin = here;
    way.fastest = fabs(rate);
    for (search = 0; search < 4000; ++search) {
        double middle;
        double middle_rate;
        double there;
        double there_rate;
        double cubic;
        double error;
        double size;
        double allowed;
        double fastest;
        double moved;
        double bent;
        int followed;
        double change;
        if (t > until) {
            return HUGE_VAL;
        }
        middle = $ha_margin(m, i, t + 0.5 * h, &middle_rate);
        there = $ha_margin(m, i, t + h, &there_rate);
        if (!($$ha_finite(middle) && $$ha_finite(there))) {
            return t > from ? t : HUGE_VAL;
        }
        cubic = 0.125 * h * (rate - there_rate);
        cubic = 0.5 * (here + there) + cubic;
        error = fabs(middle - cubic);
        size = $$ha_max($$ha_max(fabs(here), fabs(there)), fabs(middle));
        allowed = 1e-3 * size;
        fastest = $$ha_max($$ha_max(fabs(rate), fabs(there_rate)), fabs(middle_rate));
        moved = h * fastest;
        bent = fabs(middle_rate - 0.5 * (rate + there_rate));
        followed = error <= allowed || bent <= 1e-2 * fastest || moved <= 0.5 * size;
        if (!followed && h > 1e-12 * $$ha_max(fabs(t), 1e-6)) {
            h *= 0.5;
            continue;
        }
        change = $ha_change_between(m, i, t, here, rate, t + 0.5 * h, middle, middle_rate, &way);
        if (change == HUGE_VAL) {
            change = $ha_change_between(m, i, t + 0.5 * h, middle, middle_rate, t + h, there, there_rate, &way);
        }
        if (change != HUGE_VAL) {
            return change > from ? change : HUGE_VAL;
        }
        t = t + h;
        here = there;
        rate = there_rate;
        if (error <= 0.1 * allowed || bent <= 1e-3 * fastest || moved <= 0.125 * size) {
            h *= 2.0;
        }
    }
    return t;
}

//end
//item ha_clock_cross
/* Takes all of them as they are just after t, and finds when the first of them changes. */
static void ha_clock_cross(ha_model *m, double t)
{
    double lines;
    int i;
    m->clock_hold = HA_TAKE;
    $ha_clock_at(m, t);
    for (i = 0; i < $CLOCKS; ++i) {
        const int number = $ha_clock_conditions[i];
        const double a = m->clock_operand[i];
        const double rate = m->clock_rate[i];
        switch ($ha_kinds[number]) {
//if sign_conditions
        case 0:
            (void)$ha_side_along(m, HA_TAKE, number, a, rate, t);
            break;
//end
//if floor_conditions
        case 1:
            (void)$ha_whole_along(m, HA_TAKE, number, a, rate, t);
            break;
//end
        default:
//if piece_conditions
            (void)$ha_piece_along(m, HA_TAKE, number, $ha_kinds[number] - 2, a, rate, t);
//end
            break;
        }
    }
    m->clock_hold = HA_KEEP;
    lines = $ha_next_on_lines(m, t);
    m->clock_next = lines;
//if curves
    for (i = 0; i < $CLOCKS; ++i) {
        if (!$ha_clock_lines[i]) {
            const double change = $ha_next_on_curve(m, i, t, lines);
            if (change < m->clock_next) {
                m->clock_next = change;
            }
        }
    }
//end
}
