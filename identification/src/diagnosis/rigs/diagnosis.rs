//! The diagnosis of a rig on real data.

use serde::{Deserialize, Serialize};

use super::super::report::{ends_or_not_a_number, or_not_a_number};
use super::measured::{Measured, Part};
use super::{Description, DescriptionError, Measurement};
use crate::diagnosis::engine::resampling::gain_interval;
use crate::diagnosis::engine::{
    ExtensibleModel, Observer, Point, Progress, Selected, SimulatedModel, Verdict, estimates,
    select,
};

/// A parameter of the extended model, SI.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedValue {
    /// Its name.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// SI unit.
    pub unit: String,
    /// One standard deviation, autocorrelation of the residuals counted.
    #[serde(deserialize_with = "or_not_a_number")]
    pub standard_error: f64,
}

/// An effect that one part of the data asks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PartEffect {
    /// Its name.
    pub effect: String,
    /// Its parameters.
    pub parameters: Vec<NamedValue>,
    /// Probability that its gain on unseen data is no chance, correlated samples counted once.
    pub confidence: f64,
    /// By how much the squared error on the data not fitted grows without it (all else refitted),
    /// as a share of the nominal model's.
    pub share: f64,
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
    /// 95 % interval of the share of the refitted model's squared error that the effects take away
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

/// The diagnosis of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigDiagnosis {
    /// The rig.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// What is simulated.
    pub output: String,
    /// The verdict.
    pub verdict: Verdict,
    /// Effects that both parts of the data name.
    pub named: Vec<String>,
    /// Effects that only one part names.
    pub not_confirmed: Vec<String>,
    /// Fitted as described, tested on what is left out.
    pub as_described: PartReport,
    /// Fitted on what is left out, tested on the rest.
    pub swapped: PartReport,
    /// Share of the squared error on the data left out that stays unexplained.
    pub unexplained: f64,
}

/// Diagnoses a rig on its measurements.
///
/// # Errors
/// When the description does not fit the rig, or the nominal model cannot be simulated.
pub fn diagnose(
    description: &Description,
    measurement: &Measurement,
    observer: Observer<'_>,
) -> Result<RigDiagnosis, DescriptionError> {
    let rig = description.rig()?;
    let nominal = description.nominal(rig)?;
    let measured = Measured::new(rig, measurement, nominal);
    let part = |fitted: Part| -> Result<PartReport, DescriptionError> {
        let record = fitted as usize;
        observer.tell(|| Progress::Fitting(measured.record_name(record).to_owned()));
        let selected =
            select(&measured, record, observer).ok_or_else(|| DescriptionError::Description {
                path: description.path.clone(),
                what: "the nominal model gives no finite output on these data".to_owned(),
            })?;
        Ok(part_report(&measured, fitted, &selected))
    };
    let as_described = part(Part::Fitted)?;
    let swapped = part(Part::LeftOut)?;
    let list = |part: &PartReport| -> Vec<String> {
        part.effects
            .iter()
            .map(|effect| effect.effect.clone())
            .collect()
    };
    let (here, there) = (list(&as_described), list(&swapped));
    // Effects that records of a rig cannot tell apart confirm each other.
    let alike = |name: &str, other: &str| {
        name == other
            || measured
                .candidates()
                .iter()
                .any(|c| c.effect == name && c.look_alikes.contains(&other))
    };
    let in_both = |name: &String, others: &[String]| others.iter().any(|other| alike(name, other));
    let named: Vec<String> = here
        .iter()
        .filter(|name| in_both(name, &there))
        .map(|name| match there.iter().find(|other| alike(name, other)) {
            Some(other) if other != name => format!("{name} or {other}"),
            _ => name.clone(),
        })
        .collect();
    let only = here.iter().filter(|name| !in_both(name, &there));
    let not_confirmed: Vec<String> = only
        .chain(there.iter().filter(|name| !in_both(name, &here)))
        .cloned()
        .collect();
    let pays = as_described.gain_interval.0 > 0.0 && swapped.gain_interval.0 > 0.0;
    let rivalled = as_described
        .rivals
        .iter()
        .any(|(rival, against)| named.contains(against) && !alike(against, rival));
    let verdict = match (
        here.is_empty() && there.is_empty(),
        named.is_empty() || !pays,
        rivalled,
    ) {
        (true, ..) => Verdict::Adequate,
        (_, true, _) => Verdict::Unexplained,
        (_, _, true) => Verdict::Ambiguous,
        _ => Verdict::Named,
    };
    Ok(RigDiagnosis {
        name: description.name.clone(),
        kind: description.kind.clone(),
        output: rig.output().name().to_owned(),
        verdict,
        named,
        not_confirmed,
        unexplained: 1.0 - as_described.explained,
        as_described,
        swapped,
    })
}

fn part_report(measured: &Measured<'_>, fitted: Part, selected: &Selected) -> PartReport {
    let tested = fitted.other() as usize;
    let squares = |errors: &[f64]| errors.iter().map(|e| e * e).sum::<f64>();
    let origin = Point {
        nuisance: vec![0.0; measured.nuisance()],
        effects: Vec::new(),
    };
    let before = squares(&measured.errors(&origin, tested));
    let refitted = measured.errors(&selected.nominal.point, tested);
    let extended = measured.errors(&selected.extended.point, tested);
    let after = squares(&extended);
    let point = &selected.extended.point;
    let mut effects = Vec::new();
    for (i, named) in estimates(measured, point, &selected.deviations)
        .into_iter()
        .enumerate()
    {
        let without = squares(&measured.errors(&selected.without[i].point, tested));
        effects.push(PartEffect {
            effect: named.effect.to_owned(),
            parameters: named
                .parameters
                .into_iter()
                .map(|p| NamedValue {
                    name: p.name,
                    value: p.value,
                    unit: p.unit.to_owned(),
                    standard_error: p.standard_error,
                })
                .collect(),
            confidence: normal(selected.deviates[i]),
            share: (without - after) / before,
        });
    }
    let name = |i: usize| measured.candidates()[i].effect.to_owned();
    PartReport {
        nominal_error: measured.normalised_error(&origin, tested),
        refitted_error: measured.normalised_error(&selected.nominal.point, tested),
        extended_error: measured.normalised_error(point, tested),
        fitted_error: measured.normalised_error(point, fitted as usize),
        gain_interval: gain_interval(&refitted, &extended),
        parameters: parameters(measured, point, &selected.deviations),
        effects,
        explained: 1.0 - after / before,
        rivals: selected
            .rivals
            .iter()
            .map(|r| (name(r.effect), name(r.against)))
            .collect(),
        point: point.clone(),
    }
}

/// Probability below `deviate` of the normal distribution (Zelen and Severo 1964, 26.2.17 in
/// Abramowitz and Stegun; error below 1e-7), for positive deviates.
fn normal(deviate: f64) -> f64 {
    let x = deviate.abs();
    let t = 1.0 / (1.0 + 0.231_641_9 * x);
    let series = [
        0.319_381_530,
        -0.356_563_782,
        1.781_477_937,
        -1.821_255_978,
        1.330_274_429,
    ];
    let sum = series.iter().rev().fold(0.0, |sum, c| (sum + c) * t);
    let above = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt() * sum;
    if deviate < 0.0 { above } else { 1.0 - above }
}

fn parameters(measured: &Measured<'_>, point: &Point, deviations: &[f64]) -> Vec<NamedValue> {
    let values = measured.nominal_values(point);
    let names = measured.uncertain_names();
    let known = measured.rig.parameters();
    names
        .iter()
        .enumerate()
        .filter_map(|(i, name)| {
            let place = known.iter().position(|(k, _)| k == name)?;
            let mut moved = point.clone();
            moved.nuisance[i] += deviations.get(i).copied().unwrap_or(0.0);
            Some(NamedValue {
                name: (*name).to_owned(),
                value: values[place],
                unit: known[place].1.to_owned(),
                standard_error: (measured.nominal_values(&moved)[place] - values[place]).abs(),
            })
        })
        .collect()
}

impl RigDiagnosis {
    /// What was found, in a sentence.
    pub fn sentence(&self) -> String {
        let listed = |names: &[String]| names.join(", ").replace('_', " ");
        let part = &self.as_described;
        let falls = format!(
            "the error of {} on the data left out falls from {:.1} to {:.1} %",
            self.output,
            100.0 * part.nominal_error,
            100.0 * part.extended_error
        );
        let name = &self.name;
        match self.verdict {
            Verdict::Adequate => format!(
                "{name}: the nominal model is adequate; refitted within its uncertainty, its error \
                 of {} on the data left out is {:.1} %.",
                self.output,
                100.0 * part.refitted_error
            ),
            Verdict::Named => format!(
                "{name}: every part of the data names {}; {falls}.",
                listed(&self.named)
            ),
            Verdict::Ambiguous => {
                let rivals = part.rivals.iter();
                let rivals: Vec<String> = rivals
                    .map(|(rival, against)| format!("{rival} in the place of {against}"))
                    .collect();
                format!(
                    "{name}: every part of the data names {}, and {} would do nearly as well; \
                     {falls}.",
                    listed(&self.named),
                    listed(&rivals)
                )
            }
            Verdict::Unexplained => format!(
                "{name}: no effect is named by every part of the data and pays on all of them; with \
                 what one part asks for, {falls}."
            ),
        }
    }
}
