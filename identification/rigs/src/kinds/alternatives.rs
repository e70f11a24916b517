//! Other models of the same data: with effects that one part alone asks for, with an effect in the place of
//! another of its class, and without what is not needed.

use super::PartReport;
use super::confirmed::{NEAR, clearly_better, lengths, unfit, without_effect};
use super::parts::{EVERYTHING, InParts};
use super::readings::{Crossed, NEEDED, likelier};
use diagnosis::{Observer, Point, all_errors, looked, refit, settled, squares};
use rayon::prelude::*;

/// Logarithm of how much less likely a model is that does nearly as well.
const NEARLY: f64 = 2.0;

/// Error after a few steps of a fit, over the most that it may be in the end, beyond which more of them change nothing.
const ALMOST: f64 = 3.0;
/// The same of an effect in the place of another one, over the error with that.
const BEHIND: f64 = 2.0;
/// Error on all data over that of the likeliest model that is slightly more.
const SLIGHTLY: f64 = 1.2;

/// What the two parts ask for, each alone and both together, of effects that cannot be told apart one; each also
/// from the stated nominal values.
pub(super) fn proposals<M: InParts>(measured: &M, parts: [&PartReport; 2]) -> Vec<Point> {
    let mut all: Vec<Point> = parts.iter().map(|part| part.point.clone()).collect();
    for (one, other) in [(0, 1), (1, 0)] {
        let mut both = parts[one].point.clone();
        let more = parts[other].point.effects.iter();
        let new = more.filter(|(i, _)| {
            let mut own = parts[one].point.effects.iter();
            own.all(|(known, _)| !measured.are_alike(*i, *known))
        });
        both.effects.extend(new.cloned());
        if both.effects.len() > parts[one].point.effects.len() {
            all.push(both);
        }
    }
    let stated: Vec<Point> = all.iter().map(|own| measured.as_stated(own)).collect();
    all.extend(stated);
    all
}

/// A model, how either part with it predicts the other, and its errors on all data.
struct Rival {
    point: Point,
    crossed: Crossed,
    errors: Vec<f64>,
}

impl Rival {
    fn of<M: InParts>(measured: &M, point: Point, crossed: Crossed) -> Self {
        let errors = all_errors(measured, &point, EVERYTHING);
        Self {
            point,
            crossed,
            errors,
        }
    }

    /// Logarithm of the likelihood beyond that of `other`, of what is predicted and of what is fitted: what is wrong in
    /// both models may help one of them to predict.
    fn likelier_than(&self, other: &Self) -> f64 {
        self.crossed.likelier_than(&other.crossed) + likelier(&self.errors, &other.errors)
    }

    /// Whether all data are fitted better than by `other`, by a tenth of the squared error.
    fn fits_better_than(&self, other: &Self) -> bool {
        squares(&other.errors) > NEEDED * squares(&self.errors)
    }
}

/// The model at `point` and those with effects in the place of others of their class, each from the best of its
/// starts. First the likeliest, or one that is nearly as likely with effects that are more common; the rest are
/// those that do nearly as well, those that fit all data better though either part predicts the other worse, and those
/// that leave slightly more of next to nothing, which is what models get wrong alike: the data do not say which.
pub(super) fn of_its_class<M: InParts>(
    measured: &M,
    point: &Point,
    crossed: Crossed,
    observer: Observer<'_>,
) -> Vec<(Point, Crossed)> {
    let mut all = vec![Rival::of(measured, point.clone(), crossed)];
    let mut best = 0;
    for (place, &(own, _)) in point.effects.iter().enumerate() {
        for other in alike(measured, point, own) {
            if observer.is_over() {
                break;
            }
            let base = &all[best].point;
            let taken = base.effects[place].0;
            let error = |point: &Point| measured.normalised_error(point, EVERYTHING);
            let trial = in_place_of(measured, base, place, other);
            let near = trial.and_then(|trial| looked(measured, &trial, EVERYTHING));
            let near = near.filter(|near| error(near) < BEHIND * error(base));
            let Some((found, deviations)) =
                near.and_then(|near| refit(measured, &near, EVERYTHING))
            else {
                continue;
            };
            let mut reasons = unfit(measured, &found.point, &deviations, EVERYTHING).into_iter();
            if reasons.any(|(i, _)| i == other) {
                continue;
            }
            let Some(crossed) = Crossed::of(measured, &found.point) else {
                continue;
            };
            let rival = Rival::of(measured, found.point, crossed);
            // A catalogue has first what is more common.
            let least = if other < taken { -NEARLY } else { NEARLY };
            if rival.likelier_than(&all[best]) > least {
                best = all.len();
            }
            all.push(rival);
        }
    }
    let best = all.swap_remove(best);
    all.retain(|own| replaced(&best.point, &own.point).is_some());
    let error = |own: &Rival| measured.normalised_error(&own.point, EVERYTHING);
    let most = (SLIGHTLY * error(&best)).min(NEAR);
    let is_near =
        |(by, own): &(f64, Rival)| *by < NEARLY || own.fits_better_than(&best) || error(own) < most;
    let behind = all.into_iter().map(|own| (best.likelier_than(&own), own));
    let mut near: Vec<(f64, Rival)> = behind.filter(is_near).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let others: Vec<Rival> = near.into_iter().map(|(_, own)| own).collect();
    let own = [best].into_iter().chain(others);
    own.map(|rival| (rival.point, rival.crossed)).collect()
}

/// The effects of the class of `own` that the model at `point` does not have, the most common first: those that it
/// lists or that list it.
pub(super) fn alike<'a, M: InParts>(
    measured: &'a M,
    point: &'a Point,
    own: usize,
) -> impl Iterator<Item = usize> + 'a {
    let known = |i: usize| point.effects.iter().any(|(known, _)| *known == i);
    let all = 0..measured.candidates().len();
    all.filter(move |&i| !known(i) && (measured.are_alike(i, own) || measured.are_alike(own, i)))
}

/// The model at `point` with `other` in the place of one of its effects, from the nearest of its starts; none where it
/// has no starts.
pub(super) fn in_place_of<M: InParts>(
    measured: &M,
    point: &Point,
    place: usize,
    other: usize,
) -> Option<Point> {
    let candidate = &measured.candidates()[other];
    let error = |point: &Point| measured.normalised_error(point, EVERYTHING);
    let starts = candidate.starts.iter().map(|start| {
        let mut trial = point.clone();
        trial.effects[place] = (other, candidate.internal(start));
        (error(&trial), trial)
    });
    let nearest = starts.min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map(|(_, trial)| trial)
}

/// The first effect of `model` in whose place `other` has another one, and that.
pub(super) fn replaced(model: &Point, other: &Point) -> Option<(usize, usize)> {
    let mut pairs = model.effects.iter().zip(&other.effects);
    let (own, new) = pairs.find(|(own, new)| own.0 != new.0)?;
    Some((own.0, new.0))
}

/// Models without one of the nominal parameters at `point` that fit all data nearly as well: what they differ by is not
/// known.
pub(super) fn nearly_without<M: InParts>(measured: &M, point: &Point) -> Vec<Point> {
    let error = |point: &Point| measured.normalised_error(point, EVERYTHING).powi(2);
    let most = NEEDED * error(point);
    let all = (0..point.nuisance.len()).into_par_iter();
    let near = all.filter_map(|i| {
        let found = looked(measured, &measured.without(point, i)?, EVERYTHING)?;
        (error(&found) < most).then_some(found)
    });
    near.collect()
}

/// The model without any of the nominal parameters that a rig may lack, if none of them is needed: one after the
/// other may not be missed where the rest has settled to make up for it.
pub(super) fn simplest<M: InParts>(
    measured: &M,
    point: &Point,
    crossed: &Crossed,
    most: f64,
) -> Option<(Point, Crossed)> {
    let mut gone = 0;
    let mut bare = point.clone();
    for i in 0..point.nuisance.len() {
        if let Some(without) = measured.without(&bare, i) {
            (bare, gone) = (without, gone + 1);
        }
    }
    if gone < 2 {
        return None;
    }
    let mut stated = bare.clone();
    for i in 0..stated.nuisance.len() {
        let is_there = measured.block_of(i).is_none() && stated.nuisance[i] == point.nuisance[i];
        stated.nuisance[i] = if is_there { 0.0 } else { stated.nuisance[i] };
    }
    let error = |point: &Point| measured.normalised_error(point, EVERYTHING);
    let near = [bare, stated].into_par_iter().filter_map(|start| {
        let found = looked(measured, &start, EVERYTHING)?;
        Some((error(&found), found))
    });
    let (near, best) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Without noise a fit that is nearly there is far off.
    if near > (ALMOST * most).max(NEAR) {
        return None;
    }
    let best = settled(measured, &best, EVERYTHING)?;
    let error = error(&best);
    let errors = Crossed::of(measured, &best)?;
    (error < most && !crossed.needs(&errors)).then_some((best, errors))
}

/// Whether all data are explained worse `without` something than by the model at `point`, by more than chance.
fn is_missed<M: InParts>(measured: &M, without: &Point, point: &Point) -> bool {
    let [bare, own] = [without, point].map(|one| all_errors(measured, one, EVERYTHING));
    clearly_better(&bare, &own, &lengths(measured, EVERYTHING))
}

/// What a model may go without.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Item {
    Effect(usize),
    Nominal(usize),
}

/// The model without what is needed least, if that is not needed for sure; of those in `asked` alone, which
/// are those that were not the last time. Without a nominal parameter the error on all data stays below `most`.
pub(super) fn least_needed<M: InParts>(
    measured: &M,
    point: &Point,
    crossed: &Crossed,
    most: f64,
    asked: &mut Option<Vec<Item>>,
) -> Option<(Point, Crossed)> {
    let effects = point.effects.iter();
    let effects = effects.map(|(i, _)| (Item::Effect(*i), without_effect(point, *i)));
    let nominal = (0..point.nuisance.len())
        .filter_map(|i| Some((Item::Nominal(i), measured.without(point, i)?)));
    let items = effects.chain(nominal);
    let items = items.filter(|(item, _)| asked.as_ref().is_none_or(|asked| asked.contains(item)));
    let items: Vec<(Item, Point)> = items.collect();
    let idle: Vec<(Item, Point, Crossed)> = items
        .into_par_iter()
        .filter_map(|(item, left)| {
            let errors = Crossed::looked(measured, &left)?;
            if crossed.is_far_from(&errors) {
                return None;
            }
            let errors = errors.settled(measured)?;
            // Where a part does not tell a parameter that the rig has, it may predict worse with it.
            let fits = || {
                settled(measured, &left, EVERYTHING).is_some_and(|found| {
                    measured.normalised_error(&found, EVERYTHING) < most
                        && !is_missed(measured, &found, point)
                })
            };
            let is_idle = !crossed.needs(&errors) && (matches!(item, Item::Effect(_)) || fits());
            is_idle.then_some((item, left, errors))
        })
        .collect();
    *asked = Some(idle.iter().map(|(item, ..)| *item).collect());
    let (_, left, errors) = idle.into_iter().max_by(|a, b| {
        crossed
            .likelier_than(&b.2)
            .total_cmp(&crossed.likelier_than(&a.2))
    })?;
    Some((left, errors))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use std::f64::consts::TAU;

    use super::super::measured::Measured;
    use super::super::{Measurement, RigRecording, of_kind};
    use super::*;
    use nalgebra::Complex;
    use recordings::{Channel, Recording};
    use units::vocabulary;

    /// The steady motion of 10 kg on 9000 N/m with a damper (N s/m) under tones of 10 N, and noise of a hundredth.
    fn shaken(damping: f64) -> RigRecording {
        let force = Channel::Other {
            name: "force",
            unit: "N",
        };
        let tones = [1.1, 1.9, 2.7, 3.6, 5.9, 7.3];
        let [mut forces, mut shown] = [Vec::new(), Vec::new()];
        for k in 0..3000 {
            let t = 0.005 * f64::from(k);
            let noise = 4e-5 * (91.7 * f64::from(k)).sin() * (13.31 * f64::from(k)).cos();
            let (mut sum, mut x) = (0.0, noise);
            for frequency in tones {
                let omega = TAU * frequency;
                let tone = Complex::from_polar(10.0, omega * t);
                sum += tone.re;
                x += (tone / Complex::new(9000.0 - 10.0 * omega * omega, damping * omega)).re;
            }
            forces.push(sum);
            shown.push(x);
        }
        let channels = vec![(force, forces), (Channel::Displacement, shown)];
        let recording = Recording::new("shaken", 0.005, channels).unwrap();
        let mut own = RigRecording::new(recording, &[force], Channel::Displacement);
        own.left_out[1500..].fill(true);
        own
    }

    #[test]
    fn a_model_goes_without_its_damper_where_there_is_none() {
        let rig = of_kind("oscillator").unwrap();
        for (damping, is_idle) in [(0.0, true), (60.0, false)] {
            let measurement = Measurement {
                recordings: vec![shaken(damping)],
            };
            let stated = [(10.0, 0.0), (60.0, 60.0), (9000.0, 0.0), (0.0, 0.0)];
            let measured = Measured::new(rig, &measurement, stated.to_vec());
            let point = looked(&measured, &measured.origin(), EVERYTHING).unwrap();
            let near = nearly_without(&measured, &point);
            let found = near
                .iter()
                .map(|own| measured.parameters(own, &[])[0].value);
            let expected = if is_idle { vec![0.0] } else { Vec::new() };
            assert_eq!(found.collect::<Vec<_>>(), expected, "{damping} N s/m");
        }
    }

    #[test]
    fn an_effect_stands_in_for_one_that_it_does_not_list_but_that_lists_it() {
        let rig = of_kind("closed_loop_actuator").unwrap();
        let nominal = rig.parameters().iter().map(|_| (0.0, 0.0)).collect();
        let measurement = Measurement {
            recordings: Vec::new(),
        };
        let measured = Measured::new(rig, &measurement, nominal);
        let place = |name: &str| measured.index(name).unwrap();
        let [band, bristles] = [vocabulary::DEAD_BAND, "bristle_friction"].map(place);
        assert!(!measured.are_alike(band, bristles) && measured.are_alike(bristles, band));
        let others = |own: usize, effects: &[usize]| {
            let effects = effects.iter().map(|i| (*i, Vec::new())).collect();
            let point = Point {
                effects,
                ..Point::default()
            };
            let all = alike(&measured, &point, own).map(|i| measured.name(i));
            all.collect::<Vec<_>>()
        };
        for (own, other) in [
            (bristles, vocabulary::DEAD_BAND),
            (band, "bristle_friction"),
        ] {
            let found = others(own, &[own]);
            assert!(found.iter().any(|name| name == other), "{found:?}");
        }
        assert!(!others(bristles, &[bristles, band]).contains(&vocabulary::DEAD_BAND.to_owned()));
    }
}
