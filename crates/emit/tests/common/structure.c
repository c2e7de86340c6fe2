#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

static char said[1024];

static void hear(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    (void)e;
    (void)name;
    (void)status;
    (void)snprintf(said, sizeof said, "%s: %s", category, text);
}

static const fmi2CallbackFunctions functions = {hear, calloc, free, NULL, NULL};

static fmi2Status set(fmi2Component c, fmi2ValueReference parameter, fmi2Real value)
{
    return fmi2SetReal(c, &parameter, 1, &value);
}

#define WANT(call, wanted) \
    if ((call) != (wanted)) { \
        printf("line %d: %s\n", __LINE__, said); \
        return 1; \
    }

#define SAYS(what) \
    if (strstr(said, what) == NULL) { \
        printf("line %d: %s\n", __LINE__, said); \
        return 1; \
    }

static fmi2Component begun(fmi2Type type)
{
    fmi2Component c;
    said[0] = 0;
    c = fmi2Instantiate("one", type, GUID, "", &functions, fmi2False, fmi2True);
    (void)fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    (void)fmi2EnterInitializationMode(c);
    return c;
}

/* Parameters that are tuned at an event: the event tells whether they all fit. */
static int tuned_at_an_event(void)
{
    fmi2EventInfo info;
    fmi2Real rates[2] = {0.0, 0.0};
    fmi2Component c = begun(fmi2ModelExchange);
    WANT(fmi2ExitInitializationMode(c), fmi2OK)
    WANT(fmi2NewDiscreteStates(c, &info), fmi2OK)
    WANT(fmi2EnterContinuousTimeMode(c), fmi2OK)
    WANT(fmi2GetDerivatives(c, rates, STATES), fmi2OK)
    WANT(set(c, R, 2.0), fmi2OK)
    WANT(fmi2EnterEventMode(c), fmi2OK)
    WANT(set(c, A, 3.0), fmi2OK)
    WANT(set(c, B, 3.0), fmi2OK)
    WANT(fmi2NewDiscreteStates(c, &info), fmi2OK)
    WANT(fmi2EnterContinuousTimeMode(c), fmi2OK)
    WANT(fmi2GetDerivatives(c, rates, STATES), fmi2OK)
    WANT(fmi2EnterEventMode(c), fmi2OK)
    said[0] = 0;
    WANT(set(c, B, 2.0), fmi2OK)
    WANT(fmi2NewDiscreteStates(c, &info), fmi2Error)
    SAYS("derived where a - b is zero")
    WANT(fmi2GetDerivatives(c, rates, STATES), fmi2Error)
    fmi2FreeInstance(c);
    return 0;
}

/* What is tuned within a step is told by the rates. */
static int tuned_without_an_event(void)
{
    fmi2EventInfo info;
    fmi2Real rates[2] = {0.0, 0.0};
    fmi2Component c = begun(fmi2ModelExchange);
    WANT(fmi2ExitInitializationMode(c), fmi2OK)
    WANT(fmi2NewDiscreteStates(c, &info), fmi2OK)
    WANT(fmi2EnterContinuousTimeMode(c), fmi2OK)
    WANT(set(c, B, 2.0), fmi2OK)
    WANT(fmi2GetDerivatives(c, rates, STATES) == fmi2OK, 0)
    SAYS("derived where a - b is zero")
    fmi2FreeInstance(c);
    return 0;
}

int main(void)
{
    fmi2Component c = begun(fmi2CoSimulation);
    WANT(set(c, B, 2.0), fmi2OK)
    WANT(fmi2ExitInitializationMode(c), fmi2Error)
    SAYS("derived where a - b is zero")
    fmi2FreeInstance(c);
    c = begun(fmi2CoSimulation);
    WANT(set(c, B, 2.0), fmi2OK)
    WANT(set(c, A, 2.0), fmi2OK)
    WANT(fmi2ExitInitializationMode(c), fmi2OK)
    WANT(fmi2DoStep(c, 0.0, 0.1, fmi2True), fmi2OK)
    WANT(set(c, A, 3.0), fmi2OK)
    WANT(set(c, B, 3.0), fmi2OK)
    WANT(fmi2DoStep(c, 0.1, 0.1, fmi2True), fmi2OK)
    WANT(set(c, A, 1.0), fmi2OK)
    WANT(fmi2DoStep(c, 0.2, 0.1, fmi2True), fmi2Error)
    SAYS("derived where a - b is zero")
    fmi2FreeInstance(c);
    return tuned_at_an_event() || tuned_without_an_event();
}
