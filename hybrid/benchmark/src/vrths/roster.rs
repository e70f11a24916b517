//! The tracking laws that the benchmark compares.

use hybrid::laws::adaptive_inverse::AdaptiveInverse;
use hybrid::laws::compensation::Compensated;
use hybrid::laws::extrapolation::Extrapolation;
use hybrid::laws::gradient_inverse::GradientInverse;
use hybrid::laws::linear_quadratic::{LinearQuadraticDesign, LinearQuadraticTracking};
use hybrid::laws::model_inverse::ModelInverse;
use hybrid::laws::phase_lead_pi::PhaseLeadPi;
use hybrid::laws::robust_tracking::RobustTracking;
use hybrid::laws::sliding_mode::TrackingSlidingMode;
use hybrid::vrths::{PERIOD, TransferSystemEffects, TransferSystemParameters};
use plant::ModelError;

use super::simulation::TrackingLaw;

/// A tracking law with its name.
#[derive(Clone, Copy)]
pub struct Entry {
    /// What `--controller` calls it.
    pub name: &'static str,
    /// What it is, in a few words.
    pub about: &'static str,
    /// Whether the converters sit inside the law.
    pub own_converters: bool,
    make: Make,
}

/// How a law is made.
#[derive(Clone, Copy)]
enum Make {
    /// From constants of its own.
    AsPublished(fn() -> Result<Box<TrackingLaw>, ModelError>),
    /// From a model of the plant.
    From(fn(&TransferSystemParameters) -> Result<Box<TrackingLaw>, ModelError>),
}

impl Entry {
    /// A new law, designed on the nominal plant where it is designed on one.
    ///
    /// # Errors
    /// A design that has no solution.
    pub fn make(&self) -> Result<Box<TrackingLaw>, ModelError> {
        match self.make {
            Make::AsPublished(make) => make(),
            Make::From(design) => design(&TransferSystemParameters::default()),
        }
    }

    /// Whether it is designed on a model of the plant.
    #[must_use]
    pub fn is_designed(&self) -> bool {
        matches!(self.make, Make::From(_))
    }

    /// A new law designed on `plant`, and compensated for `effects` where there are any; laws that
    /// are not designed on a model stay as they are.
    ///
    /// # Errors
    /// A design that has no solution, a plant that cannot be.
    pub fn design(
        &self,
        plant: &TransferSystemParameters,
        effects: &TransferSystemEffects,
    ) -> Result<Box<TrackingLaw>, ModelError> {
        let Make::From(design) = self.make else {
            return self.make();
        };
        let law = design(plant)?;
        if !effects.is_active() {
            return Ok(law);
        }
        Ok(Box::new(Compensated::new(law, *plant, *effects, PERIOD)?))
    }
}

/// The benchmark's own controller, which the published table is of.
pub const SAMPLE: &str = "phase-lead-pi";

/// The law that does best.
pub const BEST: &str = "adaptive-inverse";

/// Lead of the desired displacement that makes up for the force, which is fed one sample late and
/// then held over one more: what the substructure gets is in the mean one and a half samples old.
pub const LEAD: f64 = 1.5;

/// All laws, the benchmark's own first.
pub const ALL: [Entry; 9] = [
    Entry {
        name: SAMPLE,
        about: "the benchmark's sample controller: PI with phase lead",
        own_converters: true,
        make: Make::AsPublished(|| Ok(Box::new(PhaseLeadPi::default()))),
    },
    Entry {
        name: "inverse-without-specimen",
        about: "inverse of the transfer system without its specimen, third order",
        own_converters: false,
        make: Make::AsPublished(|| {
            let law = ModelInverse::of(&ModelInverse::without_specimen(), 3)?;
            Ok(Box::new(law))
        }),
    },
    Entry {
        name: "inverse",
        about: "inverse of the nominal plant",
        own_converters: false,
        make: Make::From(|plant| Ok(Box::new(smooth_inverse(plant, 0.0)?))),
    },
    Entry {
        name: "inverse-pi",
        about: "the same with PI, target led by 1.5 samples",
        own_converters: false,
        make: Make::From(|plant| {
            Ok(Box::new(ModelInverse {
                proportional: 2.0,
                integral: 95.0,
                ..smooth_inverse(plant, LEAD)?
            }))
        }),
    },
    Entry {
        name: "robust",
        about: "the same with synthesised loop shaping instead of PI",
        own_converters: false,
        make: Make::From(|plant| {
            let law = RobustTracking::synthesise(plant, 60.0, 50.0, LEAD, PERIOD)?;
            Ok(Box::new(law))
        }),
    },
    Entry {
        name: "linear-quadratic",
        about: "inverse, state feedback and Kalman filter with a disturbance at the command",
        own_converters: false,
        make: Make::From(|plant| {
            let design = LinearQuadraticDesign {
                lead: LEAD,
                ..LinearQuadraticDesign::default()
            };
            let law = LinearQuadraticTracking::design(plant, &design, PERIOD)?;
            Ok(Box::new(law))
        }),
    },
    Entry {
        name: "sliding-mode",
        about: "published: Li et al. 2021",
        own_converters: false,
        make: Make::AsPublished(|| Ok(Box::new(TrackingSlidingMode::published()?))),
    },
    Entry {
        name: "gradient-inverse",
        about: "published: adaptive inverse of Gálmez and Fermandois 2022",
        own_converters: false,
        make: Make::AsPublished(|| Ok(Box::new(GradientInverse::default()))),
    },
    Entry {
        name: BEST,
        about: "inverse estimated by instrumental variables, target led by 1.5 samples",
        own_converters: false,
        make: Make::From(|plant| Ok(Box::new(AdaptiveInverse::around(plant, PERIOD)?))),
    },
];

/// The roster's entry of a name.
#[must_use]
pub fn entry(name: &str) -> Option<Entry> {
    ALL.into_iter().find(|entry| entry.name == name)
}

/// The inverse of a plant with all derivatives; the hold of the command is led by half a sample.
fn smooth_inverse(plant: &TransferSystemParameters, lead: f64) -> Result<ModelInverse, ModelError> {
    Ok(ModelInverse {
        desired: Extrapolation::new(5, 16, lead + 0.5)?,
        ..ModelInverse::of(plant, 5)?
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_law_can_be_made_and_has_its_own_name() {
        for (i, entry) in ALL.iter().enumerate() {
            entry.make().unwrap().validate().unwrap();
            assert!(ALL[..i].iter().all(|other| other.name != entry.name));
        }
        assert!(ALL.iter().any(|entry| entry.name == BEST));
    }
}
