
//section
/* ---- signals read from earlier times ---- */

//if delays
//item ha_delay_room
/* Room for the points of each delay: the first, and one after the last. */
static const int ha_delay_room[] = {
$DELAY_ROOM
};

//item ha_point
static $model_point *ha_point(ha_model *m, int d, int k)
{
    const int first = $ha_delay_room[d];
    const int room = $ha_delay_room[d + 1] - first;
    return &m->points[first + (m->delays[d].first + k) % room];
}

//item ha_delay_push
static void ha_delay_push(ha_model *m, int d, double t, $real value, $real slope, $real jump)
{
    const int room = $ha_delay_room[d + 1] - $ha_delay_room[d];
    $model_point *point;
    if (m->delays[d].count >= room) {
        m->delays[d].full = 1;
        return;
    }
    point = $ha_point(m, d, m->delays[d].count);
    point->t = t;
    point->value = value;
    point->slope = slope;
    point->jump = jump;
    ++m->delays[d].count;
}

//item ha_delay_begin
static void ha_delay_begin(ha_model *m, int d, double t, $real value, $real slope)
{
    m->delays[d].start = t;
    m->delays[d].first = 0;
    m->delays[d].count = 0;
    $ha_delay_push(m, d, t, value, slope, $0.0);
}

//item ha_delay_append
/* The signal has come to a value, smoothly. */
static void ha_delay_append(ha_model *m, int d, double t, $real value, $real slope)
{
    const int room = $ha_delay_room[d + 1] - $ha_delay_room[d];
    if (m->delays[d].count == 0) {
        $ha_delay_begin(m, d, t, value, slope);
    } else if (t > $ha_point(m, d, m->delays[d].count - 1)->t) {
        $ha_delay_push(m, d, t, value, slope, $0.0);
    }
    /* What is older than the delay is read no more; the point before it still bounds a piece. */
    while (m->delays[d].count > 3 && $ha_point(m, d, 2)->t + m->delays[d].time < t) {
        m->delays[d].first = (m->delays[d].first + 1) % room;
        --m->delays[d].count;
    }
}

//item ha_delay_jump
/* The signal has jumped at the time of the last point, or changed its slope. */
static void ha_delay_jump(ha_model *m, int d, double t, $real value, $real slope)
{
    $model_point *last;
    if (m->delays[d].count == 0) {
        $ha_delay_begin(m, d, t, value, slope);
        return;
    }
    last = $ha_point(m, d, m->delays[d].count - 1);
    if (last->value == value && last->slope == slope) {
        return;
    }
    if (last->jump == $0.0) {
        $ha_delay_push(m, d, last->t, value, slope, $1.0);
    } else {
        last->value = value;
        last->slope = slope;
    }
}

//item ha_cubic
static void ha_cubic(const $model_point *a, const $model_point *b, double s, $real *value, $real *slope)
{
//if single
    const $real h = (float)(b->t - a->t);
//else
    const $real h = b->t - a->t;
//end
    const $real u = $narrow(s - a->t) / h;
    const $real v = $1.0 - u;
    const $real rise = b->value - a->value;
    const $real ends = v * a->slope;
    const $real other = u * b->slope;
    const $real bent = h * u * v * (ends - other);
    const $real way = rise * u * u * ($3.0 - $2.0 * u);
    const $real whole = a->value + way;
    const $real first = $1.0 - $4.0 * u;
    const $real second = $3.0 * u * u;
    const $real left = (first + second) * a->slope;
    const $real right = u * ($3.0 * u - $2.0) * b->slope;
    const $real middle = $6.0 * u * v * rise / h;
    const $real both = middle + left;
    *value = whole + bent;
    *slope = both + right;
}

//item ha_delay_at
/* Value and slope of a delayed signal at t. */
static $real ha_delay_at(ha_model *m, int d, double t, $real *slope)
{
    const int count = m->delays[d].count;
    const double time = m->delays[d].time;
    const double s = t - time;
    int low = 0;
    int high = count;
    $real value;
    *slope = $0.0;
    if (count == 0) {
        return $0.0;
    }
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if ($ha_point(m, d, middle)->t <= s) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    /* Rounding of `t - time` must not decide on which side of a jump we are. */
    while (low < count && $ha_point(m, d, low)->jump != $0.0 && $ha_point(m, d, low)->t + time <= m->crossed) {
        ++low;
    }
    if (low + 1 < count && $ha_point(m, d, low + 1)->jump != $0.0 && $ha_point(m, d, low + 1)->t + time <= m->crossed) {
        low += 2;
    }
    while (low > 0 && $ha_point(m, d, low - 1)->jump != $0.0 && !($ha_point(m, d, low - 1)->t + time <= m->crossed)) {
        --low;
    }
    if (low == 0) {
        return $ha_point(m, d, 0)->value;
    }
    if (low < count && $ha_point(m, d, low)->t > $ha_point(m, d, low - 1)->t) {
        $ha_cubic($ha_point(m, d, low - 1), $ha_point(m, d, low), s, &value, slope);
    } else if (low >= 2 && $ha_point(m, d, low - 2)->t < $ha_point(m, d, low - 1)->t && $ha_point(m, d, low - 1)->t >= s) {
        $ha_cubic($ha_point(m, d, low - 2), $ha_point(m, d, low - 1), s, &value, slope);
    } else {
        const $model_point *last = $ha_point(m, d, low - 1);
        const $real way = last->slope * $narrow(s - last->t);
        *slope = last->slope;
        value = last->value + way;
    }
    return value;
}

//item ha_delay_next
/* The next time after t at which a jump arrives or a step has to end because nothing later is recorded yet. */
static double ha_delay_next(ha_model *m, int d, double t)
{
    const double time = m->delays[d].time;
    const double whole = floor((t - m->delays[d].start) / time) + 1.0;
    double next = HUGE_VAL;
    int i;
    for (i = 0; i < m->delays[d].count; ++i) {
        if ($ha_point(m, d, i)->jump != $0.0 && $ha_point(m, d, i)->t + time > t) {
            next = $ha_point(m, d, i)->t + time;
            break;
        }
    }
    for (i = 0; i < 2; ++i) {
        const double steps = (whole + (double)i) * time;
        const double horizon = m->delays[d].start + steps;
        if (horizon > t) {
            return horizon < next ? horizon : next;
        }
    }
    return next;
}

//end
//if samples
//item ha_sample_next
static double ha_sample_next(const ha_model *m, int s)
{
    return m->samples[s].next * m->samples[s].period;
}

//item ha_sample_pass
/* Samples up to t are taken. */
static void ha_sample_pass(ha_model *m, int s, double t)
{
    int i;
    for (i = 0; i < 8 && (m->samples[s].period > 0.0) && $ha_sample_next(m, s) <= t; ++i) {
        m->samples[s].next += 1.0;
    }
}

//end
