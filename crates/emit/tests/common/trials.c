#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define DO(call) \
    if ((call) != fmi2OK) { \
        printf("line %d\n", __LINE__); \
        return 1; \
    }

static char said[1024];

static void hear(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e;
    (void)name;
    (void)status;
    (void)snprintf(said, sizeof said, "%s: %s", category, text);
}

static const fmi2CallbackFunctions functions = {hear, calloc, free, NULL, NULL};

/* An instance in continuous time. */
static fmi2Component begun(void)
{
    fmi2EventInfo event;
    fmi2Component c = fmi2Instantiate("one", fmi2ModelExchange, GUID, "", &functions, fmi2False, fmi2True);
    (void)fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    (void)fmi2EnterInitializationMode(c);
    (void)fmi2ExitInitializationMode(c);
    (void)fmi2NewDiscreteStates(c, &event);
    (void)fmi2EnterContinuousTimeMode(c);
    return c;
}

/* Beyond a fold there is no solution that goes on: that is discarded, and the accepted point is as it was. */
static int beyond(void)
{
    fmi2Component c = begun();
    const fmi2ValueReference state = 1;
    const fmi2ValueReference rate = 2;
    const fmi2Real one = 1.0;
    const fmi2Real far = -0.5;
    fmi2Real x;
    fmi2Real before;
    fmi2Real after;
    fmi2Real along;
    fmi2Real along_after;
    fmi2Boolean enter;
    fmi2Boolean stop;
    DO(fmi2GetContinuousStates(c, &x, 1))
    DO(fmi2GetDerivatives(c, &before, 1))
    DO(fmi2GetDirectionalDerivative(c, &rate, 1, &state, 1, &one, &along))
    DO(fmi2SetContinuousStates(c, &far, 1))
    said[0] = 0;
    if (fmi2GetDerivatives(c, &after, 1) != fmi2Discard || strncmp(said, "logStatusDiscard: at t = 0 s", 28) != 0) {
        printf("beyond the fold: %s\n", said);
        return 1;
    }
    if (fmi2GetDerivatives(c, &after, 1) != fmi2Discard || fmi2GetReal(c, &rate, 1, &after) != fmi2Discard
        || fmi2GetDirectionalDerivative(c, &rate, 1, &state, 1, &one, &along_after) != fmi2Discard) {
        printf("not all is discarded\n");
        return 1;
    }
    DO(fmi2SetContinuousStates(c, &x, 1))
    DO(fmi2GetDerivatives(c, &after, 1))
    DO(fmi2GetDirectionalDerivative(c, &rate, 1, &state, 1, &one, &along_after))
    if (memcmp(&before, &after, sizeof before) != 0 || memcmp(&along, &along_after, sizeof along) != 0) {
        printf("%.17g, but %.17g before\n", after, before);
        return 1;
    }
    /* And the run goes on, up to where the fold is near. */
    while (x > -0.35) {
        x += 1e-3 * after;
        DO(fmi2SetContinuousStates(c, &x, 1))
        DO(fmi2CompletedIntegratorStep(c, fmi2True, &enter, &stop))
        DO(fmi2GetDerivatives(c, &after, 1))
    }
    DO(fmi2Terminate(c))
    fmi2FreeInstance(c);
    return 0;
}

/* A point far from the last completed step has the value to which small steps lead. */
static int far(void)
{
    fmi2Component at_once = begun();
    fmi2Component slowly = begun();
    const fmi2Real t = 0.0031088412590117675;
    const fmi2Real x = 0.0;
    fmi2Real rate;
    fmi2Real wanted;
    fmi2Boolean enter;
    fmi2Boolean stop;
    int i;
    DO(fmi2SetTime(at_once, t))
    DO(fmi2SetContinuousStates(at_once, &x, 1))
    DO(fmi2GetDerivatives(at_once, &rate, 1))
    for (i = 1; i <= 400; ++i) {
        DO(fmi2SetTime(slowly, i < 400 ? t * i / 400 : t))
        DO(fmi2SetContinuousStates(slowly, &x, 1))
        DO(fmi2CompletedIntegratorStep(slowly, fmi2True, &enter, &stop))
    }
    DO(fmi2GetDerivatives(slowly, &wanted, 1))
    if (!(fabs(rate - wanted) <= 1e-11 * fabs(wanted) && wanted > 0.5)) {
        printf("%.17g at once, but %.17g\n", rate, wanted);
        return 1;
    }
    fmi2FreeInstance(at_once);
    fmi2FreeInstance(slowly);
    return 0;
}

int main(void)
{
    return FAR ? far() : beyond();
}
