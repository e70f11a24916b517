//! Iterative control as laboratories use it (Section 1.2.3): the drive is corrected from run to run by
//! the inverse of the measured transfer function; or found on a model, without a run of the rig.

pub mod circle;
mod correction;
mod drive;
pub mod on_model;
pub mod on_rig;
mod page;
pub mod replay;

use identification::IdentificationError;
use serde::{Deserialize, Serialize};
use units::vocabulary;

pub use self::correction::{Inverse, Line, Measured};
pub use self::drive::{read as read_drive, text as drive_text};
pub use self::page::{ITERATION, write};
use crate::error::Error;
use crate::run::axes;
use crate::run::experiment::{Prepared, Request, prepare};
use crate::run::table::Table;
use crate::systems::built_in;
use crate::systems::control_model::ControlModel;
use fmi_master::{Ending, Record};
use fmi_system::Link;
use motion::metrics::{self, rms};
use motion::{self, Motion, Scaling};
use units::STANDARD_GRAVITY;

/// Seed and size of the motion that finds the transfer function.
const FINDING_SEED: u64 = 17;
const FINDING_PEAK: f64 = 0.1 * STANDARD_GRAVITY;
/// Where displacement takes over from acceleration when the sensors' noise is not known, Hz.
pub(crate) const USUAL_CROSSOVER: f64 = 5.0;
/// A run that is worse than the best by more than this has not come nearer.
const WORSE: f64 = 1.05;
/// An improvement below this share is none worth a specimen's wear.
const STALLED: f64 = 0.98;

/// How to iterate.
#[derive(Debug, Clone)]
pub struct Plan {
    /// What is run.
    pub request: Request,
    /// Largest number of corrections.
    pub iterations: usize,
    /// Part of the inverse that a correction applies.
    pub gain: f64,
    /// Measured error at which to stop, %.
    pub target_percent: f64,
    /// Frequencies between which errors are corrected, Hz.
    pub band: [f64; 2],
    /// Most energy of motion on the specimen, over that of the reference played once.
    pub exposure: Option<f64>,
    /// Delay of the measurements relative to the reference's clock, s; none: by the model on which
    /// the controllers are tuned.
    pub measurement_delay: Option<f64>,
    /// Mass in place of the specimen while the transfer function is found, kg.
    pub dummy_mass: Option<f64>,
    /// Drive of an earlier session to begin with.
    pub drive: Option<std::path::PathBuf>,
    /// The same along the second axis of a table with two.
    pub drive_y: Option<std::path::PathBuf>,
}

/// Why the iteration ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// The measured error is within the target.
    Target,
    /// All iterations were made.
    Iterations,
    /// The last corrections brought less than they cost.
    Stalled,
    /// Corrections made it worse, also at half the gain.
    Diverges,
    /// Another run would strain the specimen beyond its limit.
    Exposure,
    /// A run was stopped or failed.
    EndedEarly,
}

impl Stop {
    /// A sentence.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Target => "the measured error is within the target",
            Self::Iterations => "all iterations were made",
            Self::Stalled => "the last correction gained less than 2 %: it has converged",
            Self::Diverges => {
                "it does not converge: corrections make the error larger, also at half the gain; the \
                 best drive was kept"
            }
            Self::Exposure => "another run would exceed the specimen's exposure",
            Self::EndedEarly => "a run ended early; the best drive before it was kept",
        }
    }
}

/// A run of the iteration.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Run {
    /// Corrections that its drive has.
    pub iteration: usize,
    /// `100 rms/peak` of the measured acceleration error within the band, %; what the iteration goes by. Of a table
    /// with two axes the larger of the two.
    pub measured_percent: Option<f64>,
    /// The second axis of a table with two; the errors below are those of the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub along_y: Option<AlongY>,
    /// Time-domain error of the true acceleration, %.
    pub time_domain_percent: Option<f64>,
    /// Frequency-domain error, %.
    pub frequency_domain_percent: Option<f64>,
    /// Largest deviation of the response spectrum, 0.5 to 15 Hz, %.
    pub response_spectrum_percent: Option<f64>,
    /// Energy of the table's motion with the specimen on it so far, over the reference's.
    pub exposure: f64,
    /// Part of the inverse that made its drive.
    pub gain: f64,
    /// How it ended.
    pub ended: Ending,
    /// Why it ended early.
    pub ended_because: Option<String>,
}

/// A run along the second axis.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct AlongY {
    /// `100 rms/peak` of the measured acceleration error within the band, %; for an axis that is to rest over the
    /// peak of the first.
    pub measured_percent: Option<f64>,
    /// Time-domain error of the true acceleration, %; none of an axis that is to rest.
    pub time_domain_percent: Option<f64>,
}

/// What the iteration found: `iteration.json`, and what `--json` prints.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Iteration {
    /// The system.
    pub system: String,
    /// The motion.
    pub motion: String,
    /// Mean coherence of the transfer function over the band.
    pub coherence: f64,
    /// The runs.
    pub runs: Vec<Run>,
    /// Index of the best.
    pub best: usize,
    /// Why it ended.
    pub stop: Stop,
    /// Whether the best run is better than the first.
    pub converges: bool,
    /// The best drive.
    #[serde(skip)]
    pub drive: Option<Motion>,
    /// Acceleration errors of the first and the best run, m/s², a sample every `dt` s.
    #[serde(skip)]
    pub errors: Option<(f64, Vec<f64>, Vec<f64>)>,
    /// The transfer function that the corrections invert.
    #[serde(skip)]
    pub response: Vec<Line>,
}

/// The best run so far.
struct Best {
    /// Measured error, %.
    measured: f64,
    iteration: usize,
    drive: Motion,
    /// Acceleration error within the band along each axis, m/s².
    errors: Vec<Vec<f64>>,
    /// True acceleration error along the first axis, m/s².
    off: Vec<f64>,
}

/// What a run gave, axis by axis.
struct Played {
    axes: Vec<PlayedAxis>,
    ended: fmi_master::Ended,
}

/// What a run gave along an axis.
struct PlayedAxis {
    measured: Measured,
    displacement: Vec<f64>,
    acceleration: Vec<f64>,
}

/// Plays, corrects, and plays again; `progress` receives the number of finished runs.
///
/// # Errors
/// A request at fault; a run that cannot begin; a system without a table; a motion too short to find a
/// transfer function from.
pub fn iterate(plan: &Plan, progress: &mut dyn FnMut(usize)) -> Result<Iteration, Error> {
    let model = control_model(&plan.request)?;
    let delay = plan
        .measurement_delay
        .or(model
            .as_ref()
            .map(|own| own.delay as f64 * units::constants::SAMPLING_PERIOD))
        .unwrap_or(0.0);
    let crossover = model.as_ref().map_or(USUAL_CROSSOVER, |own| {
        (own.noise.acceleration / own.noise.displacement).sqrt() / std::f64::consts::TAU
    });
    let prepared = prepare(&plan.request)?;
    let late = (delay / prepared.motion.dt).round() as usize;
    let drive = first_drive(plan, &prepared.motion)?;
    let inverses = find_inverses(plan, late, crossover)?;
    progress(1);
    correct(plan, &prepared, drive, &inverses, late, progress)
}

/// Plays `drive`, corrects it by the inverse of each axis, and plays again; measurements are `late` samples late.
fn correct(
    plan: &Plan,
    prepared: &Prepared,
    mut drive: Motion,
    inverses: &[Inverse],
    late: usize,
    progress: &mut dyn FnMut(usize),
) -> Result<Iteration, Error> {
    let (wanted, inverse) = (&prepared.motion, &inverses[0]);
    let energy = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>();
    let asked: Vec<&Motion> = std::iter::once(wanted)
        .chain(wanted.across.as_deref())
        .collect();
    let whole: f64 = asked.iter().map(|own| energy(&own.acceleration)).sum();
    let peaks = peaks(&asked);
    let (mut runs, mut exposure, mut gain, mut halved) = (Vec::<Run>::new(), 0.0, plan.gain, false);
    let mut best: Option<Best> = None;
    let mut first_error = Vec::new();
    let stop = loop {
        let iteration = runs.len();
        let played = play(prepared, drive.clone(), late)?;
        progress(2 + iteration);
        let moved = played.axes.iter().map(|own| energy(&own.acceleration));
        exposure += moved.sum::<f64>() / whole;
        let complete = played.ended.kind() == Ending::Complete;
        let figures = |axis: usize| {
            let own = &played.axes[axis];
            metrics::tracking(asked[axis], &own.displacement, &own.acceleration).ok()
        };
        let tracking = figures(0);
        let errors: Vec<Vec<f64>> = (0..asked.len())
            .map(|axis| inverses[axis].error(asked[axis], &played.axes[axis].measured))
            .collect();
        let percents = errors
            .iter()
            .zip(&peaks)
            .map(|(error, peak)| 100.0 * rms(error) / peak);
        let percents: Vec<f64> = percents.collect();
        let measured = percents.iter().copied().fold(0.0, f64::max);
        runs.push(Run {
            iteration,
            measured_percent: complete.then_some(measured),
            along_y: percents.get(1).map(|percent| AlongY {
                measured_percent: complete.then_some(*percent),
                time_domain_percent: figures(1).map(|own| own.time_domain_percent),
            }),
            time_domain_percent: tracking.map(|t| t.time_domain_percent),
            frequency_domain_percent: tracking.map(|t| t.frequency_domain_percent),
            response_spectrum_percent: tracking
                .and_then(|t| Some(t.laboratory?.largest_spectrum_deviation())),
            exposure,
            gain: if iteration == 0 { 0.0 } else { gain },
            ended: played.ended.kind(),
            ended_because: played.ended.reason(),
        });
        if !complete {
            break Stop::EndedEarly;
        }
        let off: Vec<f64> = wanted
            .acceleration
            .iter()
            .zip(&played.axes[0].acceleration)
            .map(|(wanted, got)| got - wanted)
            .collect();
        if iteration == 0 {
            first_error.clone_from(&off);
        }
        let before = best.as_ref().map(|best| best.measured);
        if before.is_none_or(|before| measured < before) {
            best = Some(Best {
                measured,
                iteration,
                drive: drive.clone(),
                errors,
                off,
            });
        }
        let Some(nearest) = &best else {
            break Stop::EndedEarly;
        };
        if measured <= plan.target_percent {
            break Stop::Target;
        }
        if let Some(before) = before {
            if measured > WORSE * before {
                if halved {
                    break Stop::Diverges;
                }
                (halved, gain) = (true, 0.5 * gain);
            } else if measured > STALLED * before {
                break Stop::Stalled;
            }
        }
        if iteration == plan.iterations {
            break Stop::Iterations;
        }
        let run_costs = exposure / (iteration + 1) as f64;
        if plan
            .exposure
            .is_some_and(|most| exposure + run_costs > most)
        {
            break Stop::Exposure;
        }
        drive = nearest.drive.clone();
        inverse.correct(&mut drive, &nearest.errors[0], gain);
        if let (Some(across), [_, inverse], [_, error]) =
            (&mut drive.across, inverses, &nearest.errors[..])
        {
            inverse.correct(across, error, gain);
        }
    };
    let first = runs[0].measured_percent;
    let (at, best_drive, off) = match best {
        Some(best) => (best.iteration, Some(best.drive), best.off),
        None => (0, None, Vec::new()),
    };
    let converges = runs[at].measured_percent < first || stop == Stop::Target;
    Ok(Iteration {
        system: prepared.system.name.clone(),
        motion: wanted.name.clone(),
        coherence: inverse.coherence(),
        response: inverse.response().to_vec(),
        best: at,
        stop,
        converges,
        drive: best_drive,
        errors: (!off.is_empty()).then_some((wanted.dt, first_error, off)),
        runs,
    })
}

/// The model on which the controllers of the request are tuned.
pub(crate) fn control_model(request: &Request) -> Result<Option<ControlModel>, Error> {
    let fault = |error: IdentificationError| Error::Option {
        option: "--control-model",
        reason: error.to_string(),
    };
    match &request.control_model {
        Some(path) => ControlModel::read(path).map(Some).map_err(fault),
        None if built_in::is_commissioned(&request.plant) => {
            ControlModel::commissioned().map(Some).map_err(fault)
        }
        None => Ok(None),
    }
}

/// The peaks that errors are measured by, m/s²: of an axis that is to rest that of the other one.
fn peaks(asked: &[&Motion]) -> Vec<f64> {
    let own = asked.iter().map(|motion| motion.peak_acceleration());
    let largest = own.clone().fold(0.0, f64::max);
    own.map(|peak| if peak > 0.0 { peak } else { largest })
        .collect()
}

/// The drive of an earlier session, or the motion itself.
fn first_drive(plan: &Plan, wanted: &Motion) -> Result<Motion, Error> {
    let mut drive = match &plan.drive {
        Some(path) => Motion {
            across: wanted.across.clone(),
            ..drive::read(path, wanted)?
        },
        None => wanted.clone(),
    };
    if let Some(path) = &plan.drive_y {
        let Some(across) = &wanted.across else {
            return Err(Error::Option {
                option: "--drive-y",
                reason: format!("{} has a single axis", plan.request.system),
            });
        };
        drive.across = Some(Box::new(drive::read(path, across)?));
    }
    Ok(drive)
}

/// Plays a random motion of a third of the usual size, along two axes one for each, and finds the transfer function of
/// each axis.
fn find_inverses(plan: &Plan, late: usize, crossover: f64) -> Result<Vec<Inverse>, Error> {
    let mut request = plan.request.clone();
    if let Some(mass) = plan.dummy_mass {
        request.specimen = "none".into();
        request.set.retain(|set| !set.starts_with("specimen."));
        request.set.push(format!("table.added_payload={mass} kg"));
    }
    let prepared = prepare(&request)?;
    let options = motion::Options {
        sample_time: prepared.motion.dt,
        scaling: Some(Scaling::PeakAcceleration(FINDING_PEAK)),
        ..motion::Options::default()
    };
    let mut drive = motion::built_in(FINDING_SEED, &options)?;
    if prepared.motion.across.is_some() {
        drive = drive.along_two_axes(motion::built_in(FINDING_SEED + 1, &options)?);
    }
    let played = play(&prepared, drive.clone(), late)?;
    if played.ended.kind() != Ending::Complete {
        return Err(Error::Option {
            option: "--iterations",
            reason: format!(
                "the run of 0.1 g that finds the transfer function ended early: {}",
                played.ended.message()
            ),
        });
    }
    let drives = std::iter::once(&drive).chain(drive.across.as_deref());
    let inverses = drives.zip(&played.axes).map(|(drive, own)| {
        Inverse::new(drive, &own.measured, crossover, plan.band).ok_or(Error::Option {
            option: "--iterations",
            reason: "too little was played to find a transfer function".into(),
        })
    });
    inverses.collect()
}

/// Plays `drive` in place of the motion; what is measured is `late` samples late.
fn play(prepared: &Prepared, drive: Motion, late: usize) -> Result<Played, Error> {
    let own = prepared.playing(drive);
    let outcome = own.run(own.algorithm)?;
    let record = &outcome.record;
    let names = own.system.components.iter().map(|part| part.name.as_str());
    let links: Vec<Link> = own.system.links().collect();
    let tables = axes::tables(names, &links, record).filter(|_| own.motion.across.is_some());
    let histories = match &tables {
        Some(tables) => tables
            .iter()
            .filter_map(|table| seen(table, &links, record))
            .collect(),
        None => vec![single(prepared, record)?],
    };
    if own.motion.across.is_some() && histories.len() != 2 {
        return Err(Error::Option {
            option: "SYSTEM",
            reason: format!(
                "{} follows motions along two axes; expected a table for each, whose valve is driven by what follows \
                 the reference along its axis",
                prepared.system.name
            ),
        });
    }
    let early = |mut history: Vec<f64>, late: usize| {
        let last = history.last().copied().unwrap_or(0.0);
        let length = history.len();
        history.drain(..late.min(length));
        history.resize(length, last);
        history
    };
    let axes = histories
        .into_iter()
        .map(|([displacement, acceleration], seen)| {
            let (shown, late) = match seen {
                Some(columns) => (columns, late),
                None => ([displacement.clone(), acceleration.clone()], 0),
            };
            let [x, a] = shown.map(|history| early(history, late));
            PlayedAxis {
                measured: Measured {
                    displacement: x,
                    acceleration: a,
                },
                displacement,
                acceleration,
            }
        });
    Ok(Played {
        axes: axes.collect(),
        ended: outcome.ended,
    })
}

/// Displacement and acceleration of a table, and what sensors show of them.
type Histories = ([Vec<f64>; 2], Option<[Vec<f64>; 2]>);

/// Of the table of a system with a single axis.
fn single(prepared: &Prepared, record: &Record) -> Result<Histories, Error> {
    let moved = pair(record, "displacement", "acceleration")
        .filter(|(name, _)| name == "table")
        .or_else(|| pair(record, "displacement", "acceleration"))
        .map(|(_, columns)| columns)
        .ok_or_else(|| Error::Option {
            option: "SYSTEM",
            reason: format!(
                "{} has no component with `displacement` and `acceleration`, which an iteration \
                 corrects",
                prepared.system.name
            ),
        })?;
    let seen = pair(
        record,
        vocabulary::MEASURED_DISPLACEMENT,
        vocabulary::MEASURED_ACCELERATION,
    );
    Ok((moved, seen.map(|(_, columns)| columns)))
}

/// Of one table of several: its sensors are the component that takes its displacement and shows it.
fn seen(table: &Table<'_>, links: &[Link], record: &Record) -> Option<Histories> {
    let column = |name: &str| record.column(name);
    let displacement = table.name("displacement");
    let moved = [column(&displacement)?, column(&table.name("acceleration"))?];
    let takes = links
        .iter()
        .filter(|link| link.from.to_string() == displacement);
    let mut shown = takes.filter_map(|link| {
        let output = |variable: &str| column(&format!("{}.{variable}", link.to.component));
        Some([
            output(vocabulary::MEASURED_DISPLACEMENT)?,
            output(vocabulary::MEASURED_ACCELERATION)?,
        ])
    });
    Some((moved, shown.next()))
}

/// The first component whose outputs have both names, the table before others, with their columns.
fn pair(record: &Record, first: &str, second: &str) -> Option<(String, [Vec<f64>; 2])> {
    let names = record.columns.iter().filter_map(|column| {
        let (name, variable) = column.split_once('.')?;
        (variable == first && name != "reference").then_some(name)
    });
    let mut names: Vec<&str> = names.collect();
    names.sort_by_key(|name| *name != "table");
    names.into_iter().find_map(|name| {
        let column = |variable: &str| record.column(&format!("{name}.{variable}"));
        Some((name.to_string(), [column(first)?, column(second)?]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made;

    fn plan(drive: Option<&std::path::Path>, drive_y: Option<&std::path::Path>) -> Plan {
        Plan {
            request: Request::built_in("three-variable"),
            iterations: 3,
            gain: 1.0,
            target_percent: 1.0,
            band: [0.2, 25.0],
            exposure: None,
            measurement_delay: None,
            dummy_mass: None,
            drive: drive.map(Into::into),
            drive_y: drive_y.map(Into::into),
        }
    }

    #[test]
    fn the_first_drive_is_that_of_an_earlier_session_or_the_motion() {
        let wanted = made::wave("wave", 200);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.csv");
        let earlier = Motion {
            displacement: wanted.displacement.iter().map(|x| 1.5 * x).collect(),
            ..wanted.clone()
        };
        std::fs::write(&path, drive_text(&earlier)).unwrap();
        assert_eq!(first_drive(&plan(None, None), &wanted).unwrap(), wanted);
        let own = first_drive(&plan(Some(&path), None), &wanted).unwrap();
        assert!((own.displacement[33] / earlier.displacement[33] - 1.0).abs() < 1e-9);
        let told = first_drive(&plan(None, Some(&path)), &wanted)
            .unwrap_err()
            .to_string();
        assert!(told.contains("three-variable has a single axis"), "{told}");
        let both = wanted.clone().along_two_axes(wanted.clone());
        let own = first_drive(&plan(None, Some(&path)), &both).unwrap();
        assert_eq!(own.displacement, wanted.displacement);
        let across = own.across.unwrap();
        assert!((across.displacement[33] / earlier.displacement[33] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn controllers_are_tuned_on_the_model_that_is_named_or_that_of_the_commissioning() {
        let of = |plant: &str, file: Option<&str>| Request {
            plant: plant.into(),
            control_model: file.map(Into::into),
            ..Request::built_in("three-variable")
        };
        assert!(
            control_model(&of("servohydraulic", None))
                .unwrap()
                .is_some()
        );
        assert!(control_model(&of("identified", None)).unwrap().is_none());
        let told = control_model(&of("identified", Some("missing.toml")));
        let told = told.unwrap_err().to_string();
        assert!(
            told.contains("--control-model") && told.contains("missing.toml"),
            "{told}"
        );
    }

    #[test]
    fn an_axis_at_rest_is_measured_by_the_peak_of_the_other() {
        let wave = made::wave("wave", 500);
        let still = wave.at_rest();
        let peak = wave.peak_acceleration();
        assert_eq!(peaks(&[&wave, &still]), [peak, peak]);
        assert_eq!(peaks(&[&still]), [0.0]);
    }

    #[test]
    fn a_run_gives_what_sensors_show_as_early_as_it_was() {
        let columns = |names: &[&str]| {
            let names = names.iter().map(ToString::to_string);
            std::iter::once("time".to_string())
                .chain(names)
                .collect::<Vec<_>>()
        };
        let own = columns(&[
            "a.displacement",
            "a.acceleration",
            "table.displacement",
            "table.acceleration",
        ]);
        let record =
            Record::of(own, vec![0.0, 1.0, 2.0, 3.0, 4.0], Vec::new(), Vec::new()).unwrap();
        // The table comes before others, whatever their order.
        let found = pair(&record, "displacement", "acceleration").unwrap();
        assert_eq!(found, ("table".to_string(), [vec![3.0], vec![4.0]]));
        assert!(pair(&record, "displacement", "velocity").is_none());
        let reference = columns(&["reference.displacement", "reference.acceleration"]);
        let record = Record::of(reference, vec![0.0, 1.0, 2.0], Vec::new(), Vec::new()).unwrap();
        assert!(pair(&record, "displacement", "acceleration").is_none());
        let prepared = made::prepared(made::wave("wave", 300), made::follows);
        let played = play(&prepared, made::wave("drive", 400), 0).unwrap();
        let axis = &played.axes[0];
        assert_eq!(
            (played.ended.kind(), axis.displacement.len()),
            (Ending::Complete, 400)
        );
        // Without sensors the table itself is seen, which is not late.
        let late = play(&prepared, made::wave("drive", 400), 7).unwrap();
        assert_eq!(late.axes[0].measured.displacement, axis.displacement);
        let told = single(&prepared, &record).unwrap_err().to_string();
        assert!(
            told.contains("rig has no component with `displacement` and `acceleration`"),
            "{told}"
        );
        let links = made::links(&["table.displacement -> sensors.displacement"]);
        let table = Table::among(["table"].into_iter(), &links, &record).unwrap();
        let names = [
            "table.displacement",
            "table.acceleration",
            "sensors.measured_displacement",
            "sensors.measured_acceleration",
        ];
        let record = Record::of(
            columns(&names),
            vec![0.0, 1.0, 2.0, 3.0, 4.0],
            Vec::new(),
            Vec::new(),
        )
        .unwrap();
        let (moved, shown) = seen(&table, &links, &record).unwrap();
        assert_eq!(
            (moved, shown),
            ([vec![1.0], vec![2.0]], Some([vec![3.0], vec![4.0]]))
        );
        assert!(seen(&table, &[], &record).unwrap().1.is_none());
    }

    /// Corrections on a rig that follows with nine tenths, by an inverse that is exact: every one leaves the same part
    /// of the error.
    fn corrected(own: Plan, table: fn(&[f64], &mut [f64])) -> (Iteration, usize) {
        let wanted = motion::built_in(FINDING_SEED, &motion::Options::default()).unwrap();
        let answer = |history: &[f64]| history.iter().map(|value| 0.9 * value).collect();
        let answer = Measured {
            displacement: answer(&wanted.displacement),
            acceleration: answer(&wanted.acceleration),
        };
        let inverse = Inverse::exact(&wanted, &answer, USUAL_CROSSOVER, own.band);
        let prepared = made::prepared(wanted.clone(), table);
        let mut last = 0;
        let mut progress = |runs| last = runs;
        let found = correct(&own, &prepared, wanted, &[inverse], 0, &mut progress).unwrap();
        (found, last)
    }

    fn measured(found: &Iteration) -> Vec<f64> {
        let all = found.runs.iter().map(|run| run.measured_percent.unwrap());
        all.collect()
    }

    #[test]
    fn every_correction_leaves_the_part_that_its_gain_does_not_take() {
        let half = Plan {
            gain: 0.5,
            target_percent: 0.0,
            ..plan(None, None)
        };
        let (found, runs) = corrected(half.clone(), made::follows);
        assert_eq!((found.stop, found.best, runs), (Stop::Iterations, 3, 5));
        assert!(found.converges && found.coherence == 0.0);
        let errors = measured(&found);
        for (n, error) in errors.iter().enumerate() {
            let expected = errors[0] * 0.5_f64.powi(n as i32);
            assert!((error / expected - 1.0).abs() < 0.05, "{errors:?}");
        }
        // Energies of 0.9, 0.95, 0.975 and 0.9875 of the motion, one run after the other.
        let sizes = [0.9_f64, 0.95, 0.975, 0.9875];
        let mut exposure = 0.0;
        for (run, size) in found.runs.iter().zip(sizes) {
            exposure += size * size;
            assert!((run.exposure / exposure - 1.0).abs() < 0.01, "{run:?}");
            assert_eq!(run.gain, if run.iteration == 0 { 0.0 } else { 0.5 });
            assert_eq!((run.ended, &run.ended_because), (Ending::Complete, &None));
        }
        let (dt, first, off) = found.errors.unwrap();
        let wanted = motion::built_in(FINDING_SEED, &motion::Options::default()).unwrap();
        assert_eq!((dt, first.len()), (wanted.dt, wanted.len()));
        // A tenth is missing, and the table is a sample late.
        let share = rms(&first) / rms(&wanted.acceleration);
        assert!((share - 0.1).abs() < 0.05, "{share}");
        let both = first.iter().zip(&wanted.acceleration);
        assert!(both.map(|(off, wanted)| off * wanted).sum::<f64>() < 0.0);
        assert!(rms(&off) < 0.2 * rms(&first));

        // The same ends where the error is small enough, or the specimen has seen enough.
        let (found, _) = corrected(
            Plan {
                target_percent: 1.1 * errors[2],
                ..half.clone()
            },
            made::follows,
        );
        assert_eq!((found.stop, found.runs.len()), (Stop::Target, 3));
        let (found, _) = corrected(
            Plan {
                exposure: Some(2.0),
                ..half
            },
            made::follows,
        );
        assert_eq!((found.stop, found.runs.len()), (Stop::Exposure, 2));
    }

    #[test]
    fn corrections_that_are_too_large_are_halved_once_and_the_best_drive_is_kept() {
        let of = |gain: f64| Plan {
            gain,
            target_percent: 0.0,
            ..plan(None, None)
        };
        // Three times the inverse turns the error round at twice its size, half of it at half.
        let (found, _) = corrected(of(3.0), made::follows);
        let gains: Vec<f64> = found.runs.iter().map(|run| run.gain).collect();
        assert_eq!(gains, [0.0, 3.0, 1.5, 1.5]);
        let errors = measured(&found);
        for (n, part) in [1.0, 2.0, 0.5, 0.25].into_iter().enumerate() {
            assert!(
                (errors[n] / errors[0] / part - 1.0).abs() < 0.1,
                "{errors:?}"
            );
        }
        assert_eq!((found.stop, found.best), (Stop::Iterations, 3));
        // Five times: the half of it is too large as well.
        let (found, _) = corrected(of(5.0), made::follows);
        assert_eq!(
            (found.stop, found.best, found.runs.len()),
            (Stop::Diverges, 0, 3)
        );
        assert!(!found.converges);
        let drive = found.drive.unwrap();
        assert_eq!(
            drive.acceleration,
            motion::built_in(FINDING_SEED, &motion::Options::default())
                .unwrap()
                .acceleration
        );
        // A table that does not move is not corrected.
        let (found, _) = corrected(of(1.0), |_, outputs| outputs.fill(0.0));
        assert_eq!(
            (found.stop, found.best, found.runs.len()),
            (Stop::Stalled, 0, 2)
        );
    }

    #[test]
    fn a_run_that_ends_early_ends_the_iteration_without_a_figure() {
        let (found, runs) = corrected(plan(None, None), |_, outputs| outputs.fill(f64::NAN));
        assert_eq!(
            (found.stop, runs, found.converges),
            (Stop::EndedEarly, 2, false)
        );
        assert!(found.drive.is_none() && found.errors.is_none());
        let [run] = &found.runs[..] else {
            panic!("{:?}", found.runs)
        };
        assert_eq!((run.measured_percent, run.ended), (None, Ending::Failed));
        assert!(run.ended_because.is_some());
    }
}
