//! What a component is: plain data, a table of variables, and the laws that move it.

use std::path::Path;

use serde::{Serialize, de::DeserializeOwned};

use crate::{terminal::Terminal, variable::Variable};

/// Why a component refuses its parameters or cannot go on; the text goes to the importer's log.
pub type ComponentResult = Result<(), Box<dyn std::error::Error>>;

/// A model or control law that becomes an FMU by [`export!`](crate::export).
///
/// The implementor is a plain-data struct. Every variable is a field of it (possibly nested), so
/// that saving and restoring the state of an FMU is a copy. `Default` gives the start values.
///
/// The calls come in this order: fields are written; [`initialize`](Self::initialize);
/// [`update_outputs`](Self::update_outputs) whenever an output is read after something changed;
/// then, over and over, inputs are written and [`step`](Self::step) is called. Nothing may
/// allocate, lock or print in `update_outputs` and `step`.
pub trait Component: Clone + Default + Serialize + DeserializeOwned + Send + 'static {
    /// The name of the model, also that of the library; a C identifier.
    const NAME: &'static str;
    /// One line for the model description.
    const DESCRIPTION: &'static str;
    /// Paragraphs for `documentation/index.html`, separated by empty lines: equations, sources.
    const DOCUMENTATION: &'static str = "";
    /// Version of the component, part of the saved state's header.
    const VERSION: &'static str = env!("CARGO_PKG_VERSION");
    /// The step size, s, that an importer should use if it has no other wish.
    const STEP_SIZE: f64 = 0.002;
    /// Whether steps of any length are allowed; `false` for a law designed for `STEP_SIZE` only.
    const ANY_STEP_SIZE: bool = true;
    /// Whether [`partial_derivative`](Self::partial_derivative) is implemented.
    const PARTIAL_DERIVATIVES: bool = false;
    /// Whether a copy of it is its whole state; `false` for one with a process of its own.
    const SAVES_STATE: bool = true;
    /// Whether it needs another program to be installed.
    const NEEDS_EXECUTION_TOOL: bool = false;
    /// Number of values that [`event_indicators`](Self::event_indicators) fills.
    const EVENT_INDICATORS: usize = 0;
    /// Ports that are connected as a whole.
    const TERMINALS: &'static [Terminal] = &[];

    /// The table of variables. Their order is that of the model description.
    ///
    /// A component whose table holds derivatives of continuous states (see
    /// [`Variable::derivative_of`]) is offered for model exchange, too.
    fn variables() -> Vec<Variable<Self>>;

    /// Reads what it needs from the folder `resources` of the FMU, once, before anything else; most
    /// components need nothing.
    ///
    /// # Errors
    /// A file that cannot be used; the instance is then not made.
    fn load(&mut self, resources: &Path) -> ComponentResult {
        let _ = resources;
        Ok(())
    }

    /// Prepares the component from its parameters and puts it into its initial state.
    ///
    /// May be called again after a parameter was changed and must not depend on inputs.
    ///
    /// # Errors
    /// Names the parameter that is at fault and what was expected.
    fn initialize(&mut self) -> ComponentResult;

    /// Refuses model exchange with the present parameters, where the continuous states do not tell
    /// everything; called after [`initialize`](Self::initialize) of a model-exchange instance.
    ///
    /// # Errors
    /// Names what model exchange lacks.
    fn allow_model_exchange(&self) -> ComponentResult {
        Ok(())
    }

    /// Computes outputs (and derivatives of states) from states, inputs and `time` (s).
    fn update_outputs(&mut self, time: f64) {
        let _ = time;
    }

    /// Advances from `time` to `time + step_size` (s) with the inputs held.
    ///
    /// # Errors
    /// When the model cannot go on; the instance then answers errors until it is reset or an
    /// earlier state is restored.
    fn step(&mut self, time: f64, step_size: f64) -> ComponentResult;

    /// The partial derivative of an output or state derivative with respect to an input or state,
    /// at the present point. Asked only for pairs that the table declares as dependent.
    fn partial_derivative(&self, unknown: &str, known: &str) -> f64 {
        let _ = (unknown, known);
        0.0
    }

    /// Fills the event indicators (model exchange): an event happens where one changes its sign.
    fn event_indicators(&mut self, time: f64, indicators: &mut [f64]) {
        let _ = (time, indicators);
    }

    /// Handles an event at `time` (model exchange).
    ///
    /// # Errors
    /// When the model cannot go on.
    fn handle_event(&mut self, time: f64) -> Result<Event, Box<dyn std::error::Error>> {
        let _ = time;
        Ok(Event::default())
    }
}

/// What an event changed (model exchange).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Event {
    /// The continuous states jumped.
    pub states_changed: bool,
    /// The time (s) of the next event, when it is known beforehand.
    pub next_event_time: Option<f64>,
}
