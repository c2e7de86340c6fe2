
//item HA_SIGN
#define HA_SIGN (UINT64_C(1) << 63)
//item HA_BIAS
#define HA_BIAS (UINT64_C(1023) << 52)
//item HA_ROUNDER
#define HA_ROUNDER 6755399441055744.0
//item HA_TINY
#define HA_TINY (1.0 / 134217728.0)
//item HA_PLAIN
#define HA_PLAIN 708.0

//always
/* A sum hi + lo, lo small against hi. */
typedef struct { double hi; double lo; } ha_double;
/* An angle a + b, and quarter turns, of which the last two bits count. */
typedef struct { double a; double b; uint64_t quarters; } ha_reduced;
/* 2^power (t + rest); the power stands in its low 12 bits. */
typedef struct { double t; double rest; uint64_t power; } ha_exponential;

//item ha_bits: HA_INLINE
HA_INLINE uint64_t ha_bits(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

//item ha_number: HA_INLINE
HA_INLINE double ha_number(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

//item ha_pair: HA_INLINE
HA_INLINE ha_double ha_pair(double hi, double lo)
{
    ha_double pair;
    pair.hi = hi;
    pair.lo = lo;
    return pair;
}

//item ha_fast_two_sum: HA_INLINE ha_pair
HA_INLINE ha_double ha_fast_two_sum(double a, double b)
{
    const double sum = a + b;
    return ha_pair(sum, b - (sum - a));
}

//item ha_two_sum: HA_INLINE ha_pair
HA_INLINE ha_double ha_two_sum(double a, double b)
{
    const double sum = a + b;
    const double part = sum - a;
    return ha_pair(sum, (a - (sum - part)) + (b - part));
}

//item ha_leading: HA_INLINE ha_bits ha_number
HA_INLINE double ha_leading(double a)
{
    return ha_number(ha_bits(a) & ~((UINT64_C(1) << 27) - 1));
}

//item ha_two_product: HA_FUNCTION ha_leading ha_pair
HA_FUNCTION ha_double ha_two_product(double a, double b)
{
    const double product = a * b;
    const double ah = ha_leading(a);
    const double bh = ha_leading(b);
    const double al = a - ah;
    const double bl = b - bh;
    return ha_pair(product, (((ah * bh - product) + ah * bl) + al * bh) + al * bl);
}

//item ha_times: HA_FUNCTION ha_fast_two_sum ha_two_product
HA_FUNCTION ha_double ha_times(ha_double a, double b)
{
    const ha_double p = ha_two_product(a.hi, b);
    return ha_fast_two_sum(p.hi, p.lo + a.lo * b);
}

//item ha_product: HA_FUNCTION ha_fast_two_sum ha_two_product
HA_FUNCTION ha_double ha_product(ha_double a, ha_double b)
{
    const ha_double p = ha_two_product(a.hi, b.hi);
    return ha_fast_two_sum(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

//item ha_sum: HA_FUNCTION ha_fast_two_sum ha_two_sum
HA_FUNCTION ha_double ha_sum(ha_double a, ha_double b)
{
    const ha_double s = ha_two_sum(a.hi, b.hi);
    return ha_fast_two_sum(s.hi, s.lo + (a.lo + b.lo));
}

//item ha_minus: HA_INLINE ha_pair
HA_INLINE ha_double ha_minus(ha_double a)
{
    return ha_pair(-a.hi, -a.lo);
}

//item ha_quotient: HA_FUNCTION ha_fast_two_sum ha_two_product
HA_FUNCTION ha_double ha_quotient(ha_double a, ha_double b)
{
    const double first = a.hi / b.hi;
    const ha_double p = ha_two_product(first, b.hi);
    const double rest = ((a.hi - p.hi) - p.lo) + (a.lo - first * b.lo);
    return ha_fast_two_sum(first, rest / b.hi);
}

//always
/* Sine, cosine, tangent. */

//item ha_far: HA_PIO2_HI HA_PIO2_LO HA_SELDOM HA_TWO_OVER_PI_BITS ha_bits ha_fast_two_sum ha_minus ha_two_product
HA_SELDOM ha_reduced ha_far(double x)
{
    const uint64_t limb = UINT64_C(0xffffffff);
    uint64_t product[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    uint64_t half[2];
    uint64_t mantissa;
    uint64_t quarters;
    ha_reduced r;
    ha_double y;
    double hi = 0.0;
    double lo = 0.0;
    double weight = 1.0 / 1073741824.0;
    int exponent;
    int first;
    int shift;
    int over;
    int i;
    int j;
    const int negative = x < 0.0;
    if (!(fabs(x) <= 1.7976931348623157e308)) {
        r.a = (double)NAN;
        r.b = 0.0;
        r.quarters = 0;
        return r;
    }
    exponent = (int)((ha_bits(x) >> 52) & 0x7ff) - 1075;
    mantissa = (ha_bits(x) & ((UINT64_C(1) << 52) - 1)) | (UINT64_C(1) << 52);
    first = (exponent + 62) / 32;
    shift = exponent - 32 * (first - 1) + 30;
    half[0] = mantissa & limb;
    half[1] = mantissa >> 32;
    for (i = 0; i < 2; i++) {
        uint64_t carry = 0;
        for (j = 0; j < 7; j++) {
            const uint64_t sum = half[i] * HA_TWO_OVER_PI_BITS[first + 6 - j] + product[i + j] + carry;
            product[i + j] = sum & limb;
            carry = sum >> 32;
        }
        product[i + 7] = carry;
    }
    for (j = 6; j >= 1; j--) {
        product[j] = ((((product[j] << 32) | product[j - 1]) << shift) >> 32) & limb;
    }
    quarters = product[6] >> 30;
    product[6] &= UINT64_C(0x3fffffff);
    over = (product[6] >> 29) == 1;
    if (over) {
        quarters += 1;
        for (j = 1; j < 6; j++) {
            product[j] = ~product[j] & limb;
        }
        product[6] = ~product[6] & UINT64_C(0x3fffffff);
    }
    for (j = 6; j >= 2; j--) {
        const ha_double sum = ha_fast_two_sum(hi, (double)product[j] * weight);
        hi = sum.hi;
        lo = lo + sum.lo;
        weight *= 1.0 / 4294967296.0;
    }
    y = ha_two_product(hi, HA_PIO2_HI);
    y = ha_fast_two_sum(y.hi, y.lo + (hi * HA_PIO2_LO + lo * HA_PIO2_HI));
    if (negative != over) {
        y = ha_minus(y);
    }
    r.a = y.hi;
    r.b = y.lo;
    r.quarters = negative ? 4 - quarters : quarters;
    return r;
}

//item ha_near: HA_INLINE HA_PIO2_MIDDLE HA_PIO2_REST HA_PIO2_SHORT HA_ROUNDER HA_TWO_OVER_PI ha_bits ha_two_sum
/* Where |x| <= 1e5. */
HA_INLINE ha_reduced ha_near(double x)
{
    const double rounded = x * HA_TWO_OVER_PI + HA_ROUNDER;
    const double k = rounded - HA_ROUNDER;
    const double t = x - k * HA_PIO2_SHORT;
    const ha_double s = ha_two_sum(t, -(k * HA_PIO2_MIDDLE));
    ha_reduced r;
    r.a = s.hi;
    r.b = s.lo - k * HA_PIO2_REST;
    r.quarters = ha_bits(rounded);
    return r;
}

//item ha_sine_rest: HA_INLINE HA_SINE
HA_INLINE double ha_sine_rest(ha_reduced r, double z)
{
    const double zz = z * z;
    const double low = (HA_SINE[0] + HA_SINE[1] * z) + zz * (HA_SINE[2] + HA_SINE[3] * z);
    const double p = low + (zz * zz) * (HA_SINE[4] + HA_SINE[5] * z);
    return r.b * (1.0 - 0.5 * z) - (r.a * z) * p;
}

//item ha_cosine_parts: HA_COSINE HA_INLINE ha_pair
HA_INLINE ha_double ha_cosine_parts(ha_reduced r, double z)
{
    const double zz = z * z;
    const double low = (HA_COSINE[0] + HA_COSINE[1] * z) + zz * (HA_COSINE[2] + HA_COSINE[3] * z);
    const double p = low + (zz * zz) * (HA_COSINE[4] + HA_COSINE[5] * z);
    const double half = 0.5 * z;
    const double w = 1.0 - half;
    return ha_pair(w, ((1.0 - w) - half) + (zz * p - r.a * r.b));
}

//item ha_turned: HA_INLINE HA_SIGN ha_bits ha_cosine_parts ha_number ha_sine_rest
HA_INLINE double ha_turned(ha_reduced r, uint64_t quarters)
{
    const double z = r.a * r.a;
    double value;
    if ((quarters & 1) == 0) {
        value = ha_number(ha_bits(r.a + ha_sine_rest(r, z)) | (ha_bits(r.a) & HA_SIGN));
    } else {
        const ha_double c = ha_cosine_parts(r, z);
        value = c.hi + c.lo;
    }
    return ha_number(ha_bits(value) ^ ((quarters & 2) << 62));
}

//item ha_sin_far: HA_SELDOM ha_far ha_turned
HA_SELDOM double ha_sin_far(double x)
{
    const ha_reduced r = ha_far(x);
    return ha_turned(r, r.quarters);
}

//item ha_cos_far: HA_SELDOM ha_far ha_turned
HA_SELDOM double ha_cos_far(double x)
{
    const ha_reduced r = ha_far(x);
    return ha_turned(r, r.quarters + 1);
}

//item ha_sin: HA_FUNCTION ha_near ha_sin_far ha_turned
HA_FUNCTION double ha_sin(double x)
{
    ha_reduced r;
    if (!(fabs(x) <= 1e5)) {
        return ha_sin_far(x);
    }
    r = ha_near(x);
    return ha_turned(r, r.quarters);
}

//item ha_cos: HA_FUNCTION ha_cos_far ha_near ha_turned
HA_FUNCTION double ha_cos(double x)
{
    ha_reduced r;
    if (!(fabs(x) <= 1e5)) {
        return ha_cos_far(x);
    }
    r = ha_near(x);
    return ha_turned(r, r.quarters + 1);
}

//item ha_turn: HA_FUNCTION HA_SIGN ha_bits ha_cos_far ha_cosine_parts ha_near ha_number ha_sin_far ha_sine_rest
/* Sine and cosine. */
HA_FUNCTION void ha_turn(double x, double *both)
{
    ha_reduced r;
    ha_double c;
    double z;
    double sine;
    double cosine;
    int odd;
    if (!(fabs(x) <= 1e5)) {
        both[0] = ha_sin_far(x);
        both[1] = ha_cos_far(x);
        return;
    }
    r = ha_near(x);
    z = r.a * r.a;
    sine = ha_number(ha_bits(r.a + ha_sine_rest(r, z)) | (ha_bits(r.a) & HA_SIGN));
    c = ha_cosine_parts(r, z);
    cosine = c.hi + c.lo;
    odd = (r.quarters & 1) != 0;
    both[0] = ha_number(ha_bits(odd ? cosine : sine) ^ ((r.quarters & 2) << 62));
    both[1] = ha_number(ha_bits(odd ? sine : cosine) ^ (((r.quarters + 1) & 2) << 62));
}

//item ha_tan: HA_FUNCTION HA_TINY ha_cosine_parts ha_far ha_fast_two_sum ha_minus ha_near ha_quotient ha_sine_rest
HA_FUNCTION double ha_tan(double x)
{
    ha_reduced r;
    ha_double sine;
    ha_double cosine;
    double z;
    if (fabs(x) < HA_TINY) {
        return x;
    }
    r = fabs(x) <= 1e5 ? ha_near(x) : ha_far(x);
    z = r.a * r.a;
    sine = ha_fast_two_sum(r.a, ha_sine_rest(r, z));
    cosine = ha_cosine_parts(r, z);
    cosine = ha_fast_two_sum(cosine.hi, cosine.lo);
    return ((r.quarters & 1) == 0 ? ha_quotient(sine, cosine) : ha_quotient(cosine, ha_minus(sine))).hi;
}

//always
/* Exponential and hyperbolic functions. */

//item ha_parts: HA_EXPONENTIAL HA_FUNCTION HA_POWERS HA_ROUNDER HA_STEPS_PER_E HA_STEP_REST HA_STEP_SHORT ha_bits
HA_FUNCTION ha_exponential ha_parts(double a, double b)
{
    const double rounded = a * HA_STEPS_PER_E + HA_ROUNDER;
    const double k = rounded - HA_ROUNDER;
    const double r = ((a - k * HA_STEP_SHORT) - k * HA_STEP_REST) + b;
    const uint64_t bits = ha_bits(rounded);
    const double rr = r * r;
    const double p = r + rr * ((HA_EXPONENTIAL[0] + HA_EXPONENTIAL[1] * r)
        + rr * (HA_EXPONENTIAL[2] + HA_EXPONENTIAL[3] * r));
    ha_exponential e;
    e.t = HA_POWERS[bits & 63][0];
    e.rest = HA_POWERS[bits & 63][1] + e.t * p;
    e.power = bits >> 6;
    return e;
}

//item ha_value: HA_BIAS HA_FUNCTION ha_number
HA_FUNCTION double ha_value(ha_exponential e)
{
    return ha_number((e.power << 52) + HA_BIAS) * (e.t + e.rest);
}

//item ha_scale: HA_FUNCTION ha_number
HA_FUNCTION double ha_scale(int64_t power)
{
    return ha_number((uint64_t)(power + 1023) << 52);
}

//item ha_half_of: HA_FUNCTION
/* Floor of half of a number. */
HA_FUNCTION int64_t ha_half_of(int64_t n)
{
    return n >= 0 ? n / 2 : -((1 - n) / 2);
}

//item ha_extreme_value: HA_FUNCTION ha_half_of ha_scale
HA_FUNCTION double ha_extreme_value(ha_exponential e)
{
    const int64_t low = (int64_t)(e.power & 0xfff);
    const int64_t power = low >= 2048 ? low - 4096 : low;
    const int64_t first = ha_half_of(power);
    return (e.t + e.rest) * ha_scale(first) * ha_scale(power - first);
}

//item ha_halved: HA_FUNCTION
HA_FUNCTION ha_exponential ha_halved(ha_exponential e)
{
    e.power -= 1;
    return e;
}

//item ha_half: HA_BIAS HA_FUNCTION ha_number ha_pair
HA_FUNCTION ha_double ha_half(ha_exponential e)
{
    const double scale = ha_number((e.power << 52) + (HA_BIAS - (UINT64_C(1) << 52)));
    return ha_pair(scale * e.t, scale * e.rest);
}

//item ha_exp: HA_FUNCTION HA_PLAIN ha_extreme_value ha_parts ha_value
HA_FUNCTION double ha_exp(double x)
{
    if (fabs(x) <= HA_PLAIN) {
        return ha_value(ha_parts(x, 0.0));
    }
    if (x != x) {
        return x;
    }
    if (x > 709.782712893384) {
        return (double)INFINITY;
    }
    if (x < -745.1332191019412) {
        return 0.0;
    }
    return ha_extreme_value(ha_parts(x, 0.0));
}

//item ha_sinh_rest: HA_FUNCTION HA_SINH
HA_FUNCTION double ha_sinh_rest(double x, double z)
{
    const double zz = z * z;
    const double low = HA_SINH[0] + HA_SINH[1] * z;
    const double high = (HA_SINH[2] + HA_SINH[3] * z) + zz * ((HA_SINH[4] + HA_SINH[5] * z) + zz * HA_SINH[6]);
    return (x * z) * (low + zz * high);
}

//item ha_sinh: HA_FUNCTION HA_PLAIN HA_TINY ha_extreme_value ha_half ha_halved ha_parts ha_sinh_rest
HA_FUNCTION double ha_sinh(double x)
{
    const double size = fabs(x);
    double value;
    if (size < 1.0) {
        return size < HA_TINY ? x : x + ha_sinh_rest(x, x * x);
    }
    if (size > 711.0 || x != x) {
        return x * (double)INFINITY;
    }
    if (size > HA_PLAIN) {
        value = ha_extreme_value(ha_halved(ha_parts(size, 0.0)));
    } else {
        const ha_double h = ha_half(ha_parts(size, 0.0));
        value = h.hi + (h.lo - 0.25 / (h.hi + h.lo));
    }
    return x < 0.0 ? -value : value;
}

//item ha_cosh: HA_FUNCTION HA_PLAIN ha_extreme_value ha_half ha_halved ha_parts
HA_FUNCTION double ha_cosh(double x)
{
    const double size = fabs(x);
    ha_double h;
    if (size > 711.0 || x != x) {
        return size * (double)INFINITY;
    }
    if (size > HA_PLAIN) {
        return ha_extreme_value(ha_halved(ha_parts(size, 0.0)));
    }
    h = ha_half(ha_parts(size, 0.0));
    return h.hi + (h.lo + 0.25 / (h.hi + h.lo));
}

//item ha_tanh: HA_COSH HA_FUNCTION HA_TINY ha_fast_two_sum ha_half ha_parts ha_quotient ha_sinh_rest ha_two_sum
HA_FUNCTION double ha_tanh(double x)
{
    const double size = fabs(x);
    double value = 1.0;
    if (size < HA_TINY || x != x) {
        return x;
    }
    if (size < 0.35) {
        const double z = size * size;
        const double zz = z * z;
        const double p = (HA_COSH[0] + HA_COSH[1] * z)
            + zz * ((HA_COSH[2] + HA_COSH[3] * z) + zz * (HA_COSH[4] + HA_COSH[5] * z));
        value = ha_quotient(ha_fast_two_sum(size, ha_sinh_rest(size, z)), ha_fast_two_sum(1.0, z * p)).hi;
    } else if (size < 20.0) {
        const ha_double h = ha_half(ha_parts(2.0 * size, 0.0));
        const ha_double below = ha_two_sum(h.hi, -0.5);
        const ha_double above = ha_two_sum(h.hi, 0.5);
        value = ha_quotient(ha_fast_two_sum(below.hi, below.lo + h.lo), ha_fast_two_sum(above.hi, above.lo + h.lo)).hi;
    }
    return x < 0.0 ? -value : value;
}

//always
/* Logarithms and powers. */

//item ha_is_plain: HA_FUNCTION ha_bits
HA_FUNCTION int ha_is_plain(double x)
{
    return ha_bits(x) - (UINT64_C(1) << 52) < (UINT64_C(0x7fe) << 52);
}

//item ha_parts_of_log: HA_BIAS HA_BINS_START HA_FUNCTION HA_LN2_REST HA_LN2_SHORT HA_LOGARITHM HA_LOGARITHMS ha_bits ha_fast_two_sum ha_leading ha_number
HA_FUNCTION ha_double ha_parts_of_log(double x, double shift)
{
    const uint64_t bits = ha_bits(x);
    const uint64_t place = (bits - HA_BINS_START) + HA_BIAS;
    const uint64_t power = place >> 52;
    const double k = (ha_number(power | UINT64_C(0x4330000000000000)) - 4503599627371519.0) - shift;
    const double m = ha_number((bits - (power << 52)) + HA_BIAS);
    const double *row = HA_LOGARITHMS[(place >> 45) & 127];
    const double head = ha_leading(m);
    const ha_double r = ha_fast_two_sum(head * row[0] - 1.0, (m - head) * row[0]);
    const double head_of_r = ha_leading(r.hi);
    const double tail = r.hi - head_of_r;
    const double square = 0.5 * (head_of_r * head_of_r);
    const double square_rest = tail * (head_of_r + 0.5 * tail);
    const ha_double s = ha_fast_two_sum(k * HA_LN2_SHORT + row[1], r.hi);
    const ha_double u = ha_fast_two_sum(s.hi, -square);
    const double rr = r.hi * r.hi;
    const double low = HA_LOGARITHM[0] + HA_LOGARITHM[1] * r.hi;
    const double high = (HA_LOGARITHM[2] + HA_LOGARITHM[3] * r.hi)
        + rr * ((HA_LOGARITHM[4] + HA_LOGARITHM[5] * r.hi) + rr * HA_LOGARITHM[6]);
    const double cube = (r.hi * rr) * (low + rr * high);
    const double rests = ((k * HA_LN2_REST + row[2]) + (r.lo - r.hi * r.lo)) + (s.lo + u.lo);
    return ha_fast_two_sum(u.hi, rests + (cube - square_rest));
}

//item ha_positive: HA_FUNCTION ha_is_plain ha_parts_of_log
HA_FUNCTION ha_double ha_positive(double x)
{
    return ha_is_plain(x) ? ha_parts_of_log(x, 0.0) : ha_parts_of_log(x * 18014398509481984.0, 54.0);
}

//item ha_extreme_log: HA_FUNCTION ha_pair ha_positive ha_product
HA_FUNCTION double ha_extreme_log(double x, double hi, double lo)
{
    if (x != x) {
        return x;
    }
    if (x == 0.0) {
        return -(double)INFINITY;
    }
    if (x < 0.0) {
        return (double)NAN;
    }
    if (x > 1.7976931348623157e308) {
        return x;
    }
    return ha_product(ha_positive(x), ha_pair(hi, lo)).hi;
}

//item ha_log: HA_FUNCTION ha_extreme_log ha_is_plain ha_parts_of_log
HA_FUNCTION double ha_log(double x)
{
    return ha_is_plain(x) ? ha_parts_of_log(x, 0.0).hi : ha_extreme_log(x, 1.0, 0.0);
}

//item ha_log10: HA_FUNCTION HA_LOG10_E_HI HA_LOG10_E_LO ha_extreme_log
HA_FUNCTION double ha_log10(double x)
{
    return ha_extreme_log(x, HA_LOG10_E_HI, HA_LOG10_E_LO);
}

//item ha_log2: HA_FUNCTION HA_LOG2_E_HI HA_LOG2_E_LO ha_extreme_log
HA_FUNCTION double ha_log2(double x)
{
    return ha_extreme_log(x, HA_LOG2_E_HI, HA_LOG2_E_LO);
}

//item ha_extreme_pow: HA_FUNCTION HA_SIGN ha_bits ha_extreme_value ha_parts ha_positive ha_times
HA_FUNCTION double ha_extreme_pow(double x, double y)
{
    const double greatest = 1180591620717411303424.0;
    const double size = fabs(x);
    const int negative = (ha_bits(x) & HA_SIGN) != 0;
    const int whole = floor(y) == y;
    const int endless = fabs(y) > 1.7976931348623157e308;
    double value;
    if (y == 0.0 || x == 1.0) {
        return 1.0;
    }
    if (x != x || y != y) {
        return x + y;
    }
    if (endless && size == 1.0) {
        return 1.0;
    }
    if (endless || size == 0.0 || size > 1.7976931348623157e308) {
        value = (size > 1.0) == (y > 0.0) ? (double)INFINITY : 0.0;
    } else {
        const double bounded = y > greatest ? greatest : y < -greatest ? -greatest : y;
        const ha_double p = ha_times(ha_positive(size), bounded);
        if (p.hi > 710.0) {
            value = (double)INFINITY;
        } else if (p.hi < -746.0) {
            value = 0.0;
        } else {
            value = ha_extreme_value(ha_parts(p.hi, p.lo));
        }
    }
    if (negative && !whole && x != 0.0 && size <= 1.7976931348623157e308 && !endless) {
        return (double)NAN;
    }
    if (negative && whole && fabs(y) < 9007199254740992.0 && floor(0.5 * y) != 0.5 * y) {
        return -value;
    }
    return value;
}

//item ha_pow: HA_FUNCTION HA_PLAIN ha_extreme_pow ha_is_plain ha_parts ha_parts_of_log ha_times ha_value
HA_FUNCTION double ha_pow(double x, double y)
{
    if (ha_is_plain(x) && fabs(y) <= 1180591620717411303424.0) {
        const ha_double p = ha_times(ha_parts_of_log(x, 0.0), y);
        if (fabs(p.hi) <= HA_PLAIN) {
            return ha_value(ha_parts(p.hi, p.lo));
        }
    }
    return ha_extreme_pow(x, y);
}

//always
/* Inverse trigonometric functions. */

//item ha_short_arc: HA_ARC HA_INLINE
HA_INLINE double ha_short_arc(double z)
{
    const double zz = z * z;
    return (HA_ARC[0] + HA_ARC[1] * z) + zz * ((HA_ARC[2] + HA_ARC[3] * z) + zz * HA_ARC[4]);
}

//item ha_below_diagonal: HA_ARCS HA_FUNCTION HA_ROUNDER ha_bits ha_fast_two_sum ha_minus ha_pair ha_product ha_quotient ha_short_arc ha_sum ha_two_sum
HA_FUNCTION ha_double ha_below_diagonal(ha_double n, ha_double d)
{
    const double rounded = 8.0 * (n.hi / d.hi) + HA_ROUNDER;
    const double j = rounded - HA_ROUNDER;
    const ha_double c = ha_pair(0.125 * j, 0.0);
    const ha_double down = ha_product(d, c);
    const ha_double across = ha_product(n, c);
    const ha_double t = ha_quotient(ha_sum(n, ha_minus(down)), ha_sum(d, across));
    const double z = t.hi * t.hi;
    const double p = ha_short_arc(z);
    const double *arc = HA_ARCS[ha_bits(rounded) & 15];
    const ha_double s = ha_two_sum(arc[0], t.hi);
    return ha_fast_two_sum(s.hi, s.lo + (arc[1] + (t.lo - (t.hi * z) * p)));
}

//item ha_angle: HA_FUNCTION HA_PIO2_HI HA_PIO2_LO ha_below_diagonal ha_minus ha_pair ha_sum
HA_FUNCTION ha_double ha_angle(ha_double n, ha_double d)
{
    if (n.hi > d.hi) {
        return ha_sum(ha_pair(HA_PIO2_HI, HA_PIO2_LO), ha_minus(ha_below_diagonal(d, n)));
    }
    return ha_below_diagonal(n, d);
}

//item ha_complement: HA_FUNCTION ha_fast_two_sum ha_pair ha_product ha_two_product ha_two_sum
HA_FUNCTION ha_double ha_complement(double x)
{
    const ha_double v = ha_product(ha_two_sum(1.0, -x), ha_two_sum(1.0, x));
    const double root = sqrt(v.hi);
    ha_double p;
    if (root == 0.0) {
        return ha_pair(0.0, 0.0);
    }
    p = ha_two_product(root, root);
    return ha_fast_two_sum(root, (((v.hi - p.hi) - p.lo) + v.lo) / (2.0 * root));
}

//item ha_asin: HA_FUNCTION HA_TINY ha_angle ha_complement ha_pair
HA_FUNCTION double ha_asin(double x)
{
    const double size = fabs(x);
    double value;
    if (size < HA_TINY || x != x) {
        return x;
    }
    if (size > 1.0) {
        return (double)NAN;
    }
    value = ha_angle(ha_pair(size, 0.0), ha_complement(size)).hi;
    return x < 0.0 ? -value : value;
}

//item ha_acos: HA_FUNCTION HA_PIO2_HI HA_PI_HI HA_PI_LO ha_angle ha_complement ha_minus ha_pair ha_sum
HA_FUNCTION double ha_acos(double x)
{
    const double size = fabs(x);
    ha_double value;
    if (x != x) {
        return x;
    }
    if (size > 1.0) {
        return (double)NAN;
    }
    if (size < 1.0 / 1152921504606846976.0) {
        return HA_PIO2_HI;
    }
    value = ha_angle(ha_complement(size), ha_pair(size, 0.0));
    return x < 0.0 ? ha_sum(ha_pair(HA_PI_HI, HA_PI_LO), ha_minus(value)).hi : value.hi;
}

//item ha_arc_beyond: HA_INLINE ha_fast_two_sum ha_leading ha_short_arc
HA_INLINE double ha_arc_beyond(double arc, double arc_rest, double n, ha_double d)
{
    const double inverse = 1.0 / d.hi;
    const double hi = ha_leading(n * inverse);
    const double front = ha_leading(d.hi);
    const double lo = ((n - hi * front) - hi * ((d.hi - front) + d.lo)) * inverse;
    const double t = hi + lo;
    const double z = t * t;
    const ha_double sum = ha_fast_two_sum(arc, hi);
    return sum.hi + (sum.lo + (arc_rest + (lo - (t * z) * ha_short_arc(z))));
}

//item ha_atan: HA_ARCS_OF_QUARTERS HA_FUNCTION HA_PIO2_HI HA_PIO2_LO HA_TINY ha_arc_beyond ha_bits ha_number ha_pair ha_short_arc ha_two_product ha_two_sum
HA_FUNCTION double ha_atan(double x)
{
    const double size = fabs(x);
    double value;
    if (size < HA_TINY || x != x) {
        return x;
    }
    if (size < 0.0625) {
        value = size - size * (size * size) * ha_short_arc(size * size);
    } else if (size > 1e18) {
        value = HA_PIO2_HI;
    } else if (size >= 16.0) {
        value = ha_arc_beyond(HA_PIO2_HI, HA_PIO2_LO, -1.0, ha_pair(size, 0.0));
    } else {
        const uint64_t quarter = ha_bits(size) >> 50;
        const double c = ha_number(quarter << 50 | UINT64_C(1) << 49);
        const double *arc = HA_ARCS_OF_QUARTERS[quarter - UINT64_C(4076)];
        const ha_double across = ha_two_product(size, c);
        const ha_double d = ha_two_sum(1.0, across.hi);
        value = ha_arc_beyond(arc[0], arc[1], size - c, ha_pair(d.hi, d.lo + across.lo));
    }
    return x < 0.0 ? -value : value;
}

//item ha_finite_angle: HA_FUNCTION HA_PI_HI HA_PI_LO HA_TINY ha_angle ha_bits ha_half_of ha_minus ha_pair ha_scale ha_sum
HA_FUNCTION double ha_finite_angle(double n, double d, int behind)
{
    const double most = n > d ? n : d;
    const int64_t exponent = (int64_t)((ha_bits(most) >> 52) & 0x7ff);
    const int64_t power = (exponent > 1 ? exponent : 1) - 1023;
    const int64_t first = ha_half_of(-power);
    const double one = ha_scale(first);
    const double other = ha_scale(-power - first);
    const double flat = 1.0 / 1267650600228229401496703205376.0;
    double up = n * one * other;
    double along = d * one * other;
    ha_double value;
    if (up < HA_TINY * along && !behind) {
        return n / d;
    }
    up = up < flat ? 0.0 : up;
    along = along < flat ? 0.0 : along;
    value = ha_angle(ha_pair(up, 0.0), ha_pair(along, 0.0));
    return behind ? ha_sum(ha_pair(HA_PI_HI, HA_PI_LO), ha_minus(value)).hi : value.hi;
}

//item ha_atan2: HA_FUNCTION HA_PIO2_HI HA_PI_HI ha_bits ha_finite_angle
HA_FUNCTION double ha_atan2(double y, double x)
{
    const double n = fabs(y);
    const double d = fabs(x);
    const int behind = (int)(ha_bits(x) >> 63);
    const int high = n > 1.7976931348623157e308;
    double value;
    if (x != x || y != y) {
        return x + y;
    }
    if (n == 0.0) {
        value = behind ? HA_PI_HI : 0.0;
    } else if (d == 0.0) {
        value = HA_PIO2_HI;
    } else if (high && n == d) {
        value = (behind ? 0.75 : 0.25) * HA_PI_HI;
    } else if (high) {
        value = HA_PIO2_HI;
    } else if (d > 1.7976931348623157e308) {
        value = behind ? HA_PI_HI : 0.0;
    } else {
        value = ha_finite_angle(n, d, behind);
    }
    return (ha_bits(y) >> 63) == 1 ? -value : value;
}

//always
/* The rest. */

//item ha_sqrt: HA_FUNCTION
HA_FUNCTION double ha_sqrt(double x)
{
    return sqrt(x);
}

//item ha_abs: HA_FUNCTION
HA_FUNCTION double ha_abs(double x)
{
    return fabs(x);
}

//item ha_floor: HA_FUNCTION
HA_FUNCTION double ha_floor(double x)
{
    return floor(x);
}

//item ha_sign: HA_FUNCTION
HA_FUNCTION double ha_sign(double x)
{
    return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x == 0.0 ? 0.0 : x;
}

//item ha_min: HA_FUNCTION
HA_FUNCTION double ha_min(double x, double y)
{
    return y < x || x != x ? y : x;
}

//item ha_max: HA_FUNCTION
HA_FUNCTION double ha_max(double x, double y)
{
    return y > x || x != x ? y : x;
}

//item ha_mod: HA_FUNCTION
HA_FUNCTION double ha_mod(double x, double y)
{
    return x - y * floor(x / y);
}

//item ha_powi: HA_FUNCTION
/* x to the power n by repeated squaring. */
HA_FUNCTION double ha_powi(double x, uint32_t n)
{
    double result = 1.0;
    double square = x;
    while (n > 0) {
        if ((n & 1) == 1) {
            result *= square;
        }
        square *= square;
        n >>= 1;
    }
    return result;
}
