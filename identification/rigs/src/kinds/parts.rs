//! A model whose data are cut in two: what the judgement of [`super::diagnosis`] asks of it.

use super::Cause;
use super::named_value::NamedValue;
use diagnosis::{Point, SimulatedModel};

/// Runs into which a part is cut for the check inside it.
const RUNS: usize = 16;
/// Share of the output's variation that a first look must see.
const SEEN: f64 = 0.3;

/// Error over the output's deviation from which on a model has lost the motion.
pub(in crate::kinds) const LOST: f64 = 0.5;

/// The selections of samples that can be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::kinds) enum Part {
    /// What the description fits.
    Fitted = 0,
    /// What it leaves out.
    LeftOut = 1,
}

impl Part {
    /// The other part.
    pub fn other(self) -> Self {
        match self {
            Self::Fitted => Self::LeftOut,
            Self::LeftOut => Self::Fitted,
        }
    }
}

/// The record of all samples.
pub(in crate::kinds) const EVERYTHING: usize = 8;

/// Names of the records before those of the files.
pub(in crate::kinds) const NAMES: [&str; 9] = [
    "fitted",
    "left out",
    "fitted, fold 1",
    "fitted, fold 2",
    "left out, fold 1",
    "left out, fold 2",
    "fitted, first look",
    "left out, first look",
    "everything",
];

/// The record of file `recording` alone.
pub(in crate::kinds) fn file(recording: usize) -> usize {
    NAMES.len() + recording
}

/// The two records that are the halves of `record`.
pub(in crate::kinds) fn folds(record: usize) -> [usize; 2] {
    match record {
        0 | 1 => [2 + 2 * record, 3 + 2 * record],
        // All data are judged by their parts.
        _ => [0, 1],
    }
}

/// The record that stands for `record` where many candidates are looked at.
pub(in crate::kinds) fn screen(record: usize) -> usize {
    if record < 2 { 6 + record } else { record }
}

/// A file: its output, not a number where it was not measured, and what of it is left out.
pub(in crate::kinds) struct File<'a> {
    pub output: &'a [f64],
    pub left_out: &'a [bool],
    /// Samples that are not compared; empty where all are.
    pub is_given: &'a [bool],
}

/// Places of the samples of every record that were measured, by record and file: records 0 and 1
/// are the two parts of the data, 2 to 5 the folds inside each, 6 and 7 the begin of each, of
/// `screened` samples at least, [`EVERYTHING`] both; then follows a record for each file.
pub(in crate::kinds) fn places(files: &[File<'_>], screened: usize) -> Vec<Vec<Vec<usize>>> {
    let mut places = vec![vec![Vec::new(); files.len()]; NAMES.len() + files.len()];
    let is_measured = |one: &File<'_>, k: usize| {
        let is_given = one.is_given.get(k) == Some(&true);
        !is_given && one.output.get(k).is_some_and(|y| y.is_finite())
    };
    for part in 0..2 {
        let mut mine = Vec::new();
        for (s, one) in files.iter().enumerate() {
            let own = one.left_out.iter().enumerate();
            let in_part = own.filter(|(k, out)| usize::from(**out) == part && is_measured(one, *k));
            mine.extend(in_part.map(|(k, _)| (s, k)));
        }
        let output = |(s, k): &(usize, usize)| files[*s].output[*k];
        let mean = mine.iter().map(output).sum::<f64>() / mine.len().max(1) as f64;
        let total: f64 = mine.iter().map(|own| (output(own) - mean).powi(2)).sum();
        let mut seen = 0.0;
        for (i, &(s, k)) in mine.iter().enumerate() {
            places[part][s].push(k);
            places[2 + 2 * part + (i * RUNS / mine.len()) % 2][s].push(k);
            places[EVERYTHING][s].push(k);
            places[file(s)][s].push(k);
            if i < screened || seen < SEEN * total {
                places[6 + part][s].push(k);
            }
            seen += (output(&(s, k)) - mean).powi(2);
        }
    }
    // The parts may alternate in a file.
    for own in places.iter_mut().flatten() {
        own.sort_unstable();
    }
    places
}

/// A model that is fitted to one part of its data and tested on the other; its records are those of
/// [`places`].
pub(in crate::kinds) trait InParts: SimulatedModel {
    /// What is diagnosed.
    fn subject(&self) -> &str;

    /// Its kind.
    fn kind(&self) -> &str;

    /// What is simulated.
    fn output(&self) -> String;

    /// `||y - m|| / ||m - mean||` on the samples of `record`.
    fn normalised_error(&self, point: &Point, record: usize) -> f64;

    /// The same by output, of a model with several.
    fn error_by_output(&self, _point: &Point, _record: usize) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// Nominal parameters at `point` with standard errors, in the order of the nuisance.
    fn parameters(&self, point: &Point, deviations: &[f64]) -> Vec<NamedValue>;

    /// Stated value and standard deviation of the nominal parameter `i` of those.
    fn stated(&self, i: usize) -> (f64, f64);

    /// Whether another value of that parameter is a cause of its own, such as another scale.
    fn is_cause(&self, _i: usize) -> bool {
        false
    }

    /// Whether that parameter is of the first file, and others have their own.
    fn is_of_first_file(&self, _i: usize) -> bool {
        false
    }

    /// `point` with that parameter at `value`; none where it is no cause.
    fn at(&self, _point: &Point, _i: usize, _value: f64) -> Option<Point> {
        None
    }

    /// The same model with that parameter held at `value`; none where it is no cause.
    fn pinned(&self, _i: usize, _value: f64) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// The model at `point` without the nominal parameter `i`; none where it cannot do without, or is.
    fn without(&self, _point: &Point, _i: usize) -> Option<Point> {
        None
    }

    /// `point` with the nominal parameters as stated: where they make up for each other, a fit that went the wrong way
    /// does not come back.
    fn as_stated(&self, point: &Point) -> Point {
        point.clone()
    }

    /// `point` with the nominal parameters as stated that vanished, from where no fit comes back, and with those
    /// that are causes of their own.
    fn restored(&self, point: &Point) -> Point {
        point.clone()
    }

    /// Sensors that contradict each other, or what was stated.
    fn contradictions(&self) -> Vec<Cause> {
        Vec::new()
    }

    /// Whether sensors alone tell the nominal parameter `name`.
    fn is_read(&self, _name: &str) -> bool {
        false
    }

    /// The name of a candidate.
    fn name(&self, candidate: usize) -> String {
        self.candidates()
            .get(candidate)
            .map_or_else(String::new, |one| one.effect.to_owned())
    }

    /// The unit of a candidate's parameter.
    fn unit(&self, candidate: usize, parameter: usize) -> String {
        let own = self.candidates().get(candidate);
        own.and_then(|one| one.parameters.get(parameter))
            .map_or_else(String::new, |one| one.unit.to_owned())
    }

    /// Whether the data cannot tell candidate `one` from `other`, so that they confirm each other.
    fn are_alike(&self, one: usize, other: usize) -> bool {
        let (one, other) = (&self.candidates()[one], &self.candidates()[other]);
        one.effect == other.effect || one.look_alikes.contains(&other.effect)
    }

    /// The stated values.
    fn origin(&self) -> Point {
        Point {
            nuisance: vec![0.0; self.nuisance()],
            effects: Vec::new(),
        }
    }

    /// The candidate of that name.
    fn index(&self, name: &str) -> Option<usize> {
        (0..self.candidates().len()).find(|&i| self.name(i) == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file whose first half is fitted, at rest for 20 samples and then at 1 and -1 in turn, and one that is left
    /// out, with a gap and a sample that is given.
    #[test]
    fn records_are_the_parts_their_folds_and_begins_everything_and_each_file() {
        let first: Vec<f64> = (0..160)
            .map(|k| match k {
                0..20 => 0.0,
                _ if k % 2 == 0 => 1.0,
                _ => -1.0,
            })
            .collect();
        let mut second = vec![0.5; 32];
        second[3] = f64::NAN;
        let is_given: Vec<bool> = (0..32).map(|k| k == 7).collect();
        let is_out: Vec<bool> = (0..160).map(|k| k >= 80).collect();
        let files = [
            File {
                output: &first,
                left_out: &is_out,
                is_given: &[],
            },
            File {
                output: &second,
                left_out: &[true; 32],
                is_given: &is_given,
            },
        ];
        let all = places(&files, 8);
        assert_eq!(all.len(), 11);
        let measured: Vec<usize> = (0..32).filter(|k| ![3, 7].contains(k)).collect();
        let whole: Vec<usize> = (0..160).collect();
        assert_eq!(all[0], [whole[..80].to_vec(), Vec::new()]);
        assert_eq!(all[1], [whole[80..].to_vec(), measured.clone()]);
        assert_eq!(all[EVERYTHING], [whole.clone(), measured.clone()]);
        assert_eq!(all[file(0)], [whole.clone(), Vec::new()]);
        assert_eq!(all[file(1)], [Vec::new(), measured]);
        // Sixteen runs of five, which the folds take in turn.
        for (fold, first_run) in folds(0).into_iter().zip([0, 1]) {
            let own = whole[..80].iter().copied();
            let own = own.filter(|k| k / 5 % 2 == first_run);
            assert_eq!(all[fold][0], own.collect::<Vec<_>>(), "{}", NAMES[fold]);
        }
        let mut both = folds(1).map(|fold| all[fold].concat()).concat();
        both.sort_unstable();
        let mut whole_part = all[1].concat();
        whole_part.sort_unstable();
        assert_eq!(both, whole_part);
        assert_eq!((folds(EVERYTHING), folds(file(1))), ([0, 1], [0, 1]));
        // A first look lasts until 0.3 of the variation was seen, 18 of 60 samples, or for so many samples.
        assert_eq!(all[screen(0)][0], whole[..38]);
        assert_eq!(places(&files, 50)[screen(0)][0], whole[..50]);
        assert_eq!(screen(EVERYTHING), EVERYTHING);
    }
}
