/* Functions of FMI 2.0 that an FMU for co-simulation of these tests has and that nothing calls. */

/* What every importer looks for and none calls here does nothing. */
#define NOTHING(name) Status name(void) { return 0; }
NOTHING(fmi2SetupExperiment)
NOTHING(fmi2EnterInitializationMode)
NOTHING(fmi2ExitInitializationMode)
NOTHING(fmi2Terminate)
NOTHING(fmi2SetDebugLogging)
/* What none may call here fails. */
#define MISSING(name) Status name(void) { return 3; }
MISSING(fmi2Reset)
MISSING(fmi2GetInteger)
MISSING(fmi2GetString)
MISSING(fmi2SetInteger)
MISSING(fmi2SetBoolean)
MISSING(fmi2SetString)
MISSING(fmi2GetFMUstate)
MISSING(fmi2SetFMUstate)
MISSING(fmi2FreeFMUstate)
MISSING(fmi2SerializedFMUstateSize)
MISSING(fmi2SerializeFMUstate)
MISSING(fmi2DeSerializeFMUstate)
MISSING(fmi2GetDirectionalDerivative)
MISSING(fmi2SetRealInputDerivatives)
MISSING(fmi2GetRealOutputDerivatives)
MISSING(fmi2CancelStep)
MISSING(fmi2GetStatus)
MISSING(fmi2GetRealStatus)
MISSING(fmi2GetIntegerStatus)
MISSING(fmi2GetBooleanStatus)
MISSING(fmi2GetStringStatus)
