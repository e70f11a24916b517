//! What else the data may mean: models with and without what they do not need for sure, weighed by how either
//! part of the data predicts the other.

use serde::{Deserialize, Serialize};

use super::cause::{Cause, effect_in_words, joined};
use super::confirmed::{clearly_better, effects, lengths, on_the_other};
use super::named_value::NamedValue;
use super::parts::{EVERYTHING, InParts, Part};
use diagnosis::resampling::correlation_time;
use diagnosis::{Point, all_errors, looked, refit, settled, squares};

/// The squared error grows by this factor at least without what the data need.
pub(super) const NEEDED: f64 = 1.1;

/// And shrinks to this share at most without what makes a prediction worse.
const BETTER: f64 = 0.95;

/// Error over the output's deviation up to which a model lacks nothing that matters: no simulation, sampling or recorder
/// is more exact.
const EXACT: f64 = 1e-3;

/// Most independent samples that a part counts for, halved. No model is exact: a tenth more squared error in
/// both parts makes a reading less likely by a factor of e, however many samples show it.
const MOST: f64 = 5.0;

/// Growth of the squared error in a few steps of a fit beyond which more of them change nothing.
pub(super) const FAR: f64 = 3.0;

/// Least weight that is told in the sentence.
const TOLD: f64 = 0.05;

/// A model and what it says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Nominal parameters that are not what was stated.
    pub causes: Vec<Cause>,
    /// Its effects with their parameters.
    pub effects: Vec<(String, Vec<NamedValue>)>,
    /// Share of the described model's squared error on the held-out data that it explains.
    pub explains: f64,
    /// Its share among the readings, from 0 to 1.
    pub weight: f64,
}

/// Errors on either part of a model fitted to the other.
pub(super) struct Crossed {
    errors: [Vec<f64>; 2],
    /// The same over the output's deviation.
    normalised: [f64; 2],
    /// Samples of each file in either part.
    lengths: [Vec<usize>; 2],
    /// Where the model is, fitted to the part that is not predicted.
    points: [Point; 2],
    /// Where it began.
    start: Point,
}

impl Crossed {
    /// Of the model at `point`, fitted to either part; none where it cannot be.
    pub(super) fn of<M: InParts>(model: &M, point: &Point) -> Option<Self> {
        Self::from(model, point, [point, point], settled)
    }

    /// As [`Self::of`], of fits in a few steps.
    pub(super) fn looked<M: InParts>(model: &M, point: &Point) -> Option<Self> {
        Self::from(model, point, [point, point], looked)
    }

    /// The same with its fits ended.
    pub(super) fn settled<M: InParts>(&self, model: &M) -> Option<Self> {
        Self::from(
            model,
            &self.start,
            [&self.points[0], &self.points[1]],
            settled,
        )
    }

    fn from<M: InParts>(
        model: &M,
        start: &Point,
        starts: [&Point; 2],
        fit: impl Fn(&M, &Point, usize) -> Option<Point>,
    ) -> Option<Self> {
        let tested = [Part::Fitted, Part::LeftOut];
        let points = [
            fit(model, starts[0], tested[1] as usize)?,
            fit(model, starts[1], tested[0] as usize)?,
        ];
        let used = [0, 1].map(|i| {
            let all = || fit(model, start, EVERYTHING);
            on_the_other(model, all, &points[i], tested[1 - i])
        });
        Some(Self {
            errors: [0, 1].map(|i| all_errors(model, &used[i].0, tested[i] as usize)),
            normalised: used.map(|(_, error)| error),
            lengths: tested.map(|part| lengths(model, part as usize)),
            points,
            start: start.clone(),
        })
    }

    /// Squared errors of `without` over those of this model, by part.
    fn growths(&self, without: &Self) -> [f64; 2] {
        std::array::from_fn(|i| squares(&without.errors[i]) / squares(&self.errors[i]))
    }

    /// Whether what the model has and `without` lacks is needed: no part is clearly predicted better without
    /// it, and one clearly worse by an error that matters.
    pub(super) fn needs(&self, without: &Self) -> bool {
        let growths = self.growths(without);
        let errors = [&self.errors, &without.errors];
        let [own, bare] = errors.map(|both| move |i: usize| both[i].as_slice());
        let clear = |i: usize| clearly_better(bare(i), own(i), &self.lengths[i]);
        let spoils =
            |i: usize| growths[i] < BETTER && clearly_better(own(i), bare(i), &self.lengths[i]);
        let is_worse = |i: usize| growths[i] > NEEDED && without.normalised[i] > EXACT && clear(i);
        !(0..2).any(spoils) && (0..2).any(is_worse)
    }

    /// Whether `without`, of which the fits have not ended, will not come near this model.
    pub(super) fn is_far_from(&self, without: &Self) -> bool {
        self.growths(without).into_iter().all(|own| own > FAR) && self.needs(without)
    }

    /// Logarithm of the likelihood beyond that of `other`, correlated samples counted once.
    pub(super) fn likelier_than(&self, other: &Self) -> f64 {
        let of = |i: usize| likelier(&self.errors[i], &other.errors[i]);
        of(0) + of(1)
    }

    fn explains(&self, nominal: &[f64]) -> f64 {
        1.0 - squares(&self.errors[1]) / squares(nominal)
    }
}

/// Logarithm of the likelihood of `errors` beyond that of `others`, correlated samples counted once.
pub(super) fn likelier(errors: &[f64], others: &[f64]) -> f64 {
    let independent = 0.5 * errors.len() as f64 / correlation_time(errors);
    independent.min(MOST) * (squares(others) / squares(errors)).ln()
}

/// What is weighed: a model, what it says, and its errors.
pub(super) struct Weighed {
    pub causes: Vec<Cause>,
    pub effects: Vec<(String, Vec<NamedValue>)>,
    pub crossed: Crossed,
}

impl Weighed {
    /// The model at `point`, fitted to all data.
    pub(super) fn of<M: InParts>(model: &M, point: &Point, crossed: Crossed) -> Option<Self> {
        let (found, deviations) = refit(model, point, EVERYTHING)?;
        Some(Self {
            causes: Vec::new(),
            effects: effects(model, &found.point, &deviations),
            crossed,
        })
    }
}

/// The readings, the likeliest first; `nominal` are the described model's errors on the held-out data.
pub(super) fn ranked(all: Vec<Weighed>, nominal: &[f64]) -> Vec<Reading> {
    let Some(first) = all.first() else {
        return Vec::new();
    };
    let logs = all
        .iter()
        .map(|own| -first.crossed.likelier_than(&own.crossed));
    let logs: Vec<f64> = logs.collect();
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let shares: Vec<f64> = logs.iter().map(|log| (log - most).exp()).collect();
    let sum: f64 = shares.iter().sum();
    let pairs = all.into_iter().zip(shares);
    let mut readings: Vec<Reading> = pairs
        .map(|(own, share)| Reading {
            explains: own.crossed.explains(nominal),
            causes: own.causes,
            effects: own.effects,
            weight: share / sum,
        })
        .collect();
    readings.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    readings
}

/// Every reading with and without `cause`, which no part predicts, the likeliest first.
pub(super) fn with_and_without(readings: Vec<Reading>, cause: &Cause) -> Vec<Reading> {
    let weight = cause.weight();
    let both = readings.into_iter().flat_map(|mut without| {
        let mut with = without.clone();
        with.causes.push(cause.clone());
        with.weight *= weight;
        without.weight -= with.weight;
        [with, without]
    });
    let mut both: Vec<Reading> = both.collect();
    both.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    both
}

impl Reading {
    fn says(&self, name: &str) -> bool {
        let mut effects = self.effects.iter();
        self.causes.iter().any(|own| own.found.name == name) || effects.any(|own| own.0 == name)
    }
}

/// The values of `rival` in the likeliest of the `readings` that has it and not `named`.
pub(super) fn instead<'a>(
    readings: &'a [Reading],
    named: &str,
    rival: &str,
) -> Option<&'a [NamedValue]> {
    let of = |own: &'a Reading, name: &str| own.effects.iter().find(|(known, _)| known == name);
    let mut without = readings.iter().filter(|own| of(own, named).is_none());
    let (_, values) = without.find_map(|own| of(own, rival))?;
    Some(values)
}

/// What readings say beyond what is `named`, in a sentence; nothing where there is none.
pub(super) fn in_words(readings: &[Reading], named: &dyn Fn(&str) -> bool) -> String {
    let mut told: Vec<&str> = Vec::new();
    let mut all: Vec<String> = Vec::new();
    for own in readings {
        let causes = own.causes.iter().map(|c| (&c.found.name, c.words()));
        let effects = own.effects.iter();
        let effects = effects.map(|(name, values)| (name, effect_in_words(name, values)));
        for (name, words) in causes.chain(effects) {
            if named(name) || told.contains(&name.as_str()) {
                continue;
            }
            told.push(name);
            let with = readings.iter().filter(|one| one.says(name));
            let weight: f64 = with.map(|one| one.weight).sum();
            if weight < TOLD {
                continue;
            }
            all.push(format!("{words}, with a weight of {weight:.2}"));
        }
    }
    if all.is_empty() {
        return String::new();
    }
    format!(
        " Perhaps, but not for sure from these data: {}.",
        joined(&all)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crossed(sizes: [f64; 2]) -> Crossed {
        let errors = sizes.map(|size| {
            let sign = |k: usize| {
                if (k * k * 7919 + k * 31) % 13 < 6 {
                    1.0
                } else {
                    -1.0
                }
            };
            (0..2000).map(|k| size * sign(k)).collect()
        });
        Crossed {
            errors,
            normalised: sizes,
            lengths: [vec![2000], vec![2000]],
            start: Point::default(),
            points: [Point::default(), Point::default()],
        }
    }

    #[test]
    fn what_is_needed_makes_no_part_worse_and_one_clearly_better() {
        let with = crossed([1.0, 1.0]);
        assert!(with.needs(&crossed([1.2, 1.0])));
        assert!(!with.needs(&crossed([1.02, 1.02])));
        assert!(with.needs(&crossed([1.5, 0.99])));
        assert!(!with.needs(&crossed([1.5, 0.8])));
        // Next to nothing is left either way.
        let exact = crossed([4e-4, 4e-4]);
        assert!(!exact.needs(&crossed([9e-4, 9e-4])) && exact.needs(&crossed([9e-4, 1.1e-3])));
    }

    #[test]
    fn what_sensors_may_say_is_beside_every_reading() {
        let found = NamedValue {
            name: "accelerometer_scale".into(),
            value: 0.95,
            unit: "1".into(),
            standard_error: 0.02,
        };
        let cause = Cause { found, stated: 1.0 };
        let named = Weighed {
            causes: Vec::new(),
            effects: vec![("friction".into(), Vec::new())],
            crossed: crossed([1.0, 1.0]),
        };
        let readings = with_and_without(ranked(vec![named], &vec![3.0; 2000]), &cause);
        let [with, without] = &readings[..] else {
            panic!("there are two: {readings:?}");
        };
        assert_eq!((with.causes.len(), without.causes.len()), (1, 0));
        assert_eq!(with.effects, without.effects);
        assert!((with.weight - cause.weight()).abs() < 1e-12);
        assert!((with.weight + without.weight - 1.0).abs() < 1e-12);
        assert_eq!(
            in_words(&readings, &|name| name == "friction"),
            " Perhaps, but not for sure from these data: the accelerometer reads 5 ± 4 % less than the \
             displacement says, with a weight of 0.80."
        );
    }

    #[test]
    fn every_rival_has_the_values_of_its_own_reading() {
        let of = |name: &str, value: f64| Reading {
            causes: Vec::new(),
            effects: vec![(
                name.to_owned(),
                vec![NamedValue {
                    name: "half_width".into(),
                    value,
                    unit: "m".into(),
                    standard_error: 1e-6,
                }],
            )],
            explains: 0.9,
            weight: 0.3,
        };
        let readings = [
            of("bristle_friction", 1.0),
            of("friction", 2.0),
            of("dead_band", 3.0),
        ];
        let value = |rival: &str| instead(&readings, "friction", rival).map(|own| own[0].value);
        assert_eq!(value("bristle_friction"), Some(1.0));
        assert_eq!(value("dead_band"), Some(3.0));
        assert_eq!(value("friction"), None);
        assert_eq!(value("free_play"), None);
    }

    #[test]
    fn the_better_reading_comes_first_and_what_is_not_named_is_said_with_its_weight() {
        let effect = |name: &str| {
            let value = NamedValue {
                name: "half_width".into(),
                value: 1e-4,
                unit: "m".into(),
                standard_error: 1e-6,
            };
            (name.to_owned(), vec![value])
        };
        let of = |names: &[&str], size: f64| Weighed {
            causes: Vec::new(),
            effects: names.iter().map(|name| effect(name)).collect(),
            crossed: crossed([size, size]),
        };
        let all = vec![
            of(&["dead_band"], 1.0),
            of(&["dead_band", "free_play"], 0.99),
        ];
        let readings = ranked(all, &vec![3.0; 2000]);
        assert_eq!(readings[0].effects.len(), 2);
        assert!((readings[0].weight + readings[1].weight - 1.0).abs() < 1e-12);
        assert!((readings[1].explains - 8.0 / 9.0).abs() < 1e-12);
        let said = in_words(&readings, &|name| name == "dead_band");
        assert!(
            said.contains("free play (0.100 ± 0.002 mm), with a weight of 0.55"),
            "{said}"
        );
        assert!(!said.contains("dead band"), "{said}");
    }
}
