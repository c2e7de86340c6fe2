//always
/* Elementary functions with the same bits everywhere: no contraction of a*b + c (-std=c99, or -ffp-contract=off). */
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
#if defined(__FAST_MATH__)
#error "-ffast-math changes results; compile without it"
#endif
#if defined(__GNUC__)
//item HA_UNUSED
#define HA_UNUSED __attribute__((unused))
//item HA_INLINE
#define HA_INLINE static inline __attribute__((always_inline, unused))
//item HA_SELDOM
#define HA_SELDOM static __attribute__((noinline, cold, unused))
//always
#else
//item HA_UNUSED
#define HA_UNUSED
//item HA_INLINE
#define HA_INLINE static inline
//item HA_SELDOM
#define HA_SELDOM static
//always
#endif
//item HA_FUNCTION: HA_UNUSED
#define HA_FUNCTION static HA_UNUSED
//item HA_DATA: HA_UNUSED
#define HA_DATA static const HA_UNUSED

