//! What one part of the data says, tested on the other.

use serde::{Deserialize, Serialize};

use super::confirmed::{effects as named_values, unfit};
use super::named_value::NamedValue;
use super::parts::{InParts, Part};
use crate::report::ends_or_not_a_number;
use diagnosis::resampling::gain_interval;
use diagnosis::{Point, Selected, all_errors, completed, squares};

/// Why an effect is not named that does not help to predict the other part.
pub(super) const UNUSED: &str = "the prediction of the other part is better without it";

/// An effect that one part of the data asks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartEffect {
    /// Its name.
    pub effect: String,
    /// Its parameters.
    pub parameters: Vec<NamedValue>,
    /// Probability that its gain on unseen data is not due to chance, with correlated samples
    /// counted once.
    pub confidence: f64,
    /// By how much the squared error on the data not fitted grows without it (all else refitted),
    /// as a share of the nominal model's.
    pub share: f64,
    /// Why it is nevertheless not named: it is at its bound, its interval contains zero, or the
    /// other part is predicted worse with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub objection: Option<String>,
}

/// What one part of the data says, tested on the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartReport {
    /// Normalised error of the nominal model on the data not fitted.
    pub nominal_error: f64,
    /// With its parameters refitted.
    pub refitted_error: f64,
    /// Extended, on the data not fitted.
    pub extended_error: f64,
    /// Extended, on the fitted data.
    pub fitted_error: f64,
    /// 95 % interval of the share of the refitted model's squared error that the effects explain
    /// on the data not fitted.
    #[serde(deserialize_with = "ends_or_not_a_number")]
    pub gain_interval: (f64, f64),
    /// Nominal parameters as refitted.
    pub parameters: Vec<NamedValue>,
    /// The effects.
    pub effects: Vec<PartEffect>,
    /// Share of the nominal model's squared error on the data not fitted that the extended model
    /// explains.
    pub explained: f64,
    /// Pairs of an effect that nearly did as well and the one that was taken.
    pub rivals: Vec<(String, String)>,
    /// Where the extended model is.
    #[serde(skip)]
    pub(super) point: Point,
}

/// What the fits `selected` on one part say.
pub(super) fn part_report<M: InParts>(
    measured: &M,
    fitted: Part,
    selected: &Selected,
) -> PartReport {
    let (own, tested) = (fitted as usize, fitted.other() as usize);
    // What belongs to a file and not to the rig is fitted there, for every model alike.
    let on_tested = |point: &Point| completed(measured, point, Some(own), tested);
    let origin = completed(measured, &measured.origin(), None, tested);
    let before = squares(&all_errors(measured, &origin, tested));
    let nominal = on_tested(&selected.nominal.point);
    let point = on_tested(&selected.extended.point);
    let refitted = all_errors(measured, &nominal, tested);
    let extended = all_errors(measured, &point, tested);
    let after = squares(&extended);
    let found = &selected.extended.point;
    let objections = unfit(measured, found, &selected.deviations, own);
    let mut effects = Vec::new();
    for (i, (effect, parameters)) in named_values(measured, found, &selected.deviations)
        .into_iter()
        .enumerate()
    {
        let without = on_tested(&selected.without[i].point);
        let without = squares(&all_errors(measured, &without, tested));
        let share = (without - after) / before;
        let objection = objections
            .iter()
            .find(|(index, _)| *index == found.effects[i].0)
            .map(|(_, reason)| reason.clone());
        let negative = || UNUSED.to_owned();
        effects.push(PartEffect {
            effect,
            parameters,
            confidence: confidence(selected.deviates[i]),
            share,
            objection: objection.or_else(|| (share <= 0.0).then(negative)),
        });
    }
    let name = |i: usize| measured.name(i);
    PartReport {
        nominal_error: measured.normalised_error(&origin, tested),
        refitted_error: measured.normalised_error(&nominal, tested),
        extended_error: measured.normalised_error(&point, tested),
        fitted_error: measured.normalised_error(found, own),
        gain_interval: gain_interval(&refitted, &extended),
        parameters: measured.parameters(found, &selected.deviations),
        effects,
        explained: 1.0 - after / before,
        rivals: selected
            .rivals
            .iter()
            .map(|r| (name(r.effect), name(r.against)))
            .collect(),
        point: found.clone(),
    }
}

/// Pairs of a rival and the effect that was taken, as told by the first of `parts` that asks for the effect.
pub(super) fn rivals([first, second]: [&PartReport; 2]) -> Vec<(String, String)> {
    let asks = |effect: &str| first.effects.iter().any(|own| own.effect == effect);
    let more = second.rivals.iter().filter(|(_, against)| !asks(against));
    first.rivals.iter().chain(more).cloned().collect()
}

/// Probability below `deviate` of Student's distribution with four degrees of freedom: two folds of two
/// parts tell how far it may be off, so that no confidence is that of a normal tail.
pub(super) fn confidence(deviate: f64) -> f64 {
    // What is not known is as likely as not.
    let square = (4.0 / (1.0 + 4.0 / (deviate * deviate))).max(0.0);
    0.5 + 0.375 * square.sqrt().copysign(deviate) * (1.0 - square / 12.0)
}

#[cfg(test)]
mod tests {
    use super::{PartEffect, PartReport, Point, confidence, rivals};

    fn part(effects: &[&str], rivals: &[(&str, &str)]) -> PartReport {
        let effect = |name: &&str| PartEffect {
            effect: (*name).into(),
            parameters: Vec::new(),
            confidence: 1.0,
            share: 0.1,
            objection: None,
        };
        let rivals = rivals.iter();
        PartReport {
            nominal_error: 0.1,
            refitted_error: 0.1,
            extended_error: 0.01,
            fitted_error: 0.01,
            gain_interval: (0.9, 1.0),
            parameters: Vec::new(),
            effects: effects.iter().map(effect).collect(),
            explained: 0.9,
            rivals: rivals.map(|(a, b)| ((*a).into(), (*b).into())).collect(),
            point: Point::default(),
        }
    }

    #[test]
    fn the_first_part_that_asks_for_an_effect_tells_its_rivals() {
        let first = part(&["delay"], &[("valve_lag", "delay")]);
        let second = part(
            &["delay", "free_play"],
            &[("friction", "free_play"), ("dead_band", "delay")],
        );
        let pairs = |parts| rivals(parts).into_iter();
        let names: Vec<String> = pairs([&first, &second]).map(|(rival, _)| rival).collect();
        assert_eq!(names, ["valve_lag", "friction"]);
        let names: Vec<String> = pairs([&second, &first]).map(|(rival, _)| rival).collect();
        assert_eq!(names, ["friction", "dead_band"]);
    }

    /// Quantiles of Student's distribution with four degrees of freedom, from printed tables.
    #[test]
    fn a_confidence_is_that_of_four_degrees_of_freedom() {
        for (deviate, below) in [
            (-2.1318, 0.05),
            (0.0, 0.5),
            (0.7407, 0.75),
            (2.7764, 0.975),
            (f64::INFINITY, 1.0),
            (f64::NAN, 0.5),
        ] {
            let found = confidence(deviate);
            assert!((found - below).abs() < 1e-5, "{found} at {deviate}");
        }
    }
}
