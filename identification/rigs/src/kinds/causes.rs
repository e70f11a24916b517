//! Nominal parameters that are not what was stated: those that are causes, and those that may be.

use super::cause::{Cause, FROM, INTERVAL_95};
use super::confirmed::{Confirmed, lengths, needed};
use super::named_value::NamedValue;
use super::parts::{EVERYTHING, InParts};
use super::profile::{self, Open, Profiled};
use super::readings::{Crossed, Weighed};
use diagnosis::{Observer, Point, all_errors, settled};

/// Standard errors from which on a parameter is a cause although the errors of the parts do not agree.
pub(super) const FAR: f64 = 5.0;

/// What the parts say of a model as a whole.
#[derive(Clone, Copy)]
pub(super) struct Standing {
    /// Each part is predicted from the other about as well as it is fitted.
    pub(super) holds: bool,
    /// Each part's prediction explains much of what the described model leaves.
    pub(super) explains: bool,
}

/// What the nominal parameters of a model say.
#[derive(Default)]
pub(super) struct Causes {
    /// Those that are not what was stated.
    pub(super) named: Vec<Cause>,
    /// Those without which predictions are hardly worse.
    pub(super) doubted: Vec<Cause>,
    /// Those that may be as is usual, or off by as much as matters.
    pub(super) suspected: Vec<Cause>,
    /// The models with what is doubted as stated.
    pub(super) weighed: Vec<Weighed>,
}

impl Causes {
    /// Doubts what another model of the same data, which has these `parameters`, has as stated.
    pub(super) fn doubt<M: InParts>(&mut self, measured: &M, parameters: &[NamedValue]) {
        let is_as_stated = |cause: &Cause| {
            let mut own = parameters.iter().enumerate();
            let own = own.find(|(_, parameter)| parameter.name == cause.found.name);
            own.is_some_and(|(i, parameter)| {
                Cause::of(parameter.clone(), measured.stated(i)).is_none()
            })
        };
        let all = std::mem::take(&mut self.named).into_iter();
        let (doubted, named): (Vec<Cause>, Vec<Cause>) = all.partition(is_as_stated);
        self.named = named;
        self.doubted.extend(doubted);
    }
}

/// The causes among the nominal parameters of the model `confirmed`, of which `crossed` are the errors on either part.
/// Widens its intervals to what the data leave open.
pub(super) fn causes<M: InParts>(
    measured: &M,
    confirmed: &mut Confirmed,
    crossed: &Crossed,
    standing: Standing,
    observer: Observer<'_>,
) -> Causes {
    let mut all = Causes::default();
    let mut asked = Asked {
        measured,
        point: confirmed.point.clone(),
        profiled: None,
        observer,
    };
    for i in (0..confirmed.parameters.len()).filter(|i| measured.is_cause(*i)) {
        let stated = measured.stated(i);
        let mut fitted = NamedValue {
            standard_error: confirmed.of_the_fit[i],
            ..confirmed.parameters[i].clone()
        };
        let mut hidden = None;
        if Cause::of(fitted.clone(), stated).is_none()
            && standing.holds
            && let Some(own) = asked.profiled(i)
        {
            hidden = beyond(own, i, &fitted, stated, &confirmed.parameters);
            fitted.value = own.value(i).unwrap_or(fitted.value);
        }
        let Some(mut told) = Cause::of(fitted, stated) else {
            all.suspected.extend(hidden);
            continue;
        };
        // A zero shows in a file by itself, whatever a part tells of another.
        let is_believed = standing.holds
            || ((standing.explains || measured.is_of_first_file(i)) && told.deviations() > FAR);
        if !is_believed || told.makes_up(&confirmed.parameters) {
            continue;
        }
        let mut as_stated = None;
        match asked.widened(i, &mut told, confirmed, stated.0) {
            Some(Open::Stated(point)) => {
                as_stated = Some(point);
                if let Some(hidden) = &hidden {
                    told.widen(hidden.ends());
                }
            }
            Some(Open::Within(low, high)) if told.is_usual((low, high), stated.1) => {
                all.suspected.push(told);
                continue;
            }
            _ => {}
        }
        match asked.as_well(i, as_stated, crossed, stated.0) {
            Some(model) => {
                all.doubted.push(told);
                all.weighed.extend(model);
            }
            None => all.named.push(told),
        }
    }
    all
}

/// The model whose parameters are asked for.
struct Asked<'a, M> {
    measured: &'a M,
    point: Point,
    /// One fit serves every parameter that is profiled.
    profiled: Option<Option<Profiled<'a, M>>>,
    observer: Observer<'a>,
}

impl<'a, M: InParts> Asked<'a, M> {
    /// The profile for parameter `i`; none of one that no other can make up for, or where time is over.
    fn profiled(&mut self, i: usize) -> Option<&mut Profiled<'a, M>> {
        if self.measured.is_of_first_file(i) || self.observer.is_over() {
            return None;
        }
        let new = || profile::beside(self.measured, &self.point);
        self.profiled.get_or_insert_with(new).as_mut()
    }

    /// What is open of parameter `i`; widens the interval that is `told` and those of `confirmed` to that.
    fn widened(
        &mut self,
        i: usize,
        told: &mut Cause,
        confirmed: &mut Confirmed,
        stated: f64,
    ) -> Option<Open> {
        let measured = self.measured;
        let lost = told.lost_lag(&confirmed.parameters, |i| measured.stated(i).0);
        let open = match self.profiled(i)?.open(i, stated)? {
            Open::Within(low, high) => Open::Within(low - lost, high),
            open => open,
        };
        let own = &mut confirmed.parameters[i];
        let (low, high) = open.ends(own.value, stated);
        told.widen((low, high));
        let farthest = (own.value - low).max(high - own.value);
        own.standard_error = own.standard_error.max(farthest / INTERVAL_95);
        if let Open::Stated(point) = &open {
            confirmed.widen_by(measured, point);
        }
        Some(open)
    }

    /// The model with parameter `i` as `stated`, if predictions are as good with it; `open` is where the data allow it,
    /// `crossed` are the errors with the parameter.
    fn as_well(
        &self,
        i: usize,
        open: Option<Point>,
        crossed: &Crossed,
        stated: f64,
    ) -> Option<Vec<Weighed>> {
        let measured = self.measured;
        let own = measured.pinned(i, stated)?;
        // No part tells another one's zero.
        let (best, errors, is_needed) = if measured.is_of_first_file(i) {
            let best = settled(&own, &self.point, EVERYTHING)?;
            let bare = all_errors(&own, &best, EVERYTHING);
            let with = all_errors(measured, &self.point, EVERYTHING);
            let is_needed = needed(&bare, &with, &lengths(measured, EVERYTHING));
            let errors = Crossed::of(&own, &best)?;
            (best, errors, is_needed)
        } else {
            let is_open = open.is_some();
            let best = open.unwrap_or_else(|| self.point.clone());
            let looked = Crossed::looked(&own, &best)?;
            if !is_open && crossed.is_far_from(&looked) {
                return None;
            }
            let errors = looked.settled(&own)?;
            let is_needed = !is_open && crossed.needs(&errors);
            (best, errors, is_needed)
        };
        (!is_needed).then(|| Weighed::of(&own, &best, errors).into_iter().collect())
    }
}

/// Standard errors that no valley makes up for.
const HOPELESS: f64 = 50.0;

/// That the parameter `i` is farther from what was `stated` than the `found` value, which others of the `parameters` can
/// make up for; none where the data tell that it is not.
fn beyond<M: InParts>(
    profiled: &mut Profiled<'_, M>,
    i: usize,
    found: &NamedValue,
    (stated, within): (f64, f64),
    parameters: &[NamedValue],
) -> Option<Cause> {
    [1.0, -1.0].into_iter().find_map(|side| {
        let threshold = stated + side * FROM * within;
        let off = (threshold - found.value).abs();
        // Nor is a model to be believed that is as far off on the other side.
        if off > HOPELESS * found.standard_error || off > 2.0 * FROM * within {
            return None;
        }
        let mut cause = Cause {
            found: NamedValue {
                value: threshold,
                ..found.clone()
            },
            stated,
        };
        if cause.makes_up(parameters) || !profiled.may_be(i, threshold) {
            return None;
        }
        let far = profiled.far_end(i, threshold, stated)?;
        // As far to the near side, if not as stated.
        let best = profiled.value(i)?;
        let near = if profiled.may_be(i, stated) || (best - stated) * side < (far - best) * side {
            stated
        } else {
            2.0 * best - far
        };
        let (low, high) = (near.min(far), near.max(far));
        cause.found.value = 0.5 * (low + high);
        cause.found.standard_error = 0.5 * (high - low) / INTERVAL_95;
        Some(cause)
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use super::super::measured::Measured;
    use super::super::{Measurement, RigRecording, of_kind};
    use super::*;
    use recordings::{Channel, Recording};

    #[test]
    fn what_a_better_model_has_as_stated_is_doubted() {
        let rig = of_kind("closed_loop_actuator").unwrap();
        let command = rig.inputs()[0];
        let wave: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let channels = vec![(command, wave.clone()), (Channel::Displacement, wave)];
        let recording = Recording::new("one", 0.01, channels).unwrap();
        let recording = RigRecording::new(recording, &[command], Channel::Displacement);
        let measurement = Measurement {
            recordings: vec![recording],
        };
        let stated = |name: &str| match name {
            "scale" => (1.0, 0.01),
            "offset" => (0.0, 1e-3),
            _ => (0.0, 0.0),
        };
        let nominal = rig.parameters().iter().map(|(name, _)| stated(name));
        let measured = Measured::new(rig, &measurement, nominal.collect());
        let mut parameters = measured.parameters(&measured.origin(), &[]);
        let mut all = Causes::default();
        for own in &mut parameters {
            own.standard_error = 1e-4;
            let found = NamedValue {
                value: own.value + 0.1,
                ..own.clone()
            };
            let place = if own.name == "scale" { 1.0 } else { 0.0 };
            all.named.extend(Cause::of(found, (place, 0.01)));
        }
        let names =
            |of: &[Cause]| -> Vec<String> { of.iter().map(|own| own.found.name.clone()).collect() };
        assert_eq!(names(&all.named), ["scale", "offset"]);
        let scale = parameters.iter_mut().find(|own| own.name == "scale");
        scale.unwrap().value += 0.1;
        all.doubt(&measured, &parameters);
        assert_eq!(names(&all.named), ["scale"]);
        assert_eq!(names(&all.doubted), ["offset"]);
    }
}
