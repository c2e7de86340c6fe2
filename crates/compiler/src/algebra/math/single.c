//always
/* Elementary functions in single precision: what is far from the ordinary is left to those of double precision. */

/* A sum hi + lo, lo small against hi. */
typedef struct { float hi; float lo; } ha_float;
/* An angle a + b, and quarter turns, of which the last two bits count. */
typedef struct { float a; float b; int quarters; } ha_turned_single;

//item HA_ROUNDER_SINGLE
#define HA_ROUNDER_SINGLE 12582912.0f

//item ha_bits_single: HA_INLINE
HA_INLINE uint32_t ha_bits_single(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

//item ha_number_single: HA_INLINE
HA_INLINE float ha_number_single(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

//item ha_pair_single: HA_INLINE
HA_INLINE ha_float ha_pair_single(float hi, float lo)
{
    ha_float pair;
    pair.hi = hi + lo;
    pair.lo = lo - (pair.hi - hi);
    return pair;
}

//item ha_leading_single: HA_INLINE ha_bits_single ha_number_single
/* The first 12 bits. */
HA_INLINE float ha_leading_single(float a)
{
    return ha_number_single(ha_bits_single(a) & UINT32_C(0xfffff000));
}

//item ha_two_product_single: HA_FUNCTION ha_leading_single
HA_FUNCTION ha_float ha_two_product_single(float a, float b)
{
    const float product = a * b;
    const float ah = ha_leading_single(a);
    const float bh = ha_leading_single(b);
    const float al = a - ah;
    const float bl = b - bh;
    ha_float pair;
    pair.hi = product;
    pair.lo = (((ah * bh - product) + ah * bl) + al * bh) + al * bl;
    return pair;
}

//always
/* Sine, cosine, tangent; where |x| <= 200. */

//item ha_near_single: HA_FUNCTION HA_QUARTERS_SINGLE HA_QUARTER_FIRST HA_QUARTER_REST HA_QUARTER_SECOND HA_ROUNDER_SINGLE
HA_FUNCTION ha_turned_single ha_near_single(float x)
{
    const float k = (x * HA_QUARTERS_SINGLE + HA_ROUNDER_SINGLE) - HA_ROUNDER_SINGLE;
    const float t = x - k * HA_QUARTER_FIRST;
    const float way = k * HA_QUARTER_SECOND;
    const float hi = t - way;
    const float lo = ((t - hi) - way) - k * HA_QUARTER_REST;
    ha_turned_single r;
    r.a = hi + lo;
    r.b = lo - (r.a - hi);
    r.quarters = (int)k;
    return r;
}

//item ha_sine_rest_single: HA_INLINE HA_SINE_SINGLE
HA_INLINE float ha_sine_rest_single(ha_turned_single r, float z)
{
    const float p = (HA_SINE_SINGLE[0] + z * HA_SINE_SINGLE[1]) + (z * z) * (HA_SINE_SINGLE[2] + z * HA_SINE_SINGLE[3]);
    return r.b * (1.0f - 0.5f * z) + (r.a * z) * p;
}

//item ha_cosine_parts_single: HA_COSINE_SINGLE HA_INLINE
HA_INLINE ha_float ha_cosine_parts_single(ha_turned_single r, float z)
{
    const float low = HA_COSINE_SINGLE[0] + z * HA_COSINE_SINGLE[1];
    const float p = low + (z * z) * (HA_COSINE_SINGLE[2] + z * HA_COSINE_SINGLE[3]);
    const float half = 0.5f * z;
    ha_float c;
    c.hi = 1.0f - half;
    c.lo = ((1.0f - c.hi) - half) + ((z * z) * p - r.a * r.b);
    return c;
}

//item ha_sine_of_single: HA_INLINE ha_cosine_parts_single ha_sine_rest_single
HA_INLINE float ha_sine_of_single(ha_turned_single r, int quarters)
{
    const float z = r.a * r.a;
    float value;
    if ((quarters & 1) == 0) {
        value = r.a + ha_sine_rest_single(r, z);
    } else {
        const ha_float c = ha_cosine_parts_single(r, z);
        value = c.hi + c.lo;
    }
    return (quarters & 2) != 0 ? -value : value;
}

//item ha_sinf: HA_FUNCTION ha_near_single ha_sin ha_sine_of_single
HA_FUNCTION float ha_sinf(float x)
{
    ha_turned_single r;
    if (!(fabsf(x) <= 200.0f)) {
        return (float)ha_sin((double)x);
    }
    if (x == 0.0f) {
        return x;
    }
    r = ha_near_single(x);
    return ha_sine_of_single(r, r.quarters);
}

//item ha_cosf: HA_FUNCTION ha_cos ha_near_single ha_sine_of_single
HA_FUNCTION float ha_cosf(float x)
{
    ha_turned_single r;
    if (!(fabsf(x) <= 200.0f)) {
        return (float)ha_cos((double)x);
    }
    r = ha_near_single(x);
    return ha_sine_of_single(r, r.quarters + 1);
}

//item ha_turnf: HA_FUNCTION ha_cosf ha_cosine_parts_single ha_near_single ha_sine_rest_single ha_sinf
/* Sine and cosine. */
HA_FUNCTION void ha_turnf(float x, float *both)
{
    ha_turned_single r;
    ha_float c;
    float z;
    float sine;
    float cosine;
    if (!(fabsf(x) <= 200.0f) || x == 0.0f) {
        both[0] = ha_sinf(x);
        both[1] = ha_cosf(x);
        return;
    }
    r = ha_near_single(x);
    z = r.a * r.a;
    sine = r.a + ha_sine_rest_single(r, z);
    c = ha_cosine_parts_single(r, z);
    cosine = c.hi + c.lo;
    both[0] = (r.quarters & 1) != 0 ? cosine : sine;
    both[1] = (r.quarters & 1) != 0 ? -sine : cosine;
    if ((r.quarters & 2) != 0) {
        both[0] = -both[0];
        both[1] = -both[1];
    }
}

//item ha_tanf: HA_FUNCTION ha_cosine_parts_single ha_near_single ha_sine_rest_single ha_tan
HA_FUNCTION float ha_tanf(float x)
{
    ha_turned_single r;
    ha_float cosine;
    float rest;
    float z;
    if (!(fabsf(x) <= 200.0f)) {
        return (float)ha_tan((double)x);
    }
    if (x == 0.0f) {
        return x;
    }
    r = ha_near_single(x);
    z = r.a * r.a;
    rest = ha_sine_rest_single(r, z);
    cosine = ha_cosine_parts_single(r, z);
    if ((r.quarters & 1) == 0) {
        const float value = (r.a + rest) / (cosine.hi + cosine.lo);
        return value;
    }
    return -((cosine.hi + cosine.lo) / (r.a + rest));
}

//always
/* Exponential and hyperbolic functions. */

//item ha_scale_single: HA_INLINE ha_number_single
/* 2^power, from -126 to 127. */
HA_INLINE float ha_scale_single(int power)
{
    return ha_number_single((uint32_t)(power + 127) << 23);
}

//item ha_exponential_single: HA_EXPONENTIAL_SINGLE HA_FUNCTION HA_LN2_FIRST HA_LN2_SECOND HA_ROUNDER_SINGLE HA_STEPS_SINGLE ha_scale_single
/* e^(a + b) times 2^shift, where it is no more than twice the greatest number. */
HA_FUNCTION float ha_exponential_single(float a, float b, int shift)
{
    const float k = (a * HA_STEPS_SINGLE + HA_ROUNDER_SINGLE) - HA_ROUNDER_SINGLE;
    const float first = a - k * HA_LN2_FIRST;
    const float rest = b - k * HA_LN2_SECOND;
    const float r = first + rest;
    const float left = rest - (r - first);
    const float low = HA_EXPONENTIAL_SINGLE[0] + r * HA_EXPONENTIAL_SINGLE[1];
    const float middle = HA_EXPONENTIAL_SINGLE[2] + r * HA_EXPONENTIAL_SINGLE[3];
    const float high = HA_EXPONENTIAL_SINGLE[4] + r * HA_EXPONENTIAL_SINGLE[5];
    const float rr = r * r;
    const float value = 1.0f + (r + (left + rr * (low + rr * (middle + rr * high))));
    const int power = (int)k + shift;
    const int half = power / 2;
    return power >= -126 && power <= 127 ? value * ha_scale_single(power)
                                         : value * ha_scale_single(half) * ha_scale_single(power - half);
}

//item ha_expf: HA_FUNCTION ha_exponential_single
HA_FUNCTION float ha_expf(float x)
{
    if (x > 89.0f) {
        return x + (float)INFINITY;
    }
    if (x < -104.0f) {
        return 0.0f;
    }
    return x != x ? x : ha_exponential_single(x, 0.0f, 0);
}

//item ha_sinhf: HA_FUNCTION HA_SINH_SINGLE ha_exponential_single
HA_FUNCTION float ha_sinhf(float x)
{
    const float size = fabsf(x);
    float half;
    float value;
    if (!(size <= 90.0f)) {
        return x * (float)INFINITY;
    }
    if (size < 1.0f) {
        const float z = x * x;
        const float p = (HA_SINH_SINGLE[0] + z * HA_SINH_SINGLE[1]) + (z * z) * (HA_SINH_SINGLE[2] + z * HA_SINH_SINGLE[3]);
        return x + (x * z) * p;
    }
    half = ha_exponential_single(size, 0.0f, -1);
    value = half - 0.25f / half;
    return x < 0.0f ? -value : value;
}

//item ha_coshf: HA_FUNCTION ha_exponential_single
HA_FUNCTION float ha_coshf(float x)
{
    const float size = fabsf(x);
    float half;
    if (!(size <= 90.0f)) {
        return size * (float)INFINITY;
    }
    half = ha_exponential_single(size, 0.0f, -1);
    return half + 0.25f / half;
}

//item ha_tanhf: HA_FUNCTION HA_TANH_SINGLE ha_exponential_single
HA_FUNCTION float ha_tanhf(float x)
{
    const float size = fabsf(x);
    float value = 1.0f;
    if (x != x) {
        return x;
    }
    if (size < 0.63f) {
        const float z = x * x;
        const float zz = z * z;
        const float low = HA_TANH_SINGLE[0] + z * HA_TANH_SINGLE[1];
        const float middle = HA_TANH_SINGLE[2] + z * HA_TANH_SINGLE[3];
        const float high = HA_TANH_SINGLE[4] + z * HA_TANH_SINGLE[5];
        return x + (x * z) * (low + zz * (middle + zz * high));
    }
    if (size < 10.0f) {
        value = 1.0f - 2.0f / (ha_exponential_single(2.0f * size, 0.0f, 0) + 1.0f);
    }
    return x < 0.0f ? -value : value;
}

//always
/* Logarithms and powers. */

//item ha_parts_of_log_single: HA_FUNCTION HA_LN2_FIRST HA_LN2_SECOND HA_LOGARITHM_SINGLE ha_bits_single ha_number_single ha_pair_single ha_two_product_single
/* The logarithm of a finite number above zero: s = f/(2 + f) of the mantissa 1 + f. */
HA_FUNCTION ha_float ha_parts_of_log_single(float x)
{
    const int small = x < 1.17549435e-38f;
    const float plain = small ? x * 8388608.0f : x;
    const uint32_t bits = ha_bits_single(plain);
    /* The mantissa from the root of 1/2 to that of 2. */
    const uint32_t place = bits - UINT32_C(0x3f3504f3);
    const int power = (int)(place >> 23) - (place >= UINT32_C(0x80000000) ? 512 : 0);
    const float k = (float)(small ? power - 23 : power);
    const float f = ha_number_single((place & UINT32_C(0x007fffff)) + UINT32_C(0x3f3504f3)) - 1.0f;
    const float under = 2.0f + f;
    const float under_rest = f - (under - 2.0f);
    const float s = f / under;
    const ha_float p = ha_two_product_single(s, under);
    const float rest = (((f - p.hi) - p.lo) - s * under_rest) / under;
    const float z = s * s;
    const float low = HA_LOGARITHM_SINGLE[0] + z * HA_LOGARITHM_SINGLE[1];
    const float tail = (s * z) * (low + (z * z) * (HA_LOGARITHM_SINGLE[2] + z * HA_LOGARITHM_SINGLE[3]));
    const float whole = k * HA_LN2_FIRST;
    const float twice = 2.0f * s;
    const float hi = whole + twice;
    const float lost = whole == 0.0f ? 0.0f : twice - (hi - whole);
    return ha_pair_single(hi, lost + ((2.0f * rest + k * HA_LN2_SECOND) + tail));
}

//item ha_extreme_log_single: HA_FUNCTION
/* Where the logarithm is no finite number. */
HA_FUNCTION float ha_extreme_log_single(float x)
{
    if (x != x || x > 0.0f) {
        return x;
    }
    return x == 0.0f ? -(float)INFINITY : (float)NAN;
}

//item ha_has_log_single: HA_FUNCTION
HA_FUNCTION int ha_has_log_single(float x)
{
    return x > 0.0f && x <= 3.40282347e38f;
}

//item ha_logf: HA_FUNCTION ha_extreme_log_single ha_has_log_single ha_parts_of_log_single
HA_FUNCTION float ha_logf(float x)
{
    return ha_has_log_single(x) ? ha_parts_of_log_single(x).hi : ha_extreme_log_single(x);
}

//item ha_log_by_single: HA_FUNCTION ha_extreme_log_single ha_has_log_single ha_parts_of_log_single ha_two_product_single
HA_FUNCTION float ha_log_by_single(float x, float first, float rest)
{
    ha_float l;
    ha_float p;
    if (!ha_has_log_single(x)) {
        return ha_extreme_log_single(x);
    }
    l = ha_parts_of_log_single(x);
    p = ha_two_product_single(l.hi, first);
    return p.hi + (p.lo + (l.lo * first + l.hi * rest));
}

//item ha_log10f: HA_FUNCTION HA_LOG10_FIRST HA_LOG10_REST ha_log_by_single
HA_FUNCTION float ha_log10f(float x)
{
    return ha_log_by_single(x, HA_LOG10_FIRST, HA_LOG10_REST);
}

//item ha_log2f: HA_FUNCTION HA_LOG2_FIRST HA_LOG2_REST ha_log_by_single
HA_FUNCTION float ha_log2f(float x)
{
    return ha_log_by_single(x, HA_LOG2_FIRST, HA_LOG2_REST);
}

//item ha_powf: HA_FUNCTION ha_exponential_single ha_has_log_single ha_parts_of_log_single ha_pow ha_two_product_single
HA_FUNCTION float ha_powf(float x, float y)
{
    if (ha_has_log_single(x) && fabsf(y) <= 1e9f) {
        const ha_float l = ha_parts_of_log_single(x);
        const ha_float p = ha_two_product_single(l.hi, y);
        if (fabsf(p.hi) <= 80.0f) {
            return ha_exponential_single(p.hi, p.lo + l.lo * y, 0);
        }
    }
    return (float)ha_pow((double)x, (double)y);
}

//always
/* Inverse trigonometric functions. */

//item ha_below_diagonal_single: HA_ARC_SINGLE HA_FUNCTION HA_QUARTER_HI HA_QUARTER_LO
/* atan t for 0 <= t <= 1. */
HA_FUNCTION float ha_below_diagonal_single(float t)
{
    const int high = t > 0.41421357f;
    const float u = high ? (t - 1.0f) / (t + 1.0f) : t;
    const float z = u * u;
    const float zz = z * z;
    const float low = HA_ARC_SINGLE[0] + z * HA_ARC_SINGLE[1];
    const float p = low + zz * ((HA_ARC_SINGLE[2] + z * HA_ARC_SINGLE[3]) + zz * HA_ARC_SINGLE[4]);
    const float rest = (u * z) * p;
    return high ? 0.5f * HA_QUARTER_HI + (u + (rest + 0.5f * HA_QUARTER_LO)) : u + rest;
}

//item ha_atanf: HA_FUNCTION HA_QUARTER_HI HA_QUARTER_LO ha_below_diagonal_single
HA_FUNCTION float ha_atanf(float x)
{
    const float size = fabsf(x);
    float value;
    if (x != x || x == 0.0f) {
        return x;
    }
    if (size <= 1.0f) {
        value = ha_below_diagonal_single(size);
    } else {
        value = HA_QUARTER_HI - (ha_below_diagonal_single(1.0f / size) - HA_QUARTER_LO);
    }
    return x < 0.0f ? -value : value;
}

//item ha_atan2f: HA_FUNCTION HA_HALF_TURN_HI HA_HALF_TURN_LO HA_QUARTER_HI HA_QUARTER_LO ha_atan2 ha_below_diagonal_single ha_bits_single
HA_FUNCTION float ha_atan2f(float y, float x)
{
    const float n = fabsf(y);
    const float d = fabsf(x);
    const int behind = (int)(ha_bits_single(x) >> 31);
    const int below = (int)(ha_bits_single(y) >> 31);
    float value;
    if (!(n >= 1e-18f && n <= 1e18f && d >= 1e-18f && d <= 1e18f)) {
        return (float)ha_atan2((double)y, (double)x);
    }
    if (n <= d) {
        value = ha_below_diagonal_single(n / d);
    } else {
        value = HA_QUARTER_HI - (ha_below_diagonal_single(d / n) - HA_QUARTER_LO);
    }
    if (behind) {
        value = HA_HALF_TURN_HI - (value - HA_HALF_TURN_LO);
    }
    return below ? -value : value;
}

//item ha_arc_sine_rest_single: HA_ARC_SINE_SINGLE HA_INLINE
HA_INLINE float ha_arc_sine_rest_single(float x, float z)
{
    const float zz = z * z;
    const float low = HA_ARC_SINE_SINGLE[0] + z * HA_ARC_SINE_SINGLE[1];
    const float middle = HA_ARC_SINE_SINGLE[2] + z * HA_ARC_SINE_SINGLE[3];
    const float high = HA_ARC_SINE_SINGLE[4] + z * HA_ARC_SINE_SINGLE[5];
    return (x * z) * (low + zz * (middle + zz * high));
}

//item ha_arc_of_root_single: HA_FUNCTION ha_arc_sine_rest_single ha_pair_single ha_two_product_single
/* asin sqrt(z) for z <= 1/4, as a pair: the root has a rest. */
HA_FUNCTION ha_float ha_arc_of_root_single(float z)
{
    const float root = sqrtf(z);
    const ha_float p = ha_two_product_single(root, root);
    const float left = root == 0.0f ? 0.0f : ((z - p.hi) - p.lo) / (2.0f * root);
    return ha_pair_single(root, left + ha_arc_sine_rest_single(root, z));
}

//item ha_asinf: HA_FUNCTION HA_QUARTER_HI HA_QUARTER_LO ha_arc_of_root_single ha_arc_sine_rest_single
HA_FUNCTION float ha_asinf(float x)
{
    const float size = fabsf(x);
    ha_float half;
    float value;
    if (!(size <= 1.0f)) {
        return (float)NAN;
    }
    if (size <= 0.5f) {
        return x + ha_arc_sine_rest_single(x, x * x);
    }
    half = ha_arc_of_root_single(0.5f * (1.0f - size));
    value = HA_QUARTER_HI - (2.0f * half.hi + (2.0f * half.lo - HA_QUARTER_LO));
    return x < 0.0f ? -value : value;
}

//item ha_acosf: HA_FUNCTION HA_HALF_TURN_HI HA_HALF_TURN_LO HA_QUARTER_HI HA_QUARTER_LO ha_arc_of_root_single ha_arc_sine_rest_single
HA_FUNCTION float ha_acosf(float x)
{
    const float size = fabsf(x);
    ha_float half;
    if (!(size <= 1.0f)) {
        return (float)NAN;
    }
    if (size <= 0.5f) {
        return HA_QUARTER_HI - (x + (ha_arc_sine_rest_single(x, x * x) - HA_QUARTER_LO));
    }
    half = ha_arc_of_root_single(0.5f * (1.0f - size));
    if (x > 0.0f) {
        return 2.0f * half.hi + 2.0f * half.lo;
    }
    return HA_HALF_TURN_HI - (2.0f * half.hi + (2.0f * half.lo - HA_HALF_TURN_LO));
}

//always
/* The rest. */

//item ha_signf: HA_FUNCTION
HA_FUNCTION float ha_signf(float x)
{
    return x > 0.0f ? 1.0f : x < 0.0f ? -1.0f : x == 0.0f ? 0.0f : x;
}

//item ha_minf: HA_FUNCTION
HA_FUNCTION float ha_minf(float x, float y)
{
    return y < x || x != x ? y : x;
}

//item ha_maxf: HA_FUNCTION
HA_FUNCTION float ha_maxf(float x, float y)
{
    return y > x || x != x ? y : x;
}
