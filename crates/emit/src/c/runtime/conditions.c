//if holds

//section
/* ---- conditions: followed, held, or taken anew ---- */

//always
enum { HA_FOLLOW, HA_KEEP, HA_TAKE };

//end
//if conditions

//if sign_conditions
//item ha_side
static double ha_side(ha_model *m, int hold, int number, double a)
{
    double value;
    if (hold == HA_KEEP) {
        return m->held[number];
    }
    value = a > 0.0 ? 1.0 : 0.0;
    if (hold == HA_TAKE) {
        m->held[number] = value;
    }
    return value;
}

//end
//if floor_conditions
//item ha_whole
static double ha_whole(ha_model *m, int hold, int number, double a)
{
    double value;
    if (hold == HA_KEEP) {
        return m->held[number];
    }
    value = floor(a);
    if (hold == HA_TAKE) {
        m->held[number] = value;
    }
    return value;
}

//end
//if piece_conditions
//item ha_piece
static double ha_piece(ha_model *m, int hold, int number, int table, double a)
{
    double value;
    if (hold == HA_KEEP) {
        return m->held[number];
    }
    value = (double)$ha_piece_of(&$ha_tables[table], a);
    if (hold == HA_TAKE) {
        m->held[number] = value;
    }
    return value;
}

//end
//if conditions
//item ha_is_at
static int ha_is_at(double a, double border, double reach)
{
    return fabs(a - border) <= reach + 16.0 * DBL_EPSILON * fabs(border);
}

//if sign_conditions
//item ha_side_along
/* The same where the operand is known with its rate by time: a border that is just reached counts as crossed. */
static double ha_side_along(ha_model *m, int hold, int number, double a, double rate, double t)
{
    const double reach = 16.0 * DBL_EPSILON * fabs(rate * t);
    if (hold != HA_TAKE || rate == 0.0 || !$ha_is_at(a, 0.0, reach)) {
        return $ha_side(m, hold, number, a);
    }
    m->held[number] = rate > 0.0 ? 1.0 : 0.0;
    return m->held[number];
}

//end
//if floor_conditions
//item ha_whole_along
static double ha_whole_along(ha_model *m, int hold, int number, double a, double rate, double t)
{
    const double reach = 16.0 * DBL_EPSILON * fabs(rate * t);
    if (hold != HA_TAKE || rate == 0.0 || !$ha_is_at(a, round(a), reach)) {
        return $ha_whole(m, hold, number, a);
    }
    m->held[number] = round(a) - (rate < 0.0 ? 1.0 : 0.0);
    return m->held[number];
}

//end
//if piece_conditions
//item ha_piece_along
static double ha_piece_along(ha_model *m, int hold, int number, int table, double a, double rate, double t)
{
    const double reach = 16.0 * DBL_EPSILON * fabs(rate * t);
    int knot = 0;
    if (hold == HA_TAKE && rate != 0.0) {
        const ha_table *of = &$ha_tables[table];
        while (knot < of->n && !$ha_is_at(a, of->x[knot], reach)) {
            ++knot;
        }
        if (knot < of->n) {
            m->held[number] = (double)knot + (rate > 0.0 ? 1.0 : 0.0);
            return m->held[number];
        }
    }
    return $ha_piece(m, hold, number, table, a);
}

//end
//end
//end
//if conditions
//item ha_kinds
/* What each condition is: 0 the sign, 1 the integer part, 2 + i the piece of table i. */
static const int ha_kinds[] = {
$KINDS
};

//item ha_borders
/* The lower and upper border of the held value. */
static void ha_borders(const ha_model *m, int number, double *low, double *high)
{
    const double held = m->held[number];
    const int kind = $ha_kinds[number];
    *low = -HUGE_VAL;
    *high = HUGE_VAL;
    if (kind == 0) {
        if (held != 0.0) {
            *low = 0.0;
        } else {
            *high = 0.0;
        }
    } else if (kind == 1) {
        *low = held;
        *high = held + 1.0;
//if tables
    } else {
        const ha_table *table = &$ha_tables[kind - 2];
        const int piece = (int)held;
        if (piece > 0) {
            *low = table->x[piece - 1];
        }
        if (piece < table->n) {
            *high = table->x[piece];
        }
//end
    }
}

//end
