//! Verdicts on a spring whose law is known: `y = k x` with effects added, under white noise of a known size.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use diagnosis::{
    Candidate, EffectParameter, ExtensibleModel, Judgement, Lesson, Observer, PenalisedLikelihood,
    Point, Role, SUREST, Scale, Selected, SimulatedModel, Verdict, judge, nominal, select,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SAMPLES: usize = 2000;
/// Root mean square of the noise.
const NOISE: f64 = 0.05;
/// The stiffness is stated as 1, known to this.
const KNOWN_TO: f64 = 0.1;

/// Motion of a record and its velocity.
fn motion(record: usize, k: usize) -> [f64; 2] {
    let t = k as f64 / 50.0;
    let shift = record as f64;
    let tones: [(f64, f64); 3] = [(1.3, 1.0), (3.7, 0.6), (7.9, 0.3)];
    let of = |wave: fn(f64) -> f64, power: i32| -> f64 {
        let all = tones.iter();
        all.map(|(rate, size)| size * rate.powi(power) * wave(rate * t + shift * rate))
            .sum()
    };
    [of(f64::sin, 0), of(f64::cos, 1)]
}

/// Forces that a spring may have beside its own: of its cube, of the velocity, of the velocity's sign, and a
/// tone that the catalogue does not know.
fn forces([x, v]: [f64; 2], k: usize) -> [f64; 4] {
    [x * x * x, v, v.signum(), (0.43 * k as f64).sin()]
}

#[derive(Clone)]
struct Spring {
    candidates: Vec<Candidate>,
    /// Shares of the forces in a unit of each candidate.
    shares: Vec<[f64; 4]>,
    measured: Vec<Vec<f64>>,
    noise_price: f64,
}

impl Spring {
    /// With these shares of the forces, in three records.
    fn new(stiffness: f64, sizes: [f64; 4]) -> Self {
        Self::of(&|own, k| {
            let extra = forces(own, k).into_iter().zip(sizes);
            let extra: f64 = extra.map(|(force, size)| size * force).sum();
            stiffness * own[0] + extra
        })
    }

    /// With this force at a motion and a sample.
    fn of(force: &dyn Fn([f64; 2], usize) -> f64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut record = |record: usize| {
            let mut uniform = || random.random_range(-0.5..0.5);
            // Sums of twelve are nearly normal; of unit power here.
            let noise: Vec<f64> = (0..SAMPLES)
                .map(|_| (0..12).map(|_| uniform()).sum())
                .collect();
            let power = noise.iter().map(|one| one * one).sum::<f64>() / SAMPLES as f64;
            let all = noise
                .iter()
                .enumerate()
                .map(|(k, noise)| force(motion(record, k), k) + NOISE * noise / power.sqrt());
            all.collect()
        };
        let candidate = |effect| {
            let size = EffectParameter {
                name: "size",
                unit: "N",
                scale: Scale::Linear(0.1),
                role: Role::Size { weak: 0.1 },
                bounds: (-3.0, 3.0),
            };
            Candidate::new(effect, vec![size], vec![vec![0.3], vec![-0.3]])
        };
        let mut candidates = ["cubic", "viscous", "dry"].map(candidate).to_vec();
        // Dry friction that turns over a range of velocity.
        let mut smooth = candidates[2].clone();
        smooth.parameters.push(EffectParameter {
            name: "range",
            unit: "m/s",
            scale: Scale::Linear(1.0),
            role: Role::Shape {
                typical: 1.0,
                spread: 2.0,
            },
            bounds: (0.05, 8.0),
        });
        smooth.starts = vec![vec![0.3, 1.0], vec![-0.3, 4.0]];
        (smooth.effect, smooth.contains) = ("smooth", Some("dry"));
        candidates.push(smooth);
        Self {
            candidates,
            shares: (0..4)
                .map(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
                .collect(),
            measured: (0..3).map(&mut record).collect(),
            noise_price: 0.0,
        }
    }

    /// Adds a candidate like dry friction that has these shares of the forces.
    fn add(&mut self, effect: &'static str, shares: [f64; 4]) {
        let like = self.candidates[2].clone();
        self.candidates.push(Candidate { effect, ..like });
        self.shares.push(shares);
    }

    /// The force at a point of the model.
    fn force(&self, point: &Point, record: usize, k: usize) -> f64 {
        let own = motion(record, k);
        let of_effect = |(i, q): &(usize, Vec<f64>)| match q[..] {
            [size, range] => 0.1 * size * (own[1] / range).tanh(),
            _ => {
                let pairs = forces(own, k).into_iter().zip(self.shares[*i]);
                0.1 * q[0] * pairs.map(|(force, share)| force * share).sum::<f64>()
            }
        };
        let extra: f64 = point.effects.iter().map(of_effect).sum();
        (1.0 + KNOWN_TO * point.nuisance[0]) * own[0] + extra
    }
}

impl ExtensibleModel for Spring {
    type Predictor = ();

    fn nuisance(&self) -> usize {
        1
    }
    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }
    fn records(&self) -> usize {
        self.measured.len()
    }
    fn record_name(&self, record: usize) -> &str {
        ["first", "second", "third"][record]
    }
    fn channels(&self) -> &[&'static str] {
        &["force"]
    }
    fn regressors(&self, record: usize) -> Vec<(String, Vec<f64>)> {
        let names = ["cube", "velocity", "direction"].into_iter().enumerate();
        names
            .map(|(at, name)| {
                let values = (0..SAMPLES).map(|k| forces(motion(record, k), k)[at]);
                (name.to_string(), values.collect())
            })
            .collect()
    }
    fn with_learned_noise(&self, _: &Point, _: &[f64], _: &[usize]) -> Option<Lesson<Self>> {
        None
    }
    fn noise_price(&self) -> f64 {
        self.noise_price
    }
    fn quiet_records(&self, _: &[usize]) -> Vec<usize> {
        Vec::new()
    }
    fn residual_count(&self, record: usize) -> usize {
        self.measured[record].len()
    }
    fn sample_count(&self, record: usize) -> usize {
        self.measured[record].len()
    }
    fn predictor(&self, _: &Point) -> Option<()> {
        Some(())
    }
    fn log_determinant(&self, _: &()) -> f64 {
        2.0 * NOISE.ln()
    }
    fn residuals(&self, _: &(), point: &Point, record: usize, out: &mut [f64]) -> bool {
        for (k, (out, measured)) in out.iter_mut().zip(&self.measured[record]).enumerate() {
            *out = (measured - self.force(point, record, k)) / NOISE;
        }
        out.iter().all(|value| value.is_finite())
    }
}

/// Two records are fitted, the third is kept to predict.
fn judged(stiffness: f64, sizes: [f64; 4]) -> Judgement {
    let mut spring = Spring::new(stiffness, sizes);
    judge(&mut spring, &[0, 1], &[2], Observer::none()).unwrap()
}

/// Names and sizes of effects, in the order of their names.
fn sizes(judgement: &Judgement) -> Vec<(&'static str, f64, f64)> {
    let effects = judgement.effects.iter();
    let mut all: Vec<_> = effects
        .map(|own| {
            (
                own.effect,
                own.parameters[0].value,
                own.parameters[0].standard_error,
            )
        })
        .collect();
    all.sort_by_key(|own| own.0);
    all
}

#[test]
fn a_spring_without_more_is_adequate_and_its_stiffness_is_found() {
    let found = judged(1.05, [0.0; 4]);
    assert_eq!(found.verdict, Verdict::Adequate);
    assert!(found.effects.is_empty() && found.unseen_gains.is_empty());
    // In stated standard deviations of 0.1.
    let (own, error) = (found.nominal.nuisance[0], found.nuisance_errors[0]);
    assert!(
        (own - 0.5).abs() < 5.0 * error && error > 0.0,
        "{own} {error}"
    );
    let squares: f64 = (0..2 * SAMPLES)
        .map(|k| motion(k / SAMPLES, k % SAMPLES)[0].powi(2))
        .sum();
    let expected = NOISE / KNOWN_TO / squares.sqrt();
    assert!((error / expected - 1.0).abs() < 0.3, "{error} {expected}");
}

#[test]
fn an_effect_is_named_with_its_size_and_predicts_what_was_not_fitted() {
    for (at, effect, size) in [(0, "cubic", 0.4), (1, "viscous", -0.3), (2, "dry", 0.5)] {
        let mut hidden = [0.0; 4];
        hidden[at] = size;
        let found = judged(0.97, hidden);
        assert_eq!(found.verdict, Verdict::Named, "{effect}");
        let all = sizes(&found);
        let [(name, value, error)] = all[..] else {
            panic!("{all:?}");
        };
        assert_eq!(name, effect);
        assert!((value - size).abs() < 5.0 * error, "{value} {error}");
        assert!(error > 0.0 && error < 0.01 * size.abs(), "{value} {error}");
        assert!(found.share_explained > 0.99, "{}", found.share_explained);
        assert!(found.alternatives.is_empty());
        assert!(
            found.unseen_gains[0].unwrap() > 5.0,
            "{:?}",
            found.unseen_gains
        );
        assert!(found.without[0].as_ref().unwrap().effects.is_empty());
        assert!(found.effects[0].confidence > 0.9);
    }
}

/// A tone that no effect makes is left beside one that explains nearly all, and by itself.
#[test]
fn traces_count_for_less_beside_an_effect_that_explains_nearly_all() {
    let left = |size, tone| {
        let found = judged(1.0, [size, 0.0, 0.0, tone]);
        let names: Vec<_> = found.effects.iter().map(|own| own.effect).collect();
        (found.verdict, names, found.tests[0].deviate)
    };
    let (verdict, names, deviate) = left(0.4, 0.03);
    assert_eq!((verdict, names), (Verdict::Named, vec!["cubic"]));
    let (verdict, _, alone) = left(0.0, 0.03);
    assert_eq!(verdict, Verdict::Unexplained);
    assert!(
        deviate > 5.6 && (alone - deviate).abs() < 0.01,
        "{deviate} {alone}"
    );
    let (verdict, _, deviate) = left(0.4, 0.036);
    assert!(deviate < 9.5, "{deviate}");
    assert_eq!(verdict, Verdict::Unexplained);
}

#[test]
fn a_model_s_score_is_its_cost_with_the_prices_of_its_effects_and_noises() {
    let mut spring = Spring::new(1.0, [0.4, 0.0, 0.0, 0.0]);
    spring.noise_price = 7.0;
    let selection = PenalisedLikelihood::of(&spring, &[0, 1], Observer::none());
    let bare = selection.nominal().unwrap();
    assert!((bare.score - bare.fit.cost - 7.0).abs() < 1e-6);
    // Squares over the noise's, its determinant for each sample, and the squared deviation of the stiffness.
    let squares: f64 = bare.fit.residuals.iter().map(|own| own * own).sum();
    let samples = 2.0 * SAMPLES as f64;
    let expected = squares + samples * 2.0 * NOISE.ln() + bare.fit.point.nuisance[0].powi(2);
    assert!((bare.fit.cost - expected).abs() < 1e-6);
    assert!((bare.mean_square() - squares / samples).abs() < 1e-9);
    let extended = selection.extensions(&bare);
    let best = &extended[0];
    assert_eq!(best.effects(), [0]);
    assert!((best.score - best.fit.cost - 7.0 - 18.0).abs() < 1e-6);
    assert!(extended.is_sorted_by(|a, b| a.score <= b.score));
    assert!(extended.iter().all(|own| own.score < bare.score));
}

#[test]
fn two_effects_are_found_together_and_a_third_is_not_invented() {
    let found = judged(1.0, [0.4, 0.0, -0.5, 0.0]);
    assert_eq!(found.verdict, Verdict::Named);
    let all = sizes(&found);
    let [(first, cubic, _), (second, dry, _)] = all[..] else {
        panic!("{all:?}");
    };
    assert_eq!((first, second), ("cubic", "dry"));
    assert!(
        (cubic - 0.4).abs() < 0.02 && (dry + 0.5).abs() < 0.02,
        "{all:?}"
    );
    assert_eq!(found.unseen_gains.len(), 2);
}

#[test]
fn the_general_case_of_an_effect_is_asked_for_where_the_special_one_leaves_traces() {
    let mut spring = Spring::of(&|[x, v], _| x + 0.5 * (v / 0.7).tanh());
    let found = judge(&mut spring, &[0, 1], &[2], Observer::none()).unwrap();
    assert_eq!(found.verdict, Verdict::Named);
    // Two starts lead to it, which are not each other's rivals.
    assert!(found.alternatives.is_empty() && found.effects[0].confidence > 0.9);
    let [effect] = &found.effects[..] else {
        panic!("{:?}", found.effects);
    };
    assert_eq!(effect.effect, "smooth");
    let parameters = effect
        .parameters
        .iter()
        .zip([("size", 0.5), ("range", 0.7)]);
    for (own, (name, truth)) in parameters {
        assert_eq!((own.name.as_str(), own.is_shape), (name, name == "range"));
        assert!(
            (own.value - truth).abs() < 5.0 * own.standard_error,
            "{own:?}"
        );
        assert!(own.standard_error < 0.1 * truth, "{own:?}");
    }
}

#[test]
fn two_effects_that_no_record_tells_apart_are_ambiguous() {
    let mut spring = Spring::new(1.0, [0.0, 0.0, 0.5, 0.0]);
    spring.add("twin", [0.0, 0.0, 1.0, 0.0]);
    let found = judge(&mut spring, &[0, 1], &[2], Observer::none()).unwrap();
    assert_eq!(found.verdict, Verdict::Ambiguous);
    let own = found.effects[0].effect;
    let other = if own == "dry" { "twin" } else { "dry" };
    assert_eq!(found.alternatives, [[other]]);
    let [rival] = &found.rival_points[..] else {
        panic!("{:?}", found.rival_points);
    };
    assert!((rival.effects[0].1[0] - 5.0).abs() < 0.1, "{rival:?}");
    // Each as likely as the other.
    assert!((found.effects[0].confidence - 0.5 * SUREST).abs() < 0.01);
    let weights: Vec<f64> = found.candidates.iter().map(|own| own.weight).collect();
    assert!(
        weights.len() == 2 && weights.iter().all(|own| (own - 0.5).abs() < 0.01),
        "{weights:?}"
    );
    assert!(found.candidates.iter().all(|own| own.explains > 0.99));
}

/// A tone with some dry friction in it explains more than the tone alone, until viscous friction is there.
#[test]
fn an_effect_that_was_right_only_by_itself_gives_its_place_to_another_one() {
    let mut spring = Spring::new(1.0, [0.5, 0.1, 0.0, 0.4]);
    spring.add("tone", [0.0, 0.0, 0.0, 1.0]);
    spring.add("mixture", [0.0, 0.0, 0.6, 1.0]);
    let found = judge(&mut spring, &[0, 1], &[2], Observer::none()).unwrap();
    assert_eq!(found.verdict, Verdict::Named);
    let names: Vec<_> = sizes(&found).into_iter().map(|own| own.0).collect();
    assert_eq!(names, ["cubic", "tone", "viscous"]);
}

#[test]
fn a_weak_effect_is_too_small_and_a_stranger_is_unexplained() {
    // Six hundredths are the least that matters; this much hardly shows over the noise.
    let found = judged(1.0, [0.0, 0.0, 0.008, 0.0]);
    assert_eq!(found.verdict, Verdict::TooSmall);
    let all = sizes(&found);
    assert!(
        all.len() == 1 && all[0].0 == "dry" && (all[0].1 - 0.008).abs() < 5.0 * all[0].2,
        "{all:?}"
    );
    let found = judged(1.0, [0.0, 0.0, 0.0, 0.5]);
    assert_eq!(found.verdict, Verdict::Unexplained);
    let strongest = &found.tests[0];
    assert!(strongest.deviate > 10.0, "{strongest:?}");
    // With an effect beside it, that one is ranked.
    let found = judged(1.0, [0.8, 0.0, 0.0, 0.2]);
    assert_eq!(found.verdict, Verdict::Unexplained);
    let first = &found.candidates[0];
    let [cubic] = &first.effects[..] else {
        panic!("{first:?}");
    };
    assert_eq!(cubic.effect, "cubic");
    assert!((0.9..0.99).contains(&first.explains), "{}", first.explains);
    // Known no better than the root of what is not explained.
    let size = &cubic.parameters[0];
    let least = (1.0 - first.explains).sqrt() * size.value;
    assert!(
        size.standard_error >= least && size.standard_error < 1.1 * least,
        "{size:?}"
    );
    assert!((size.value - 0.8).abs() < size.standard_error);
}

/// The same spring by simulation: a record of both halves of the first (2), and these (0 and 1).
impl SimulatedModel for Spring {
    fn nuisance(&self) -> usize {
        1
    }
    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }
    fn blocks(&self) -> usize {
        1
    }
    fn block_of(&self, _: usize) -> Option<usize> {
        None
    }
    fn samples(&self, record: usize, _: usize) -> usize {
        if record == 2 { SAMPLES } else { SAMPLES / 2 }
    }
    fn errors(&self, point: &Point, record: usize, _: usize) -> Vec<f64> {
        let half = SAMPLES / 2;
        let part = match record {
            0 => 0..half,
            1 => half..SAMPLES,
            _ => 0..SAMPLES,
        };
        part.map(|k| self.measured[0][k] - self.force(point, 0, k))
            .collect()
    }
    fn folds(&self, _: usize) -> [usize; 2] {
        [0, 1]
    }
    fn screen(&self, record: usize) -> usize {
        record
    }
    fn held(&self) -> Self {
        self.clone()
    }
    fn record_name(&self, _: usize) -> &str {
        "first"
    }
}

fn selected(stiffness: f64, sizes: [f64; 4]) -> Selected {
    let mut spring = Spring::new(stiffness, sizes);
    // Without what holds another as a special case.
    spring.candidates.truncate(3);
    select(&spring, 2, Observer::none()).unwrap()
}

#[test]
fn effects_that_help_on_the_other_half_are_selected_with_their_sizes() {
    let found = selected(1.05, [0.4, 0.0, -0.5, 0.0]);
    let mut effects = found.extended.point.effects.clone();
    effects.sort_by_key(|own| own.0);
    let [(0, cubic), (2, dry)] = &effects[..] else {
        panic!("{effects:?}");
    };
    // Tenths of a newton.
    assert!(
        (cubic[0] - 4.0).abs() < 0.2 && (dry[0] + 5.0).abs() < 0.2,
        "{effects:?}"
    );
    assert!((found.extended.point.nuisance[0] - 0.5).abs() < 0.1);
    // Only the noise is left, of which three coordinates take a little.
    let noise = NOISE * NOISE * SAMPLES as f64;
    let left = found.extended.squares / noise;
    assert!((0.98..1.0).contains(&left), "{left}");
    assert!(found.nominal.squares > 20.0 * noise);
    assert_eq!((found.deviates.len(), found.without.len()), (2, 2));
    assert!(
        found.deviates.iter().all(|deviate| *deviate > 4.0),
        "{:?}",
        found.deviates
    );
    for without in &found.without {
        assert_eq!(without.point.effects.len(), 1);
        assert!(without.squares > 2.0 * noise && without.squares < found.nominal.squares);
    }
    assert!(found.rivals.is_empty());
    // By the noise over the root of what each moves.
    assert_eq!(found.deviations.len(), 3);
    assert!(
        found.deviations.iter().all(|own| (1e-3..0.2).contains(own)),
        "{:?}",
        found.deviations
    );
}

#[test]
fn nothing_is_selected_of_noise_and_the_nominal_model_is_refitted() {
    let found = selected(0.9, [0.0; 4]);
    assert!(found.extended.point.effects.is_empty() && found.without.is_empty());
    let spring = Spring::new(0.9, [0.0; 4]);
    let alone = nominal(&spring, 2).unwrap();
    for own in [&alone, &found.nominal] {
        assert!((own.point.nuisance[0] + 1.0).abs() < 0.1, "{:?}", own.point);
        let left = own.squares / (NOISE * NOISE * SAMPLES as f64);
        assert!((0.99..1.0).contains(&left), "{left}");
    }
}
