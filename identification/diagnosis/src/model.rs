//! What the engine knows of a rig: parameters, candidates, whitened residuals.

use std::ops::Range;

/// A rig with records, as the engine sees it. A new rig is one implementation of this.
pub trait ExtensibleModel: Sync {
    /// What stays fixed while derivatives are taken (a predictor's gain).
    type Predictor: Send + Sync;

    /// Number of uncertain nominal parameters; each is counted in its own standard deviations.
    fn nuisance(&self) -> usize;

    /// The catalogue.
    fn candidates(&self) -> &[Candidate];

    /// Number of records.
    fn records(&self) -> usize;

    /// Name of a record.
    fn record_name(&self, record: usize) -> &str;

    /// Names of the channels, in the order of their residuals within a sample.
    fn channels(&self) -> &[&'static str];

    /// Functions of command and state that a wrong model leaves traces of, each with its name,
    /// one value a sample.
    fn regressors(&self, record: usize) -> Vec<(String, Vec<f64>)>;

    /// Share of the sampling rate below which the noise of a sensor is the drift of its zero, of which one record
    /// says little of another's.
    fn drifts_below(&self) -> f64 {
        0.0
    }

    /// The same rig with the noises that fit `residuals`, those of `records` after one another at
    /// `point`; none where they cannot be learned.
    fn with_learned_noise(
        &self,
        point: &Point,
        residuals: &[f64],
        records: &[usize],
    ) -> Option<Lesson<Self>>
    where
        Self: Sized;

    /// The same rig with a predictor that follows the records less closely, if it has a choice. A true effect
    /// keeps its size then; one that only mends a wrong noise does not.
    fn following_less(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// Whether its noises are no louder than is usual. Where they are, behaviour that the model lacks may be
    /// mistaken for them.
    fn is_usual(&self) -> bool {
        true
    }

    /// Whether its noises are those of `other`.
    fn has_noises_of(&self, _other: &Self) -> bool {
        false
    }

    /// What the noises cost that were learned beyond those assumed, in units of `2 log` likelihood: a
    /// coloured noise competes with every effect that resembles it.
    fn noise_price(&self) -> f64 {
        0.0
    }

    /// Records of `among` in which an effect hardly shows that grows with the motion: those of low level,
    /// and those from before an effect.
    fn quiet_records(&self, among: &[usize]) -> Vec<usize>;

    /// Length of a record's residual vector.
    fn residual_count(&self, record: usize) -> usize;

    /// Samples over which [`Self::log_determinant`] counts.
    fn sample_count(&self, record: usize) -> usize;

    /// The predictor for `point`, or nothing where the model cannot be simulated there.
    fn predictor(&self, point: &Point) -> Option<Self::Predictor>;

    /// Logarithm of the determinant of the innovations' covariance, per sample.
    fn log_determinant(&self, predictor: &Self::Predictor) -> f64;

    /// Whitened residuals of `record` at `point` into `out`; false where they are not finite.
    fn residuals(
        &self,
        predictor: &Self::Predictor,
        point: &Point,
        record: usize,
        out: &mut [f64],
    ) -> bool;
}

/// A model whose noises were learned from records.
pub struct Lesson<M> {
    /// It.
    pub model: M,
    /// By how much they lower twice the negative log likelihood.
    pub gain: f64,
    /// False where a sensor would be far louder than stated: a wrong model looks like that.
    pub is_believable: bool,
    /// What was learned, by name.
    pub figures: Vec<(&'static str, f64)>,
}

/// Share of its range within which a parameter is at its bound.
const AT_BOUND: f64 = 1e-3;

/// Values of everything that can be estimated.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Point {
    /// Deviations of the nominal parameters, in their standard deviations.
    pub nuisance: Vec<f64>,
    /// Accepted effects: index of the candidate and its internal coordinates.
    pub effects: Vec<(usize, Vec<f64>)>,
}

/// How a parameter is counted inside the engine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// The value itself over a unit.
    Linear(f64),
    /// The logarithm of one plus the value, over a unit: a change by a factor, which then adds to
    /// that of an uncertain parameter.
    Factor(f64),
    /// The value's logarithm.
    Logarithmic,
    /// One over the value, in units of one over this; zero is off.
    Inverse(f64),
}

impl Scale {
    /// Internal coordinate of `value`.
    pub fn to_internal(self, value: f64) -> f64 {
        match self {
            Self::Linear(unit) => value / unit,
            Self::Factor(unit) => value.ln_1p() / unit,
            Self::Logarithmic => value.ln(),
            Self::Inverse(unit) => unit / value,
        }
    }

    /// Value of an internal coordinate.
    pub fn to_value(self, internal: f64) -> f64 {
        match self {
            Self::Linear(unit) => internal * unit,
            Self::Factor(unit) => (internal * unit).exp_m1(),
            Self::Logarithmic => internal.exp(),
            Self::Inverse(unit) => unit / internal,
        }
    }

    /// Derivative of the value by the internal coordinate.
    pub fn slope(self, internal: f64) -> f64 {
        match self {
            Self::Linear(unit) => unit,
            Self::Factor(unit) => unit * (internal * unit).exp(),
            Self::Logarithmic => internal.exp(),
            Self::Inverse(unit) => -unit / (internal * internal),
        }
    }
}

/// What a parameter tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// How strong the effect is; counts against the engineering floor `weak` (SI).
    Size {
        /// The weakest value of the catalogue.
        weak: f64,
    },
    /// A detail of its form, known to `spread` (internal units) about `typical` (SI).
    Shape {
        /// The usual value.
        typical: f64,
        /// One standard deviation of the internal coordinate.
        spread: f64,
    },
}

/// One parameter of a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectParameter {
    /// Its name in the catalogue.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// How it is counted.
    pub scale: Scale,
    /// What it tells.
    pub role: Role,
    /// Smallest and largest value that is tried (SI).
    pub bounds: (f64, f64),
}

impl EffectParameter {
    /// Whether it is a size that can be nothing: a logarithm has no zero.
    pub(crate) fn has_zero(&self) -> bool {
        matches!(self.role, Role::Size { .. }) && self.scale != Scale::Logarithmic
    }

    /// One of ten either way.
    #[cfg(test)]
    pub(crate) const fn example(scale: Scale, role: Role) -> Self {
        Self {
            name: "size",
            unit: "N",
            scale,
            role,
            bounds: (-10.0, 10.0),
        }
    }
}

#[cfg(test)]
impl Role {
    pub(crate) const SIZE: Self = Self::Size { weak: 0.1 };
    pub(crate) const SHAPE: Self = Self::Shape {
        typical: 1.0,
        spread: 0.5,
    };
}

/// One effect of the catalogue.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its name in the catalogue.
    pub effect: &'static str,
    /// Its parameters.
    pub parameters: Vec<EffectParameter>,
    /// Values (SI) from which fits begin.
    pub starts: Vec<Vec<f64>>,
    /// Effects that one record often cannot tell from this one.
    pub look_alikes: &'static [&'static str],
    /// How much larger than usual the traces may be that the right model with this effect leaves.
    pub tolerance: f64,
    /// Effect that this one holds as a special case.
    pub contains: Option<&'static str>,
    /// Law whose form it changes, empty where that is its own: effects of one law make up for each other's form.
    pub law: &'static str,
    /// Whether it changes the linear part of the rig, through which the noises pass as well: a noise of
    /// another form than was learned looks like a little of it.
    pub is_linear: bool,
}

impl Candidate {
    /// An effect on a law of its own that looks like no other, with values (SI) from which fits begin.
    pub const fn new(
        effect: &'static str,
        parameters: Vec<EffectParameter>,
        starts: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            effect,
            parameters,
            starts,
            look_alikes: &[],
            tolerance: 1.0,
            contains: None,
            law: "",
            is_linear: false,
        }
    }

    /// Values (SI) of internal coordinates.
    pub fn values(&self, internal: &[f64]) -> Vec<f64> {
        let pairs = self.parameters.iter().zip(internal);
        pairs.map(|(p, &q)| p.scale.to_value(q)).collect()
    }

    /// Internal coordinates of values (SI).
    pub fn internal(&self, values: &[f64]) -> Vec<f64> {
        let pairs = self.parameters.iter().zip(values);
        pairs.map(|(p, &v)| p.scale.to_internal(v)).collect()
    }

    /// Internal coordinates of a weak effect of the form of `start`: functions of the share of the
    /// catalogue's weakest value.
    pub fn nearly_off(&self, start: &[f64]) -> Vec<impl Fn(f64) -> f64> {
        let pairs = self.parameters.iter().zip(start);
        pairs
            .map(|(p, &value)| {
                let (full, shrinks) = match (p.role, p.scale) {
                    (Role::Size { weak }, Scale::Linear(_) | Scale::Factor(_)) => {
                        (p.scale.to_internal(weak), true)
                    }
                    (Role::Size { weak }, Scale::Inverse(_)) => {
                        // Not past the bound where the effect is off.
                        (p.scale.to_internal(weak.max(0.9 * p.bounds.1)), false)
                    }
                    (Role::Size { .. }, Scale::Logarithmic) | (Role::Shape { .. }, _) => {
                        (p.scale.to_internal(value), false)
                    }
                };
                move |share| if shrinks { share * full } else { full }
            })
            .collect()
    }

    /// The first size among internal coordinates that is at a bound other than zero.
    pub fn bound(&self, internal: &[f64]) -> Option<&EffectParameter> {
        let mut pairs = self.parameters.iter().zip(internal);
        let found = pairs.find(|(parameter, q)| {
            if matches!(parameter.role, Role::Shape { .. }) {
                return false;
            }
            let [a, b] = [parameter.bounds.0, parameter.bounds.1]
                .map(|value| parameter.scale.to_internal(value));
            let near = AT_BOUND * (b - a).abs();
            let at = |end: f64| end != 0.0 && (*q - end).abs() < near.max(1e-9 * end.abs());
            at(a) || at(b)
        });
        found.map(|(parameter, _)| parameter)
    }

    /// Brings internal coordinates into the parameters' bounds.
    pub fn clamp(&self, internal: &mut [f64]) {
        for (parameter, q) in self.parameters.iter().zip(internal) {
            let (low, high) = parameter.bounds;
            let (a, b) = (
                parameter.scale.to_internal(low),
                parameter.scale.to_internal(high),
            );
            *q = q.clamp(a.min(b), a.max(b));
        }
    }
}

impl Point {
    /// Cost of the priors: squares of nuisance and of shapes in their standard deviations.
    pub fn prior_cost(&self, candidates: &[Candidate]) -> f64 {
        let nuisance: f64 = self.nuisance.iter().map(|p| p * p).sum();
        nuisance
            + self
                .prior_rows(candidates)
                .iter()
                .map(|(_, off, spread)| (off / spread).powi(2))
                .sum::<f64>()
    }

    /// Priors of the effects' shapes: place among all effect coordinates, deviation, spread.
    pub fn prior_rows(&self, candidates: &[Candidate]) -> Vec<(usize, f64, f64)> {
        let mut rows = Vec::new();
        let mut place = 0;
        for (candidate, internal) in &self.effects {
            for (parameter, &q) in candidates[*candidate].parameters.iter().zip(internal) {
                if let Role::Shape { typical, spread } = parameter.role {
                    rows.push((place, q - parameter.scale.to_internal(typical), spread));
                }
                place += 1;
            }
        }
        rows
    }

    /// Places of its effects among the candidates, in ascending order.
    pub fn set(&self) -> Vec<usize> {
        let mut effects: Vec<_> = self.effects.iter().map(|(i, _)| *i).collect();
        effects.sort_unstable();
        effects
    }

    /// Number of effect coordinates.
    pub fn effect_coordinates(&self) -> usize {
        self.effects.iter().map(|(_, q)| q.len()).sum()
    }

    /// Coordinates of the effect at `place`.
    pub(crate) fn coordinates(&self, place: usize) -> Range<usize> {
        let sizes = self.effects[..place].iter().map(|(_, q)| q.len());
        let begin = self.nuisance.len() + sizes.sum::<usize>();
        begin..begin + self.effects[place].1.len()
    }

    /// The step from here to `other`, which has the same effects: nuisance first, then the effects'.
    pub(crate) fn step_to(&self, other: &Self) -> nalgebra::DVector<f64> {
        let all = |point: &Self| -> Vec<f64> {
            let effects = point.effects.iter().flat_map(|(_, q)| q);
            point.nuisance.iter().chain(effects).copied().collect()
        };
        let (from, to) = (all(self), all(other));
        nalgebra::DVector::from_fn(from.len(), |i, _| to[i] - from[i])
    }

    /// Adds `step` to coordinates: nuisance first, then the effects'; kept in bounds.
    pub fn moved(&self, step: &[f64], candidates: &[Candidate]) -> Self {
        let mut point = self.clone();
        let (nuisance, mut rest) = step.split_at(self.nuisance.len());
        for (p, s) in point.nuisance.iter_mut().zip(nuisance) {
            *p += s;
        }
        for (candidate, internal) in &mut point.effects {
            let (mine, others) = rest.split_at(internal.len());
            for (q, s) in internal.iter_mut().zip(mine) {
                *q += s;
            }
            candidates[*candidate].clamp(internal);
            rest = others;
        }
        point
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(bounds: (f64, f64), scale: Scale) -> Candidate {
        Candidate::new(
            "effect",
            vec![EffectParameter {
                name: "size",
                unit: "1",
                scale,
                role: Role::Size { weak: 1.0 },
                bounds,
            }],
            Vec::new(),
        )
    }

    #[test]
    fn values_and_coordinates_are_each_other_s_inverse_on_every_scale() {
        for (scale, value, internal) in [
            (Scale::Linear(2.0), 3.0, 1.5),
            (Scale::Factor(0.5), 0.25, 2.0 * 1.25_f64.ln()),
            (Scale::Logarithmic, 3.0, 3.0_f64.ln()),
            (Scale::Inverse(6.0), 3.0, 2.0),
        ] {
            let own = candidate((0.0, 10.0), scale);
            let [found] = own.internal(&[value])[..] else {
                panic!("one coordinate");
            };
            assert!((found - internal).abs() < 1e-12, "{scale:?}");
            let back = own.values(&[found]);
            assert!(back.len() == 1 && (back[0] - value).abs() < 1e-12);
            // The slope by a small difference.
            let step = 1e-6;
            let rise = scale.to_value(found + step) - scale.to_value(found - step);
            assert!(
                (rise / (2.0 * step) - scale.slope(found)).abs() < 1e-6,
                "{scale:?}"
            );
        }
    }

    #[test]
    fn a_size_at_either_end_is_at_its_bound_but_for_zero() {
        let signed = candidate((-4.0, 4.0), Scale::Linear(2.0));
        let is_at = |candidate: &Candidate, q: f64| candidate.bound(&[q]).is_some();
        assert!(is_at(&signed, 2.0) && is_at(&signed, -2.0));
        assert!(!is_at(&signed, 1.99) && !is_at(&signed, -1.99) && !is_at(&signed, 0.0));
        // Within a thousandth of the range.
        assert!(is_at(&signed, 1.997) && is_at(&signed, -1.997) && !is_at(&signed, 1.995));
        let positive = candidate((0.0, 4.0), Scale::Linear(2.0));
        assert!(!is_at(&positive, 0.0) && is_at(&positive, 2.0));
    }

    #[test]
    fn a_step_ends_at_the_bounds_whichever_way_the_scale_runs() {
        let candidates = [
            candidate((-4.0, 4.0), Scale::Linear(2.0)),
            candidate((2.0, 8.0), Scale::Inverse(16.0)),
        ];
        let point = Point {
            nuisance: vec![1.0],
            effects: vec![(0, vec![1.0]), (1, vec![4.0])],
        };
        let up = point.moved(&[10.0, 10.0, 10.0], &candidates);
        assert_eq!(up.nuisance, [11.0]);
        assert_eq!(up.effects, [(0, vec![2.0]), (1, vec![8.0])]);
        let down = point.moved(&[0.0, -10.0, -10.0], &candidates);
        assert_eq!(down.effects, [(0, vec![-2.0]), (1, vec![2.0])]);
    }
}
