
//always
/* Constants of the elementary functions in single precision. Written by `single.py`. */

//item HA_QUARTERS_SINGLE
/* 2/pi. */
#define HA_QUARTERS_SINGLE 0.6366197466850281f
//item HA_QUARTER_FIRST
/* pi/2 in multiples of 2^-16. */
#define HA_QUARTER_FIRST 1.57080078125f
//item HA_QUARTER_SECOND
/* What is left of it, in multiples of 2^-33. */
#define HA_QUARTER_SECOND -4.454399459064007e-06f
//item HA_QUARTER_REST
/* What is left of that. */
#define HA_QUARTER_REST -5.564431554416771e-11f
//item HA_QUARTER_HI
/* pi/2 as a number of single precision. */
#define HA_QUARTER_HI 1.5707963705062866f
//item HA_QUARTER_LO
/* What is left of it. */
#define HA_QUARTER_LO -4.371138828673793e-08f
//item HA_HALF_TURN_HI
/* pi as a number of single precision. */
#define HA_HALF_TURN_HI 3.1415927410125732f
//item HA_HALF_TURN_LO
/* What is left of it. */
#define HA_HALF_TURN_LO -8.742277657347586e-08f
//item HA_SINE_SINGLE: HA_DATA
/* (sin a - a)/a^3 by z = a^2; error 2^-28.29 of the function. */
HA_DATA float HA_SINE_SINGLE[4] = {-0.1666666716337204f, 0.008333331905305386f, -0.00019840082677546889f, 2.7249313916399842e-06f};
//item HA_COSINE_SINGLE: HA_DATA
/* (cos a - 1 + z/2)/z^2 by z = a^2; error 2^-31.01 of the function. */
HA_DATA float HA_COSINE_SINGLE[4] = {0.0416666679084301f, -0.00138888880610466f, 2.480059629306197e-05f, -2.730044741383608e-07f};
//item HA_STEPS_SINGLE
/* 1/ln 2. */
#define HA_STEPS_SINGLE 1.4426950216293335f
//item HA_LN2_FIRST
/* ln 2 in multiples of 2^-15. */
#define HA_LN2_FIRST 0.693145751953125f
//item HA_LN2_SECOND
/* ln 2 without them. */
#define HA_LN2_SECOND 1.428606765330187e-06f
//item HA_EXPONENTIAL_SINGLE: HA_DATA
/* (e^r - 1 - r)/r^2; error 2^-30.75 of the function. */
HA_DATA float HA_EXPONENTIAL_SINGLE[6] = {0.5f, 0.1666666716337204f, 0.04166645556688309f, 0.00833331048488617f, 0.0013934541493654251f, 0.00019891980628017336f};
//item HA_LOGARITHM_SINGLE: HA_DATA
/* (ln((1 + s)/(1 - s)) - 2 s)/s^3 by z = s^2; error 2^-31.64 of the function. */
HA_DATA float HA_LOGARITHM_SINGLE[4] = {0.6666666865348816f, 0.4000012278556824f, 0.28550735116004944f, 0.23332762718200684f};
//item HA_LOG10_FIRST
/* 1/ln 10. */
#define HA_LOG10_FIRST 0.4342944920063019f
//item HA_LOG10_REST
/* What is left of it. */
#define HA_LOG10_REST -1.0103049952192578e-08f
//item HA_LOG2_FIRST
/* 1/ln 2. */
#define HA_LOG2_FIRST 1.4426950216293335f
//item HA_LOG2_REST
/* What is left of it. */
#define HA_LOG2_REST 1.925963033500011e-08f
//item HA_ARC_SINGLE: HA_DATA
/* (atan t - t)/t^3 by z = t^2; error 2^-28.46 of the function. */
HA_DATA float HA_ARC_SINGLE[5] = {-0.3333333134651184f, 0.19999538362026215f, -0.14263896644115448f, 0.10743099451065063f, -0.06449835002422333f};
//item HA_ARC_SINE_SINGLE: HA_DATA
/* (asin x - x)/x^3 by z = x^2; error 2^-28.58 of the function. */
HA_DATA float HA_ARC_SINE_SINGLE[6] = {0.1666666567325592f, 0.07500094920396805f, 0.044599320739507675f, 0.031101727858185768f, 0.017143717035651207f, 0.03370072692632675f};
//item HA_SINH_SINGLE: HA_DATA
/* (sinh x - x)/x^3 by z = x^2; error 2^-27.67 of the function. */
HA_DATA float HA_SINH_SINGLE[4] = {0.1666666716337204f, 0.008333339355885983f, 0.00019838102161884308f, 2.806280235745362e-06f};
//item HA_TANH_SINGLE: HA_DATA
/* (tanh x - x)/x^3 by z = x^2; error 2^-27.43 of the function. */
HA_DATA float HA_TANH_SINGLE[6] = {-0.3333333432674408f, 0.1333329975605011f, -0.053958460688591f, 0.021762503311038017f, -0.0083231870085001f, 0.0022695017978549004f};

