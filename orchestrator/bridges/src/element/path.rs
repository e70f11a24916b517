//! What a step of the analysis is in time: how long it lasts and how the rig goes through it.

use super::{Command, ElementError, Trial};

/// How a rig goes from one displacement to the next.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Shape {
    /// On a straight line over the whole interval.
    #[default]
    Ramp,
    /// On a straight line over the interval; then it is held for so long, s, before the force is read.
    Hold {
        /// s.
        settle: f64,
    },
    /// On a cubic that keeps the velocity: from where it is to the trial's displacement and velocity.
    Continuous,
    /// First where the last steps point (a quadratic through the last three displacements), for as long
    /// as the analysis would compute; then to the trial.
    PredictorCorrector {
        /// Share of the interval that is predicted, between 0 and 1.
        share: f64,
    },
}

/// How long a step of the analysis lasts on the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// As long as this, s, whatever the client says; else as long as the client's time passes.
    pub fixed: Option<f64>,
    /// Seconds of the rig for a second of the analysis.
    pub scale: f64,
}

impl Default for Interval {
    fn default() -> Self {
        Self {
            fixed: None,
            scale: 1.0,
        }
    }
}

impl Interval {
    /// The rig's steps, of `own` seconds each, in the step of the analysis that ends with `trial` and
    /// began at `since`; none where no time passes.
    pub(super) fn steps(
        &self,
        step: usize,
        trial: &Trial,
        since: Option<f64>,
        own: f64,
    ) -> Result<usize, ElementError> {
        let passed = match (self.fixed, trial.time, since) {
            (Some(fixed), _, _) => fixed,
            (None, Some(time), Some(since)) => (time - since) * self.scale,
            _ => 0.0,
        };
        let ratio = passed / own;
        let whole = ratio.round();
        // The client's times are sums of many steps.
        let slack = 1e-6 * whole.abs().max(1.0);
        if !(ratio.is_finite() && whole >= 0.0 && (ratio - whole).abs() <= slack) {
            return Err(ElementError::Interval {
                step,
                interval_s: passed,
                ratio,
                own_s: own,
            });
        }
        Ok(whole as usize)
    }
}

/// A way from where a rig was asked to be to a trial, for each degree of freedom.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// Where it was asked to be at the ends of the last three steps, the latest last.
    past: [Vec<f64>; 3],
    /// How it was asked to move at the end of the last step.
    velocity: Vec<f64>,
    /// Steps until now, up to 3.
    known: usize,
}

impl Path {
    /// At rest at zero.
    pub(super) fn at_rest(degrees_of_freedom: usize) -> Self {
        let zeros = vec![0.0; degrees_of_freedom];
        Self {
            past: [zeros.clone(), zeros.clone(), zeros.clone()],
            velocity: zeros,
            known: 1,
        }
    }

    /// Puts what is asked for at the share `at` of a step of `length` seconds to `trial` into
    /// `command`.
    pub(super) fn command(
        &self,
        shape: Shape,
        trial: &Trial,
        (at, length): (f64, f64),
        command: &mut Command,
    ) {
        let n = trial.displacement.len();
        command.displacement.resize(n, 0.0);
        command.velocity.resize(n, 0.0);
        command.acceleration.resize(n, 0.0);
        for i in 0..n {
            let (from, to) = (self.past[2][i], trial.displacement[i]);
            let [d, v, a] = match shape {
                _ if length <= 0.0 => [to, 0.0, 0.0],
                Shape::Ramp | Shape::Hold { .. } => straight(from, to, at, length),
                Shape::Continuous => {
                    let mean = (to - from) / length;
                    let wanted = trial.velocity.get(i).copied().unwrap_or(mean);
                    cubic((from, self.velocity[i]), (to, wanted), at, length)
                }
                Shape::PredictorCorrector { share } => {
                    if at < share {
                        self.predicted(i, at, length)
                    } else {
                        let turn = self.predicted(i, share, length)[0];
                        let rest = 1.0 - share;
                        straight(turn, to, (at - share) / rest, length * rest)
                    }
                }
            };
            // The end of a step is where the trial is, to the bit.
            command.displacement[i] = if at >= 1.0 { to } else { d };
            command.velocity[i] = v;
            command.acceleration[i] = a;
        }
    }

    /// Displacement, velocity and acceleration of the quadratic through the last three displacements,
    /// the share `at` of a step after the last.
    fn predicted(&self, i: usize, at: f64, length: f64) -> [f64; 3] {
        let [before, last, now] = [self.past[0][i], self.past[1][i], self.past[2][i]];
        let (slope, bend) = match self.known {
            0 | 1 => (0.0, 0.0),
            2 => (now - last, 0.0),
            _ => (
                1.5 * now - 2.0 * last + 0.5 * before,
                now - 2.0 * last + before,
            ),
        };
        [
            now + at * slope + 0.5 * at * at * bend,
            (slope + at * bend) / length,
            bend / (length * length),
        ]
    }

    /// Takes note that a step ended where `command` is.
    pub(super) fn arrive(&mut self, command: &Command) {
        self.past.rotate_left(1);
        self.past[2].clone_from(&command.displacement);
        self.velocity.clone_from(&command.velocity);
        self.known = (self.known + 1).min(3);
    }
}

fn straight(from: f64, to: f64, at: f64, length: f64) -> [f64; 3] {
    [from + at * (to - from), (to - from) / length, 0.0]
}

/// A cubic with these displacements and velocities at its ends.
fn cubic((from, begin): (f64, f64), (to, end): (f64, f64), s: f64, length: f64) -> [f64; 3] {
    let (b, e) = (begin * length, end * length);
    let rise = to - from;
    let (two, three) = (3.0 * rise - 2.0 * b - e, b + e - 2.0 * rise);
    [
        from + s * (b + s * (two + s * three)),
        (b + s * (2.0 * two + 3.0 * s * three)) / length,
        (2.0 * two + 6.0 * s * three) / (length * length),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(displacement: f64, velocity: f64) -> Trial {
        Trial {
            displacement: vec![displacement],
            velocity: vec![velocity],
            ..Trial::default()
        }
    }

    /// A path that has followed `x` at the ends of steps of 0.1 s.
    fn followed(x: impl Fn(f64) -> [f64; 2]) -> Path {
        let mut path = Path::at_rest(1);
        for k in 0..4 {
            let [d, v] = x(0.1 * f64::from(k));
            path.arrive(&Command {
                displacement: vec![d],
                velocity: vec![v],
                acceleration: vec![0.0],
            });
        }
        path
    }

    #[test]
    fn every_shape_arrives_and_the_smooth_ones_keep_the_velocity() {
        // A parabola, which both smooth shapes follow to rounding.
        let x = |t: f64| [0.2 + 0.3 * t - 0.4 * t * t, 0.3 - 0.8 * t];
        let path = followed(x);
        let to = x(0.4);
        let mut command = Command::default();
        let smooth = [Shape::Continuous, Shape::PredictorCorrector { share: 0.6 }];
        for shape in smooth
            .into_iter()
            .chain([Shape::Ramp, Shape::Hold { settle: 1.0 }])
        {
            path.command(shape, &trial(to[0], to[1]), (1.0, 0.1), &mut command);
            assert_eq!(command.displacement, [to[0]]);
        }
        for shape in smooth {
            path.command(shape, &trial(to[0], to[1]), (0.5, 0.1), &mut command);
            assert!((command.displacement[0] - x(0.35)[0]).abs() < 1e-12);
            assert!((command.velocity[0] - x(0.35)[1]).abs() < 1e-12);
            assert!((command.acceleration[0] + 0.8).abs() < 1e-10);
        }
        path.command(Shape::Ramp, &trial(to[0], to[1]), (0.5, 0.1), &mut command);
        assert!((command.displacement[0] - 0.5 * (x(0.3)[0] + to[0])).abs() < 1e-12);
    }

    #[test]
    fn a_step_is_a_whole_number_of_the_rigs() {
        let at = |time: f64| Trial {
            time: Some(time),
            ..trial(0.0, 0.0)
        };
        let steps = |interval: Interval, time: f64| interval.steps(7, &at(time), Some(1.0), 0.002);
        assert_eq!(steps(Interval::default(), 1.01).unwrap(), 5);
        assert_eq!(steps(Interval::default(), 1.0).unwrap(), 0);
        let stretched = Interval {
            scale: 10.0,
            ..Interval::default()
        };
        assert_eq!(steps(stretched, 1.01).unwrap(), 50);
        let fixed = Interval {
            fixed: Some(0.004),
            ..Interval::default()
        };
        assert_eq!(steps(fixed, 0.0).unwrap(), 2);
        for wrong in [1.003, 0.99, f64::NAN, f64::INFINITY] {
            let refused = steps(Interval::default(), wrong).unwrap_err().to_string();
            assert!(refused.contains("step 7 of the analysis"), "{refused}");
        }
    }
}
