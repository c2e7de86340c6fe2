
//section
/* ---- modes: which branch each set-valued law has; each mode has equations of its own, told by m->mode ---- */

//if bounds
//always
enum {
    HA_LAWS = $LAWS,
    HA_COMBINATIONS = $COMBINATIONS
};

//item ha_law_branches
/* How many branches each law has. */
static const int ha_law_branches[] = {$LAW_BRANCHES};

//item ha_law_places
/* What a branch of each law counts in the number of a combination. */
static const int ha_law_places[] = {$LAW_PLACES};

//item ha_mode_of
/* The mode of each combination of branches; -1 where there are no equations. */
static const int ha_mode_of[] = {
$MODE_OF
};

//item ha_branches
/* The branches of each mode. */
static const int ha_branches[][HA_LAWS] = {
$MODE_BRANCHES
};

//item ha_free
/* The branch that each law of a mode has while impulses are shared out, -1 where it takes no part in them. */
static const int ha_free[][HA_LAWS] = {
$MODE_FREE
};

//item ha_commanded
/* Whether a condition ends the branch of each law of a mode. */
static const unsigned char ha_commanded[][HA_LAWS] = {
$MODE_COMMANDED
};

//end
//if exchanges
//item ha_independent
/* Which variables are independent in each mode. */
static const unsigned char ha_independent[][$EXCHANGED] = {
$MODE_INDEPENDENT
};

//item ha_mode_with
/* The mode with the branches of another one in which these variables are independent; -1 if there is none. */
static int ha_mode_with(int like, const unsigned char *wanted)
{
    int mode;
    int i;
    for (mode = 0; mode < $MODES; ++mode) {
        int same = 1;
//if bounds
        for (i = 0; i < HA_LAWS; ++i) {
            same = same && $ha_branches[mode][i] == $ha_branches[like][i];
        }
//else
        (void)like;
//end
        for (i = 0; i < $EXCHANGED; ++i) {
            same = same && $ha_independent[mode][i] == wanted[i];
        }
        if (same) {
            return mode;
        }
    }
    return -1;
}

//end
//if bounds
//item ha_mode_like
/* The mode of a combination of branches with the independent variables that have taken over last, or with its own. */
static int ha_mode_like(const ha_model *m, int combination)
{
    const int first = $ha_mode_of[combination];
//if exchanges
    const int like = first >= 0 ? $ha_mode_with(first, m->taken_over) : -1;
    return like >= 0 ? like : first;
//else
    (void)m;
    return first;
//end
}

//item ha_combination
static int ha_combination(const int *branches)
{
    int number = 0;
    int law;
    for (law = 0; law < HA_LAWS; ++law) {
        number += branches[law] * $ha_law_places[law];
    }
    return number;
}

//item ha_branch_of
/* The branch of a law in a combination. */
static int ha_branch_of(int combination, int law)
{
    return combination / $ha_law_places[law] % $ha_law_branches[law];
}

//item ha_try_mode
/* Tries to go on in a combination of branches: 1 if it can be, with the state there and by how much storages leap; 0 if a branch has ended
 * in it, which next tells; -1 if it has no equations, or none that can be entered. */
static int ha_try_mode(ha_model *m, double t, $real *x, int combination, int *next, $real *leap)
{
    int law;
    if ($ha_mode_of[combination] < 0) {
        return -1;
    }
    m->mode = $ha_mode_like(m, combination);
    if ($ha_enter(m, t, x, leap) != $MODEL_OK || $ha_ended(m, t, x, next) != $MODEL_OK) {
        return -1;
    }
    for (law = 0; law < HA_LAWS; ++law) {
        if (next[law] >= 0) {
            return 0;
        }
    }
    return 1;
}

//item ha_may_leap
/* Whether storages may leap on the way to a mode: not by what is bounded, nor by contacts, whose impulses are told. */
static int ha_may_leap(int from, int to)
{
    int law;
    for (law = 0; law < HA_LAWS; ++law) {
        if ($ha_free[to][law] >= 0 && $ha_branches[to][law] != $ha_branches[from][law]) {
            return 0;
        }
    }
    return 1;
}

//item ha_neighbours
/* Puts the combinations that differ in one branch behind the others that wait. */
static void ha_neighbours(ha_model *m, int from, int combination, int *waiting)
{
    int law;
    int branch;
    for (law = 0; law < HA_LAWS; ++law) {
        if ($ha_commanded[from][law] || m->apart[law]) {
            continue;
        }
        for (branch = 0; branch < $ha_law_branches[law]; ++branch) {
            const int other = combination + (branch - $ha_branch_of(combination, law)) * $ha_law_places[law];
            if (!m->seen_modes[other]) {
                m->seen_modes[other] = 1;
                m->waiting_modes[*waiting] = other;
                ++*waiting;
            }
        }
    }
}

//item ha_distance
/* In how many branches two combinations differ. */
static int ha_distance(int a, int b)
{
    int count = 0;
    int law;
    for (law = 0; law < HA_LAWS; ++law) {
        count += $ha_branch_of(a, law) != $ha_branch_of(b, law);
    }
    return count;
}

//item ha_beyond
/* The combination beyond the first branch that has ended. */
static int ha_beyond(int combination, const int *next)
{
    int law;
    for (law = 0; law < HA_LAWS; ++law) {
        if (next[law] >= 0) {
            return combination + (next[law] - $ha_branch_of(combination, law)) * $ha_law_places[law];
        }
    }
    return combination;
}

//item ha_first_of
/* The next of those that wait, or -1; none is far from the first once a mode is known to which storages leap. */
static int ha_first_of(int first, int combination, int leaping)
{
    return leaping >= 0 && $ha_distance(combination, first) > 2 ? -1 : combination;
}

//item ha_search_mode
/* The mode in which the run goes on, from the one that was left: by exchanging the branch with the least number that has ended (Murty's
 * principal pivoting), and where that leads in a circle or to a mode that cannot be, by the number of exchanges. The combination, or
 * -1. */
static int ha_search_mode(ha_model *m, double t, $real *x, const int *ended)
{
    const int from = m->mode;
    int first = $ha_combination($ha_branches[from]);
    int pivot;
    int leaping = -1;
    int waiting = 1;
    int done = 0;
    int turn;
    int law;
    $real least = $0.0;
    for (law = 0; law < HA_LAWS; ++law) {
        /* Commands are obeyed by whatever mode. */
        if (ended[law] >= 0 && $ha_commanded[from][law]) {
            first += (ended[law] - $ha_branch_of(first, law)) * $ha_law_places[law];
        }
    }
    pivot = first;
    for (law = 0; law < HA_LAWS; ++law) {
        if (ended[law] >= 0) {
            pivot += (ended[law] - $ha_branch_of(pivot, law)) * $ha_law_places[law];
        }
    }
    for (turn = 0; turn < HA_COMBINATIONS; ++turn) {
        m->tried_modes[turn] = 0;
        m->seen_modes[turn] = 0;
    }
    m->seen_modes[first] = 1;
    m->waiting_modes[0] = first;
    /* Each combination is tried once, and taken from those that wait once. */
    for (turn = 0; turn < 2 * HA_COMBINATIONS; ++turn) {
        int combination = pivot;
        int next[HA_LAWS];
        int fits;
        $real leap;
        pivot = -1;
        if (combination < 0) {
            combination = done < waiting ? $ha_first_of(first, m->waiting_modes[done], leaping) : -1;
            if (combination < 0) {
                break;
            }
            ++done;
            $ha_neighbours(m, from, combination, &waiting);
            if (m->tried_modes[combination]) {
                continue;
            }
        }
        m->tried_modes[combination] = 1;
        $ha_copy(m->most_kept, m->most_margins, $MOST_MARGINS);
        fits = $ha_try_mode(m, t, x, combination, next, &leap);
        if (fits == 1 && leap <= m->no_leap) {
            return combination;
        }
        $ha_copy(m->most_margins, m->most_kept, $MOST_MARGINS);
        if (fits == 1 && $ha_may_leap(from, m->mode) && (leaping < 0 || leap < least)) {
            leaping = combination;
            least = leap;
        } else if (fits == 0) {
            pivot = $ha_beyond(combination, next);
            pivot = m->tried_modes[pivot] ? -1 : pivot;
        }
    }
    if (leaping >= 0) {
        int next[HA_LAWS];
        return $ha_try_mode(m, t, x, leaping, next, &least) == 1 ? leaping : -1;
    }
    return -1;
}

//item ha_settle
/* Goes on in another mode if a branch of a set-valued law has ended; whether one has. */
static int ha_settle(ha_model *m, double t, $real *x, int *switched)
{
    int ended[HA_LAWS];
    int law;
    int first = -1;
    int status = $ha_ended(m, t, x, ended);
    *switched = 0;
    for (law = HA_LAWS - 1; law >= 0; --law) {
        first = ended[law] >= 0 ? law : first;
    }
    if (status != $MODEL_OK || first < 0) {
        return status;
    }
    *switched = 1;
    status = $ha_leave(m, t, x);
    if (status == $MODEL_OK) {
        status = $ha_find_apart(m, t, x);
    }
    if (status == $MODEL_OK && $ha_search_mode(m, t, x, ended) < 0) {
        status = $ha_fail(m, $MODEL_NO_MODE, first, t);
    }
    return status;
}

//if releases
//item ha_release
/* Opens contacts and lets go what sticks, before impulses are shared out among all that move: what they take of it is found then. */
static int ha_release(ha_model *m, double t, $real *x)
{
    const int from = m->mode;
    int branches[HA_LAWS];
    int law;
    int to;
    int changed = 0;
    int status;
    $real leap;
    for (law = 0; law < HA_LAWS; ++law) {
        branches[law] = $ha_free[from][law] >= 0 ? $ha_free[from][law] : $ha_branches[from][law];
        changed = changed || branches[law] != $ha_branches[from][law];
    }
    if (!changed || !$ha_resets(m)) {
        return $MODEL_OK;
    }
    status = $ha_note_fired(m);
    if (status == $MODEL_OK) {
        status = $ha_leave(m, t, x);
    }
    if (status != $MODEL_OK) {
        return status;
    }
    to = $ha_mode_like(m, $ha_combination(branches));
    if (to < 0) {
        return $ha_fail(m, $MODEL_STUCK, 0, t);
    }
    m->mode = to;
    if ($ha_enter(m, t, x, &leap) != $MODEL_OK || !(leap <= $HA_NO_LEAP)) {
        return $ha_fail(m, $MODEL_STUCK, 0, t);
    }
    for (law = 0; law < HA_LAWS; ++law) {
        const int kept = m->let_go_at == t && m->let_go[law];
        m->let_go[law] = kept || branches[law] != $ha_branches[from][law];
    }
    m->let_go_at = t;
    m->switched = 1;
    return $ha_fire_again(m);
}

//end
//item ha_run_rounds
/* Lets happen what has been found to happen, and what follows from that at the same instant. */
static int ha_run_rounds(ha_model *m, double t, $real *x)
{
    int turn;
    int status = $MODEL_OK;
    for (turn = 0; turn < 200 && status == $MODEL_OK && $ha_first_fired(m) >= 0; ++turn) {
//if releases
        status = $ha_release(m, t, x);
//end
        if (status == $MODEL_OK) {
            status = $ha_round(m, t, x, turn == 0);
        }
    }
    if (status != $MODEL_OK || $ha_first_fired(m) < 0) {
        return status;
    }
    return $ha_fail(m, $MODEL_ENDLESS_EVENTS, $ha_first_fired(m), t);
}

//entry ha_settle_all
/* Lets happen what has been found to happen, and goes on in the mode that holds after it. */
static int ha_settle_all(ha_model *m, double t, $real *x)
{
    int status = $ha_note_compared(m, t, x);
    int turn;
    if (status == $MODEL_OK) {
        status = $ha_run_rounds(m, t, x);
    }
    for (turn = 0; turn < 200 && status == $MODEL_OK; ++turn) {
        int switched;
        status = $ha_settle(m, t, x, &switched);
        if (status != $MODEL_OK || !switched) {
            return status;
        }
        m->switched = 1;
        status = $ha_find_fired(m, t, x);
        if (status == $MODEL_OK) {
            status = $ha_run_rounds(m, t, x);
        }
    }
    return status == $MODEL_OK ? $ha_fail(m, $MODEL_NO_MODE, 0, t) : status;
}

//end
//if exchanges
//item ha_exchange
/* Goes on with other independent variables where these move many times as fast, as near a dead centre; whether it does. Then x is the same
 * position and motion in the new ones. */
static int ha_exchange(ha_model *m, double t, $real *x, int failed, int *exchanged)
{
    unsigned char wanted[$EXCHANGED];
    const int from = m->mode;
    const int found = $ha_find_wanted(m, t, x, failed, wanted);
    int status;
    int to;
    *exchanged = 0;
    if (found <= 0) {
        return found < 0 ? $ha_fail(m, $MODEL_PASSED, 0, t) : $MODEL_OK;
    }
    to = $ha_mode_with(m->mode, wanted);
    if (to < 0 || to == from) {
        return $MODEL_OK;
    }
    status = $ha_leave(m, t, x);
    if (status != $MODEL_OK) {
        return status;
    }
    $ha_copy(m->left_x, x, HA_NX);
    m->mode = to;
    if ($ha_enter_at(m, t, x) == $MODEL_OK) {
        int i;
        for (i = 0; i < $EXCHANGED; ++i) {
            m->taken_over[i] = wanted[i];
        }
        *exchanged = 1;
        return $MODEL_OK;
    }
    /* It goes on as it was. */
    m->mode = from;
    status = $ha_enter_at(m, t, x);
    $ha_copy(x, m->left_x, HA_NX);
    return status;
}

//entry ha_go_on_from
/* A step has failed: tries to go on from its beginning with other independent variables, once; whether it does. */
static int ha_go_on_from(ha_model *m, double t, $real *x)
{
    const $model_failure failure = m->failure;
    int exchanged = 0;
    if (m->exchanged_at == t || m->t != t) {
        return failure.code;
    }
    m->exchanged_at = t;
    m->failure.code = $MODEL_OK;
    if ($ha_exchange(m, t, x, 1, &exchanged) != $MODEL_OK || !exchanged || $ha_hold_sides(m, t, x) != $MODEL_OK) {
        m->failure = failure;
//if keeps_steps
    } else {
        $ha_forget_steps(m);
//end
    }
    return m->failure.code;
}

//end
//public $model_is_over
int $model_is_over($model *m, double t, const $real *x, int *over)
{
    int status = $MODEL_OK;
    *over = 0;
//if bounds
    status = $ha_is_margin_below(m, t, x, over);
//end
//if exchanges
    if (status == $MODEL_OK && !*over) {
        unsigned char wanted[$EXCHANGED];
        const int found = $ha_find_wanted(m, t, x, 0, wanted);
        if (found < 0) {
            return $ha_fail(m, $MODEL_PASSED, 0, t);
        }
        m->exchange_due = found && $ha_mode_with(m->mode, wanted) >= 0;
        *over = m->exchange_due;
    }
//end
    return status;
}

//public $model_go_on
int $model_go_on($model *m, double t, $real *x)
{
    int status = $MODEL_OK;
//if bounds
    int below = 0;
    if (!m->switched) {
        status = $ha_is_margin_below(m, t, x, &below);
        if (status == $MODEL_OK && below) {
            status = $ha_find_fired(m, t, x);
        }
        if (status == $MODEL_OK && below) {
            status = $ha_settle_all(m, t, x);
        }
    }
//end
//if exchanges
    if (status == $MODEL_OK && !m->switched) {
        status = $ha_exchange(m, t, x, m->exchange_due, &m->switched);
        m->exchange_due = 0;
    }
//end
    if (status == $MODEL_OK && m->switched) {
        status = $ha_hold_sides(m, t, x);
//if keeps_steps
        $ha_forget_steps(m);
//end
    }
    m->switched = 0;
    return status;
}
