//! How designs bear rigs that are not the one they were made for: rigs drawn within stated spreads,
//! each under controllers designed once on the nominal rig's recordings, and under controllers
//! designed on its own.

mod draw;
mod page;
mod statistics;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;

pub use draw::Rig;
pub use statistics::{Pair, Spread, Standing};

use crate::commission;
use crate::comparison::Played;
use crate::error::Error;
use crate::master::{Algorithm, Ending};
use crate::metrics;
use crate::motion::Motion;
use crate::report;
use crate::results::Results;
use crate::run::experiment::{self, Prepared, prepare_file};
use crate::system::built_in;
use crate::system::control_model::ControlModel;
use crate::system::tuning::{Rules, Wanted};

/// The plant that is varied.
const PLANT: &str = "servohydraulic";

/// What is studied.
#[derive(Debug, Clone)]
pub struct Request {
    /// Rigs drawn.
    pub rigs: u64,
    /// Seed of the draw.
    pub seed: u64,
    /// What stands on the tables while they are compared; they are commissioned bare.
    pub specimen: String,
    /// Controllers.
    pub controllers: Vec<String>,
    /// What is played.
    pub motions: Vec<Played>,
    /// Length of the recordings that are identified, s.
    pub duration: f64,
}

/// How the controllers of a rig came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DesignedOn {
    /// The nominal rig's recordings.
    Nominal,
    /// The rig's own.
    Own,
}

/// A controller on a rig.
#[derive(Debug, Clone, Serialize)]
pub struct Run {
    /// The controller.
    pub controller: String,
    /// Where it was designed.
    pub designed_on: DesignedOn,
    /// Mean time-domain error over the motions, %; absent where one was not played to its end.
    pub error_percent: Option<f64>,
    /// The worst end of the motions.
    pub ended: Ending,
}

/// A rig with its runs.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The rig.
    pub rig: Rig,
    /// Why its recordings gave no controllers.
    pub not_commissioned: Option<String>,
    /// Its runs.
    pub runs: Vec<Run>,
}

/// What came of it: what `--json` prints.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// The rigs.
    pub rows: Vec<Row>,
    /// Seed of the draw.
    pub seed: u64,
    /// Motions played on each.
    pub motions: Vec<String>,
    /// Standings of controllers and designs.
    pub standings: Vec<Standing>,
    /// Which controller is better than which, with how much certainty.
    pub ranking: Vec<Pair>,
}

/// Draws the rigs, designs, and runs; `tell` hears how many are done.
///
/// # Errors
/// Unknown names, or a motion at fault: nothing is run then.
pub fn study(request: &Request, tell: &(dyn Fn(usize) + Sync)) -> Result<Study, Error> {
    let nominal = ControlModel::commissioned()
        .and_then(|model| Rules::new(model).map_err(|error| error.to_string()))
        .map_err(|reason| Error::Option {
            option: "--controllers",
            reason,
        })?;
    let base = experiment::Request {
        plant: PLANT.to_string(),
        specimen: request.specimen.clone(),
        ..experiment::Request::built_in(commission::CONTROLLER)
    };
    let motions: Result<Vec<Motion>, Error> = request
        .motions
        .iter()
        .map(|played| {
            let own = played.request(&base);
            Ok(experiment::prepare(&own)?.motion)
        })
        .collect();
    let motions = motions?;
    let done = AtomicUsize::new(0);
    tell(0);
    let rows: Result<Vec<Row>, Error> = (0..request.rigs)
        .into_par_iter()
        .map(|number| {
            let row = row(request, &base, &nominal, &motions, number);
            tell(1 + done.fetch_add(1, Ordering::Relaxed));
            row
        })
        .collect();
    let rows = rows?;
    Ok(Study {
        standings: statistics::standings(&rows, &request.controllers),
        ranking: statistics::ranking(&rows, &request.controllers, request.seed),
        rows,
        seed: request.seed,
        motions: motions.into_iter().map(|motion| motion.name).collect(),
    })
}

/// One rig.
fn row(
    request: &Request,
    base: &experiment::Request,
    nominal: &Rules,
    motions: &[Motion],
    number: u64,
) -> Result<Row, Error> {
    let rig = Rig::draw(request.seed, number);
    let set = rig.settings();
    let own = commission::rules_on_recordings(PLANT, set.clone(), request.duration, request.seed);
    let not_commissioned = own.as_ref().err().cloned();
    let mut runs = Vec::new();
    let designs = [
        (DesignedOn::Nominal, Some(nominal)),
        (DesignedOn::Own, own.as_ref().ok()),
    ];
    for (designed_on, rules) in designs {
        let Some(rules) = rules else {
            continue;
        };
        for controller in &request.controllers {
            let wanted = Wanted {
                rules: Some(rules),
                ..Wanted::default()
            };
            let file = built_in::system(controller, PLANT, &request.specimen, wanted)?;
            let mut prepared = prepare_file(
                &experiment::Request {
                    system: controller.clone(),
                    set: set.clone(),
                    ..base.clone()
                },
                &file,
            )?;
            runs.push(run(&mut prepared, controller, designed_on, motions)?);
        }
    }
    Ok(Row {
        rig,
        not_commissioned,
        runs,
    })
}

fn run(
    prepared: &mut Prepared,
    controller: &str,
    designed_on: DesignedOn,
    motions: &[Motion],
) -> Result<Run, Error> {
    let mut errors = Vec::new();
    let mut worst = Ending::Complete;
    for motion in motions {
        prepared.samples = motion.len();
        prepared.motion = motion.clone();
        let outcome = prepared.run(Algorithm::default())?;
        if !outcome.ended.is_regular() {
            worst = outcome.ended.kind();
            break;
        }
        let column = |name: &str| outcome.record.column(&format!("table.{name}"));
        let tracking = column("displacement")
            .zip(column("acceleration"))
            .and_then(|(x, a)| metrics::tracking(motion, &x, &a).ok());
        errors.extend(tracking.map(|own| own.time_domain_percent));
    }
    let whole = worst == Ending::Complete && errors.len() == motions.len();
    let mean = errors.iter().sum::<f64>() / errors.len().max(1) as f64;
    Ok(Run {
        controller: controller.to_string(),
        designed_on,
        error_percent: whole.then_some(mean),
        ended: worst,
    })
}

impl Study {
    /// Writes `report.html` and `rigs.json` into `folder`.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let page = report::render(&page::page(self), &folder.join(report::FILE))?;
        let mut results = Results::begin(folder)?;
        results.write_text(report::FILE, &page)?;
        results.write_json("rigs.json", self)?;
        Ok(results.finish()?)
    }

    /// The standings as a table: a row of heads, then one a controller and design.
    pub fn table(&self) -> Vec<Vec<String>> {
        page::table(self)
    }

    /// A sentence for each pair of neighbours in the ranking.
    pub fn ranking_in_words(&self) -> Vec<String> {
        page::ranking(self)
    }
}
