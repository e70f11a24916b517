//! The order of calls: in which phase an instance is and what it then accepts.

use serde::{Deserialize, Serialize};

use crate::variable::{Causality, Variability};

/// How an instance is driven.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// The component advances itself.
    CoSimulation,
    /// The importer integrates the component's derivatives.
    ModelExchange,
}

/// Phase of an instance in the order of calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Phase {
    /// Made or reset.
    Instantiated,
    /// Between entering and leaving initialization.
    Initialization,
    /// Co-simulation, at a communication point.
    Step,
    /// Model exchange, at an event.
    Event,
    /// Model exchange, between events.
    ContinuousTime,
    /// A step or an event failed.
    Failed,
    /// The simulation has ended.
    Terminated,
    /// Structural parameters are set.
    Configuration,
}

impl Phase {
    /// The name for messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "before initialization",
            Self::Initialization => "in initialization mode",
            Self::Step => "in step mode",
            Self::Event => "in event mode",
            Self::ContinuousTime => "in continuous-time mode",
            Self::Failed => "after a failed step",
            Self::Terminated => "after termination",
            Self::Configuration => "in configuration mode",
        }
    }

    /// Whether a variable of this kind may be set now.
    #[inline]
    pub fn accepts(self, causality: Causality, variability: Variability) -> bool {
        match (causality, self) {
            (
                Causality::Input | Causality::Parameter,
                Self::Instantiated | Self::Initialization,
            ) => true,
            (Causality::Input, Self::Step | Self::Event) => true,
            (Causality::Input, Self::ContinuousTime) => variability == Variability::Continuous,
            (Causality::Parameter, Self::Step | Self::Event) => variability == Variability::Tunable,
            _ => false,
        }
    }

    /// Whether computed variables are brought up to date before they are read.
    #[inline]
    pub fn computes(self) -> bool {
        matches!(
            self,
            Self::Initialization | Self::Step | Self::Event | Self::ContinuousTime
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Causality::{Input, Local, Output, Parameter};
    use Phase::*;
    use Variability::{Continuous, Discrete, Fixed, Tunable};

    const ALL: [Phase; 8] = [
        Instantiated,
        Initialization,
        Step,
        Event,
        ContinuousTime,
        Failed,
        Terminated,
        Configuration,
    ];

    #[test]
    fn computed_variables_are_never_set() {
        for phase in ALL {
            assert!(!phase.accepts(Output, Continuous));
            assert!(!phase.accepts(Local, Discrete));
        }
    }

    #[test]
    fn fixed_parameters_are_set_up_to_the_end_of_initialization() {
        let accepted: Vec<_> = ALL
            .into_iter()
            .filter(|p| p.accepts(Parameter, Fixed))
            .collect();
        assert_eq!(accepted, [Instantiated, Initialization]);
        let accepted: Vec<_> = ALL
            .into_iter()
            .filter(|p| p.accepts(Parameter, Tunable))
            .collect();
        assert_eq!(accepted, [Instantiated, Initialization, Step, Event]);
    }

    #[test]
    fn discrete_inputs_are_not_set_in_continuous_time() {
        assert!(ContinuousTime.accepts(Input, Continuous));
        assert!(!ContinuousTime.accepts(Input, Discrete));
        assert!(!Terminated.accepts(Input, Continuous));
        assert!(!Failed.accepts(Input, Continuous));
    }
}
