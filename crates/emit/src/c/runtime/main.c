/* Steps the model and prints its outputs, in the units that the model declares for them, as `halfarrow simulate` does. The time
 * to stop, how many steps lie between lines, and `units` for a second line with the units can be given. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "$model.h"

static void print(const $model *m)
{
    printf("%.17g", m->t);
$PRINT_OUTPUTS
    printf("\n");
}

int main(int argc, char **argv)
{
    static $model m;
    const double to = argc > 1 ? strtod(argv[1], NULL) : 1.0;
    const long every = argc > 2 ? strtol(argv[2], NULL, 10) : 1;
    long steps = 0;
    int status = $model_reset(&m);
    printf("t");
$OUTPUT_NAMES
    printf("\n");
    if (argc > 3 && strcmp(argv[3], "units") == 0) {
        printf("s");
$OUTPUT_UNITS
        printf("\n");
    }
    if (status == $MODEL_OK) {
        status = $model_start(&m, 0.0);
    }
    if (status == $MODEL_OK) {
        print(&m);
    }
    while (status == $MODEL_OK && m.t < to - 1e-9 * m.step) {
        status = $model_step(&m);
        ++steps;
        if (status == $MODEL_OK && (every <= 1 || steps % every == 0)) {
            print(&m);
        }
    }
    if (status != $MODEL_OK) {
        fprintf(stderr, "at t = %g s: %s\n", m.failure.time, $model_message(&m));
        return 3;
    }
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "the output cannot be written\n");
        return 2;
    }
    return 0;
}
