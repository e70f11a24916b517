//! The identified shake table as the engine sees it: fifteen uncertain nominal parameters, the
//! catalogue, and the innovations of every record.

mod candidates;

pub use candidates::catalogue;

use plant::identified::effects::Effect;
use plant::identified::nominal::{NominalRig, PARAMETERS};
use plant::identified::rig::IdentifiedRig;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::case::Nominal;
use crate::kinds::shake_table::predictor::{
    Disturbance, Innovations, Learned, Noise, Predictor, Samples, learn, total,
};
use diagnosis::{Candidate, ExtensibleModel, Lesson, PRICE_OF_A_PARAMETER, Point, evaluate};
use recordings::OUTPUT_NAMES;

/// A sensor whose noise is this many times what is stated is another than the one described, or a broken
/// one: no cause is claimed from it. The prior of a level is a factor of 2.7 at its 95 % ends.
pub const TOO_LOUD: f64 = 4.0;
/// Drift in what is stated from which on a sensor is as good as broken, too.
const DRIFTS_AT_MOST: f64 = 20.0;
/// Slower noise of a sensor is a drift, Hz.
const DRIFT_BELOW: f64 = 0.5;
/// Noises beyond this many times what is stated or assumed may hide behaviour that the model lacks.
const UNUSUAL: f64 = 3.0;
/// Share of the unseen voltage with which a predictor follows the records less closely.
const FOLLOWING_LESS: f64 = 0.3;
/// Seed of the voltage that probes how much of one passes.
const PROBE_SEED: u64 = 20_261_122;
/// Share of an unseen voltage's power that passes at least, so that a level remains defined.
const LEAST_PASSED: f64 = 1e-3;
/// A rig that passes less than this share of an unseen voltage's power holds it back.
const HELD_BACK: f64 = 0.7;
/// A record with less than this share of the loudest one's command is one of low level.
const LOW_LEVEL: f64 = 0.5;

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
    /// What its predictors assume of the noises.
    pub noise: Noise,
    /// What was known of them beforehand.
    pub stated_noise: Noise,
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
        let unseen = Disturbance::beside_command(nominal.command_noise, period);
        let noise = Noise::new(noise, unseen);
        Self {
            nominal: IdentifiedRig {
                shake_table: nominal.shake_table,
                specimen: nominal.specimen,
                effects: nominal.effects,
                sensors: nominal.sensors,
            },
            uncertainty: nominal.uncertainty,
            period,
            stated_noise: noise.clone(),
            noise,
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

    /// The rig at `point` as it was when `record` was taken.
    fn rig_of(&self, record: usize, point: &Point) -> IdentifiedRig {
        if self.records[record].with_effects {
            self.rig(point)
        } else {
            self.rig_without_effects(&point.nuisance)
        }
    }

    /// Power that an unseen voltage leaves in the innovations of `rig` on `record` (`whitened` without
    /// it) over that on the linear part: from both with the same small voltage added. None where they
    /// cannot be predicted.
    fn passed(&self, rig: &IdentifiedRig, record: usize, whitened: &[f64]) -> Option<f64> {
        let samples = &self.records[record].samples;
        let mut random = ChaCha8Rng::seed_from_u64(PROBE_SEED);
        let mut past = vec![[0.0; 2]; self.stated_noise.unseen.len()];
        let probe = |_| -> f64 {
            let parts = self.stated_noise.unseen.iter().zip(&mut past);
            let next = parts.map(|(part, past)| {
                let new: f64 = StandardNormal.sample(&mut random);
                past[0] = part.expect(past) + part.drive() * new;
                past[0]
            });
            next.sum()
        };
        let probe: Vec<f64> = (0..samples.len()).map(probe).collect();
        let predictor = Predictor::design(rig, self.period, &self.noise).ok()?;
        let response = |rig: &IdentifiedRig, samples: &Samples| {
            let sampled = predictor.sample(rig).ok()?;
            let mut out = vec![0.0; 4 * samples.len()];
            predictor
                .disturbed_innovations(&sampled, samples, |k| probe[k], &mut out)
                .then_some(out)
        };
        let at_rest = Samples {
            command: vec![0.0; samples.len()],
            channels: vec![[0.0; 4]; samples.len()],
        };
        let disturbed = response(rig, samples)?;
        let linear = response(&rig.linear_part(), &at_rest)?;
        let pairs = disturbed.iter().zip(whitened);
        let left: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
        let expected: f64 = linear.iter().map(|r| r * r).sum();
        Some((left / expected.max(f64::MIN_POSITIVE)).max(LEAST_PASSED))
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

/// The level of a sensor's noise over what is `stated`, of the loudest. A drift of its zero counts little: its size
/// is known poorly, and a slow voltage that nobody sees looks like one.
pub fn loudest(noise: &Noise, stated: &Noise, period: f64) -> f64 {
    let ratios = (0..4).filter_map(|i| {
        let own = stated.white[i];
        let level = noise.above(i, DRIFT_BELOW, period);
        let with_drift = noise.of_channel(i) * TOO_LOUD / DRIFTS_AT_MOST;
        own.is_finite().then(|| level.max(with_drift) / own)
    });
    ratios.fold(0.0, f64::max)
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

    fn with_learned_noise(
        &self,
        point: &Point,
        residuals: &[f64],
        records: &[usize],
    ) -> Option<Lesson<Self>> {
        let mut rest = residuals;
        let mut innovations = Vec::new();
        for &record in records {
            let (whitened, others) = rest.split_at_checked(self.residual_count(record))?;
            rest = others;
            let rig = self.rig_of(record, point);
            innovations.push(Innovations {
                rig,
                whitened,
                passed: self.passed(&rig, record, whitened)?,
            });
        }
        // The voltage may act before what holds it back, or behind.
        let mut lessons = vec![learn(
            &innovations,
            self.period,
            &self.noise,
            &self.stated_noise,
        )?];
        if innovations.iter().any(|own| own.passed < HELD_BACK) {
            for own in &mut innovations {
                own.passed = 1.0;
            }
            lessons.extend(learn(
                &innovations,
                self.period,
                &self.noise,
                &self.stated_noise,
            ));
        }
        let cost = |learned: &Learned| {
            let mut model = self.clone();
            model.noise = learned.noise.clone();
            evaluate(&model, point, records).map_or(f64::INFINITY, |fit| fit.cost)
        };
        let learned = match lessons.as_slice() {
            [before, behind] if cost(behind) < cost(before) => behind,
            all => all.first()?,
        }
        .clone();
        let mut model = self.clone();
        let mut figures = vec![("unseen voltage in mV", 1e3 * total(&learned.noise.unseen))];
        for (i, name) in OUTPUT_NAMES.into_iter().enumerate() {
            let stated = self.stated_noise.white[i];
            if stated.is_finite() {
                figures.push((name, learned.noise.of_channel(i) / stated));
            }
        }
        let is_believable = loudest(&learned.noise, &self.stated_noise, self.period) < TOO_LOUD;
        model.noise = learned.noise;
        Some(Lesson {
            model,
            gain: learned.gain,
            is_believable,
            figures,
        })
    }

    fn following_less(&self) -> Option<Self> {
        let mut model = self.clone();
        for part in &mut model.noise.unseen {
            part.sigma *= FOLLOWING_LESS;
        }
        Some(model)
    }

    fn is_usual(&self) -> bool {
        let unseen = total(&self.noise.unseen) / total(&self.stated_noise.unseen);
        unseen < UNUSUAL && loudest(&self.noise, &self.stated_noise, self.period) < UNUSUAL
    }

    fn has_noises_of(&self, other: &Self) -> bool {
        self.noise == other.noise
    }

    fn noise_price(&self) -> f64 {
        let parts = |noise: &Noise| -> usize {
            let coloured = noise.coloured.iter().flatten().chain(&noise.unseen);
            coloured.map(|part| 1 + part.order()).sum()
        };
        let further = parts(&self.noise).saturating_sub(parts(&self.stated_noise));
        PRICE_OF_A_PARAMETER * further as f64
    }

    fn quiet_records(&self, among: &[usize]) -> Vec<usize> {
        let size = |record: &usize| -> f64 {
            let command = &self.records[*record].samples.command;
            let square: f64 = command.iter().map(|u| u * u).sum();
            (square / command.len().max(1) as f64).sqrt()
        };
        let loudest = among.iter().map(size).fold(0.0, f64::max);
        let is_quiet = |r: &usize| !self.records[*r].with_effects || size(r) < LOW_LEVEL * loudest;
        among.iter().copied().filter(is_quiet).collect()
    }

    fn drifts_below(&self) -> f64 {
        DRIFT_BELOW * self.period
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
        let design = |rig: &IdentifiedRig| Predictor::design(rig, self.period, &self.noise).ok();
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
        // Those of the predictor are in units of the white noise that it assumes.
        let levels = self.noise.white.iter().zip(&self.stated_noise.white);
        let units = levels.filter(|(own, _)| own.is_finite());
        let units = units.map(|(own, stated)| 2.0 * (own / stated).ln());
        predictor.with_effects.log_determinant + units.sum::<f64>()
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
    use crate::kinds::shake_table::course::courses;
    use diagnosis::{Deadline, Judgement, Observer, Verdict, judge};
    use plant::identified::shake_table::ShakeTable;
    use plant::specimens::linear::LinearSpecimen;

    const PERIOD: f64 = 2e-3;
    const STATED: [f64; 4] = [1.3e-5, 0.04, 1.3, 0.025];

    fn stated() -> Noise {
        Noise::new(STATED, Disturbance::beside_command(5e-4, PERIOD))
    }

    /// Records of `rig` with `noise` under a small proportional controller on random references.
    fn model(rig: &IdentifiedRig, noise: &Noise, seed: u64) -> ShakeTableModel {
        let nominal = Nominal {
            sample_rate: 1.0 / PERIOD,
            shake_table: ShakeTable::default(),
            specimen: Some(LinearSpecimen::default()),
            controller: None,
            noise: STATED,
            command_noise: 5e-4,
            uncertainty: 0.01,
            effects: Default::default(),
            sensors: Default::default(),
        };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let sampled = rig.sample(PERIOD, 2).unwrap();
        let records = ["identification", "validation"].map(|name| {
            let mut state = Default::default();
            let (mut reference, mut slow) = (0.0, 0.0);
            let mut coloured = noise
                .coloured
                .clone()
                .map(|parts| vec![[0.0; 2]; parts.len()]);
            let mut unseen = vec![[0.0; 2]; noise.unseen.len()];
            let mut samples = Samples {
                command: Vec::new(),
                channels: Vec::new(),
            };
            for k in 0..4000 {
                slow += 0.01 * (0.15 * normal() - slow);
                reference += 0.02 * (slow - reference);
                let mut channels = sampled.measure(&mut state, f64::from(k) * PERIOD);
                for i in 0..4 {
                    for (part, past) in noise.coloured[i].iter().zip(&mut coloured[i]) {
                        past[0] = part.expect(past) + part.drive() * normal();
                        channels[i] += past[0];
                    }
                    channels[i] += noise.white[i] * normal();
                }
                let command = 240.0 * (reference - channels[0]);
                samples.command.push(command);
                samples.channels.push(channels);
                let mut voltage = 0.0;
                for (part, past) in noise.unseen.iter().zip(&mut unseen) {
                    past[0] = part.expect(past) + part.drive() * normal();
                    voltage += past[0];
                }
                sampled.step_disturbed(&mut state, command, voltage);
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

    fn said(judgement: &Judgement) -> (Verdict, Vec<&'static str>) {
        let mut names: Vec<_> = judgement.effects.iter().map(|e| e.effect).collect();
        names.sort_unstable();
        (judgement.verdict, names)
    }

    #[test]
    fn the_noise_is_learned_from_the_records() {
        let rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        let mut there = Noise::new(STATED, Disturbance::below(15e-3, 8.0, PERIOD));
        there.white[2] *= 0.5;
        there.coloured[2] = vec![Disturbance::below(STATED[2], 10.0, PERIOD)];
        there
            .unseen
            .push(Disturbance::around(8e-3, 17.0, 0.04, PERIOD));
        let model = model(&rig, &there, 47);
        let origin = Point {
            nuisance: vec![0.0; model.nuisance()],
            effects: Vec::new(),
        };
        let lesson = |model: &ShakeTableModel| {
            let fit = evaluate(model, &origin, &[0, 1]).unwrap();
            let lesson = model.with_learned_noise(&origin, &fit.residuals, &[0, 1]);
            (fit.residuals, lesson.unwrap())
        };
        let (before, first) = lesson(&model);
        let (after, second) = lesson(&first.model);
        let found = &first.model.noise;
        let near = |found: f64, there: f64, within: f64| {
            assert!((found / there - 1.0).abs() < within, "{found} for {there}");
        };
        let [below, around] = found.unseen.as_slice() else {
            panic!("{:?}", found.unseen)
        };
        near(below.sigma, 15e-3, 0.15);
        near(below.corner(PERIOD), 8.0, 0.3);
        near(around.sigma, 8e-3, 0.15);
        near(around.frequency(PERIOD).unwrap(), 17.0, 0.02);
        for i in 0..4 {
            near(found.white[i], there.white[i], 0.05);
        }
        let [slow] = found.coloured[2].as_slice() else {
            panic!("{:?}", found.coloured)
        };
        near(slow.sigma, STATED[2], 0.15);
        near(slow.corner(PERIOD), 10.0, 0.3);
        // With it the innovations are white and of unit size, and there is nothing more to learn.
        let mean_square = |r: &[f64]| r.iter().map(|r| r * r).sum::<f64>() / r.len() as f64;
        assert!(mean_square(&before) > 1.5, "{}", mean_square(&before));
        near(mean_square(&after), 1.0, 0.02);
        assert!(
            first.gain > 1e3 && second.gain < 30.0,
            "{} {}",
            first.gain,
            second.gain
        );
    }

    /// What is slower than a record is a voltage's as well as a sensor's, and this one would be broken.
    #[test]
    fn a_drift_is_never_learned_as_a_broken_sensor() {
        let rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        let mut there = stated();
        there.coloured[0] = vec![Disturbance::below(40.0 * STATED[0], 0.05, PERIOD)];
        let model = model(&rig, &there, 53);
        let origin = Point {
            nuisance: vec![0.0; model.nuisance()],
            effects: Vec::new(),
        };
        let fit = evaluate(&model, &origin, &[0, 1]).unwrap();
        let lesson = model.with_learned_noise(&origin, &fit.residuals, &[0, 1]);
        let noise = lesson.unwrap().model.noise;
        assert!(!noise.coloured[0].is_empty());
        for part in &noise.coloured[0] {
            assert!(part.sigma <= 10.001 * STATED[0], "{noise:?}");
        }
    }

    #[test]
    fn an_effect_below_what_matters_is_present_but_too_small() {
        let mut rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        // The catalogue's weakest is 1.33 N.
        rig.sensors.actuator_force.bias = 0.6;
        let mut model = model(&rig, &stated(), 33);
        let judgement = judge(&mut model, &[0], &[1], Observer::none()).unwrap();
        let named = (Verdict::TooSmall, vec!["load_cell_bias"]);
        assert_eq!(said(&judgement), named);
        let bias = &judgement.effects[0].parameters[0];
        assert!(
            (bias.value - 0.6).abs() < 4.0 * bias.standard_error,
            "{bias:?}"
        );
    }

    /// Columns softer by nine stated deviations: the nominal stiffness fits them as well, and only its prior tells.
    #[test]
    fn an_effect_that_is_nearly_a_nominal_parameter_is_found() {
        let mut rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        if let Some(specimen) = &mut rig.specimen {
            specimen.stiffness *= 0.91;
        }
        let mut model = model(&rig, &stated(), 35);
        let judgement = judge(&mut model, &[0], &[1], Observer::none()).unwrap();
        let named = (Verdict::Named, vec!["specimen_stiffness"]);
        assert_eq!(said(&judgement), named);
        let change = &judgement.effects[0].parameters[0];
        assert!((change.value + 0.09).abs() < 0.03, "{change:?}");
    }

    /// An accelerometer that loses a tenth at 4.8 s, under a model whose accelerometer is off throughout.
    #[test]
    fn when_an_effect_begins_is_found() {
        let rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        let mut model = model(&rig, &stated(), 41);
        for row in model.records[0].samples.channels.iter_mut().skip(2400) {
            row[1] *= 0.9;
        }
        let scale = |own: &Candidate| own.effect == "accelerometer_scale";
        let place = model.candidates.iter().position(scale).unwrap();
        let point = Point {
            nuisance: vec![0.0; model.nuisance()],
            effects: vec![(place, model.candidates[place].internal(&[-0.05]))],
        };
        let found: Vec<_> = courses(&model, &point)
            .into_iter()
            .filter(|own| own.record == "identification")
            .collect();
        let [course] = found.as_slice() else {
            panic!("{found:?}");
        };
        assert!((course.onset_s.unwrap() - 4.8).abs() < 0.1, "{course:?}");
        assert!(course.before.abs() < 0.01, "{course:?}");
        assert!((course.after + 0.1).abs() < 0.01, "{course:?}");
    }

    #[test]
    fn what_the_deadline_cut_short_names_nothing() {
        let mut rig = IdentifiedRig {
            specimen: Some(LinearSpecimen::default()),
            ..Default::default()
        };
        rig.effects.valve.dead_band = 0.12;
        let mut model = model(&rig, &stated(), 31);
        let deadline = Deadline::after(std::time::Duration::ZERO);
        let observer = Observer::none().until(&deadline);
        let judgement = judge(&mut model, &[0], &[1], observer).unwrap();
        assert!(deadline.has_cut());
        assert_eq!(judgement.verdict, Verdict::Unexplained);
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
            let model = model(&rig, &stated(), 31);
            let straight = judge(&mut model.clone(), &[0], &[1], Observer::none()).unwrap();
            assert_eq!(said(&straight).1, hidden);

            let mut turned = model.clone();
            turned.candidates.reverse();
            turned.effects.reverse();
            turned.candidates.rotate_left(7);
            turned.effects.rotate_left(7);
            assert_eq!(
                said(&judge(&mut turned, &[0], &[1], Observer::none()).unwrap()),
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
            let judgement = judge(&mut relabelled, &[0], &[1], Observer::none()).unwrap();
            let mut expected: Vec<_> = hidden.iter().map(|name| mirror(name)).collect();
            expected.sort_unstable();
            assert_eq!(said(&judgement), (straight.verdict, expected));
        }
    }
}
