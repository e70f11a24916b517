//! The tracking laws that the benchmark compares.

use hybrid::marths::laws::{
    Class, DecentralisedAdaptive, Law, NoControl, Predictive, PredictiveDesign,
};
use plant::ModelError;

/// A tracking law with its name.
#[derive(Clone, Copy)]
pub struct Entry {
    /// What `--controller` calls it.
    pub name: &'static str,
    /// What it is, in a few words.
    pub about: &'static str,
    /// What it feeds to the specimen's force.
    pub class: Class,
    make: fn() -> Result<Box<dyn Law>, ModelError>,
}

impl Entry {
    /// A new law.
    ///
    /// # Errors
    /// A design that has no solution.
    pub fn make(&self) -> Result<Box<dyn Law>, ModelError> {
        (self.make)()
    }
}

/// All laws, the benchmark's own first.
pub const ALL: [Entry; 6] = [
    Entry {
        name: "rodeac",
        about: "the benchmark's sample controller: an adaptive filter for each actuator",
        class: Class::Raw,
        make: || Ok(Box::new(DecentralisedAdaptive::default())),
    },
    Entry {
        name: "none",
        about: "the targets are the commands",
        class: Class::Raw,
        make: || Ok(Box::new(NoControl)),
    },
    Entry {
        name: "decoupled-predictive",
        about: "predictive, each actuator by its own entry of the nominal plant",
        class: Class::Raw,
        make: || {
            let mut design = raw(false);
            design.plant.static_gain[0][1] = 0.0;
            design.plant.static_gain[1][0] = 0.0;
            Ok(Box::new(Predictive::new(design)?))
        },
    },
    Entry {
        name: "predictive",
        about: "predictive, both actuators by the nominal plant",
        class: Class::Raw,
        make: || Ok(Box::new(Predictive::new(raw(false))?)),
    },
    Entry {
        name: "adaptive-predictive",
        about: "predictive, by a plant that is estimated during the test",
        class: Class::Raw,
        make: || Ok(Box::new(Predictive::new(raw(true))?)),
    },
    Entry {
        name: "adaptive-predictive-estimate",
        about: "the same, the estimated strokes make the specimen's force",
        class: Class::Estimate,
        make: || {
            let design = PredictiveDesign {
                class: Class::Estimate,
                order: 3,
                ..raw(true)
            };
            Ok(Box::new(Predictive::new(design)?))
        },
    },
];

/// With measured strokes in the force the targets jitter, which asks for a lower order.
fn raw(adaptive: bool) -> PredictiveDesign {
    PredictiveDesign {
        adaptive,
        ..PredictiveDesign::default()
    }
}

/// The roster's entry of a name.
#[must_use]
pub fn entry(name: &str) -> Option<Entry> {
    ALL.into_iter().find(|entry| entry.name == name)
}
