//! The FMI 2.0 and 3.0 C interfaces, once, for every component.
//!
//! A component is a plain-data struct with the trait [`Component`]: a table of variables, each with
//! the way to its field, and the laws that move it. `fmu_kit::export!(ShakeTable)` in a crate of
//! type `cdylib` gives the library every function of both standards; the model descriptions, the
//! documentation page, saved states and checks follow from the table.
//!
//! ```
//! use fmu_kit::{Component, ComponentResult, Dependency, Variable};
//!
//! #[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
//! struct Integrator {
//!     input: f64,
//!     output: f64,
//! }
//!
//! impl Component for Integrator {
//!     const NAME: &'static str = "Integrator";
//!     const DESCRIPTION: &'static str = "Integrates its input";
//!
//!     fn variables() -> Vec<Variable<Self>> {
//!         fmu_kit::table! { Self, s:
//!             input("velocity", s.input, "What is integrated", "m/s" => "in/s");
//!             output("displacement", s.output, "The integral", "m" => "in");
//!         }
//!     }
//!
//!     fn initialize(&mut self) -> ComponentResult {
//!         self.output = 0.0;
//!         Ok(())
//!     }
//!
//!     fn step(&mut self, _time: f64, step_size: f64) -> ComponentResult {
//!         self.output += step_size * self.input;
//!         Ok(())
//!     }
//! }
//! ```

mod ahead;
mod built;
mod checksum;
mod component;
mod derivative;
mod exchange;
mod export;
mod fault;
mod guard;
mod instance;
mod log;
#[cfg(test)]
mod oscillator;
#[cfg(test)]
mod panel;
mod phase;
mod pointers;
mod shared;
mod start;
mod state;
mod structure;
mod values;

pub mod conformance;
pub mod description;
pub mod extended;
pub mod fmi2;
pub mod fmi3;
pub mod model;
pub mod native;
pub mod resources;
pub mod terminal;
pub mod variable;

pub use ahead::reference_ahead;
pub use built::Built;
pub use component::{Component, ComponentResult, Event};
pub use fault::Status;
pub use guard::collect_panics;
pub use phase::{Kind, Phase};
#[doc(hidden)]
pub use shared::{exchanges, states};
pub use terminal::Terminal;
#[doc(hidden)]
pub use units::vocabulary;
pub use variable::{Causality, Dependency, Enumeration, Item, Variable};

/// Short names for the types of the C interfaces, used by [`export!`].
#[doc(hidden)]
pub mod c {
    pub use crate::fault::Status as S;
    pub use crate::fmi2::Handle as H;
    /// A C string.
    pub type Text = *const std::ffi::c_char;
}
