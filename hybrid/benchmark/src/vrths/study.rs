//! The study: every controller on the same plants, motions and draws of noise.

use std::collections::BTreeMap;

use hybrid::vrths::{
    BenchmarkCase, Deviation, FORCE_LIMIT, InteractionForm, PERIOD, STROKE,
    TransferSystemParameters, corners,
};
use plant::ModelError;
use rayon::prelude::*;
use serde::Serialize;

use super::criteria::{Reference, criteria, normalised_deviation};
use super::motions::Motion;
use super::roster::{Entry, SAMPLE, entry};
use super::simulation::{
    NO_EFFECTS, Setting, TrackingLaw, independent_noise, published_noise, reference, run,
};

/// Which plants a study runs on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Plants {
    /// The nominal plant and so many drawn ones a case.
    Drawn(u32),
    /// The sixteen corners of the box of so many standard deviations.
    Corners(f64),
    /// So many plants a case with the specimen's stiffness drawn evenly, in the logarithm, from
    /// the nominal one divided to the nominal one multiplied by the factor; the others as before.
    StiffnessWithin {
        /// The factor.
        factor: f64,
        /// Plants a case.
        count: u32,
    },
}

/// What a study varies.
#[derive(Clone)]
pub struct Study {
    /// Cases.
    pub cases: Vec<BenchmarkCase>,
    /// Ground motions.
    pub motions: Vec<Motion>,
    /// Controllers.
    pub controllers: Vec<Entry>,
    /// Plants.
    pub plants: Plants,
    /// How the plant's derivatives are formed.
    pub form: InteractionForm,
    /// Seed of plants and noise.
    pub seed: u64,
}

/// One run.
#[derive(Debug, Clone, Serialize)]
pub struct RunScore {
    /// Case, 1 to 4.
    pub case: u8,
    /// Name of the motion.
    pub motion: String,
    /// Number of the plant, 0 being the nominal one of a drawn study.
    pub plant: usize,
    /// Whether it ran to its end.
    pub stable: bool,
    /// `J1..J9`; not numbers where the run was unstable.
    pub criteria: [f64; 9],
    /// Standard deviation of the true tracking error over that of the desired displacement, %.
    pub true_tracking_percent: f64,
    /// Largest force, N.
    pub peak_force_n: f64,
    /// Largest displacement of the specimen, m.
    pub peak_displacement_m: f64,
}

/// What the runs of one controller have in common.
#[derive(Debug, Clone, Serialize)]
pub struct ControllerScore {
    /// Number of runs.
    pub runs: usize,
    /// How many of them were unstable; mean and largest leave those out.
    pub unstable: usize,
    /// Mean of `J1..J9`.
    pub mean: [f64; 9],
    /// Standard deviation of `J1..J9` over the runs.
    pub deviation: [f64; 9],
    /// Largest of `J1..J9`.
    pub max: [f64; 9],
    /// Mean and largest of the true tracking error, %.
    pub true_tracking_percent: Spread,
    /// Runs whose force passes the limit at which the published program stops.
    pub beyond_force_limit: usize,
    /// Runs whose displacement passes the actuator's stroke, as the paper states it.
    pub beyond_stroke: usize,
    /// Every run.
    #[serde(skip)]
    pub all: Vec<RunScore>,
}

/// Mean and largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Mean.
    pub mean: f64,
    /// Largest.
    pub max: f64,
}

/// The scores of a study, by controller.
pub type Scores = BTreeMap<&'static str, ControllerScore>;

/// A case under a motion.
pub(super) struct Scene<'a> {
    pub(super) case: BenchmarkCase,
    place: usize,
    pub(super) motion: &'a Motion,
    reference: Reference,
}

impl<'a> Scene<'a> {
    /// Every case under every motion.
    pub(super) fn all(
        cases: &[BenchmarkCase],
        motions: &'a [Motion],
    ) -> Result<Vec<Self>, ModelError> {
        let pairs = cases
            .iter()
            .flat_map(|case| motions.iter().enumerate().map(move |pair| (*case, pair)));
        pairs
            .map(|(case, (place, motion))| {
                Ok(Self {
                    case,
                    place,
                    motion,
                    reference: reference(&case.frame(), &motion.ground)?,
                })
            })
            .collect()
    }

    /// Noise of the run on plant `number`.
    pub(super) fn noise(&self, seed: u64, number: usize) -> [Vec<f64>; 2] {
        independent_noise(seed, stream(self, number), self.motion.ground.samples())
    }

    /// Runs `law` on plant `number` as `setting` has it.
    pub(super) fn score(
        &self,
        number: usize,
        setting: &Setting<'_>,
        law: &mut TrackingLaw,
    ) -> Result<RunScore, ModelError> {
        let histories = run(setting, law)?;
        let stable = histories.measured.len() == setting.ground.samples();
        let peak = |values: &[f64]| values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        Ok(RunScore {
            case: self.case.number(),
            motion: self.motion.name.clone(),
            plant: number,
            stable,
            criteria: if stable {
                criteria(&histories, &self.reference, PERIOD)
            } else {
                [f64::NAN; 9]
            },
            true_tracking_percent: if stable {
                100.0 * normalised_deviation(&histories.displacement, &histories.numerical[0])
            } else {
                f64::NAN
            },
            peak_force_n: histories.peak_force,
            peak_displacement_m: peak(&histories.displacement),
        })
    }
}

impl Study {
    /// Number of runs of each controller.
    #[must_use]
    pub fn runs(&self) -> usize {
        let plants = match self.plants {
            Plants::Drawn(count) => count as usize + 1,
            Plants::Corners(_) => corners(0.0).count(),
            Plants::StiffnessWithin { count, .. } => count as usize,
        };
        plants * self.cases.len() * self.motions.len()
    }

    /// Plants of a case.
    fn plants(&self, case: BenchmarkCase) -> Vec<TransferSystemParameters> {
        let nominal = TransferSystemParameters::default();
        let deviation = Deviation::default();
        let number = |i: u32| u64::from(case.number()) << 32 | u64::from(i);
        match self.plants {
            Plants::Drawn(count) => std::iter::once(nominal)
                .chain((0..count).map(|i| deviation.draw(&nominal, self.seed, number(i))))
                .collect(),
            Plants::Corners(by) => corners(by)
                .map(|by| deviation.moved(&nominal, by))
                .collect(),
            Plants::StiffnessWithin { factor, count } => (0..count)
                .map(|i| {
                    let drawn = deviation.draw(&nominal, self.seed, number(i));
                    // Evenly spaced, so that both ends are among them.
                    let place = 2.0 * f64::from(i) / f64::from(count.max(2) - 1) - 1.0;
                    TransferSystemParameters {
                        specimen_stiffness: nominal.specimen_stiffness * factor.powf(place),
                        ..drawn
                    }
                })
                .collect(),
        }
    }

    /// Runs everything; `done` is called after each run of all controllers on one plant.
    ///
    /// # Errors
    /// A plant, frame or controller that cannot be simulated.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<Scores, ModelError> {
        let scenes = Scene::all(&self.cases, &self.motions)?;
        let jobs: Vec<_> = scenes
            .iter()
            .flat_map(|scene| {
                let plants = self.plants(scene.case);
                plants
                    .into_iter()
                    .enumerate()
                    .map(move |(number, plant)| (scene, number, plant))
            })
            .collect();
        let scores: Result<Vec<_>, _> = jobs
            .par_iter()
            .map(|(scene, number, plant)| {
                let scores = self.on_one_plant(scene, *number, plant);
                done();
                scores
            })
            .collect();
        let scores = scores?;
        Ok(self
            .controllers
            .iter()
            .enumerate()
            .map(|(i, entry)| {
                let all = scores.iter().filter_map(|runs| runs.get(i).cloned());
                (entry.name, ControllerScore::of(all.collect()))
            })
            .collect())
    }

    /// One run of every controller, with the same draws of noise.
    fn on_one_plant(
        &self,
        scene: &Scene<'_>,
        number: usize,
        plant: &TransferSystemParameters,
    ) -> Result<Vec<RunScore>, ModelError> {
        let frame = scene.case.frame();
        let ground = &scene.motion.ground;
        let noise = scene.noise(self.seed, number);
        self.controllers
            .iter()
            .map(|entry| {
                let setting = Setting {
                    frame: &frame,
                    plant,
                    effects: &NO_EFFECTS,
                    form: self.form,
                    ground,
                    noise: &noise,
                    own_converters: entry.own_converters,
                };
                scene.score(number, &setting, entry.make()?.as_mut())
            })
            .collect()
    }
}

/// Number of a run's draws of noise, another one for every case, motion and plant; it fits the
/// parameter `stream` of the component TrackingSensors.
fn stream(scene: &Scene<'_>, plant: usize) -> u64 {
    u64::from(scene.case.number()) << 24 | (scene.place as u64) << 16 | plant as u64
}

impl ControllerScore {
    pub(super) fn of(all: Vec<RunScore>) -> Self {
        let stable: Vec<&RunScore> = all.iter().filter(|run| run.stable).collect();
        let count = stable.len() as f64;
        let mean = |value: &dyn Fn(&RunScore) -> f64| {
            stable.iter().map(|run| value(run)).sum::<f64>() / count
        };
        let largest = |value: &dyn Fn(&RunScore) -> f64| {
            stable.iter().map(|run| value(run)).fold(f64::NAN, f64::max)
        };
        let means: [f64; 9] = std::array::from_fn(|i| mean(&|run| run.criteria[i]));
        Self {
            runs: all.len(),
            unstable: all.len() - stable.len(),
            mean: means,
            deviation: std::array::from_fn(|i| {
                mean(&|run| (run.criteria[i] - means[i]).powi(2)).sqrt()
            }),
            max: std::array::from_fn(|i| largest(&|run| run.criteria[i])),
            true_tracking_percent: Spread {
                mean: mean(&|run| run.true_tracking_percent),
                max: largest(&|run| run.true_tracking_percent),
            },
            beyond_force_limit: all
                .iter()
                .filter(|run| run.peak_force_n >= FORCE_LIMIT)
                .count(),
            beyond_stroke: all
                .iter()
                .filter(|run| run.peak_displacement_m > STROKE)
                .count(),
            all,
        }
    }
}

/// The published table again: the sample controller on the nominal plant with the program's
/// derivative blocks and the noise of its fresh session, `J1..J9` of cases 1 to 4.
///
/// # Errors
/// None with the benchmark's numbers.
pub fn sample_table(el_centro: &Motion) -> Result<[[f64; 9]; 4], ModelError> {
    let Some(entry) = entry(SAMPLE) else {
        return Ok([[f64::NAN; 9]; 4]);
    };
    let ground = &el_centro.ground;
    let noise = published_noise(ground.samples());
    let rows: Result<Vec<_>, ModelError> = BenchmarkCase::ALL
        .par_iter()
        .map(|case| {
            let frame = case.frame();
            let setting = Setting {
                frame: &frame,
                plant: &TransferSystemParameters::default(),
                effects: &NO_EFFECTS,
                form: InteractionForm::DerivativeBlocks,
                ground,
                noise: &noise,
                own_converters: entry.own_converters,
            };
            let histories = run(&setting, entry.make()?.as_mut())?;
            Ok(criteria(&histories, &reference(&frame, ground)?, PERIOD))
        })
        .collect();
    let mut table = [[f64::NAN; 9]; 4];
    for (to, from) in table.iter_mut().zip(rows?) {
        *to = from;
    }
    Ok(table)
}
