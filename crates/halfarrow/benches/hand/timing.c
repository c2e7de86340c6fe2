/* Reads how often to evaluate the rates, writes the nanoseconds that it took: one number a line. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>

#include "rates.h"

int main(void)
{
    double x[STATES];
    double dx[STATES];
    long count;
    int i;
    while (scanf("%ld", &count) == 1) {
        struct timespec from;
        struct timespec to;
        double t = 0.0;
        long k;
        start(x);
        clock_gettime(CLOCK_MONOTONIC, &from);
        for (k = 0; k < count; ++k) {
            rates(t, x, dx);
            for (i = 0; i < STATES; ++i) {
                x[i] += 1e-9 * dx[i];
            }
            t += 1e-9;
        }
        clock_gettime(CLOCK_MONOTONIC, &to);
        printf("%.0f", (double)(to.tv_sec - from.tv_sec) * 1e9 + (double)(to.tv_nsec - from.tv_nsec));
        for (i = 0; i < STATES; ++i) {
            printf(" %.17g", x[i]);
        }
        printf("\n");
        fflush(stdout);
    }
    return 0;
}
