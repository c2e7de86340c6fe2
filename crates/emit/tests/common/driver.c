#include <stdio.h>
#include <stdint.h>
#include <string.h>

static void bits(double value)
{
    uint64_t whole;
    memcpy(&whole, &value, sizeof whole);
    printf("%llx ", (unsigned long long)whole);
}

#define RUN(NAME, UP) \
    static void run_##NAME(long steps, int parameter, double value) \
    { \
        static NAME m; \
        long i; \
        int k; \
        int status = NAME##_reset(&m); \
        printf("== %s\n", #NAME); \
        if (status == UP##_OK && parameter >= 0) { \
            status = NAME##_set_parameter(&m, parameter, value); \
        } \
        if (status == UP##_OK) { \
            status = NAME##_start(&m, 0.0); \
        } \
        for (i = 0; i <= steps && status == UP##_OK; ++i) { \
            bits(i == 0 ? m.t : m.tick_next); \
            for (k = 0; k < UP##_OUTPUTS; ++k) { \
                bits(m.y[k]); \
            } \
            printf("\n"); \
            if (i == 50 && parameter >= 0) { \
                static NAME saved; \
                saved = m; \
                (void)NAME##_step(&m); \
                (void)NAME##_step(&m); \
                m = saved; \
                m.u[0] = UP##_INPUTS > 0 ? 1.5 : 0.0; \
            } \
            if (i < steps) { \
                status = NAME##_step(&m); \
            } \
        } \
        if (status != UP##_OK) { \
            printf("! %s\n", NAME##_message(&m)); \
        } \
    }

