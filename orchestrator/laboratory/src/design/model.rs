//! All controllers for an identified rig: their margins as they run, and what the model's
//! uncertainty leaves of them.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

use controllers::ModelError;
use controllers::robustness::{LateRig, OpenLoop, Pushed};
use controllers::tuning::suite::{Member, Suite};
use rayon::prelude::*;
use serde::Serialize;

use crate::error::Error;
use crate::results::{self, Out};
use crate::systems::control_model::ControlModel;
use pages::report::number::significant;
use pages::report::{Abscissa, Axis, Panel, Report, Section, Series, Style, Table, Units};

/// Least margins that a controller must keep on 95 of 100 rigs that the model's uncertainty allows;
/// unstable it may be on none.
pub const LEAST_GAIN_MARGIN_DB: f64 = 3.0;
/// See [`LEAST_GAIN_MARGIN_DB`].
pub const LEAST_PHASE_MARGIN_DEG: f64 = 20.0;
/// Rigs drawn by default.
pub const DRAWS: u64 = 40;
/// Time over which a push is followed, s.
const FOLLOWED: f64 = 8.0;
/// Lowest frequency that is looked at, rad/s.
const LOWEST: f64 = 2.0;

/// What is designed on what.
#[derive(Debug, Clone)]
pub struct Options {
    /// The model file.
    pub model: PathBuf,
    /// One controller; none: all.
    pub only: Option<String>,
    /// Crossover of loop shaping, rad/s; none: the fastest with 6 dB and 45 degrees.
    pub crossover: Option<f64>,
    /// Rigs drawn.
    pub draws: u64,
    /// Seed of the draws.
    pub seed: u64,
}

/// Values of which five in a hundred are smaller, and five larger.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// 5th percentile.
    pub low: f64,
    /// 95th percentile.
    pub high: f64,
}

/// Margins of one controller on the model and on the rigs that its uncertainty allows.
#[derive(Debug, Clone, Serialize)]
pub struct LoopOnModel {
    /// The controller.
    pub name: String,
    /// Whether it holds the model.
    pub stable: bool,
    /// Where the gain is one, rad/s.
    pub crossover_rad_s: Option<f64>,
    /// Smallest in magnitude.
    pub phase_margin_deg: Option<f64>,
    /// Smallest in magnitude.
    pub gain_margin_db: Option<f64>,
    /// Where `L/(1 + L)` has fallen by 3 dB, Hz.
    pub bandwidth_hz: Option<f64>,
    /// Largest sensitivity.
    pub peak_sensitivity: f64,
    /// Crossover that was asked for, where one was, rad/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_crossover_rad_s: Option<f64>,
    /// Over the drawn rigs.
    pub phase_margin_band_deg: Option<Band>,
    /// Over the drawn rigs.
    pub gain_margin_band_db: Option<Band>,
    /// Drawn rigs that it does not hold.
    pub unstable: usize,
    /// Whether it keeps its least margins.
    pub robust: bool,
    /// What it is refused for, or what the reader should know.
    pub note: String,
    /// What it is set to, by the names of its component, SI.
    pub parameters: BTreeMap<String, f64>,
    #[serde(skip)]
    open: Option<OpenLoop>,
    #[serde(skip)]
    drawn: Vec<OpenLoop>,
}

impl LoopOnModel {
    /// A controller whose rule finds none.
    fn without(member: Member, error: &ModelError) -> Self {
        Self {
            name: member.name().to_string(),
            stable: false,
            crossover_rad_s: None,
            phase_margin_deg: None,
            gain_margin_db: None,
            bandwidth_hz: None,
            peak_sensitivity: f64::INFINITY,
            target_crossover_rad_s: None,
            phase_margin_band_deg: None,
            gain_margin_band_db: None,
            unstable: 0,
            robust: false,
            note: format!("is not found: {error}"),
            parameters: BTreeMap::new(),
            open: None,
            drawn: Vec::new(),
        }
    }
}

/// Controllers on a model: what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct ModelDesign {
    /// The controllers.
    pub loops: Vec<LoopOnModel>,
    /// The model file.
    pub model: PathBuf,
    /// Delay of the measurements, ms.
    pub late_ms: f64,
    /// Rigs drawn from the model's uncertainty.
    pub draws: usize,
    /// Their seed.
    pub seed: u64,
    /// What the reader should know.
    pub warnings: Vec<String>,
}

/// Designs controllers on a model file.
///
/// # Errors
/// A file at fault, an unknown controller.
pub fn design(options: &Options) -> Result<ModelDesign, Error> {
    let model = ControlModel::read(&options.model).map_err(|error| Error::Option {
        option: "--model",
        reason: error.to_string(),
    })?;
    on_model(&model, options)
}

/// As [`design`], on a model that has been read.
///
/// # Errors
/// See [`design`].
pub fn on_model(model: &ControlModel, options: &Options) -> Result<ModelDesign, Error> {
    let fault = |reason: ModelError| Error::Option {
        option: "--model",
        reason: format!("{}: {reason}", options.model.display()),
    };
    let members: Vec<Member> = match &options.only {
        None => Member::ALL.to_vec(),
        Some(name) => {
            let found = Member::ALL.into_iter().find(|member| member.name() == name);
            vec![found.ok_or_else(|| Error::Option {
                option: "--loop",
                reason: format!(
                    "`{name}` is not a controller; expected one of {}",
                    Member::ALL.map(Member::name).join(", ")
                ),
            })?]
        }
    };
    let mut suite = model.suite();
    if let Some(crossover) = options.crossover {
        suite = suite
            .with_crossover(crossover)
            .map_err(|error| Error::Option {
                option: "--crossover",
                reason: error.to_string(),
            })?;
    }
    let late = |rig: &plant::identified::shake_table::ShakeTable, late: f64| {
        LateRig::new(&rig.state_space(), late, suite.measurements.period)
    };
    let nominal = late(&model.rig, model.late).map_err(fault)?;
    let draws: Vec<LateRig> = model
        .draws(options.draws, options.seed)
        .iter()
        .filter_map(|draw| late(&draw.rig, draw.late).ok())
        .collect();
    let loops: Vec<LoopOnModel> = members
        .into_par_iter()
        .map(|member| {
            let own = examine(&suite, member, &nominal, &draws);
            own.unwrap_or_else(|error| LoopOnModel::without(member, &error))
        })
        .collect();
    let mut warnings = Vec::new();
    if draws.is_empty() {
        warnings.push("the model has no uncertainty, so there is no band".to_string());
    }
    if model.hydraulics.is_none() && !draws.is_empty() {
        warnings.push(
            "the model has no correlations of its errors: they are drawn as independent, which \
             makes the bands too wide"
                .to_string(),
        );
    }
    Ok(ModelDesign {
        loops,
        model: options.model.clone(),
        late_ms: 1e3 * model.late,
        draws: draws.len(),
        seed: options.seed,
        warnings,
    })
}

/// A controller on the model and on every drawn rig.
fn examine(
    suite: &Suite,
    member: Member,
    nominal: &LateRig,
    draws: &[LateRig],
) -> Result<LoopOnModel, ModelError> {
    let open = |rig: &LateRig| -> Result<(bool, OpenLoop), ModelError> {
        let mut law = suite.law(member)?;
        let run = Pushed::new(rig, &mut *law, FOLLOWED);
        Ok((run.is_stable(), run.open_loop(LOWEST)))
    };
    let (stable, own) = open(nominal)?;
    let margins = own.margins();
    let mut unstable = 0;
    let (mut gains, mut phases, mut drawn) = (Vec::new(), Vec::new(), Vec::new());
    for rig in draws {
        let (holds, one) = open(rig)?;
        unstable += usize::from(!holds);
        let found = one.margins();
        // Without a crossing the margin has no end.
        gains.push(found.gain_margin_db.unwrap_or(f64::INFINITY).abs());
        phases.push(found.phase_margin_deg.unwrap_or(f64::INFINITY).abs());
        drawn.push(one);
    }
    let (gain_band, phase_band) = (band(&mut gains), band(&mut phases));
    let least = |band: Option<Band>, nominal: Option<f64>| {
        let nominal = nominal.map_or(f64::INFINITY, f64::abs);
        band.map_or(nominal, |band| band.low.min(nominal))
    };
    let (gain, phase) = (
        least(gain_band, margins.gain_margin_db),
        least(phase_band, margins.phase_margin_deg),
    );
    let note = if !stable {
        "does not stabilise the model".to_string()
    } else if unstable > 0 {
        format!(
            "does not stabilise {unstable} of {} rigs within the model's uncertainty",
            draws.len()
        )
    } else if gain < LEAST_GAIN_MARGIN_DB {
        format!("keeps a gain margin of {gain:.1} dB, less than {LEAST_GAIN_MARGIN_DB}")
    } else if phase < LEAST_PHASE_MARGIN_DEG {
        format!("keeps a phase margin of {phase:.0} degrees, less than {LEAST_PHASE_MARGIN_DEG}")
    } else {
        String::new()
    };
    let finite =
        |band: Option<Band>| band.filter(|own| own.low.is_finite() && own.high.is_finite());
    Ok(LoopOnModel {
        name: member.name().to_string(),
        stable,
        crossover_rad_s: margins.crossover,
        phase_margin_deg: margins.phase_margin_deg,
        gain_margin_db: margins.gain_margin_db,
        bandwidth_hz: bandwidth(&own),
        peak_sensitivity: own.peak_sensitivity(),
        target_crossover_rad_s: match member {
            Member::LoopShaping => Some(suite.loop_shaping()?.target),
            _ => None,
        },
        phase_margin_band_deg: finite(phase_band),
        gain_margin_band_db: finite(gain_band),
        unstable,
        robust: note.is_empty(),
        note,
        parameters: suite.named(member)?.into_iter().collect(),
        open: Some(own),
        drawn,
    })
}

fn band(values: &mut [f64]) -> Option<Band> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = |part: f64| values[(part * last as f64).round() as usize];
    Some(Band {
        low: at(0.05),
        high: at(0.95),
    })
}

/// Where the closed loop has fallen by 3 dB, Hz.
fn bandwidth(open: &OpenLoop) -> Option<f64> {
    let closed = |value: &nalgebra::Complex<f64>| (value / (1.0 + value)).norm();
    let least = 10f64.powf(-3.0 / 20.0);
    let last = open
        .values
        .iter()
        .rposition(|value| closed(value) >= least)?;
    open.omega.get(last + 1).map(|omega| omega / TAU)
}

impl ModelDesign {
    /// No controllers, for a model that is not used.
    pub(crate) fn without(model: PathBuf, seed: u64) -> Self {
        Self {
            loops: Vec::new(),
            model,
            late_ms: 0.0,
            draws: 0,
            seed,
            warnings: Vec::new(),
        }
    }

    /// The margins as a table: a row of heads, one of units, then one a controller.
    pub fn table(&self) -> Vec<Vec<String>> {
        let heads = [
            ["controller", ""],
            ["robust", ""],
            ["crossover", "rad/s"],
            ["phase margin", "deg"],
            ["of the band", "deg"],
            ["gain margin", "dB"],
            ["of the band", "dB"],
            ["bandwidth", "Hz"],
        ];
        let cell =
            |value: Option<f64>| value.map_or("-".to_string(), |value| significant(value, 3));
        let span = |band: Option<Band>| {
            band.map_or("-".to_string(), |own| {
                format!(
                    "{} to {}",
                    significant(own.low, 3),
                    significant(own.high, 3)
                )
            })
        };
        let mut rows: Vec<Vec<String>> = (0..2)
            .map(|i| heads.iter().map(|own| own[i].to_string()).collect())
            .collect();
        for own in &self.loops {
            rows.push(vec![
                own.name.clone(),
                if own.robust { "yes" } else { "REFUSED" }.to_string(),
                cell(own.crossover_rad_s),
                cell(own.phase_margin_deg),
                span(own.phase_margin_band_deg),
                cell(own.gain_margin_db),
                span(own.gain_margin_band_db),
                cell(own.bandwidth_hz),
            ]);
        }
        rows
    }

    /// Writes `report.html` into `folder`; says where.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Out) -> Result<PathBuf, Error> {
        results::write_report(&self.report(), folder)
    }

    /// The sections of the report, for a page of its own or a part of another.
    pub fn sections(&self) -> Vec<Section> {
        let mut sections = vec![Section {
            heading: "Controllers".into(),
            text: vec![format!(
                "Margins of the running controllers, opened at the valve, on the model and on {} \
                 rigs drawn from the errors of its identification (5 to 95 %, seed {}). A \
                 controller is refused if it does not stabilise one of them, or keeps less than \
                 {LEAST_GAIN_MARGIN_DB} dB or {LEAST_PHASE_MARGIN_DEG} degrees.",
                self.draws, self.seed
            )],
            notes: self.warnings.clone(),
            tables: vec![Table::headed_with_units("Margins", self.table())],
            ..Section::default()
        }];
        sections.extend(self.loops.iter().map(drawn_section));
        sections
    }

    fn report(&self) -> Report {
        let refused: Vec<&str> = self
            .loops
            .iter()
            .filter(|own| !own.robust)
            .map(|own| own.name.as_str())
            .collect();
        Report {
            title: format!("Controllers for {}", self.model.display()),
            summary: if refused.is_empty() {
                "All controllers are robust to the model's uncertainty.".into()
            } else {
                format!(
                    "Not robust to the model's uncertainty: {}.",
                    refused.join(", ")
                )
            },
            sections: self.sections(),
            footer: format!("shakebench {}", env!("CARGO_PKG_VERSION")),
            ..Report::default()
        }
    }
}

/// Gain and phase of a loop with its band.
fn drawn_section(own: &LoopOnModel) -> Section {
    let mut panels = Vec::new();
    if let Some(open) = &own.open {
        let places: Arc<[f64]> = open.omega.iter().map(|omega| omega / TAU).collect();
        type Value = fn(&nalgebra::Complex<f64>) -> f64;
        let quantities: [(&str, Axis, Value); 2] = [
            ("gain", Axis::linear("gain", Units::DECIBEL), |value| {
                20.0 * value.norm().log10()
            }),
            // From -360 degrees upwards, so that a late loop does not jump at -180.
            ("phase", Axis::linear("phase", Units::DEGREE), |value| {
                let phase = value.arg().to_degrees();
                if phase > 90.0 { phase - 360.0 } else { phase }
            }),
        ];
        for (name, y, value) in quantities {
            let line = |title: &str, values: Vec<f64>| {
                Series::line(title, Abscissa::At(places.clone()), values)
            };
            let mut series = vec![line("model", open.values.iter().map(value).collect())];
            if !own.drawn.is_empty() {
                let edges: Vec<Band> = (0..open.omega.len())
                    .filter_map(|i| {
                        let drawn = own.drawn.iter();
                        let mut all: Vec<f64> = drawn
                            .filter_map(|one| one.values.get(i))
                            .map(value)
                            .collect();
                        band(&mut all)
                    })
                    .collect();
                let edge = |of: fn(&Band) -> f64| edges.iter().map(of).collect();
                series.push(line("5 %", edge(|band| band.low)).styled(Style::Dashed));
                series.push(line("95 %", edge(|band| band.high)).styled(Style::Dashed));
            }
            panels.push(Panel {
                title: format!("Open loop, {name}"),
                x: Axis::logarithmic("frequency", Units::FREQUENCY),
                y,
                series,
            });
        }
    }
    let mut text = Vec::new();
    if !own.note.is_empty() {
        text.push(format!("Refused: {}.", own.note));
    }
    Section {
        heading: own.name.clone(),
        text,
        panels,
        tables: vec![Table::of(
            "Parameters, SI",
            ["parameter", "value"],
            own.parameters
                .iter()
                .map(|(name, value)| [name.clone(), significant(*value, 6)]),
        )],
        ..Section::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_holds_nine_tenths_of_the_draws() {
        // 0 to 100 in another order.
        let mut values: Vec<f64> = (0..=100).map(|k| f64::from((37 * k) % 101)).collect();
        let found = band(&mut values).unwrap();
        assert_eq!((found.low, found.high), (5.0, 95.0));
        let one = band(&mut [3.0]).unwrap();
        assert_eq!((one.low, one.high), (3.0, 3.0));
        assert!(band(&mut []).is_none());
    }
}
