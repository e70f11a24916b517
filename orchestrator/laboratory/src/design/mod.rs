//! Margins and frequency responses of the loops, and the loop-shaping synthesis.

mod bode;
mod figures;
mod loops;
pub mod model;
mod page;
mod panels;
mod table;

use std::str::FromStr;

use controllers::ModelError;
use controllers::loop_shaping::LoopShaping;
use controllers::sliding_mode;
use controllers::synthesis::whole_plant::{Shaped, WholePlantDesign};
use controllers::synthesis::{self, EQUATION_3_10_CROSSOVER, LoopShapingDesign};
use plant::identified::coupled::Rig;
use plant::identified::shake_table::ShakeTable;
use plant::specimens::linear::LinearSpecimen;
use serde::Serialize;
use units::constants::SAMPLING_PERIOD;

pub use figures::{Figures, LoopFigures};
use loops::NamedLoop;
pub use loops::{LoopName, UnknownLoop};
pub use page::{thesis_figures, write};
pub use table::table;

/// What is designed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// One loop; none: all.
    pub only: Option<LoopName>,
    /// Crossover that the synthesised controller's sampled loop is to reach, rad/s; none: the
    /// thesis's synthesis, for the target that comes nearest to Eq 3-10.
    pub crossover: Option<f64>,
    /// What stands on the table.
    pub specimen: Specimen,
}

/// What stands on the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Specimen {
    /// Nothing.
    #[default]
    None,
    /// The linear specimen of Appendix A.
    Linear,
}

impl Specimen {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Linear => "linear",
        }
    }
}

/// A specimen around which no loop can be designed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` has no linear model; expected none or linear")]
pub struct NoLinearModel(pub String);

impl FromStr for Specimen {
    type Err = NoLinearModel;

    fn from_str(text: &str) -> Result<Self, NoLinearModel> {
        match text {
            "none" => Ok(Self::None),
            "linear" => Ok(Self::Linear),
            other => Err(NoLinearModel(other.to_string())),
        }
    }
}

/// Loops with their figures: what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Design {
    /// The loops.
    pub loops: Vec<LoopFigures>,
    /// What stands on the table.
    pub specimen: Specimen,
    /// The loop-shaping synthesis.
    pub synthesis: Synthesis,
    /// `lambda = K` of sliding mode.
    pub sliding_mode_rate_1_s: f64,
    /// For the plots.
    #[serde(skip)]
    drawn: Vec<NamedLoop>,
    #[serde(skip)]
    shaping: LoopShapingDesign,
}

/// The loop-shaping synthesis.
#[derive(Debug, Clone, Serialize)]
pub struct Synthesis {
    /// Target crossover.
    pub crossover_rad_s: f64,
    /// Crossover that the sampled loop reaches, where it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reached_crossover_rad_s: Option<f64>,
    /// Smallest bound that a controller can reach.
    pub gamma_min: f64,
    /// Bound of the controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// Gain of the second-order controller (Eq 3-10), V/m.
    pub gain_v_m: f64,
    /// `n1` of its numerator `s² + n1 s + n0`.
    pub numerator_rate_1_s: f64,
    /// `n0` of it.
    pub numerator_constant_1_s2: f64,
    /// `p` of its denominator `s (s + p)`.
    pub pole_1_s: f64,
    /// Further sections, `[b2, b1, a2, a1]` of `(b2 s² + b1 s + 1)/(a2 s² + a1 s + 1)`.
    pub sections: Vec<[f64; 4]>,
    /// Of the controller of full order.
    pub hankel_singular_values: Vec<f64>,
}

/// Finds the figures of the loops on the identified rig.
///
/// # Errors
/// A crossover for which there is no controller.
pub fn design(options: &Options) -> Result<Design, ModelError> {
    let rig = Rig {
        specimen: match options.specimen {
            Specimen::None => None,
            Specimen::Linear => Some(LinearSpecimen::appendix_a()),
        },
        ..Rig::default()
    };
    let shaping = synthesis::loop_shaping(
        &ShakeTable::default().voltage_to_displacement(),
        EQUATION_3_10_CROSSOVER,
    )?;
    let whole = options
        .crossover
        .map(|crossover| {
            Shaped {
                rig: &rig.shake_table,
                late: 0.0,
                noise: 0.0,
                period: SAMPLING_PERIOD,
            }
            .design(crossover)
        })
        .transpose()?;
    let synthesised = whole
        .as_ref()
        .map_or(LoopShaping::new(shaping.coefficients), |own| own.law);
    let chosen = LoopName::ALL.into_iter();
    let drawn = chosen
        .filter(|name| options.only.is_none_or(|only| only == *name))
        .map(|name| NamedLoop::new(name, &rig, &synthesised))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Design {
        loops: drawn.iter().map(LoopFigures::of).collect(),
        specimen: options.specimen,
        synthesis: whole
            .as_ref()
            .map_or_else(|| Synthesis::from(&shaping), Synthesis::from),
        sliding_mode_rate_1_s: sliding_mode::IDENTIFIED_RATE,
        drawn,
        shaping,
    })
}

impl From<&LoopShapingDesign> for Synthesis {
    fn from(design: &LoopShapingDesign) -> Self {
        let c = design.coefficients;
        Self {
            crossover_rad_s: design.crossover,
            reached_crossover_rad_s: None,
            gamma_min: design.robust.gamma_min,
            gamma: Some(design.robust.gamma),
            gain_v_m: c.gain,
            numerator_rate_1_s: c.numerator_rate,
            numerator_constant_1_s2: c.numerator_constant,
            pole_1_s: c.pole,
            sections: Vec::new(),
            hankel_singular_values: design.hankel_singular_values.clone(),
        }
    }
}

impl From<&WholePlantDesign> for Synthesis {
    fn from(design: &WholePlantDesign) -> Self {
        let c = design.law.coefficients;
        let sections = design.law.sections.iter().filter(|own| !own.is_one());
        Self {
            crossover_rad_s: design.target,
            reached_crossover_rad_s: Some(design.reached),
            gamma_min: design.gamma_min,
            gamma: None,
            gain_v_m: c.gain,
            numerator_rate_1_s: c.numerator_rate,
            numerator_constant_1_s2: c.numerator_constant,
            pole_1_s: c.pole,
            sections: sections
                .map(|own| [own.b2, own.b1, own.a2, own.a1])
                .collect(),
            hankel_singular_values: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specimens_and_loops_are_read_by_their_names() {
        for specimen in [Specimen::None, Specimen::Linear] {
            assert_eq!(specimen.name().parse(), Ok(specimen));
        }
        let refused = "yielding".parse::<Specimen>().unwrap_err().to_string();
        assert_eq!(
            refused,
            "`yielding` has no linear model; expected none or linear"
        );
        for name in LoopName::ALL {
            assert_eq!(name.name().parse(), Ok(name));
            assert_eq!(name.to_string(), name.name());
        }
        let refused = "pid".parse::<LoopName>().unwrap_err().to_string();
        assert!(
            refused
                .starts_with("`pid` is not a loop; expected one of displacement-pid, force-pid, "),
            "{refused}"
        );
        let mut about = LoopName::ALL.map(LoopName::about).to_vec();
        about.sort_unstable();
        about.dedup();
        assert_eq!(about.len(), LoopName::ALL.len());
    }

    #[test]
    fn loops_of_the_thesis_have_their_margins_and_pages() {
        use pages::report::columns::aligned;
        let mut text = String::new();
        for specimen in [Specimen::None, Specimen::Linear] {
            let found = design(&Options {
                specimen,
                ..Options::default()
            })
            .unwrap();
            text += &aligned(&table(&found.loops));
            for own in &found.loops {
                text += &format!("{}: {}\n", own.name, own.note);
            }
            text += &page::text_of(&found).replace(env!("CARGO_PKG_VERSION"), "VERSION");
        }
        expected::compare(env!("CARGO_MANIFEST_DIR"), "design.txt", &text);
    }

    #[test]
    fn one_loop_is_designed_alone_and_for_a_crossover() {
        let found = design(&Options {
            only: Some(LoopName::LoopShapingSynthesis),
            crossover: Some(60.0),
            specimen: Specimen::None,
        })
        .unwrap();
        assert_eq!(found.loops.len(), 1);
        let own = &found.loops[0];
        assert_eq!(own.name, LoopName::LoopShapingSynthesis);
        let reached = found.synthesis.reached_crossover_rad_s.unwrap();
        assert!((reached / 60.0 - 1.0).abs() < 0.02, "{reached}");
        let crossover = own.sampled.crossover_rad_s.unwrap();
        assert!((crossover / reached - 1.0).abs() < 0.02, "{crossover}");
        assert!(found.synthesis.gamma.is_none() && found.synthesis.gamma_min > 1.0);
        let folder = tempfile::tempdir().unwrap();
        let page = page::write(&found, &crate::results::Out::new(folder.path())).unwrap();
        let text = std::fs::read_to_string(page).unwrap();
        assert!(text.contains("Loops of the shake table"));
    }
}
