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
#define HA_UNUSED __attribute__((unused))
#define HA_INLINE static inline __attribute__((always_inline, unused))
#define HA_SELDOM static __attribute__((noinline, cold, unused))
#else
#define HA_UNUSED
#define HA_INLINE static inline
#define HA_SELDOM static
#endif
#define HA_FUNCTION static HA_UNUSED
#define HA_DATA static const HA_UNUSED

