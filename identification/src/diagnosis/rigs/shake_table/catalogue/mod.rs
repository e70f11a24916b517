//! The identified shake table as the engine sees it: fifteen uncertain nominal parameters, the
//! catalogue, and the innovations of every record.

mod candidates;

pub use candidates::catalogue;

use plant::identified::effects::Effect;
use plant::identified::nominal::{NominalRig, PARAMETERS};
use plant::identified::rig::IdentifiedRig;

use crate::data::OUTPUT_NAMES;
use crate::diagnosis::case::Nominal;
use crate::diagnosis::engine::{Candidate, ExtensibleModel, Point};
use crate::diagnosis::rigs::shake_table::predictor::{Disturbance, Predictor, Samples};

/// A recording prepared for the predictor, and whether the effects were there when it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
    /// Its name.
    pub name: String,
    /// The samples, SI.
    pub samples: Samples,
    /// False for a baseline: the same rig before the effect.
    pub with_effects: bool,
    /// Whether the command is that of the stated law rather than the recorded one.
    pub by_law: bool,
}

/// The shake table of a case.
#[derive(Debug, Clone)]
pub struct ShakeTableModel {
    /// The nominal rig.
    pub nominal: IdentifiedRig,
    /// Relative standard deviation of its parameters.
    pub uncertainty: f64,
    /// Sampling period, s.
    pub period: f64,
    /// Sensor noise, SI, infinite where a channel is missing.
    pub noise: [f64; 4],
    /// What drives the rig unseen.
    pub disturbance: Disturbance,
    /// The records.
    pub records: Vec<Prepared>,
    candidates: Vec<Candidate>,
    effects: Vec<&'static Effect>,
}

impl ShakeTableModel {
    /// The model for `nominal` and `records`; `noise` as in [`Nominal::noise`], infinite where a
    /// channel is missing.
    pub fn new(nominal: &Nominal, noise: [f64; 4], records: Vec<Prepared>) -> Self {
        let period = 1.0 / nominal.sample_rate;
        let commands = records
            .first()
            .map(|record| record.samples.command.as_slice());
        let peak = commands
            .unwrap_or_default()
            .iter()
            .fold(1e-3f64, |peak, u| peak.max(u.abs()));
        let (candidates, effects) = catalogue(peak, period).into_iter().unzip();
        Self {
            nominal: IdentifiedRig {
                shake_table: nominal.shake_table,
                specimen: nominal.specimen,
                effects: nominal.effects,
                sensors: nominal.sensors,
            },
            uncertainty: nominal.uncertainty,
            period,
            noise,
            disturbance: Disturbance::beside_command(nominal.command_noise, period),
            records,
            candidates,
            effects,
        }
    }

    /// The nominal rig with `nuisance` (in standard deviations of the parameters' logarithms, so that
    /// factors add up) and no effects but those that were known.
    pub fn rig_without_effects(&self, nuisance: &[f64]) -> IdentifiedRig {
        let mut nominal = self.nominal_rig();
        for (parameter, deviation) in PARAMETERS.iter().zip(nuisance) {
            if let Some(value) = nominal.place(parameter) {
                *value *= (self.uncertainty * deviation).exp();
            }
        }
        IdentifiedRig {
            shake_table: nominal.shake_table,
            specimen: nominal.specimen,
            ..self.nominal
        }
    }

    /// The nominal actuator, table and specimen, whose parameters are in the order of
    /// [`Point::nuisance`].
    pub fn nominal_rig(&self) -> NominalRig {
        NominalRig {
            shake_table: self.nominal.shake_table,
            specimen: self.nominal.specimen,
        }
    }

    /// The rig at `point`.
    pub fn rig(&self, point: &Point) -> IdentifiedRig {
        let mut rig = self.rig_without_effects(&point.nuisance);
        for (candidate, internal) in &point.effects {
            let values = self.candidates[*candidate].values(internal);
            self.effects[*candidate].apply(&mut rig.effects, &mut rig.sensors, &values);
        }
        rig
    }
}

/// Predictors of the rig with and without its effects.
pub struct ShakeTablePredictor {
    with_effects: Predictor,
    without_effects: Option<Predictor>,
}

impl ExtensibleModel for ShakeTableModel {
    type Predictor = ShakeTablePredictor;

    fn nuisance(&self) -> usize {
        self.nominal_rig().parameters().count()
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn records(&self) -> usize {
        self.records.len()
    }

    fn record_name(&self, record: usize) -> &str {
        &self.records[record].name
    }

    fn channels(&self) -> &[&'static str] {
        &OUTPUT_NAMES
    }

    fn disturbed(&self, factor: f64) -> Self {
        let mut model = self.clone();
        model.disturbance.sigma *= factor;
        model
    }

    // From the measured signals one sample before: the noise of the sample itself is in its
    // innovation.
    fn regressors(&self, record: usize) -> Vec<(String, Vec<f64>)> {
        let samples = &self.records[record].samples;
        let n = samples.len();
        let before = |k: usize| k.saturating_sub(1);
        let channel =
            |i: usize| -> Vec<f64> { (0..n).map(|k| samples.channels[before(k)][i]).collect() };
        let x = channel(0);
        // Velocity over eight samples, smooth enough for its sign.
        let v: Vec<f64> = (0..n)
            .map(|k| (x[k] - x[k.saturating_sub(8)]) / (8.0 * self.period))
            .collect();
        let command: Vec<f64> = (0..n).map(|k| samples.command[before(k)]).collect();
        let mut all = Vec::new();
        for (name, signal) in [
            ("valve command", command),
            ("displacement", x.clone()),
            ("velocity", v),
            ("actuator force", channel(2)),
            ("specimen acceleration", channel(3)),
        ] {
            let peak = signal.iter().fold(0.0f64, |peak, s| peak.max(s.abs()));
            if peak == 0.0 {
                continue;
            }
            let even = signal.iter().map(|s| s * s / peak).collect();
            let odd = signal.iter().map(|s| s * s * s / (peak * peak)).collect();
            let sign = signal.iter().map(|s| (40.0 * s / peak).tanh()).collect();
            all.push((format!("{name} squared"), even));
            all.push((format!("{name} cubed"), odd));
            all.push((format!("sign of {name}"), sign));
            all.push((name.to_string(), signal));
        }
        all
    }

    fn residual_count(&self, record: usize) -> usize {
        4 * self.records[record].samples.len()
    }

    fn sample_count(&self, record: usize) -> usize {
        self.records[record].samples.len()
    }

    fn predictor(&self, point: &Point) -> Option<ShakeTablePredictor> {
        let design = |rig: &IdentifiedRig| {
            Predictor::design(rig, self.period, self.noise, self.disturbance).ok()
        };
        let without_effects = if self.records.iter().all(|record| record.with_effects) {
            None
        } else {
            Some(design(&self.rig_without_effects(&point.nuisance))?)
        };
        Some(ShakeTablePredictor {
            with_effects: design(&self.rig(point))?,
            without_effects,
        })
    }

    fn log_determinant(&self, predictor: &ShakeTablePredictor) -> f64 {
        predictor.with_effects.log_determinant
    }

    fn residuals(
        &self,
        predictor: &ShakeTablePredictor,
        point: &Point,
        record: usize,
        out: &mut [f64],
    ) -> bool {
        let Prepared {
            samples,
            with_effects,
            ..
        } = &self.records[record];
        let (rig, predictor) = match (&predictor.without_effects, with_effects) {
            (Some(without), false) => (self.rig_without_effects(&point.nuisance), without),
            _ => (self.rig(point), &predictor.with_effects),
        };
        predictor
            .sample(&rig)
            .is_ok_and(|sampled| predictor.innovations(&sampled, samples, out))
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnosis::engine::{Judgement, Observer, judge};
    use plant::identified::shake_table::ShakeTable;
    use plant::specimens::linear::LinearSpecimen;

    /// Records of `rig` under a small proportional controller on random references.
    fn model(rig: &IdentifiedRig, seed: u64) -> ShakeTableModel {
        let nominal = Nominal {
            sample_rate: 500.0,
            shake_table: ShakeTable::default(),
            specimen: Some(LinearSpecimen::default()),
            controller: None,
            noise: [1.3e-5, 0.04, 1.3, 0.025],
            command_noise: 5e-4,
            uncertainty: 0.01,
            effects: Default::default(),
            sensors: Default::default(),
        };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let period = 1.0 / nominal.sample_rate;
        let sampled = rig.sample(period, 2).unwrap();
        let disturbance = Disturbance::beside_command(nominal.command_noise, period);
        let records = ["identification", "validation"].map(|name| {
            let mut state = Default::default();
            let (mut reference, mut slow, mut unseen) = (0.0, 0.0, 0.0);
            let mut samples = Samples {
                command: Vec::new(),
                channels: Vec::new(),
            };
            for k in 0..4000 {
                slow += 0.01 * (0.15 * normal() - slow);
                reference += 0.02 * (slow - reference);
                let mut channels = sampled.measure(&mut state, f64::from(k) * period);
                for (value, noise) in channels.iter_mut().zip(nominal.noise) {
                    *value += noise * normal();
                }
                let command = 240.0 * (reference - channels[0]);
                samples.command.push(command);
                samples.channels.push(channels);
                let fresh = disturbance.sigma * (1.0 - disturbance.phi.powi(2)).sqrt();
                unseen = disturbance.phi * unseen + fresh * normal();
                sampled.step_disturbed(&mut state, command, unseen);
            }
            Prepared {
                name: name.into(),
                samples,
                with_effects: true,
                by_law: false,
            }
        });
        ShakeTableModel::new(&nominal, nominal.noise, records.into())
    }

    fn said(judgement: &Judgement) -> (crate::diagnosis::engine::Verdict, Vec<&'static str>) {
        let mut names: Vec<_> = judgement.effects.iter().map(|e| e.effect).collect();
        names.sort_unstable();
        (judgement.verdict, names)
    }

    #[test]
    fn order_and_labels_of_the_catalogue_change_no_verdict() {
        let mut rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        for hidden in [vec![], vec!["load_cell_bias", "valve_dead_band"]] {
            rig.effects.valve.dead_band = f64::from(hidden.contains(&"valve_dead_band")) * 0.12;
            rig.sensors.actuator_force.bias = f64::from(hidden.contains(&"load_cell_bias")) * 8.0;
            let model = model(&rig, 31);
            let straight = judge(&model, &[0], &[1], Observer::none()).unwrap();
            assert_eq!(said(&straight).1, hidden);

            let mut turned = model.clone();
            turned.candidates.reverse();
            turned.effects.reverse();
            turned.candidates.rotate_left(7);
            turned.effects.rotate_left(7);
            assert_eq!(
                said(&judge(&turned, &[0], &[1], Observer::none()).unwrap()),
                said(&straight)
            );

            // Labels: every effect takes the name of its mirror image in the catalogue.
            let names: Vec<&'static str> = model.candidates.iter().map(|c| c.effect).collect();
            let mirror = |name: &str| {
                let place = names.iter().position(|n| *n == name).unwrap();
                names[names.len() - 1 - place]
            };
            let mut relabelled = model.clone();
            for candidate in &mut relabelled.candidates {
                candidate.effect = mirror(candidate.effect);
                candidate.contains = candidate.contains.map(mirror);
            }
            let judgement = judge(&relabelled, &[0], &[1], Observer::none()).unwrap();
            let mut expected: Vec<_> = hidden.iter().map(|name| mirror(name)).collect();
            expected.sort_unstable();
            assert_eq!(said(&judgement), (straight.verdict, expected));
        }
    }
}
