//! The symbols of FMI 3.0 that an extended component has and others refuse.

/// As [`export!`](crate::export) for FMI 3.0 alone, for a component that is
/// [`Extended`](crate::extended::Extended).
#[macro_export]
macro_rules! export_extended {
    ($C:ty) => {
        /// The C interface of this component.
        #[allow(
            unsafe_code,
            reason = "the functions of the FMI standard are C functions"
        )]
        #[allow(non_snake_case, missing_docs, clippy::too_many_arguments)]
        #[allow(clippy::missing_safety_doc)]
        pub mod interface {
            use super::*;
            $crate::export_private!($C, $crate::extended::describe::<$C>);

            pub mod v3 {
                use super::*;
                use $crate::c::*;
                use $crate::extended as e;
                use $crate::fmi3 as f;

                $crate::export_fmi3_common!($C);

                $crate::c_functions! {
                    fmi3InstantiateCoSimulation(name: Text, token: Text, resources: Text,
                        _visible: bool, logging_on: bool, event_mode_used: bool,
                        early_return: bool, _intermediate: *const u32, _n_intermediate: usize,
                        environment: H, logger: Option<f::Fmi3Logger>,
                        update: Option<e::Update>) -> H = {
                        #[cfg(not(test))]
                        $crate::collect_panics();
                        e::instantiate::<$C>(name, token, resources, logging_on, event_mode_used,
                            early_return, environment, logger, update)
                    };
                    fmi3ExitInitializationMode(c: H) -> S = e::exit_initialization_mode::<$C>(c);
                    fmi3EnterEventMode(c: H) -> S = e::enter_event_mode::<$C>(c);
                    fmi3EnterStepMode(c: H) -> S = e::enter_step_mode::<$C>(c);
                    fmi3EnterConfigurationMode(c: H) -> S = e::enter_configuration_mode::<$C>(c);
                    fmi3ExitConfigurationMode(c: H) -> S = e::exit_configuration_mode::<$C>(c);
                    fmi3GetFloat64(c: H, vr: *const u32, n: usize, v: *mut f64, m: usize) -> S =
                        e::get_float64::<$C>(c, vr, n, v, m);
                    fmi3SetFloat64(c: H, vr: *const u32, n: usize, v: *const f64, m: usize) -> S =
                        e::set_float64::<$C>(c, vr, n, v, m);
                    fmi3GetUInt64(c: H, vr: *const u32, n: usize, v: *mut u64, _m: usize) -> S =
                        e::get_uint64::<$C>(c, vr, n, v);
                    fmi3SetUInt64(c: H, vr: *const u32, n: usize, v: *const u64, _m: usize) -> S =
                        e::set_uint64::<$C>(c, vr, n, v);
                    fmi3GetBinary(c: H, vr: *const u32, n: usize, sizes: *mut usize,
                        v: *mut *const u8, _m: usize) -> S =
                        e::get_binary::<$C>(c, vr, n, sizes, v);
                    fmi3SetBinary(c: H, vr: *const u32, n: usize, sizes: *const usize,
                        v: *const *const u8, _m: usize) -> S =
                        e::set_binary::<$C>(c, vr, n, sizes, v);
                    fmi3GetClock(c: H, vr: *const u32, n: usize, v: *mut bool) -> S =
                        e::get_clock::<$C>(c, vr, n, v);
                    fmi3SetClock(c: H, vr: *const u32, n: usize, v: *const bool) -> S =
                        e::set_clock::<$C>(c, vr, n, v);
                    fmi3GetIntervalDecimal(c: H, vr: *const u32, n: usize, v: *mut f64,
                        q: *mut i32) -> S = e::get_interval::<$C>(c, vr, n, v, q);
                    fmi3UpdateDiscreteStates(c: H, again: *mut bool, terminate: *mut bool,
                        nominals: *mut bool, states: *mut bool, next_defined: *mut bool,
                        next: *mut f64) -> S =
                        e::update_discrete_states::<$C>(
                            c, again, terminate, nominals, states, next_defined, next);
                    fmi3DoStep(c: H, time: f64, step_size: f64, _no_set_state: bool,
                        event: *mut bool, terminate: *mut bool, early: *mut bool,
                        last: *mut f64) -> S =
                        e::do_step::<$C>(c, time, step_size, event, terminate, early, last);
                }
            }
        }
    };
}
