//! The tracking laws that the benchmark compares.

use hybrid::marths::PlantParameters;
use hybrid::marths::laws::{
    Class, DecentralisedAdaptive, Inverse, Law, LinearQuadratic, LinearQuadraticDesign, NoControl,
    Predictive, PredictiveDesign, SingleAxis,
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
    /// Of a law that leaves the coupling of the actuators out: the same law with it.
    pub full: Option<&'static str>,
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
pub const ALL: [Entry; 12] = [
    Entry {
        name: "rodeac",
        about: "the benchmark's sample controller: an adaptive filter for each actuator",
        class: Class::Raw,
        full: None,
        make: || Ok(Box::new(DecentralisedAdaptive::default())),
    },
    Entry {
        name: "none",
        about: "the targets are the commands",
        class: Class::Raw,
        full: None,
        make: || Ok(Box::new(NoControl)),
    },
    Entry {
        name: "single-axis",
        about: "the best law of the single-axis benchmark, an adaptive inverse, for each actuator",
        class: Class::Raw,
        full: None,
        make: || {
            Ok(Box::new(SingleAxis::new(
                &PlantParameters::default(),
                0.1,
                3,
                16,
                0.0,
            )?))
        },
    },
    Entry {
        name: "decoupled-inverse",
        about: "the inverse of each actuator's own entry of the nominal plant",
        class: Class::Raw,
        full: Some("inverse"),
        make: || inverse(alone(PlantParameters::default())),
    },
    Entry {
        name: "inverse",
        about: "the inverse of the nominal plant",
        class: Class::Raw,
        full: None,
        make: || inverse(PlantParameters::default()),
    },
    Entry {
        name: "linear-quadratic",
        about: "the inverse with state feedback, a Kalman filter and integral action",
        class: Class::Raw,
        full: None,
        make: || {
            let design = LinearQuadraticDesign::default();
            let plant = PlantParameters::default();
            Ok(Box::new(LinearQuadratic::new(plant, &design, 2, 12)?))
        },
    },
    Entry {
        name: "decoupled-predictive",
        about: "predictive, each actuator by its own entry of the nominal plant",
        class: Class::Raw,
        full: Some("predictive"),
        make: || predictive(decoupled(raw(false))),
    },
    Entry {
        name: "predictive",
        about: "predictive, both actuators by the nominal plant",
        class: Class::Raw,
        full: None,
        make: || predictive(raw(false)),
    },
    Entry {
        name: "decoupled-adaptive-predictive",
        about: "predictive, each actuator by its own entry of a plant that is estimated during the test",
        class: Class::Raw,
        full: Some("adaptive-predictive"),
        make: || predictive(decoupled(raw(true))),
    },
    Entry {
        name: "adaptive-predictive",
        about: "predictive, by a plant that is estimated during the test",
        class: Class::Raw,
        full: None,
        make: || predictive(raw(true)),
    },
    Entry {
        name: "decoupled-adaptive-predictive-estimate",
        about: "the same for each actuator by its own entry, the estimated strokes make the specimen's force",
        class: Class::Estimate,
        full: Some("adaptive-predictive-estimate"),
        make: || predictive(decoupled(estimate())),
    },
    Entry {
        name: "adaptive-predictive-estimate",
        about: "the same with both actuators",
        class: Class::Estimate,
        full: None,
        make: || predictive(estimate()),
    },
];

fn predictive(design: PredictiveDesign) -> Result<Box<dyn Law>, ModelError> {
    Ok(Box::new(Predictive::new(design)?))
}

/// With measured strokes in the force the targets jitter, which asks for a lower order.
fn raw(adaptive: bool) -> PredictiveDesign {
    PredictiveDesign {
        adaptive,
        ..PredictiveDesign::default()
    }
}

fn estimate() -> PredictiveDesign {
    PredictiveDesign {
        class: Class::Estimate,
        order: 3,
        ..raw(true)
    }
}

/// A command moves the stroke of its own actuator alone, also in what is estimated.
fn decoupled(mut design: PredictiveDesign) -> PredictiveDesign {
    design.plant = alone(design.plant);
    design
}

fn alone(mut plant: PlantParameters) -> PlantParameters {
    plant.static_gain[0][1] = 0.0;
    plant.static_gain[1][0] = 0.0;
    plant
}

fn inverse(plant: PlantParameters) -> Result<Box<dyn Law>, ModelError> {
    Ok(Box::new(Inverse::new(plant, 2, 12)?))
}

/// The roster's entry of a name.
#[must_use]
pub fn entry(name: &str) -> Option<Entry> {
    ALL.into_iter().find(|entry| entry.name == name)
}
