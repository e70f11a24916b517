//! The motion that is played, as options.

use std::path::PathBuf;

use clap::Args;

use super::quantity::{positive, whole};
use laboratory::error::Error;
use motion::{self, Scaling};
use units::STANDARD_GRAVITY;

/// Options that choose a motion and how large it is played.
#[derive(Debug, Clone, Default, Args)]
pub struct MotionArguments {
    /// Ground motion: acceleration only, as PEER .AT2 or .csv; filtered and scaled for the table
    #[arg(
        long,
        alias = "motion",
        value_name = "FILE",
        conflicts_with = "reference"
    )]
    pub record: Option<PathBuf>,
    /// Ground motion along the second axis of a biaxial table, scaled like the first; without it, that axis stays at rest
    #[arg(long, value_name = "FILE", requires = "record")]
    pub record_y: Option<PathBuf>,
    /// Reference: .csv with time, displacement, velocity, acceleration, played as given
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Reference along the second axis of a biaxial table
    #[arg(long, value_name = "FILE", requires = "reference")]
    pub reference_y: Option<PathBuf>,
    /// Scale of the motion: a factor
    #[arg(long, value_name = "FACTOR", group = "scaling")]
    pub scale: Option<f64>,
    /// Scale of the motion: peak acceleration in g
    #[arg(long, value_name = "G", group = "scaling")]
    pub pga: Option<String>,
    /// Scale of the motion: peak displacement, such as "1.2 in" (a plain number is in m)
    #[arg(long, value_name = "L", group = "scaling")]
    pub peak: Option<String>,
    /// Seed of the built-in motion [default: 1]
    #[arg(long, value_parser = whole::<u64>, conflicts_with_all = ["record", "reference"])]
    pub seed: Option<u64>,
}

impl MotionArguments {
    /// Size of the motion, if given.
    ///
    /// # Errors
    /// No positive quantity.
    pub fn scaling(&self) -> Result<Option<Scaling>, Error> {
        Ok(match (self.scale, &self.pga, &self.peak) {
            (Some(factor), _, _) => Some(Scaling::Factor(factor)),
            (_, Some(pga), _) => Some(Scaling::PeakAcceleration(
                positive("--pga", pga, "g")? * STANDARD_GRAVITY,
            )),
            (_, _, Some(peak)) => Some(Scaling::PeakDisplacement(positive("--peak", peak, "m")?)),
            _ => None,
        })
    }

    /// The seed, chosen or not.
    pub fn seed(&self) -> u64 {
        self.seed.unwrap_or(motion::DEFAULT_SEED)
    }
}
