
/* ---- signals read from earlier times ---- */

//if delays
/* Room for the points of each delay: the first, and one after the last. */
static const int ha_delay_room[] = {
DELAY_ROOM
};

static MODEL_point *ha_point(ha_model *m, int d, int k)
{
    const int first = ha_delay_room[d];
    const int room = ha_delay_room[d + 1] - first;
    return &m->points[first + (m->delays[d].first + k) % room];
}

static void ha_delay_push(ha_model *m, int d, ha_wide t, double value, double slope, double jump)
{
    const int room = ha_delay_room[d + 1] - ha_delay_room[d];
    MODEL_point *point;
    if (m->delays[d].count >= room) {
        m->delays[d].full = 1;
        return;
    }
    point = ha_point(m, d, m->delays[d].count);
    point->t = t;
    point->value = value;
    point->slope = slope;
    point->jump = jump;
    ++m->delays[d].count;
}

static void ha_delay_begin(ha_model *m, int d, ha_wide t, double value, double slope)
{
    m->delays[d].start = t;
    m->delays[d].first = 0;
    m->delays[d].count = 0;
    ha_delay_push(m, d, t, value, slope, 0.0);
}

/* The signal has come to a value, smoothly. */
static void ha_delay_append(ha_model *m, int d, ha_wide t, double value, double slope)
{
    const int room = ha_delay_room[d + 1] - ha_delay_room[d];
    if (m->delays[d].count == 0) {
        ha_delay_begin(m, d, t, value, slope);
    } else if (t > ha_point(m, d, m->delays[d].count - 1)->t) {
        ha_delay_push(m, d, t, value, slope, 0.0);
    }
    /* What is older than the delay is read no more; the point before it still bounds a piece. */
    while (m->delays[d].count > 3 && ha_point(m, d, 2)->t + m->delays[d].time < t) {
        m->delays[d].first = (m->delays[d].first + 1) % room;
        --m->delays[d].count;
    }
}

/* The signal has jumped at the time of the last point, or changed its slope. */
static void ha_delay_jump(ha_model *m, int d, ha_wide t, double value, double slope)
{
    MODEL_point *last;
    if (m->delays[d].count == 0) {
        ha_delay_begin(m, d, t, value, slope);
        return;
    }
    last = ha_point(m, d, m->delays[d].count - 1);
    if (last->value == value && last->slope == slope) {
        return;
    }
    if (last->jump == 0.0) {
        ha_delay_push(m, d, last->t, value, slope, 1.0);
    } else {
        last->value = value;
        last->slope = slope;
    }
}

static void ha_cubic(const MODEL_point *a, const MODEL_point *b, ha_wide s, double *value, double *slope)
{
    const double h = ha_narrow(b->t - a->t);
    const double u = ha_narrow(s - a->t) / h;
    const double v = 1.0 - u;
    const double rise = b->value - a->value;
    const double ends = v * a->slope;
    const double other = u * b->slope;
    const double bent = h * u * v * (ends - other);
    const double way = rise * u * u * (3.0 - 2.0 * u);
    const double whole = a->value + way;
    const double first = 1.0 - 4.0 * u;
    const double second = 3.0 * u * u;
    const double left = (first + second) * a->slope;
    const double right = u * (3.0 * u - 2.0) * b->slope;
    const double middle = 6.0 * u * v * rise / h;
    const double both = middle + left;
    *value = whole + bent;
    *slope = both + right;
}

/* Value and slope of a delayed signal at t. */
static double ha_delay_at(ha_model *m, int d, ha_wide t, double *slope)
{
    const int count = m->delays[d].count;
    const ha_wide time = m->delays[d].time;
    const ha_wide s = t - time;
    int low = 0;
    int high = count;
    double value;
    *slope = 0.0;
    if (count == 0) {
        return 0.0;
    }
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (ha_point(m, d, middle)->t <= s) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    /* Rounding of `t - time` must not decide on which side of a jump we are. */
    while (low < count && ha_point(m, d, low)->jump != 0.0 && ha_point(m, d, low)->t + time <= m->crossed) {
        ++low;
    }
    if (low + 1 < count && ha_point(m, d, low + 1)->jump != 0.0 && ha_point(m, d, low + 1)->t + time <= m->crossed) {
        low += 2;
    }
    while (low > 0 && ha_point(m, d, low - 1)->jump != 0.0 && !(ha_point(m, d, low - 1)->t + time <= m->crossed)) {
        --low;
    }
    if (low == 0) {
        return ha_point(m, d, 0)->value;
    }
    if (low < count && ha_point(m, d, low)->t > ha_point(m, d, low - 1)->t) {
        ha_cubic(ha_point(m, d, low - 1), ha_point(m, d, low), s, &value, slope);
    } else if (low >= 2 && ha_point(m, d, low - 2)->t < ha_point(m, d, low - 1)->t && ha_point(m, d, low - 1)->t >= s) {
        ha_cubic(ha_point(m, d, low - 2), ha_point(m, d, low - 1), s, &value, slope);
    } else {
        const MODEL_point *last = ha_point(m, d, low - 1);
        const double way = last->slope * ha_narrow(s - last->t);
        *slope = last->slope;
        value = last->value + way;
    }
    return value;
}

/* The next time after t at which a jump arrives or a step has to end because nothing later is recorded yet. */
static ha_wide ha_delay_next(ha_model *m, int d, ha_wide t)
{
    const ha_wide time = m->delays[d].time;
    const ha_wide whole = HA_WIDE(floor((t - m->delays[d].start) / time) + 1.0);
    ha_wide next = HA_WIDE(HUGE_VAL);
    int i;
    for (i = 0; i < m->delays[d].count; ++i) {
        if (ha_point(m, d, i)->jump != 0.0 && ha_point(m, d, i)->t + time > t) {
            next = ha_point(m, d, i)->t + time;
            break;
        }
    }
    for (i = 0; i < 2; ++i) {
        const ha_wide steps = HA_WIDE((whole + (double)i) * time);
        const ha_wide horizon = m->delays[d].start + steps;
        if (horizon > t) {
            return horizon < next ? horizon : next;
        }
    }
    return next;
}

//end
//if samples
static ha_wide ha_sample_next(const ha_model *m, int s)
{
    return m->samples[s].next * m->samples[s].period;
}

/* Samples up to t are taken. */
static void ha_sample_pass(ha_model *m, int s, ha_wide t)
{
    int i;
    for (i = 0; i < 8 && HA_WIDE(m->samples[s].period > 0.0) && ha_sample_next(m, s) <= t; ++i) {
        m->samples[s].next += HA_WIDE(1.0);
    }
}

//end
