/* Steps the model and prints its outputs: the time to stop, and how many steps lie between lines, can be given. */
#include <stdio.h>
#include <stdlib.h>

#include "NAME.h"

static void print(const MODEL *m)
{
    int i;
    printf("%.17g", m->t);
    for (i = 0; i < MODEL_OUTPUTS; ++i) {
        printf(",%.17g", m->y[i]);
    }
    printf("\n");
}

int main(int argc, char **argv)
{
    static MODEL m;
    const double to = argc > 1 ? strtod(argv[1], NULL) : 1.0;
    const long every = argc > 2 ? strtol(argv[2], NULL, 10) : 1;
    long steps = 0;
    int status = MODEL_reset(&m);
    printf("tOUTPUT_NAMES\n");
    if (status == MODEL_OK) {
        status = MODEL_start(&m, 0.0);
    }
    if (status == MODEL_OK) {
        print(&m);
    }
    while (status == MODEL_OK && m.t < to - 1e-9 * m.step) {
        status = MODEL_step(&m);
        ++steps;
        if (status == MODEL_OK && (every <= 1 || steps % every == 0)) {
            print(&m);
        }
    }
    if (status != MODEL_OK) {
        fprintf(stderr, "at t = %g s: %s\n", m.failure.time, MODEL_message(&m));
        return 3;
    }
    return 0;
}
