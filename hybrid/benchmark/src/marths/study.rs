//! The study: every controller on the same plants, motions and draws of noise.

use std::collections::BTreeMap;

use hybrid::marths::criteria::{COLUMNS, COUNT, criteria};
use hybrid::marths::laws::Class;
use hybrid::marths::run::{Ending, Histories, Motions, Setting, perfect, reference, run};
use hybrid::marths::{
    COVERING, Deviation, Pair, PlantParameters, Volts, covering_corners, independent_noise,
    published_noise,
};
use plant::ModelError;
use rayon::prelude::*;
use serde::Serialize;

use super::roster::Entry;

/// A ground motion at the benchmark's samples.
#[derive(Debug, Clone)]
pub struct Motion {
    /// Short name.
    pub name: String,
    /// Ground acceleration, m/s^2.
    pub ground: Vec<f64>,
}

/// Plants that the controllers are run on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plants {
    /// The nominal plant and so many perturbed ones.
    Drawn(u32),
    /// Corners that cover the perturbations at three standard deviations, with static gains 5 % off and commands a sample
    /// late.
    Corners,
}

/// Distance of the corners, standard deviations, and what their static gains are off by.
const CORNER: (f64, f64) = (3.0, 0.05);

impl std::fmt::Display for Plants {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Drawn(perturbed) => write!(to, "nominal plant and {perturbed} perturbed"),
            Self::Corners => write!(to, "{COVERING} corners at {} standard deviations", CORNER.0),
        }
    }
}

impl Plants {
    fn count(self) -> usize {
        match self {
            Self::Drawn(perturbed) => perturbed as usize + 1,
            Self::Corners => COVERING,
        }
    }

    /// The plant of a number; of drawn ones 0 is the nominal plant.
    fn plant(self, seed: u64, number: usize) -> PlantParameters {
        let nominal = PlantParameters::default();
        match self {
            Self::Drawn(_) if number == 0 => nominal,
            Self::Drawn(_) => Deviation::default().draw(&nominal, seed, number as u64),
            Self::Corners => covering_corners(&nominal, CORNER.0, CORNER.1)[number],
        }
    }
}

/// What a study varies.
#[derive(Clone)]
pub struct Study {
    /// Ground motions.
    pub motions: Vec<Motion>,
    /// Controllers.
    pub controllers: Vec<Entry>,
    /// Plants.
    pub plants: Plants,
    /// Seed of plants and noise.
    pub seed: u64,
}

/// Criteria by name.
pub type Named = BTreeMap<&'static str, f64>;

/// One run.
#[derive(Debug, Clone)]
pub struct RunScore {
    /// Name of the motion.
    pub motion: String,
    /// Number of the plant; of drawn ones 0 is the nominal plant.
    pub plant: usize,
    /// The criteria; none where the run was unstable.
    pub criteria: Option<[f64; COUNT]>,
    /// How the run ended.
    pub ending: Ending,
    /// Largest command, V.
    pub peak_volts: f64,
}

/// What the runs of one controller have in common.
#[derive(Debug, Clone, Serialize)]
pub struct ControllerScore {
    /// What it feeds to the force.
    pub class: Class,
    /// Number of runs.
    pub runs: usize,
    /// How many of them were unstable; mean and largest leave those out.
    pub unstable: usize,
    /// How many of those ended with strokes that no rotation of the coupler gives.
    pub out_of_reach: usize,
    /// Mean of each criterion.
    pub mean: Named,
    /// Largest magnitude of each criterion.
    pub max: Named,
    /// Largest command of all runs, V.
    pub peak_volts: f64,
    /// Every run.
    #[serde(skip)]
    pub all: Vec<RunScore>,
}

/// Scores by controller.
pub type Scores = BTreeMap<&'static str, ControllerScore>;

/// Criteria on the nominal plant with the published noise, by controller and motion.
pub type Nominal = BTreeMap<&'static str, BTreeMap<String, Named>>;

/// A motion with what runs are compared with.
struct Scene<'a> {
    motion: &'a Motion,
    place: u64,
    reference: Motions,
    perfect: Histories,
}

/// Criteria by name.
#[must_use]
pub fn named(values: &[f64; COUNT]) -> Named {
    COLUMNS.into_iter().zip(values.iter().copied()).collect()
}

impl Scene<'_> {
    fn score(
        &self,
        number: usize,
        plant: &PlantParameters,
        noise: &[Pair],
        entry: &Entry,
    ) -> Result<RunScore, ModelError> {
        let setting = Setting {
            plant,
            ground: &self.motion.ground,
            noise,
        };
        let histories = run(&setting, entry.make()?.as_mut())?;
        let volts = Volts::default();
        let [first, second] = &histories.command;
        let commands = first.iter().zip(second);
        let peak_volts = commands
            .flat_map(|(first, second)| volts.of([*first, *second]))
            .fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let stable = histories.samples() == self.motion.ground.len();
        Ok(RunScore {
            motion: self.motion.name.clone(),
            plant: number,
            criteria: stable.then(|| criteria(&histories, &self.reference, &self.perfect)),
            ending: histories.ending,
            peak_volts,
        })
    }
}

impl Study {
    /// Number of plants that each motion is run on.
    #[must_use]
    pub fn jobs(&self) -> usize {
        (self.plants.count() + 1) * self.motions.len()
    }

    /// Runs everything; `done` is called after each run of all controllers on one plant.
    ///
    /// # Errors
    /// A plant, structure or controller that cannot be simulated.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<(Nominal, Scores), ModelError> {
        let scenes: Result<Vec<_>, ModelError> = self
            .motions
            .par_iter()
            .enumerate()
            .map(|(place, motion)| {
                Ok(Scene {
                    motion,
                    place: place as u64,
                    reference: reference(&motion.ground)?,
                    perfect: perfect(&motion.ground)?,
                })
            })
            .collect();
        let scenes = scenes?;
        let nominal = PlantParameters::default();
        // The published noise first, then independent noise on every plant.
        let jobs: Vec<(&Scene<'_>, Option<usize>)> = scenes
            .iter()
            .flat_map(|scene| {
                let plants = 0..self.plants.count();
                std::iter::once(None)
                    .chain(plants.map(Some))
                    .map(move |job| (scene, job))
            })
            .collect();
        let scores: Result<Vec<_>, ModelError> = jobs
            .par_iter()
            .map(|(scene, job)| {
                let samples = scene.motion.ground.len();
                let (plant, noise) = match job {
                    None => (nominal, published_noise(samples)),
                    Some(number) => {
                        let stream = scene.place << 32 | *number as u64;
                        (
                            self.plants.plant(self.seed, *number),
                            independent_noise(self.seed, stream, samples),
                        )
                    }
                };
                let number = job.unwrap_or_default();
                let entries = self.controllers.iter();
                let scores: Result<Vec<_>, _> = entries
                    .map(|entry| scene.score(number, &plant, &noise, entry))
                    .collect();
                done();
                scores
            })
            .collect();
        let scores = scores?;
        let (mut published, mut all) = (Nominal::new(), Scores::new());
        for (i, entry) in self.controllers.iter().enumerate() {
            let of = |published: bool| {
                let runs = jobs.iter().zip(&scores);
                runs.filter(move |((_, job), _)| job.is_none() == published)
                    .map(move |(_, runs)| runs[i].clone())
            };
            let rows = of(true).filter_map(|run| Some((run.motion, named(&run.criteria?))));
            published.insert(entry.name, rows.collect());
            all.insert(
                entry.name,
                ControllerScore::of(entry.class, of(false).collect()),
            );
        }
        Ok((published, all))
    }
}

impl ControllerScore {
    fn of(class: Class, all: Vec<RunScore>) -> Self {
        let stable: Vec<_> = all.iter().filter_map(|run| run.criteria).collect();
        let each = |of: &dyn Fn(usize) -> f64| {
            let values: [f64; COUNT] = std::array::from_fn(of);
            named(&values)
        };
        Self {
            class,
            runs: all.len(),
            unstable: all.len() - stable.len(),
            out_of_reach: all
                .iter()
                .filter(|run| run.ending == Ending::OutOfReach)
                .count(),
            mean: each(&|i| stable.iter().map(|c| c[i]).sum::<f64>() / stable.len() as f64),
            max: each(&|i| stable.iter().map(|c| c[i].abs()).fold(f64::NAN, f64::max)),
            peak_volts: all.iter().map(|run| run.peak_volts).fold(0.0, f64::max),
            all,
        }
    }
}
