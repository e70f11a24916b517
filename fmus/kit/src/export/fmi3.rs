//! The symbols of FMI 3.0.

/// Every function of FMI 3.0, each with what it does.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi3 {
    ($C:ty) => {
        pub mod v3 {
            use super::*;
            use $crate::c::*;
            use $crate::fmi3 as f;

            $crate::export_fmi3_common!($C);

            $crate::c_functions! {
                fmi3InstantiateCoSimulation(name: Text, token: Text, resources: Text,
                    _visible: bool, logging_on: bool, event_mode_used: bool, _early_return: bool,
                    _intermediate: *const u32, _n_intermediate: usize, environment: H,
                    logger: Option<f::Fmi3Logger>, _update: Option<unsafe extern "C" fn()>) -> H = {
                    #[cfg(not(test))]
                    $crate::collect_panics();
                    f::instantiate::<$C>($crate::Kind::CoSimulation, name, token, resources,
                        logging_on, event_mode_used, environment, logger)
                };
                fmi3ExitInitializationMode(c: H) -> S =
                    f::call::<$C>(c, "fmi3ExitInitializationMode", f::exit_initialization);
                fmi3EnterEventMode(c: H) -> S =
                    f::call::<$C>(c, "fmi3EnterEventMode", f::enter_event_mode);
                fmi3GetFloat64(c: H, vr: *const u32, n: usize, v: *mut f64, m: usize) -> S =
                    f::get_float64::<$C>(c, vr, n, v, m);
                fmi3SetFloat64(c: H, vr: *const u32, n: usize, v: *const f64, m: usize) -> S =
                    f::set_float64::<$C>(c, vr, n, v, m);
                fmi3GetBinary(c: H, _vr: *const u32, n: usize, _sizes: *mut usize,
                    _v: *mut *const u8, _m: usize) -> S =
                    f::no_such_type::<$C>(c, "fmi3GetBinary", n);
                fmi3SetBinary(c: H, _vr: *const u32, n: usize, _sizes: *const usize,
                    _v: *const *const u8, _m: usize) -> S =
                    f::no_such_type::<$C>(c, "fmi3SetBinary", n);
                fmi3GetClock(c: H, _vr: *const u32, n: usize, _v: *mut bool) -> S =
                    f::no_such_type::<$C>(c, "fmi3GetClock", n);
                fmi3SetClock(c: H, _vr: *const u32, n: usize, _v: *const bool) -> S =
                    f::no_such_type::<$C>(c, "fmi3SetClock", n);
                fmi3UpdateDiscreteStates(c: H, need_update: *mut bool, terminate: *mut bool,
                    nominals: *mut bool, states: *mut bool, next_defined: *mut bool,
                    next: *mut f64) -> S =
                    f::update_discrete_states::<$C>(
                        c, need_update, terminate, nominals, states, next_defined, next);
                fmi3EnterStepMode(c: H) -> S =
                    f::call::<$C>(c, "fmi3EnterStepMode", f::enter_step_mode);
                fmi3DoStep(c: H, time: f64, step_size: f64, _no_set_state: bool,
                    event: *mut bool, terminate: *mut bool, early: *mut bool,
                    last: *mut f64) -> S =
                    f::do_step::<$C>(c, time, step_size, event, terminate, early, last);
            }

            $crate::without_values! { $C;
                fmi3GetUInt64 *mut u64; fmi3SetUInt64 *const u64;
            }

            $crate::without_ability! { $C;
                "structural parameters": fmi3EnterConfigurationMode();
                "structural parameters": fmi3ExitConfigurationMode();
                "clocks": fmi3GetIntervalDecimal(
                    vr: *const u32, n: usize, v: *mut f64, q: *mut i32);
            }
        }
    };
}

/// The functions of FMI 3.0 that are the same for [extended](crate::extended) components.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi3_common {
    ($C:ty) => {
        $crate::c_functions! {
            fmi3GetVersion() -> Text = c"3.0".as_ptr();
            fmi3SetDebugLogging(c: H, on: bool, n: usize, categories: *const Text) -> S =
                f::set_debug_logging::<$C>(c, on, n, categories);
            fmi3InstantiateModelExchange(name: Text, token: Text, resources: Text,
                _visible: bool, logging_on: bool, environment: H,
                logger: Option<f::Fmi3Logger>) -> H = {
                #[cfg(not(test))]
                $crate::collect_panics();
                f::instantiate::<$C>($crate::Kind::ModelExchange, name, token, resources,
                    logging_on, false, environment, logger)
            };
            fmi3InstantiateScheduledExecution(name: Text, _token: Text, _resources: Text,
                _visible: bool, _logging_on: bool, environment: H,
                logger: Option<f::Fmi3Logger>, _clock: Option<unsafe extern "C" fn()>,
                _lock: Option<unsafe extern "C" fn()>,
                _unlock: Option<unsafe extern "C" fn()>) -> H =
                f::refuse_scheduled_execution::<$C>(name, environment, logger);
            fmi3FreeInstance(c: H) = f::free_instance::<$C>(c);
            fmi3EnterInitializationMode(c: H, _tolerance_defined: bool, _tolerance: f64,
                start: f64, stop_defined: bool, stop: f64) -> S =
                f::enter_initialization_mode::<$C>(c, start, stop_defined, stop);
            fmi3Terminate(c: H) -> S = f::call::<$C>(c, "fmi3Terminate", f::terminate);
            fmi3Reset(c: H) -> S = f::call::<$C>(c, "fmi3Reset", f::reset);
            fmi3GetInt32(c: H, vr: *const u32, n: usize, v: *mut i32, m: usize) -> S =
                f::get_int32::<$C>(c, vr, n, v, m);
            fmi3GetInt64(c: H, vr: *const u32, n: usize, v: *mut i64, m: usize) -> S =
                f::get_int64::<$C>(c, vr, n, v, m);
            fmi3GetBoolean(c: H, vr: *const u32, n: usize, v: *mut u8, m: usize) -> S =
                f::get_boolean::<$C>(c, vr, n, v, m);
            fmi3GetString(c: H, vr: *const u32, n: usize, v: *mut Text, m: usize) -> S =
                f::get_string::<$C>(c, vr, n, v, m);
            fmi3SetInt32(c: H, vr: *const u32, n: usize, v: *const i32, m: usize) -> S =
                f::set_int32::<$C>(c, vr, n, v, m);
            fmi3SetInt64(c: H, vr: *const u32, n: usize, v: *const i64, m: usize) -> S =
                f::set_int64::<$C>(c, vr, n, v, m);
            fmi3SetBoolean(c: H, vr: *const u32, n: usize, v: *const u8, m: usize) -> S =
                f::set_boolean::<$C>(c, vr, n, v, m);
            fmi3SetString(c: H, vr: *const u32, n: usize, v: *const Text, m: usize) -> S =
                f::set_string::<$C>(c, vr, n, v, m);
            fmi3GetNumberOfVariableDependencies(c: H, vr: u32, n: *mut usize) -> S =
                f::dependencies::<$C>(c, vr, n);
            fmi3GetVariableDependencies(c: H, vr: u32, elements: *mut usize,
                independents: *mut u32, independent_elements: *mut usize, kinds: *mut i32,
                n: usize) -> S =
                f::list_dependencies::<$C>(
                    c, vr, elements, independents, independent_elements, kinds, n);
            fmi3GetFMUState(c: H, state: *mut H) -> S =
                $crate::states::get::<$C>(c, "fmi3GetFMUState", state);
            fmi3SetFMUState(c: H, state: H) -> S =
                $crate::states::set::<$C>(c, "fmi3SetFMUState", state);
            fmi3FreeFMUState(c: H, state: *mut H) -> S =
                $crate::states::free::<$C>(c, "fmi3FreeFMUState", state);
            fmi3SerializedFMUStateSize(c: H, state: H, size: *mut usize) -> S =
                $crate::states::size::<$C>(c, "fmi3SerializedFMUStateSize", state, size);
            fmi3SerializeFMUState(c: H, state: H, bytes: *mut u8, size: usize) -> S =
                $crate::states::serialize::<$C>(c, "fmi3SerializeFMUState", state, bytes, size);
            fmi3DeserializeFMUState(c: H, bytes: *const u8, size: usize, state: *mut H) -> S =
                $crate::states::deserialize::<$C>(
                    c, "fmi3DeserializeFMUState", bytes, size, state);
            fmi3GetDirectionalDerivative(c: H, unknowns: *const u32, n_unknowns: usize,
                knowns: *const u32, n_knowns: usize, seed: *const f64, n_seed: usize,
                sensitivity: *mut f64, n_sensitivity: usize) -> S =
                f::directional_derivative::<$C>(c, unknowns, n_unknowns, knowns, n_knowns,
                    seed, n_seed, sensitivity, n_sensitivity);
            fmi3GetAdjointDerivative(c: H, unknowns: *const u32, n_unknowns: usize,
                knowns: *const u32, n_knowns: usize, seed: *const f64, n_seed: usize,
                sensitivity: *mut f64, n_sensitivity: usize) -> S =
                f::adjoint_derivative::<$C>(c, unknowns, n_unknowns, knowns, n_knowns,
                    seed, n_seed, sensitivity, n_sensitivity);
            fmi3EnterContinuousTimeMode(c: H) -> S =
                f::call::<$C>(c, "fmi3EnterContinuousTimeMode", f::enter_continuous_time_mode);
            fmi3CompletedIntegratorStep(c: H, _no_set_state: bool, event: *mut bool,
                terminate: *mut bool) -> S =
                f::completed_integrator_step::<$C>(c, event, terminate);
            fmi3SetTime(c: H, time: f64) -> S =
                $crate::exchanges::set_time::<$C>(c, "fmi3SetTime", time);
            fmi3SetContinuousStates(c: H, x: *const f64, n: usize) -> S =
                $crate::exchanges::set_states::<$C>(c, "fmi3SetContinuousStates", x, n);
            fmi3GetContinuousStateDerivatives(c: H, x: *mut f64, n: usize) -> S =
                $crate::exchanges::derivatives::<$C>(
                    c, "fmi3GetContinuousStateDerivatives", x, n);
            fmi3GetEventIndicators(c: H, x: *mut f64, n: usize) -> S =
                $crate::exchanges::indicators::<$C>(c, "fmi3GetEventIndicators", x, n);
            fmi3GetContinuousStates(c: H, x: *mut f64, n: usize) -> S =
                $crate::exchanges::states::<$C>(c, "fmi3GetContinuousStates", x, n);
            fmi3GetNominalsOfContinuousStates(c: H, x: *mut f64, n: usize) -> S =
                $crate::exchanges::nominals::<$C>(
                    c, "fmi3GetNominalsOfContinuousStates", x, n);
            fmi3GetNumberOfEventIndicators(c: H, n: *mut usize) -> S =
                f::count::<$C>(c, "fmi3GetNumberOfEventIndicators", n, f::event_indicators);
            fmi3GetNumberOfContinuousStates(c: H, n: *mut usize) -> S =
                f::count::<$C>(c, "fmi3GetNumberOfContinuousStates", n, f::continuous_states);
        }

        $crate::without_values! { $C;
            fmi3GetFloat32 *mut f32; fmi3SetFloat32 *const f32;
            fmi3GetInt8 *mut i8; fmi3SetInt8 *const i8;
            fmi3GetUInt8 *mut u8; fmi3SetUInt8 *const u8;
            fmi3GetInt16 *mut i16; fmi3SetInt16 *const i16;
            fmi3GetUInt16 *mut u16; fmi3SetUInt16 *const u16;
            fmi3GetUInt32 *mut u32; fmi3SetUInt32 *const u32;
        }

        $crate::without_ability! { $C;
            "clocks": fmi3GetIntervalFraction(
                vr: *const u32, n: usize, v: *mut u64, r: *mut u64, q: *mut i32);
            "clocks": fmi3GetShiftDecimal(vr: *const u32, n: usize, v: *mut f64);
            "clocks": fmi3GetShiftFraction(vr: *const u32, n: usize, v: *mut u64, r: *mut u64);
            "clocks": fmi3SetIntervalDecimal(vr: *const u32, n: usize, v: *const f64);
            "clocks": fmi3SetIntervalFraction(
                vr: *const u32, n: usize, v: *const u64, r: *const u64);
            "clocks": fmi3SetShiftDecimal(vr: *const u32, n: usize, v: *const f64);
            "clocks": fmi3SetShiftFraction(
                vr: *const u32, n: usize, v: *const u64, r: *const u64);
            "separate evaluation of discrete states": fmi3EvaluateDiscreteStates();
            "derivatives of outputs": fmi3GetOutputDerivatives(
                vr: *const u32, n: usize, o: *const i32, v: *mut f64, m: usize);
            "model partitions": fmi3ActivateModelPartition(clock: u32, time: f64);
        }
    };
}

/// Getters and setters of types that no variable has.
#[doc(hidden)]
#[macro_export]
macro_rules! without_values {
    ($C:ty; $($name:ident $type:ty;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(
            c: H, _vr: *const u32, n: usize, _v: $type, _m: usize,
        ) -> S {
            unsafe { f::no_such_type::<$C>(c, stringify!($name), n) }
        }
    )*};
}

/// Functions for abilities that no component has.
#[doc(hidden)]
#[macro_export]
macro_rules! without_ability {
    ($C:ty; $($ability:literal: $name:ident($($argument:ident: $type:ty),*);)*) => {$(
        #[unsafe(no_mangle)]
        #[allow(unused_variables)]
        pub unsafe extern "C" fn $name(c: H $(, $argument: $type)*) -> S {
            unsafe { f::unsupported::<$C>(c, stringify!($name), $ability) }
        }
    )*};
}
