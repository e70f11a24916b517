//! The answer in words.

use super::cause::{Cause, effect_in_words, in_own_words, joined, undetermined};
use super::diagnosis::RigDiagnosis;
use super::named_value::NamedValue;
use super::part_report::confidence;
use super::readings::{in_words, instead};
use diagnosis::Verdict;

/// Share of the squared error beyond which what is explained is all of it.
const ALL: f64 = 0.98;

impl RigDiagnosis {
    /// What the reader should know beside the verdict, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let aside = self.set_aside.iter();
        let aside = aside.map(|one| format!("`{}` is not named: {}", one.effect, one.reason));
        aside
            .chain(self.findings.iter().cloned())
            .chain(undetermined(&self.confirmed.effects))
            .collect()
    }

    /// What was found, in a sentence, and what else the data may mean.
    pub fn sentence(&self) -> String {
        let is_named = |name: &str| {
            let mut effects = self.confirmed.effects.iter();
            self.causes.iter().any(|own| own.found.name == name)
                || effects.any(|(own, _)| {
                    own == name || self.instead_of(own).any(|(rival, _)| rival == name)
                })
        };
        self.named_in_words() + &in_words(&self.readings, &is_named)
    }

    /// How sure the parts are of `named`, or of an effect that records cannot tell from it. Where neither part
    /// proposes one, as sure as its first value is of not being zero.
    pub(crate) fn confidence_and_share(
        &self,
        (named, values): &(String, Vec<NamedValue>),
    ) -> (f64, Option<f64>) {
        let parts = [&self.as_described, &self.swapped];
        let of = |name: &str| {
            let mut all = parts.iter().flat_map(|part| &part.effects);
            all.find(|one| one.effect == name)
        };
        let own = of(named).or_else(|| self.rivals_of(named).find_map(of));
        if let Some(own) = own {
            return (own.confidence, Some(own.share));
        }
        let first = values.first();
        let deviate = first.map_or(0.0, |own| (own.value / own.standard_error).abs());
        (confidence(deviate), None)
    }

    /// Effects that records cannot tell from `named`, with their parameters.
    fn instead_of(&self, named: &str) -> impl Iterator<Item = (&str, &[NamedValue])> {
        self.rivals_of(named).filter_map(move |rival| {
            let values = instead(&self.readings, named, rival)?;
            Some((rival, values))
        })
    }

    /// The names of what does nearly as well in the place of `named`.
    fn rivals_of(&self, named: &str) -> impl Iterator<Item = &str> {
        let rivals = self.as_described.rivals.iter();
        let own = rivals.filter(move |(_, against)| against == named);
        own.map(|(rival, _)| rival.as_str())
    }

    fn causes_in_words(&self) -> Vec<String> {
        let causes = self.causes.iter();
        let words = causes.map(|own| match own.or(&self.confirmed.parameters) {
            Some((_, other)) => format!("{} or {other}", own.words()),
            None => own.words(),
        });
        words.collect()
    }

    /// The named effects, each `with_values`, after what shows them.
    fn shown_in_words(&self, with_values: Vec<String>) -> Vec<String> {
        let names = self.confirmed.effects.iter().map(|(name, _)| name);
        let (one, every): (Vec<_>, Vec<_>) = names
            .zip(with_values)
            .partition(|(name, _)| self.confirmed.on_one_part.contains(name));
        let said = |begin: &str, all: Vec<(&String, String)>| {
            let all: Vec<String> = all.into_iter().map(|(_, words)| words).collect();
            (!all.is_empty()).then(|| format!("{begin} {}", joined(&all)))
        };
        let every = said("every part of the data shows", every);
        let one = said(
            "one part of the data, the other not reaching it, shows",
            one,
        );
        every.into_iter().chain(one).collect()
    }

    fn named_in_words(&self) -> String {
        let effects = self.confirmed.effects.iter();
        let with_values: Vec<String> = effects
            .map(|(name, values)| {
                let own = match self.sentences.get(name) {
                    Some(sentence) => in_own_words(sentence, values),
                    None => effect_in_words(name, values),
                };
                let others = self.instead_of(name);
                others.fold(own, |all, (rival, values)| {
                    format!("{all} or {}", effect_in_words(rival, values))
                })
            })
            .collect();
        let shown = self.shown_in_words(with_values);
        let part = &self.as_described;
        let falls = format!(
            "the error of {} on the held-out data falls from {:.1} to {:.1} %",
            self.output,
            100.0 * part.nominal_error,
            100.0 * self.confirmed.error
        );
        let name = &self.name;
        match self.verdict {
            Verdict::Adequate => format!(
                "{name}: the nominal model is adequate; refitted{}, its error of {} on the \
                 held-out data is {:.1} %.",
                if self.findings.is_empty() {
                    " within its uncertainty"
                } else {
                    ""
                },
                self.output,
                100.0 * part.refitted_error
            ),
            Verdict::Named => {
                let mut all = self.causes_in_words();
                all.extend(shown);
                let is_modelled = |own: &Cause| {
                    let mut parameters = self.confirmed.parameters.iter();
                    parameters.any(|p| p.name == own.found.name)
                };
                if self.confirmed.effects.is_empty() && !self.causes.iter().any(is_modelled) {
                    return format!(
                        "{name}: {}; the refitted model does not depend on it, and its error of {} on the held-out \
                         data is {:.1} %.",
                        joined(&all),
                        self.output,
                        100.0 * self.confirmed.error
                    );
                }
                let left = 1.0 - self.unexplained;
                let count = self.causes.len() + self.confirmed.effects.len();
                let share = match (count, left > ALL) {
                    _ if left <= 0.0 => {
                        return format!(
                            "{name}: {}; the error of {} on the held-out data, {:.1} %, is not theirs.",
                            joined(&all),
                            self.output,
                            100.0 * part.nominal_error
                        );
                    }
                    (1, true) => "that is all of the error".to_owned(),
                    (_, true) => "together they are all of the error".to_owned(),
                    (1, _) => format!("it explains {:.0} % of the squared error", 100.0 * left),
                    (..) => format!("they explain {:.0} % of the squared error", 100.0 * left),
                };
                format!("{name}: {}; {share}; {falls}.", joined(&all))
            }
            Verdict::Ambiguous => {
                let causes = self.causes_in_words();
                let causes = match causes.as_slice() {
                    [] => String::new(),
                    some => format!("{}; ", joined(some)),
                };
                let mut rivals: Vec<String> = Vec::new();
                for (own, _) in &self.confirmed.effects {
                    let is_shown =
                        |rival: &str| self.instead_of(own).any(|(shown, _)| shown == rival);
                    let all = self.rivals_of(own).filter(|rival| !is_shown(rival));
                    let all: Vec<&str> = all.collect();
                    if !all.is_empty() {
                        rivals.push(format!("{} instead of {own}", all.join(" or ")));
                    }
                }
                let nearly = match rivals.as_slice() {
                    [] => String::new(),
                    some => format!(", and {} explains it nearly as well", joined(some)),
                };
                let nearly = nearly.replace('_', " ");
                format!("{name}: {causes}{}{nearly}; {falls}.", shown.join(" and "))
            }
            Verdict::Unexplained if part.effects.is_empty() && self.swapped.effects.is_empty() => {
                format!(
                    "{name}: no effect improves the model, and the nominal model is not adequate: \
                     refitted, its error of {} \
                     on the held-out data is {:.1} %.",
                    self.output,
                    100.0 * part.refitted_error
                )
            }
            Verdict::TooSmall | Verdict::Unexplained => {
                let one = if part.effects.is_empty() {
                    &self.swapped
                } else {
                    part
                };
                let own = one.effects.iter();
                let own: Vec<String> = own
                    .map(|own| effect_in_words(&own.effect, &own.parameters))
                    .collect();
                format!(
                    "{name}: no effect is shown by every part of the data and improves the model on \
                     all of them; with {} of one part, the error of {} on the other falls from {:.1} to {:.1} %.",
                    joined(&own),
                    self.output,
                    100.0 * one.nominal_error,
                    100.0 * one.extended_error
                )
            }
        }
    }
}
