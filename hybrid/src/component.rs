//! Tracking laws as FMUs.

// What the macro names, so that a component depends on this crate for it.
#[doc(hidden)]
pub use {controllers, fmu_kit, serde};

/// A component that makes a transfer system follow a displacement by a law:
///
/// ```ignore
/// hybrid::tracking_component! {
///     /// Tracking control by sliding mode.
///     TrackingSlidingMode, "Tracking control by sliding mode", Law;
///     // What it is set to, and its start.
///     { rate: f64 = 150.0 }
///     // The law of these settings.
///     |s| { Law { rate: s.rate, ..Law::published()? } }
///     // Rows of the table beside those of the displacement.
///     parameter("rate", s.rate, "lambda", "1/s");
/// }
/// ```
#[macro_export]
macro_rules! tracking_component {
    (
        $(#[$about:meta])*
        $name:ident, $description:literal, $law:ty;
        { $($field:ident: $type:ty = $start:expr),* $(,)? }
        |$s:ident| $build:block
        $($rows:tt)*
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, $crate::component::serde::Serialize, $crate::component::serde::Deserialize)]
        #[serde(crate = "hybrid::component::serde")]
        pub struct $name {
            $($field: $type,)*
            law: Option<$law>,
            input: $crate::laws::TrackingInput,
            command: f64,
        }

        impl Default for $name {
            fn default() -> Self {
                Self {
                    $($field: $start,)*
                    law: None,
                    input: Default::default(),
                    command: 0.0,
                }
            }
        }

        impl $name {
            fn law(&self) -> Result<$law, $crate::component::controllers::ModelError> {
                let $s = self;
                Ok($build)
            }
        }

        impl $crate::component::fmu_kit::Component for $name {
            const NAME: &'static str = stringify!($name);
            const DESCRIPTION: &'static str = $description;
            const DOCUMENTATION: &'static str = include_str!("../README.md");
            const TERMINALS: &'static [$crate::component::fmu_kit::Terminal] = &[
                $crate::component::fmu_kit::Terminal::DESIRED_DISPLACEMENT,
                $crate::component::fmu_kit::Terminal::MEASURED_DISPLACEMENT,
                $crate::component::fmu_kit::Terminal::ACTUATOR,
            ];
            const STEP_SIZE: f64 = $crate::vrths::PERIOD;
            const ANY_STEP_SIZE: bool = false;

            fn variables() -> Vec<$crate::component::fmu_kit::Variable<Self>> {
                let mut variables = $crate::component::fmu_kit::displacement_tracking!(Self, s: s.input, s.command);
                variables.extend($crate::component::fmu_kit::table! { Self, $s: $($rows)* });
                variables
            }

            fn initialize(&mut self) -> $crate::component::fmu_kit::ComponentResult {
                let law = self.law()?;
                $crate::component::controllers::Controller::validate(&law)?;
                self.law = Some(law);
                self.command = 0.0;
                Ok(())
            }

            fn step(&mut self, _time: f64, step_size: f64) -> $crate::component::fmu_kit::ComponentResult {
                if let Some(law) = &mut self.law {
                    self.command = $crate::component::controllers::Controller::step(law, &self.input, step_size);
                }
                Ok(())
            }
        }

        $crate::component::fmu_kit::export!($name);
    };
}
