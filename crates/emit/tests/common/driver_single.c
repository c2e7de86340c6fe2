#include <stdio.h>

#define RUN(NAME, UP) \
    static void run_##NAME(double from, long steps, long every, int parameter, double value) \
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
            status = NAME##_start(&m, from); \
        } \
        for (i = 0; i <= steps && status == UP##_OK; ++i) { \
            if (i % every == 0) { \
                printf("%.17g", m.t); \
                for (k = 0; k < UP##_OUTPUTS; ++k) { \
                    printf(" %.9g", (double)m.y[k]); \
                } \
                printf("\n"); \
            } \
            if (i < steps) { \
                status = NAME##_step(&m); \
            } \
        } \
        if (status != UP##_OK) { \
            printf("! %s\n", NAME##_message(&m)); \
        } \
    }
