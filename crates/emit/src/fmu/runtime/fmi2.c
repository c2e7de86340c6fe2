/* $MODEL_TITLE as a Functional Mock-up Unit 2.0. */
#include "$model.h"

#include "fmi2Functions.h"

$COMMON
/* ---- FMI 2.0 ---- */

/* How bad it is what is said. */
static fmi2Status ha_severity(const ha_fmu *f)
{
    return f->warned ? fmi2Warning : f->discarded ? fmi2Discard : fmi2Error;
}

static void ha_log2(ha_fmu *f, const char *message)
{
    const fmi2CallbackFunctions *functions = (const fmi2CallbackFunctions *)f->logger;
    char text[1100];
    size_t from;
    size_t to = 0;
    if (functions == NULL || functions->logger == NULL) {
        return;
    }
    /* The message is a format: some importers print it as it is, so all of it stands there. */
    for (from = 0; message[from] != 0 && to + 2 < sizeof text; ++from) {
        if (message[from] == '%') {
            text[to++] = '%';
        }
        text[to++] = message[from];
    }
    text[to] = 0;
    functions->logger(f->environment, f->name, ha_severity(f), f->warned ? "logStatusWarning" : f->discarded ? "logStatusDiscard" : "logStatusError", text);
}

static fmi2Status ha_status(int good)
{
    return good ? fmi2OK : fmi2Error;
}

/* What a point that may be a trial of the importer gives. */
static fmi2Status ha_tried(const ha_fmu *f, int good)
{
    return good && !f->warned ? fmi2OK : ha_severity(f);
}

#define HA_CHECK(modes, function) \
    ha_fmu *f = (ha_fmu *)c; \
    if (f == NULL || !ha_is_in(f, (modes), function)) { \
        return fmi2Error; \
    }

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    (void)nCategories;
    (void)categories;
    if (c == NULL) {
        return fmi2Error;
    }
    ((ha_fmu *)c)->logging = loggingOn != fmi2False;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    void *(*allocate)(size_t, size_t) = calloc;
    void (*release)(void *) = free;
    ha_fmu *f;
    (void)fmuResourceLocation;
    (void)visible;
    if (functions != NULL && functions->allocateMemory != NULL && functions->freeMemory != NULL) {
        allocate = functions->allocateMemory;
        release = functions->freeMemory;
    }
    f = ha_new(instanceName, fmuGUID, allocate, release);
    if (f == NULL) {
        if (functions != NULL && functions->logger != NULL) {
            functions->logger(functions->componentEnvironment, instanceName, fmi2Error, "logStatusError", "the GUID is not that of this model, or there is no memory");
        }
        return NULL;
    }
    f->exchange = fmuType == fmi2ModelExchange;
    f->logging = loggingOn != fmi2False;
    f->log = ha_log2;
    if (functions != NULL) {
        f->environment = functions->componentEnvironment;
        f->logger = f->allocate(1, sizeof *functions);
        if (f->logger != NULL) {
            memcpy(f->logger, functions, sizeof *functions);
        }
    }
    if (!ha_begin(f)) {
        (void)ha_failed(f);
    }
    return f;
}

void fmi2FreeInstance(fmi2Component c)
{
    ha_fmu *f = (ha_fmu *)c;
    if (f != NULL) {
        void (*release)(void *) = f->release;
        release(f->logger);
        release(f);
    }
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    HA_CHECK(HA_IN(HA_INSTANTIATED), "fmi2SetupExperiment")
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    f->s.start_time = startTime;
    f->s.start_due = 1;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    HA_CHECK(HA_IN(HA_INSTANTIATED), "fmi2EnterInitializationMode")
    f->s.mode = HA_INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    HA_CHECK(HA_IN(HA_INITIALISING), "fmi2ExitInitializationMode")
    return ha_status(ha_initialised(f));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    HA_CHECK(HA_RUNNING | HA_IN(HA_FAILED), "fmi2Terminate")
    f->s.mode = HA_TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    ha_fmu *f = (ha_fmu *)c;
    if (f == NULL) {
        return fmi2Error;
    }
    return ha_begin(f) ? fmi2OK : ha_status(ha_failed(f));
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    size_t i;
    HA_CHECK(HA_ANY | HA_IN(HA_FAILED), "fmi2GetReal")
    for (i = 0; i < nvr; ++i) {
        if (!ha_get(f, vr[i], &value[i])) {
            return ha_tried(f, 0);
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[])
{
    size_t i;
    HA_CHECK(HA_IN(HA_INSTANTIATED) | HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi2SetReal")
    for (i = 0; i < nvr; ++i) {
        if (!ha_set(f, vr[i], value[i])) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

/* There are variables of type Real only. */
#define HA_OTHER(TYPE) \
    fmi2Status fmi2Get##TYPE(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##TYPE value[]) \
    { \
        (void)vr; \
        (void)value; \
        return nvr == 0 ? fmi2OK : ha_status(ha_refuse((ha_fmu *)c, "all variables are of the type Real")); \
    } \
    fmi2Status fmi2Set##TYPE(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##TYPE value[]) \
    { \
        (void)vr; \
        (void)value; \
        return nvr == 0 ? fmi2OK : ha_status(ha_refuse((ha_fmu *)c, "all variables are of the type Real")); \
    }

HA_OTHER(Integer)
HA_OTHER(Boolean)
HA_OTHER(String)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    return c == NULL ? fmi2Error : ha_status(ha_save((ha_fmu *)c, FMUstate));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    if (c == NULL || FMUstate == NULL) {
        return fmi2Error;
    }
    memcpy(&((ha_fmu *)c)->s, FMUstate, sizeof(ha_state));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    if (c == NULL) {
        return fmi2Error;
    }
    if (FMUstate != NULL && *FMUstate != NULL) {
        ((ha_fmu *)c)->release(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    (void)c;
    (void)FMUstate;
    *size = ha_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    return c == NULL ? fmi2Error : ha_status(ha_serialise((ha_fmu *)c, FMUstate, serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate)
{
    return c == NULL ? fmi2Error : ha_status(ha_deserialise((ha_fmu *)c, serializedState, size, FMUstate));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown, const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING | HA_IN(HA_TERMINATED), "fmi2GetDirectionalDerivative")
    return ha_tried(f, ha_direction(f, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown, dvUnknown));
}

fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    HA_CHECK(HA_IN(HA_CONTINUOUS) | HA_IN(HA_EVENT), "fmi2EnterEventMode")
    f->s.mode = HA_EVENT;
    f->s.fresh = 0;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    double next = 0.0;
    HA_CHECK(HA_IN(HA_EVENT), "fmi2NewDiscreteStates")
    if (!ha_event(f, &next)) {
        return fmi2Error;
    }
    eventInfo->newDiscreteStatesNeeded = fmi2False;
    eventInfo->terminateSimulation = fmi2False;
//if modes
    eventInfo->nominalsOfContinuousStatesChanged = f->renewed ? fmi2True : fmi2False;
//else
    eventInfo->nominalsOfContinuousStatesChanged = fmi2False;
//end
//if moves
    eventInfo->valuesOfContinuousStatesChanged = f->moved ? fmi2True : fmi2False;
//else
    eventInfo->valuesOfContinuousStatesChanged = fmi2False;
//end
    eventInfo->nextEventTimeDefined = next - next == 0.0 ? fmi2True : fmi2False;
    eventInfo->nextEventTime = next - next == 0.0 ? next : 0.0;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    HA_CHECK(HA_IN(HA_EVENT), "fmi2EnterContinuousTimeMode")
    f->s.mode = HA_CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint, fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    HA_CHECK(HA_IN(HA_CONTINUOUS), "fmi2CompletedIntegratorStep")
    (void)noSetFMUStatePriorToCurrentPoint;
    *terminateSimulation = fmi2False;
//if moves
    {
        const int good = ha_stepped(f);
        *enterEventMode = f->event_due ? fmi2True : fmi2False;
        return ha_tried(f, good);
    }
//else
    *enterEventMode = fmi2False;
    return ha_tried(f, ha_stepped(f));
//end
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    HA_CHECK(HA_IN(HA_EVENT) | HA_IN(HA_CONTINUOUS), "fmi2SetTime")
    f->s.m.t = time;
    ha_changed(f);
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    HA_CHECK(HA_IN(HA_EVENT) | HA_IN(HA_CONTINUOUS), "fmi2SetContinuousStates")
    if (nx != HA_NX) {
        return ha_status(ha_refuse(f, "the number of states is another one"));
    }
    memcpy(f->s.m.x, x, nx * sizeof *x);
    ha_changed(f);
    return fmi2OK;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi2GetDerivatives")
    if (nx != HA_NX || !ha_started(f) || !ha_rates(f)) {
        return ha_tried(f, 0);
    }
    memcpy(derivatives, f->s.dx, nx * sizeof *derivatives);
    return fmi2OK;
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi2GetEventIndicators")
    return ha_tried(f, ni == HA_NG && ha_started(f) && ha_indicators(f, eventIndicators));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi2GetContinuousStates")
    if (nx != HA_NX || !ha_started(f)) {
        return fmi2Error;
    }
    memcpy(x, f->s.m.x, nx * sizeof *x);
    return fmi2OK;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    if (c == NULL || nx != HA_NX) {
        return fmi2Error;
    }
    ha_nominals((const ha_fmu *)c, x_nominal);
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 ? fmi2OK : ha_status(ha_refuse((ha_fmu *)c, "inputs are constant between communication points"));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[])
{
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 ? fmi2OK : ha_status(ha_refuse((ha_fmu *)c, "derivatives of outputs are not there"));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    HA_CHECK(HA_IN(HA_STEPPING), "fmi2DoStep")
    (void)noSetFMUStatePriorToCurrentPoint;
    return ha_status(ha_advance_to(f, currentCommunicationPoint, communicationStepSize));
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return ha_status(ha_refuse((ha_fmu *)c, "steps are not asynchronous"));
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    if (c == NULL || s != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = ((ha_fmu *)c)->s.m.t;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    if (c == NULL || s != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)s;
    (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}
