//! The symbols of FMI 2.0.

/// Every function of FMI 2.0, each with what it does.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi2 {
    ($C:ty) => {
        pub mod v2 {
            use super::*;
            use $crate::c::*;
            use $crate::fmi2 as f;

            $crate::c_functions! {
                fmi2GetTypesPlatform() -> Text = c"default".as_ptr();
                fmi2GetVersion() -> Text = c"2.0".as_ptr();
                fmi2SetDebugLogging(c: H, on: i32, n: usize, categories: *const Text) -> S =
                    f::set_debug_logging::<$C>(c, on, n, categories);
                fmi2Instantiate(name: Text, kind: i32, guid: Text, resources: Text,
                    callbacks: *const f::Callbacks, _visible: i32, logging_on: i32) -> H = {
                    #[cfg(not(test))]
                    $crate::collect_panics();
                    f::instantiate::<$C>(name, kind, guid, resources, callbacks, logging_on)
                };
                fmi2FreeInstance(c: H) = f::free_instance::<$C>(c);
                fmi2SetupExperiment(c: H, _tolerance_defined: i32, _tolerance: f64, start: f64,
                    stop_defined: i32, stop: f64) -> S =
                    f::setup_experiment::<$C>(c, start, stop_defined, stop);
                fmi2EnterInitializationMode(c: H) -> S = f::enter_initialization_mode::<$C>(c);
                fmi2ExitInitializationMode(c: H) -> S =
                    f::call::<$C>(c, "fmi2ExitInitializationMode", f::exit_initialization);
                fmi2Terminate(c: H) -> S = f::call::<$C>(c, "fmi2Terminate", f::terminate);
                fmi2Reset(c: H) -> S = f::call::<$C>(c, "fmi2Reset", f::reset);
                fmi2GetReal(c: H, vr: *const u32, n: usize, v: *mut f64) -> S =
                    f::get_real::<$C>(c, vr, n, v);
                fmi2GetInteger(c: H, vr: *const u32, n: usize, v: *mut i32) -> S =
                    f::get_integer::<$C>(c, vr, n, v);
                fmi2GetBoolean(c: H, vr: *const u32, n: usize, v: *mut i32) -> S =
                    f::get_boolean::<$C>(c, vr, n, v);
                fmi2GetString(c: H, vr: *const u32, n: usize, v: *mut Text) -> S =
                    f::get_string::<$C>(c, vr, n, v);
                fmi2SetReal(c: H, vr: *const u32, n: usize, v: *const f64) -> S =
                    f::set_real::<$C>(c, vr, n, v);
                fmi2SetInteger(c: H, vr: *const u32, n: usize, v: *const i32) -> S =
                    f::set_integer::<$C>(c, vr, n, v);
                fmi2SetBoolean(c: H, vr: *const u32, n: usize, v: *const i32) -> S =
                    f::set_boolean::<$C>(c, vr, n, v);
                fmi2SetString(c: H, vr: *const u32, n: usize, v: *const Text) -> S =
                    f::set_string::<$C>(c, vr, n, v);
                fmi2GetFMUstate(c: H, state: *mut H) -> S =
                    $crate::states::get::<$C>(c, "fmi2GetFMUstate", state);
                fmi2SetFMUstate(c: H, state: H) -> S =
                    $crate::states::set::<$C>(c, "fmi2SetFMUstate", state);
                fmi2FreeFMUstate(c: H, state: *mut H) -> S =
                    $crate::states::free::<$C>(c, "fmi2FreeFMUstate", state);
                fmi2SerializedFMUstateSize(c: H, state: H, size: *mut usize) -> S =
                    $crate::states::size::<$C>(c, "fmi2SerializedFMUstateSize", state, size);
                fmi2SerializeFMUstate(c: H, state: H, bytes: *mut u8, size: usize) -> S =
                    $crate::states::serialize::<$C>(c, "fmi2SerializeFMUstate", state, bytes, size);
                fmi2DeSerializeFMUstate(c: H, bytes: *const u8, size: usize, state: *mut H) -> S =
                    $crate::states::deserialize::<$C>(
                        c, "fmi2DeSerializeFMUstate", bytes, size, state);
                fmi2GetDirectionalDerivative(c: H, unknowns: *const u32, n_unknowns: usize,
                    knowns: *const u32, n_knowns: usize, seed: *const f64,
                    sensitivity: *mut f64) -> S =
                    f::directional_derivative::<$C>(
                        c, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
                fmi2EnterEventMode(c: H) -> S =
                    f::call::<$C>(c, "fmi2EnterEventMode", f::enter_event_mode);
                fmi2NewDiscreteStates(c: H, info: *mut f::EventInfo) -> S =
                    f::new_discrete_states::<$C>(c, info);
                fmi2EnterContinuousTimeMode(c: H) -> S =
                    f::call::<$C>(c, "fmi2EnterContinuousTimeMode", f::enter_continuous_time_mode);
                fmi2CompletedIntegratorStep(c: H, _no_set_state: i32, event: *mut i32,
                    terminate: *mut i32) -> S =
                    f::completed_integrator_step::<$C>(c, event, terminate);
                fmi2SetTime(c: H, time: f64) -> S =
                    $crate::exchanges::set_time::<$C>(c, "fmi2SetTime", time);
                fmi2SetContinuousStates(c: H, x: *const f64, n: usize) -> S =
                    $crate::exchanges::set_states::<$C>(c, "fmi2SetContinuousStates", x, n);
                fmi2GetDerivatives(c: H, x: *mut f64, n: usize) -> S =
                    $crate::exchanges::derivatives::<$C>(c, "fmi2GetDerivatives", x, n);
                fmi2GetEventIndicators(c: H, x: *mut f64, n: usize) -> S =
                    $crate::exchanges::indicators::<$C>(c, "fmi2GetEventIndicators", x, n);
                fmi2GetContinuousStates(c: H, x: *mut f64, n: usize) -> S =
                    $crate::exchanges::states::<$C>(c, "fmi2GetContinuousStates", x, n);
                fmi2GetNominalsOfContinuousStates(c: H, x: *mut f64, n: usize) -> S =
                    $crate::exchanges::nominals::<$C>(
                        c, "fmi2GetNominalsOfContinuousStates", x, n);
                fmi2SetRealInputDerivatives(c: H, _vr: *const u32, _n: usize, _o: *const i32,
                    _v: *const f64) -> S =
                    $crate::fmi3::unsupported::<$C>(
                        c, "fmi2SetRealInputDerivatives", "interpolation of inputs");
                fmi2GetRealOutputDerivatives(c: H, _vr: *const u32, _n: usize, _o: *const i32,
                    _v: *mut f64) -> S =
                    $crate::fmi3::unsupported::<$C>(
                        c, "fmi2GetRealOutputDerivatives", "derivatives of outputs");
                fmi2DoStep(c: H, time: f64, step_size: f64, _no_set_state: i32) -> S =
                    f::do_step::<$C>(c, time, step_size);
                fmi2CancelStep(c: H) -> S =
                    $crate::fmi3::unsupported::<$C>(c, "fmi2CancelStep", "asynchronous steps");
                fmi2GetStatus(c: H, _kind: i32, _v: *mut i32) -> S =
                    f::no_status::<$C>(c, "fmi2GetStatus");
                fmi2GetRealStatus(c: H, kind: i32, v: *mut f64) -> S =
                    f::get_real_status::<$C>(c, kind, v);
                fmi2GetIntegerStatus(c: H, _kind: i32, _v: *mut i32) -> S =
                    f::no_status::<$C>(c, "fmi2GetIntegerStatus");
                fmi2GetBooleanStatus(c: H, kind: i32, v: *mut i32) -> S =
                    f::get_boolean_status::<$C>(c, kind, v);
                fmi2GetStringStatus(c: H, _kind: i32, _v: *mut Text) -> S =
                    f::no_status::<$C>(c, "fmi2GetStringStatus");
            }
        }
    };
}
