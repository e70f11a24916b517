//! What data leave open of a nominal parameter that others can make up for.

use rayon::prelude::*;

use super::confirmed::{clearly_better, lengths};
use super::parts::{EVERYTHING, InParts};
use super::readings::FAR;
use diagnosis::{Point, all_errors, looked, settled, settled_along, squares};

/// Growth of the squared error that tells nothing: no model is exact; and as a share of what is not white noise.
const INEXACT: f64 = 0.01;
const COLOURED: f64 = 0.2;
/// Values that are tried to either side.
const TRIES: usize = 4;
/// And for what is only suspected.
const QUICK: usize = 2;
/// Share of a distance to which its end is found.
const NEAR: f64 = 0.15;
/// Share of the way between a value that agrees and one that does not which no further trial is nearer to either.
const MARGIN: f64 = 0.1;
/// Factor to the next distance where the last one changes hardly anything.
const LONGER: f64 = 2.0;

/// What the data leave open of a nominal parameter that differs from what was stated.
pub(super) enum Open {
    /// It may be as stated: the model there.
    Stated(Point),
    /// It is between these.
    Within(f64, f64),
}

impl Open {
    /// The ends; alike to either side of the `found` value if it may be as `stated`.
    pub(super) fn ends(&self, found: f64, stated: f64) -> (f64, f64) {
        let off = (found - stated).abs();
        match self {
            Self::Stated(_) => (found - off, found + off),
            Self::Within(low, high) => (*low, *high),
        }
    }
}

/// The best model beside one that is told, from which its parameters are profiled.
pub(super) struct Profiled<'a, M> {
    measured: &'a M,
    starts: Vec<Point>,
    best: Point,
    errors: Vec<f64>,
    /// Growth of the squared error that tells nothing.
    allowed: f64,
    lengths: Vec<usize>,
}

/// The best fit beside the model at `point`, also of what that model goes without. None where nothing can be fitted.
pub(super) fn beside<'a, M: InParts>(measured: &'a M, point: &Point) -> Option<Profiled<'a, M>> {
    let mut starts = vec![point.clone()];
    let restored = measured.restored(point);
    if restored != *point {
        starts.push(restored);
    }
    let all = starts.par_iter();
    let all = all.filter_map(|start| settled_along(measured, start, EVERYTHING));
    let all = all.map(|best| (all_errors(measured, &best, EVERYTHING), best));
    let (errors, best) = all.min_by(|a, b| squares(&a.0).total_cmp(&squares(&b.0)))?;
    Some(Profiled {
        measured,
        starts,
        best,
        allowed: 1.0 + INEXACT.max(COLOURED * coloured(&errors)),
        errors,
        lengths: lengths(measured, EVERYTHING),
    })
}

/// Share of the power of `errors` that is not white noise, of which fourth differences have 70 times the power.
fn coloured(errors: &[f64]) -> f64 {
    let fourth = |e: &[f64]| e[0] - 4.0 * e[1] + 6.0 * e[2] - 4.0 * e[3] + e[4];
    let white: f64 = errors.windows(5).map(|e| fourth(e).powi(2) / 70.0).sum();
    (1.0 - white / squares(errors)).clamp(0.0, 1.0)
}

impl<M: InParts> Profiled<'_, M> {
    /// What is open of the nominal parameter `i`, which was `stated`, by the profile of the likelihood (Venzon and
    /// Moolgavkar, Applied Statistics 37, 1988), everything else fitted again. Open is where the squared error on all
    /// data is above the least by chance, or by a fifth at most of what in it is not white noise. A standard error holds
    /// for a model that is exact. Where delay, lag and feedforward make up for each other, an error of the model's form
    /// counts for more than noise.
    pub(super) fn open(&self, i: usize, stated: f64) -> Option<Open> {
        let value = self.value(i)?;
        let off = value - stated;
        Some(match self.end(TRIES, (i, value), -off, off.abs()) {
            (_, Some(stated)) => Open::Stated(stated),
            (near, None) => {
                let (far, _) = self.end(TRIES, (i, value), near.copysign(off), f64::INFINITY);
                let ends = [value - near.copysign(off), value + far.copysign(off)];
                Open::Within(ends[0].min(ends[1]), ends[0].max(ends[1]))
            }
        })
    }

    /// The best value of parameter `i`.
    pub(super) fn value(&self, i: usize) -> Option<f64> {
        let all = self.measured.parameters(&self.best, &[]);
        all.get(i).map(|own| own.value)
    }

    /// Whether parameter `i` may also be at `value`. Where a model there is better than the best so far, that one is the
    /// best from now on.
    pub(super) fn may_be(&mut self, i: usize, value: f64) -> bool {
        let starts = self.starts();
        let Some((growth, is_told, there)) = self.fitted((i, value), &starts) else {
            return false;
        };
        if growth < 1.0
            && let Some(at) = self.measured.at(&there, i, value)
            && let Some(best) = settled_along(self.measured, &at, EVERYTHING)
        {
            let errors = all_errors(self.measured, &best, EVERYTHING);
            if squares(&errors) < squares(&self.errors) {
                (self.best, self.errors) = (best, errors);
            }
        }
        !is_told
    }

    /// Where fits of a held parameter begin.
    fn starts(&self) -> Vec<Point> {
        let mut starts = self.starts.clone();
        starts.push(self.best.clone());
        starts
    }

    /// The far end of what is open of parameter `i`, on the side on which `value` is of what was `stated`. The best may be
    /// next to `value` or beyond it.
    pub(super) fn far_end(&self, i: usize, value: f64, stated: f64) -> Option<f64> {
        let best = self.value(i)?;
        let first = (value - best).abs().max((value - stated).abs());
        let first = first.copysign(value - stated);
        let (far, _) = self.end(QUICK, (i, best), first, f64::INFINITY);
        Some(best + far.copysign(first))
    }

    /// Distance from the `found` value of parameter `i` at which the error begins to tell, on the side of `first`, which
    /// is tried first; at `most` it ends with the model there.
    fn end(
        &self,
        tries: usize,
        (i, found): (usize, f64),
        first: f64,
        most: f64,
    ) -> (f64, Option<Point>) {
        let mut starts = self.starts();
        let (mut inside, mut outside, mut at) = (0.0f64, f64::INFINITY, first.abs());
        // Where the error is least, and what it is.
        let mut least = (0.0, 1.0);
        for _ in 0..tries {
            let value = found + at.copysign(first);
            let (growth, is_told, best) = self.fitted((i, value), &starts).unwrap_or((
                f64::INFINITY,
                true,
                self.best.clone(),
            ));
            // From there it grows with the square of the distance.
            let expected = if growth > least.1 {
                least.0 + (at - least.0) * ((self.allowed - least.1) / (growth - least.1)).sqrt()
            } else {
                least = (at, growth);
                f64::INFINITY
            };
            if is_told {
                outside = at;
            } else {
                inside = at;
            }
            if inside >= most {
                return (most, Some(best));
            }
            let farthest = outside.min(LONGER * inside.max(at));
            let margin = MARGIN * (farthest - inside);
            at = expected.clamp(inside + margin, farthest - margin);
            if outside - inside < NEAR * outside {
                break;
            }
            starts = vec![self.best.clone(), best];
        }
        (at.min(most), None)
    }

    /// Growth of the squared error with parameter `i` at `value`, whether it tells against that, and the best fit.
    fn fitted(&self, (i, value): (usize, f64), starts: &[Point]) -> Option<(f64, bool, Point)> {
        let held = self.measured.pinned(i, value)?;
        let grown = |best: Point| {
            let errors = all_errors(&held, &best, EVERYTHING);
            (squares(&errors) / squares(&self.errors), errors, best)
        };
        // Of several ways to the same end the one that is ahead is walked to it.
        let near = starts.par_iter();
        let near = near.filter_map(|start| looked(&held, start, EVERYTHING).map(grown));
        let near = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (growth, errors, best) = if near.0 > FAR {
            near
        } else {
            grown(settled(&held, &near.2, EVERYTHING)?)
        };
        let is_told = growth > self.allowed && clearly_better(&errors, &self.errors, &self.lengths);
        Some((growth, is_told, best))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
mod tests {
    use std::f64::consts::TAU;

    use super::super::measured::Measured;
    use super::super::{Measurement, RigRecording, of_kind};
    use super::*;
    use recordings::{Channel, Recording};

    const COMMAND: Channel = Channel::Other {
        name: "command",
        unit: "m",
    };

    fn command(t: f64) -> f64 {
        let sines = (0..30).map(|i| {
            let (frequency, phase) = (0.3 + 0.21 * f64::from(i), 1.7 * f64::from(i));
            1e-3 / (0.5 + frequency) * (TAU * frequency * t + phase).sin()
        });
        sines.sum()
    }

    /// A valve of second order in a loop with feedforward, its flow less than proportional, by small steps.
    fn played(delay: f64) -> RigRecording {
        let (rate, count, steps) = (200.0, 4000, 50);
        let (gain, sent_ahead, omega, damping) = (30.0, 0.85, 377.0, 0.9);
        let h = 1.0 / rate / f64::from(steps);
        let (mut flow, mut change, mut x) = (0.0f64, 0.0f64, command(-delay));
        let mut rows = Vec::new();
        for k in 0..count {
            rows.push(x);
            for part in 0..steps {
                let t = f64::from(k) / rate + f64::from(part) * h - delay;
                let speed = (command(t + 1e-5) - command(t - 1e-5)) / 2e-5;
                let asked = gain * (command(t) - x) + sent_ahead * speed;
                change += h * omega * (omega * (asked - flow) - 2.0 * damping * change);
                flow += h * change;
                x += h * flow * (1.0 - 0.5 * flow.abs());
            }
        }
        let asked = (0..count).map(|k| command(f64::from(k) / rate));
        let channels = vec![(COMMAND, asked.collect()), (Channel::Displacement, rows)];
        let recording = Recording::new("valve", 1.0 / rate, channels).unwrap();
        let mut own = RigRecording::new(recording, &[COMMAND], Channel::Displacement);
        own.left_out[2000..].fill(true);
        own
    }

    #[test]
    fn the_interval_of_a_delay_holds_what_a_lag_that_was_left_out_takes_of_it() {
        let rig = of_kind("closed_loop_actuator").unwrap();
        let stated = |name: &str| match name {
            "loop_gain" => (25.0, 12.5),
            "loop_lag" => (4e-3, 4e-3),
            "feedforward" => (0.1, 0.1),
            "scale" => (1.0, 0.01),
            "command_delay" => (0.0, 1.5e-3),
            "resonance_damping" => (0.5, 0.0),
            _ => (0.0, 0.0),
        };
        for delay in [0.0, 6e-3] {
            let measurement = Measurement {
                recordings: vec![played(delay)],
            };
            let nominal = rig.parameters().iter().map(|(name, _)| stated(name));
            let measured = Measured::new(rig, &measurement, nominal.collect());
            let place = |name: &str| {
                let mut names = measured.uncertain_names().into_iter();
                names.position(|own| own == name).unwrap()
            };
            let i = place("command_delay");
            let bare = measured.without(&measured.origin(), place("loop_lag"));
            let point = settled_along(&measured, &bare.unwrap(), EVERYTHING).unwrap();
            let found = measured.parameters(&point, &[])[i].value;
            assert!(found > delay + 2e-3, "the lag does not matter: {found}");
            match beside(&measured, &point).unwrap().open(i, 0.0).unwrap() {
                Open::Stated(_) => assert_eq!(delay, 0.0, "{found}"),
                Open::Within(low, high) => {
                    assert!(delay > 0.0, "{found}: {low} {high}");
                    assert!((low..=high).contains(&delay), "{low} {high}");
                    assert!(high - low < 0.012, "{low} {high}");
                }
            }
            let mut own = beside(&measured, &point).unwrap();
            assert!(own.may_be(i, delay) && !own.may_be(i, delay + 0.02));
            let far = own.far_end(i, delay + 0.02, 0.0).unwrap();
            assert!(far > delay && far < delay + 0.02, "{far}");
            // As far from a value that is next to the best.
            let next = own.value(i).unwrap() + 1e-5;
            let again = own.far_end(i, next, 0.0).unwrap();
            assert!((again - far).abs() < 0.3 * far, "{again} {far}");
        }
    }
}
