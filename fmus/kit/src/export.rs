//! The symbols of a component's library, and the table of its variables.

mod extended;
mod fmi2;
mod fmi3;

/// Writes a component's table of variables, one line a variable: kind, name, field, meaning, SI
/// unit and the unit in which a laboratory wants to see it; then what [`Variable`]'s methods add.
///
/// `group(field)` takes in a part of the component that derives [`units::Parameters`], changed by
/// the methods of [`Rows`]; `include(rows)` takes in rows made elsewhere.
///
/// ```
/// # use fmu_kit::{Variable, Dependency};
/// #[derive(Default, units::Parameters)]
/// struct Columns {
///     /// Stiffness of the storey.
///     #[parameter("N/m", min = 0.0)]
///     stiffness: f64,
/// }
/// # #[derive(Default)] struct Spring { force: f64, drift: f64, columns: Columns }
/// let table: Vec<Variable<Spring>> = fmu_kit::table! { Spring, s:
///     input("drift", s.drift, "Drift of the storey", "m" => "in").nominal(0.02);
///     output("force", s.force, "Force on the table", "N" => "lbf")
///         .depends_on_inputs(Dependency::Fixed);
///     group(s.columns).prefixed("first_");
/// };
/// assert_eq!(table[0].display_unit, Some("in"));
/// assert_eq!(table[1].dependencies, [("drift".into(), Dependency::Fixed)]);
/// assert_eq!(table[2].name, "first_stiffness");
/// ```
///
/// [`Variable`]: crate::Variable
/// [`Rows`]: crate::variable::Rows
#[macro_export]
macro_rules! table {
    ($component:ty, $s:ident: $(
        $kind:ident($($argument:tt)*)$(.$method:ident($($value:expr),*))*;
    )*) => {{
        #[allow(unused_imports, reason = "not every table has groups")]
        use $crate::variable::Rows as _;
        let mut table: Vec<$crate::Variable<$component>> = Vec::new();
        $(table.extend($crate::row!($component, $s, $kind($($argument)*))$(.$method($($value),*))*);)*
        $crate::Variable::resolve_inputs(&mut table);
        table
    }};
}

/// One row of [`table!`], or several.
#[doc(hidden)]
#[macro_export]
macro_rules! row {
    ($component:ty, $s:ident, group($field:expr)) => {
        $crate::Variable::<$component>::group(|$s: &mut $component| &mut $field)
    };
    ($component:ty, $s:ident, include($rows:expr)) => {
        $rows
    };
    ($component:ty, $s:ident, $kind:ident(
        $name:expr, $field:expr, $about:literal $(, $unit:literal $(=> $shown:literal)?)?
    )) => {
        $crate::Variable::<$component>::$kind($name, |$s: &mut $component| &mut $field)
            .about($about)
            $(.unit($unit)$(.shown_in($shown))?)?
    };
}

/// The inputs of a law that makes a measured motion follow a reference, as in `tracking_inputs!(Self, s:
/// s.reference, s.measured)`: `reference_displacement` (m), `reference_velocity`,
/// `reference_acceleration`, and the same of `measured`. Each of the two has the fields of a motion.
#[macro_export]
macro_rules! tracking_inputs {
    ($component:ty, $s:ident: $reference:expr, $measured:expr) => {
        $crate::table! { $component, $s:
            input($crate::vocabulary::REFERENCE_DISPLACEMENT, $reference.displacement, "Wanted displacement", "m" => "in").nominal(0.0381);
            input($crate::vocabulary::REFERENCE_VELOCITY, $reference.velocity, "Wanted velocity", "m/s" => "in/s").nominal(0.5);
            input($crate::vocabulary::REFERENCE_ACCELERATION, $reference.acceleration, "Wanted acceleration", "m/s2" => "g").nominal(10.0);
            input($crate::vocabulary::MEASURED_DISPLACEMENT, $measured.displacement, "Displacement of the table", "m" => "in").nominal(0.0381);
            input($crate::vocabulary::MEASURED_VELOCITY, $measured.velocity, "Velocity of the table", "m/s" => "in/s").nominal(0.5);
            input($crate::vocabulary::MEASURED_ACCELERATION, $measured.acceleration, "Acceleration of the table", "m/s2" => "g").nominal(10.0);
        }
    };
}

/// Inputs and output of a law that makes a transfer system follow a displacement, as in
/// `displacement_tracking!(Self, s: s.input, s.command)`: `desired_displacement`, `measured_displacement` and
/// `command` (m). The input has the fields `desired` and `measured`.
#[macro_export]
macro_rules! displacement_tracking {
    ($component:ty, $s:ident: $input:expr, $command:expr) => {
        $crate::table! { $component, $s:
            input("desired_displacement", $input.desired, "Displacement that the numerical substructure wants", "m" => "mm").nominal(5e-3);
            input($crate::vocabulary::MEASURED_DISPLACEMENT, $input.measured, "Displacement of the specimen, as measured", "m" => "mm").nominal(5e-3);
            output("command", $command, "Command to the actuator", "m" => "mm").discrete().nominal(5e-3)
                .depends_on(&["desired_displacement", $crate::vocabulary::MEASURED_DISPLACEMENT], $crate::Dependency::Dependent);
        }
    };
}

/// Gives a component's library every function of FMI 2.0 and FMI 3.0, and the private ones with
/// which the packer asks for descriptions and the tests run the component without FMI.
///
/// Stands once in a crate of type `cdylib`.
#[macro_export]
macro_rules! export {
    ($component:ty) => {
        /// The C interfaces of this component.
        #[allow(
            unsafe_code,
            reason = "the functions of the FMI standards are C functions"
        )]
        #[allow(non_snake_case, missing_docs, clippy::too_many_arguments)]
        #[allow(clippy::missing_safety_doc)]
        pub mod interface {
            use super::*;
            $crate::export_private!($component, $crate::native::describe::<$component>);
            $crate::export_fmi2!($component);
            $crate::export_fmi3!($component);
        }

        #[cfg(test)]
        mod conformance {
            use super::*;

            #[global_allocator]
            static ALLOCATOR: $crate::conformance::CountingAllocator =
                $crate::conformance::CountingAllocator;

            #[test]
            fn the_component_keeps_the_promises_of_its_table() {
                $crate::conformance::check::<$component>();
            }
        }
    };
}

/// Functions outside the standards; their names begin with `shakebench_`.
#[doc(hidden)]
#[macro_export]
macro_rules! export_private {
    ($component:ty, $describe:expr) => {
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn shakebench_describe(what: i32) -> *mut std::ffi::c_char {
            $describe(what)
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn shakebench_free_text(text: *mut std::ffi::c_char) {
            unsafe { $crate::native::free_text(text) }
        }

        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn shakebench_run_without_fmi(
            job: *const $crate::native::Job,
        ) -> *mut std::ffi::c_char {
            unsafe { $crate::native::run::<$component>(job) }
        }
    };
}

/// Declares functions of the C interface, each with its arguments and what it does.
#[doc(hidden)]
#[macro_export]
macro_rules! c_functions {
    ($($name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? = $body:expr;)*) => {$(
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) $(-> $result)? {
            #[allow(unused_unsafe)]
            unsafe { $body }
        }
    )*};
}
