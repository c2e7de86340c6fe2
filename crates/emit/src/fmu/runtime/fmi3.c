/* $MODEL_TITLE as a Functional Mock-up Unit 3.0. */
#include "$model.h"

#include "fmi3Functions.h"

$COMMON
/* ---- FMI 3.0 ---- */

/* How bad it is what is said. */
static fmi3Status ha_severity(const ha_fmu *f)
{
    return f->warned ? fmi3Warning : f->discarded ? fmi3Discard : fmi3Error;
}

static void ha_log3(ha_fmu *f, const char *message)
{
    fmi3LogMessageCallback log;
    if (f->logger == NULL) {
        return;
    }
    memcpy(&log, f->logger, sizeof log);
    log(f->environment, ha_severity(f), f->warned ? "logStatusWarning" : f->discarded ? "logStatusDiscard" : "logStatusError", message);
}

static fmi3Status ha_status(int good)
{
    return good ? fmi3OK : fmi3Error;
}

static fmi3Status ha_not_there(fmi3Instance instance, const char *function)
{
    char text[256];
    (void)snprintf(text, sizeof text, "%s is not supported by this model", function);
    if (instance != NULL) {
        ha_say((ha_fmu *)instance, text);
    }
    return fmi3Error;
}

/* What a point that may be a trial of the importer gives. */
static fmi3Status ha_tried(const ha_fmu *f, int good)
{
    return good && !f->warned ? fmi3OK : ha_severity(f);
}

#define HA_CHECK(modes, function) \
    ha_fmu *f = (ha_fmu *)instance; \
    if (f == NULL || !ha_is_in(f, (modes), function)) { \
        return fmi3Error; \
    }

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[])
{
    (void)nCategories;
    (void)categories;
    if (instance == NULL) {
        return fmi3Error;
    }
    ((ha_fmu *)instance)->logging = loggingOn;
    return fmi3OK;
}

static fmi3Instance ha_instantiate(fmi3String instanceName, fmi3String token, int exchange, fmi3Boolean loggingOn, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    ha_fmu *f = ha_new(instanceName, token, calloc, free);
    if (f == NULL) {
        if (log != NULL) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is not that of this model, or there is no memory");
        }
        return NULL;
    }
    f->exchange = exchange;
    f->logging = loggingOn;
    f->environment = environment;
    f->log = ha_log3;
    if (log != NULL) {
        f->logger = malloc(sizeof log);
        if (f->logger != NULL) {
            memcpy(f->logger, &log, sizeof log);
        }
    }
    if (!ha_begin(f)) {
        (void)ha_failed(f);
    }
    return f;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    (void)resourcePath;
    (void)visible;
    return ha_instantiate(instanceName, instantiationToken, 1, loggingOn, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)resourcePath;
    ha_fmu *f;
    (void)visible;
    (void)requiredIntermediateVariables;
    (void)intermediateUpdate;
    if (nRequiredIntermediateVariables > 0) {
        if (logMessage != NULL) {
            logMessage(instanceEnvironment, fmi3Error, "logStatusError", "co-simulation has no intermediate variables");
        }
        return NULL;
    }
    f = (ha_fmu *)ha_instantiate(instanceName, instantiationToken, 0, loggingOn, instanceEnvironment, logMessage);
    if (f != NULL) {
        f->event_mode = eventModeUsed ? 1 : 0;
        f->stops = eventModeUsed && earlyReturnAllowed;
    }
    return f;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    if (logMessage != NULL) {
        logMessage(instanceEnvironment, fmi3Error, "logStatusError", "scheduled execution is not supported by this model");
    }
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    ha_fmu *f = (ha_fmu *)instance;
    if (f != NULL) {
        free(f->logger);
        free(f);
    }
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    HA_CHECK(HA_IN(HA_INSTANTIATED), "fmi3EnterInitializationMode")
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    f->s.start_time = startTime;
    f->s.start_due = 1;
    f->s.mode = HA_INITIALISING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    HA_CHECK(HA_IN(HA_INITIALISING), "fmi3ExitInitializationMode")
    return ha_status(ha_initialised(f));
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    HA_CHECK(HA_IN(HA_CONTINUOUS) | HA_IN(HA_EVENT) | HA_IN(HA_STEPPING), "fmi3EnterEventMode")
    if (!f->exchange && !f->event_mode) {
        return ha_status(ha_refuse(f, "the model was instantiated without event mode"));
    }
    if (f->s.mode == HA_STEPPING) {
        /* What happens by itself at this time has happened in the step. */
        f->s.mode = HA_EVENT;
        f->s.fresh = f->s.m.crossed == f->s.m.t;
        return fmi3OK;
    }
    f->s.mode = HA_EVENT;
    f->s.fresh = 0;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    HA_CHECK(HA_RUNNING | HA_IN(HA_FAILED), "fmi3Terminate")
    f->s.mode = HA_TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    ha_fmu *f = (ha_fmu *)instance;
    if (f == NULL) {
        return fmi3Error;
    }
    return ha_begin(f) ? fmi3OK : ha_status(ha_failed(f));
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    size_t i;
    HA_CHECK(HA_ANY | HA_IN(HA_FAILED), "fmi3GetFloat64")
    if (nValues != nValueReferences) {
        return ha_status(ha_refuse(f, "all variables are scalars"));
    }
    for (i = 0; i < nValues; ++i) {
        if (!ha_get(f, valueReferences[i], &values[i])) {
            return ha_tried(f, 0);
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    size_t i;
    HA_CHECK(HA_IN(HA_INSTANTIATED) | HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi3SetFloat64")
    if (nValues != nValueReferences) {
        return ha_status(ha_refuse(f, "all variables are scalars"));
    }
    for (i = 0; i < nValues; ++i) {
        if (!ha_set(f, valueReferences[i], values[i])) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

/* There are variables of type Float64 only. */
#define HA_OTHER(TYPE) \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3##TYPE values[], size_t nValues) \
    { \
        (void)valueReferences; \
        (void)values; \
        return nValueReferences == 0 && nValues == 0 ? fmi3OK : ha_not_there(instance, "fmi3Get" #TYPE); \
    } \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3##TYPE values[], size_t nValues) \
    { \
        (void)valueReferences; \
        (void)values; \
        return nValueReferences == 0 && nValues == 0 ? fmi3OK : ha_not_there(instance, "fmi3Set" #TYPE); \
    }

HA_OTHER(Float32)
HA_OTHER(Int8)
HA_OTHER(UInt8)
HA_OTHER(Int16)
HA_OTHER(UInt16)
HA_OTHER(Int32)
HA_OTHER(UInt32)
HA_OTHER(Int64)
HA_OTHER(UInt64)
HA_OTHER(Boolean)
HA_OTHER(String)

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    return instance == NULL ? fmi3Error : ha_status(ha_save((ha_fmu *)instance, FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    if (instance == NULL || FMUState == NULL) {
        return fmi3Error;
    }
    memcpy(&((ha_fmu *)instance)->s, FMUState, sizeof(ha_state));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    if (instance == NULL) {
        return fmi3Error;
    }
    if (FMUState != NULL && *FMUState != NULL) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    (void)instance;
    (void)FMUState;
    *size = ha_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    return instance == NULL ? fmi3Error : ha_status(ha_serialise((ha_fmu *)instance, FMUState, serializedState, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
{
    return instance == NULL ? fmi3Error : ha_status(ha_deserialise((ha_fmu *)instance, serializedState, size, FMUState));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING | HA_IN(HA_TERMINATED), "fmi3GetDirectionalDerivative")
    if (nSeed != nKnowns || nSensitivity != nUnknowns) {
        return ha_status(ha_refuse(f, "all variables are scalars"));
    }
    return ha_tried(f, ha_direction(f, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity));
}

/* By one state or input after the other, each along its direction. */
static int ha_adjoint(ha_fmu *f, const unsigned *unknowns, size_t rows, const unsigned *knowns, size_t columns, const double *seed, double *result)
{
    const double one = 1.0;
    double dv[HA_NX > 0 ? HA_NX : 1];
    double dy[HA_NY > 0 ? HA_NY : 1];
    size_t i;
    size_t j;
    if (!ha_started(f)) {
        return 0;
    }
    for (j = 0; j < columns; ++j) {
        double sum = 0.0;
        memset(dv, 0, sizeof dv);
        memset(dy, 0, sizeof dy);
        if (!ha_along(f, &knowns[j], 1, &one, dv, dy)) {
            return 0;
        }
        for (i = 0; i < rows; ++i) {
            double slope = 0.0;
            if (!ha_of(f, unknowns[i], dv, dy, &slope)) {
                return 0;
            }
            sum += seed[i] * slope;
        }
        result[j] = sum;
    }
    return 1;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING | HA_IN(HA_TERMINATED), "fmi3GetAdjointDerivative")
    if (nSeed != nUnknowns || nSensitivity != nKnowns) {
        return ha_status(ha_refuse(f, "all variables are scalars"));
    }
    return ha_tried(f, ha_adjoint(f, unknowns, nUnknowns, knowns, nKnowns, seed, sensitivity));
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance)
{
    return ha_not_there(instance, "fmi3EnterConfigurationMode");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance)
{
    return ha_not_there(instance, "fmi3ExitConfigurationMode");
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return ha_not_there(instance, "fmi3EvaluateDiscreteStates");
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
{
    double next = 0.0;
    HA_CHECK(HA_IN(HA_EVENT), "fmi3UpdateDiscreteStates")
    if (!ha_event(f, &next)) {
        return fmi3Error;
    }
    *discreteStatesNeedUpdate = fmi3False;
    *terminateSimulation = fmi3False;
//if modes
    *nominalsOfContinuousStatesChanged = f->renewed != 0;
//else
    *nominalsOfContinuousStatesChanged = fmi3False;
//end
//if moves
    *valuesOfContinuousStatesChanged = f->moved != 0;
//else
    *valuesOfContinuousStatesChanged = fmi3False;
//end
    *nextEventTimeDefined = next - next == 0.0;
    *nextEventTime = next - next == 0.0 ? next : 0.0;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    HA_CHECK(HA_IN(HA_EVENT), "fmi3EnterContinuousTimeMode")
    if (!f->exchange) {
        return ha_status(ha_refuse(f, "fmi3EnterContinuousTimeMode is a function of model exchange"));
    }
    f->s.mode = HA_CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    HA_CHECK(HA_IN(HA_CONTINUOUS), "fmi3CompletedIntegratorStep")
    (void)noSetFMUStatePriorToCurrentPoint;
    *terminateSimulation = fmi3False;
//if moves
    {
        const int good = ha_stepped(f);
        *enterEventMode = f->event_due ? fmi3True : fmi3False;
        return ha_tried(f, good);
    }
//else
    *enterEventMode = fmi3False;
    return ha_tried(f, ha_stepped(f));
//end
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    HA_CHECK(HA_IN(HA_EVENT) | HA_IN(HA_CONTINUOUS), "fmi3SetTime")
    f->s.m.t = time;
    ha_changed(f);
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    HA_CHECK(HA_IN(HA_EVENT) | HA_IN(HA_CONTINUOUS), "fmi3SetContinuousStates")
    if (nContinuousStates != HA_NX) {
        return ha_status(ha_refuse(f, "the number of states is another one"));
    }
    memcpy(f->s.m.x, continuousStates, nContinuousStates * sizeof *continuousStates);
    ha_changed(f);
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi3GetContinuousStateDerivatives")
    if (nContinuousStates != HA_NX || !ha_started(f) || !ha_rates(f)) {
        return ha_tried(f, 0);
    }
    memcpy(derivatives, f->s.dx, nContinuousStates * sizeof *derivatives);
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi3GetEventIndicators")
    return ha_tried(f, nEventIndicators == HA_NG && ha_started(f) && ha_indicators(f, eventIndicators));
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates)
{
    HA_CHECK(HA_IN(HA_INITIALISING) | HA_RUNNING, "fmi3GetContinuousStates")
    if (nContinuousStates != HA_NX || !ha_started(f)) {
        return fmi3Error;
    }
    memcpy(continuousStates, f->s.m.x, nContinuousStates * sizeof *continuousStates);
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates)
{
    if (instance == NULL || nContinuousStates != HA_NX) {
        return fmi3Error;
    }
    ha_nominals((const ha_fmu *)instance, nominals);
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators)
{
    (void)instance;
    *nEventIndicators = HA_NG;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates)
{
    (void)instance;
    *nContinuousStates = HA_NX;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    HA_CHECK(HA_IN(HA_EVENT), "fmi3EnterStepMode")
    if (f->exchange) {
        return ha_status(ha_refuse(f, "fmi3EnterStepMode is a function of co-simulation"));
    }
    f->s.mode = HA_STEPPING;
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    int good;
    HA_CHECK(HA_IN(HA_STEPPING), "fmi3DoStep")
    (void)noSetFMUStatePriorToCurrentPoint;
    good = ha_advance_to(f, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = f->stopped ? fmi3True : fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = f->stopped && f->s.m.t + 1e-9 * f->s.m.step < currentCommunicationPoint + communicationStepSize ? fmi3True : fmi3False;
    *lastSuccessfulTime = f->s.m.t;
    return ha_status(good);
}

/* ---- what this model does not have ---- */

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return ha_not_there(instance, "fmi3GetBinary");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return ha_not_there(instance, "fmi3SetBinary");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Clock values[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)values;
    return ha_not_there(instance, "fmi3GetClock");
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Clock values[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)values;
    return ha_not_there(instance, "fmi3SetClock");
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference, size_t *nDependencies)
{
    (void)valueReference;
    (void)nDependencies;
    return ha_not_there(instance, "fmi3GetNumberOfVariableDependencies");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[], size_t nDependencies)
{
    (void)dependent;
    (void)elementIndicesOfDependent;
    (void)independents;
    (void)elementIndicesOfIndependents;
    (void)dependencyKinds;
    (void)nDependencies;
    return ha_not_there(instance, "fmi3GetVariableDependencies");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)intervals;
    (void)qualifiers;
    return ha_not_there(instance, "fmi3GetIntervalDecimal");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return ha_not_there(instance, "fmi3GetIntervalFraction");
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3Float64 shifts[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)shifts;
    return ha_not_there(instance, "fmi3GetShiftDecimal");
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return ha_not_there(instance, "fmi3GetShiftFraction");
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Float64 intervals[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)intervals;
    return ha_not_there(instance, "fmi3SetIntervalDecimal");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return ha_not_there(instance, "fmi3SetIntervalFraction");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Float64 shifts[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)shifts;
    return ha_not_there(instance, "fmi3SetShiftDecimal");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)counters;
    (void)resolutions;
    return ha_not_there(instance, "fmi3SetShiftFraction");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
{
    (void)valueReferences;
    (void)nValueReferences;
    (void)orders;
    (void)values;
    (void)nValues;
    return ha_not_there(instance, "fmi3GetOutputDerivatives");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime)
{
    (void)clockReference;
    (void)activationTime;
    return ha_not_there(instance, "fmi3ActivateModelPartition");
}
