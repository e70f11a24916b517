//! A step of a closed loop: the linear equations exactly, what is not linear straight over the step, and friction
//! implicitly.

use nalgebra::SMatrix;

/// The linear loop.
pub(super) struct Loop {
    pub(super) gain: f64,
    pub(super) command_lag: f64,
    pub(super) loop_lag: f64,
    pub(super) feedforward: f64,
    pub(super) integral: f64,
    /// Share of the displacement that a spring takes of what moves the table: before the lags, which are short beside it.
    pub(super) spring_droop: f64,
    pub(super) resonance: f64,
    pub(super) resonance_damping: f64,
    /// Share of that damping which is the controller's, by feedback of the acceleration: what bounds the drive bounds it.
    pub(super) fed_back: f64,
    pub(super) friction: Option<Rubbing>,
}

/// Lagging command, displacement, flow, integral of the error, velocity and its rate times `P`, flow behind
/// half of its lag; friction of 1, against the speed: how far its bristles are bent.
pub(super) type State = [f64; WIDTH];
const STATES: usize = 7;
const RATE: usize = 5;
/// Its place in what the controller sends.
const RATE_SENT: usize = 6;
const RUBBED: usize = STATES;
/// As processors take numbers.
pub(super) const WIDTH: usize = 8;
/// Behind the states: the command, its slope, the flow beyond the linear one that is asked for, its rise over the step,
/// the speed that friction takes, and the flow beyond the linear one at the spool and its rise.
const COMMAND: usize = STATES;
const SLOPE: usize = STATES + 1;
const BEYOND: usize = STATES + 2;
const RISE: usize = STATES + 3;
const RUBS: usize = STATES + 4;
const PASSED: usize = STATES + 5;
const PASSED_RISE: usize = STATES + 6;
const ALL: usize = STATES + 7;

/// How friction builds up.
#[derive(Debug, Clone, Copy)]
pub(super) enum Law {
    /// `tanh(v / s)` with s, m/s.
    Sliding(f64),
    /// By bristles that bend up to a deflection, m.
    Bristles(f64),
}

/// Friction on a speed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rubbing {
    /// Speed that it takes at most, m/s, where one unit of it takes one.
    pub(super) most: f64,
    pub(super) law: Law,
}

impl Rubbing {
    /// The friction of 1 after a step of `length` from the speed `now`, which would be `free` without it, and from a
    /// friction of `before`. `share` is what one unit of it takes.
    fn after(&self, [now, free]: [f64; 2], share: f64, before: f64, length: f64) -> f64 {
        let most = share * self.most;
        match self.law {
            Law::Sliding(speed) => rubbing([now, free], most, speed),
            Law::Bristles(deflection) => bending(deflection, [now, free], most, before, length),
        }
    }
}

/// How far bristles are bent after a step of `length`, implicit: the speed `now` would be `free` without them, and
/// friction takes `most` of it where they are bent wholly. Over a way of `a` deflections, what they lack decays by
/// `1 / (1 + a + a^2 / 2)`, which is `exp(-a)` to second order and as still for a long way.
fn bending(deflection: f64, [now, free]: [f64; 2], most: f64, bent: f64, length: f64) -> f64 {
    let per_speed = 0.5 * length / deflection;
    // v + most z(v) = free has one solution, since z grows with v.
    let (mut low, mut high) = (free - most, free + most);
    let mut v = free - most * bent;
    for _ in 0..20 {
        let way = per_speed * (now + v);
        let (a, side) = (way.abs(), 1.0_f64.copysign(way));
        let lacking = most * (1.0 - bent * side);
        // All times what the lack is divided by.
        let decay = 1.0 + a * (1.0 + 0.5 * a);
        let off = (v + most * side - free) * decay - lacking * side;
        let step = off * decay / (decay * decay + lacking * (1.0 + a) * per_speed);
        if off > 0.0 {
            high = v;
        } else {
            low = v;
        }
        let next = v - step;
        v = if (low..=high).contains(&next) {
            next
        } else {
            0.5 * (low + high)
        };
        if step.abs() <= SOLVED * most {
            break;
        }
    }
    // By the balance: where they are stiff, they bend much by little of the speed.
    ((free - v) / most).clamp(-1.0, 1.0)
}

/// The friction of 1 after a step from a speed that is `now` and would be `free` without what it takes, `most` at most:
/// implicit, so that it sticks with steps of any length. Where the speed turns, friction does inside the step.
fn rubbing([now, free]: [f64; 2], most: f64, sliding_speed: f64) -> f64 {
    let (mut from, mut by) = (free, most);
    if now * (free - most.copysign(now)) < 0.0 {
        let end = free - most * tanh(now / sliding_speed);
        if now * end < 0.0 {
            // From rest in what is left of the step.
            let left = end / (end - now);
            (from, by) = (left * (free - now), left * most);
        }
    }
    (free - slowed(from, by, sliding_speed)) / most
}

/// The speed after a step of friction `most` that would be `free` without.
fn slowed(free: f64, most: f64, sliding_speed: f64) -> f64 {
    // v + most tanh(v / s) = free has one solution, which is between free less most and free.
    let (mut low, mut high) = ((free.abs() - most).max(0.0), free.abs());
    if low > SATURATED * sliding_speed {
        return low.copysign(free);
    }
    let mut v = low.max(high * sliding_speed / (sliding_speed + most));
    for _ in 0..20 {
        let t = tanh(v / sliding_speed);
        let off = v + most * t - free.abs();
        if off > 0.0 {
            high = v;
        } else {
            low = v;
        }
        let step = off / (1.0 + most / sliding_speed * (1.0 - t * t));
        let next = v - step;
        v = if (low..=high).contains(&next) {
            next
        } else {
            0.5 * (low + high)
        };
        if step.abs() <= SOLVED * sliding_speed {
            break;
        }
    }
    v.copysign(free)
}

/// Of what friction takes, or of its speed: the last step of Newton's method. The error is of the order of its square.
const SOLVED: f64 = 1e-5;
/// `tanh` is one beyond it.
const SATURATED: f64 = 20.0;

/// To the last digits of one, by a single exponential.
pub(super) fn tanh(x: f64) -> f64 {
    1.0 - 2.0 / (1.0 + (2.0 * x).exp())
}

/// The solution over a step for a command that runs straight and a flow beyond the linear one that does
/// (exponential time differencing; Cox and Matthews, J. Comput. Phys. 176, 2002): exact for any lag.
pub(super) struct Step {
    /// s.
    pub(super) length: f64,
    /// The state after the step for one of everything before.
    pub(super) columns: [State; ALL],
    /// What the controller sends, of the first four states, the command, its slope and the velocity's rate.
    pub(super) sent: [f64; 7],
    /// What it sends after the step for one of everything before, beside what it sends of the command there.
    later: [f64; ALL],
    /// What it sends at once for one of what friction takes, by the velocity's rate.
    sent_at_once: f64,
    /// The state that is the spool's position as a flow; none without a lag.
    pub(super) spool: Option<usize>,
    /// Friction and the state that is the speed on which it acts.
    pub(super) rubbed: Option<(Rubbing, usize)>,
}

/// The command over a step.
pub(super) struct Course {
    pub(super) ends: [f64; 2],
    pub(super) slope: f64,
}

/// Damping of the resonance below which friction takes no more speed.
const LEAST_DAMPING: f64 = 0.02;

impl Loop {
    pub(super) fn step(&self, length: f64, sample: f64) -> Step {
        let Self {
            gain,
            feedforward,
            integral,
            ..
        } = *self;
        // A lag that is nothing beside a sample is none.
        let pole = |time: f64| {
            if time > 1e-3 * sample {
                1.0 / time
            } else {
                0.0
            }
        };
        let has_resonance = self.resonance > 1e-3 * sample;
        // Friction needs a speed to act on.
        let least = if self.friction.is_some() && !has_resonance {
            0.1 * sample
        } else {
            0.0
        };
        let lag = 0.5 * self.loop_lag.max(least);
        let (command_pole, pole) = (pole(self.command_lag), pole(lag));
        let ahead = feedforward / gain;
        // Of the first four states, the command, its slope and the velocity's rate.
        let error = if command_pole > 0.0 {
            [1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        } else {
            [0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0]
        };
        let speed = if command_pole > 0.0 {
            [-command_pole, 0.0, 0.0, 0.0, command_pole, 0.0, 0.0]
        } else {
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        };
        let mut sent: [f64; 7] = std::array::from_fn(|i| error[i] + ahead * speed[i]);
        sent[3] += 1.0;
        let own_damping = self.resonance_damping * (1.0 - self.fed_back);
        let fed_back = 2.0 * self.resonance_damping * self.fed_back;
        if has_resonance {
            sent[RATE_SENT] = -fed_back / gain;
        }
        let column = |i: usize| [0, 1, 2, 3, COMMAND, SLOPE, RATE, BEYOND][i];
        let mut a = SMatrix::<f64, ALL, ALL>::zeros();
        let mut sent_at_once = 0.0;
        let flow: [f64; 8] = std::array::from_fn(|i| sent.get(i).map_or(1.0, |s| gain * s));
        // What the flow moves: the table itself, or the mass on the oil.
        let moved = if has_resonance { RATE } else { 1 };
        let share = if has_resonance {
            1.0 / self.resonance
        } else {
            1.0
        };
        for i in 0..6 {
            let place = column(i);
            if command_pole > 0.0 {
                a[(0, place)] = speed[i];
            }
            a[(3, place)] = integral * error[i];
        }
        // What the flow acts on first.
        let (driven, by) = if pole > 0.0 {
            (6, pole)
        } else {
            (moved, share)
        };
        for (i, value) in flow.into_iter().enumerate() {
            a[(driven, column(i))] += by * value;
        }
        // Behind the spool: the mass on the oil, or half of the lag in its place.
        let mut passes = (moved, share);
        if pole > 0.0 {
            a[(6, 6)] -= pole;
            a[(2, 6)] = pole;
            a[(2, 2)] = -pole;
            a[(moved, 2)] += share;
            if !has_resonance {
                a[(2, RUBS)] = pole;
                passes = (2, pole);
            }
        }
        let (behind, by_spool) = passes;
        a[(behind, PASSED)] = by_spool;
        // The spring holds the table back behind whatever bounds the flow.
        a[(behind, 1)] -= by_spool * gain * self.spring_droop;
        if has_resonance {
            // On the mass: what it takes of a steady speed is lost in the damping (a leak, a coil's resistance).
            let per_friction = 0.5 / own_damping.max(LEAST_DAMPING);
            a[(4, RUBS)] = share * per_friction;
            a[(1, 4)] = 1.0;
            a[(4, 5)] = share;
            a[(5, 4)] -= share;
            a[(5, 5)] -= 2.0 * own_damping * share;
            // The velocity's rate is less by what friction takes.
            a[(driven, RUBS)] -= by * fed_back * per_friction;
            sent_at_once = -fed_back * per_friction / gain;
        }
        a[(COMMAND, SLOPE)] = 1.0;
        let mut a = a * length;
        a[(BEYOND, RISE)] = 1.0;
        a[(PASSED, PASSED_RISE)] = 1.0;
        let solution = if a.iter().all(|value| value.is_finite()) {
            a.exp()
        } else {
            a.map(|_| f64::NAN)
        };
        let sent_of = |j: usize| -> f64 {
            let first: f64 = (0..4).map(|i| sent[i] * solution[(i, j)]).sum();
            first + sent[RATE_SENT] * solution[(RATE, j)]
        };
        let mut later: [f64; ALL] = std::array::from_fn(sent_of);
        later[RUBS] += sent_at_once;
        Step {
            length,
            columns: std::array::from_fn(|j| {
                std::array::from_fn(|i| if i < STATES { solution[(i, j)] } else { 0.0 })
            }),
            sent,
            later,
            sent_at_once,
            spool: (pole > 0.0).then_some(if has_resonance { 2 } else { 6 }),
            rubbed: self
                .friction
                .map(|own| (own, if has_resonance { 4 } else { 2 })),
        }
    }
}

impl Step {
    /// The state after the step. `beyond` is the flow beyond the linear one for what the controller sends, `passed` for
    /// the spool's position as a flow.
    #[inline]
    pub(super) fn advance(
        &self,
        state: State,
        course: &Course,
        beyond: Option<&impl Fn(f64) -> f64>,
        passed: Option<(usize, &impl Fn(f64) -> f64)>,
    ) -> State {
        let (columns, slope) = (&self.columns, course.slope);
        let [begin, end] = course.ends;
        let mut after: State = [0.0; WIDTH];
        for (column, value) in columns.iter().zip(&state[..STATES]) {
            add(&mut after, column, *value);
        }
        add(&mut after, &columns[COMMAND], begin);
        add(&mut after, &columns[SLOPE], slope);
        let rub = |own: &Rubbing, at: usize, free: f64| {
            let (speeds, share) = ([state[at], free], columns[RUBS][at]);
            own.after(speeds, share, state[RUBBED], self.length)
        };
        let passed = passed.map(|(at, passed)| (at, passed, passed(state[at])));
        if let Some((.., now)) = passed {
            add(&mut after, &columns[PASSED], now);
        }
        if let Some(beyond) = beyond {
            let (sent, later) = (&self.sent, &self.later);
            // In pairs, which processors add side by side.
            let pairs = |of: &[f64]| {
                (of[0] * state[0] + of[1] * state[1]) + (of[2] * state[2] + of[3] * state[3])
            };
            let given = |command: f64| sent[4] * command + sent[5] * slope;
            let rubs = self.rubbed.as_ref();
            let rubs = rubs.map_or(0.0, |(own, _)| -own.most * state[RUBBED]);
            let rate = sent[RATE_SENT] * state[RATE] + self.sent_at_once * rubs;
            let now = beyond((pairs(sent) + rate) + given(begin));
            let rate = later[4] * state[4] + later[RATE] * state[RATE];
            let given = (later[COMMAND] * begin + later[SLOPE] * slope) + given(end);
            let mut sends =
                (pairs(later) + (rate + later[6] * state[6])) + given + later[BEYOND] * now;
            if let Some((.., now)) = passed {
                sends += later[PASSED] * now;
            }
            if let Some((own, at)) = &self.rubbed {
                let free = after[*at] + now * columns[BEYOND][*at];
                sends += later[RUBS] * (-own.most * rub(own, *at, free));
            }
            let mut rise = beyond(sends) - now;
            if sent[RATE_SENT] != 0.0 {
                rise = beyond(sends + later[RISE] * rise) - now;
            }
            add(&mut after, &columns[BEYOND], now);
            add(&mut after, &columns[RISE], rise);
        }
        if let Some((at, passed, now)) = passed {
            let rise = passed(after[at]) - now;
            add(&mut after, &columns[PASSED_RISE], rise);
        }
        if let Some((own, at)) = &self.rubbed {
            let friction = rub(own, *at, after[*at]);
            add(&mut after, &columns[RUBS], -own.most * friction);
            after[RUBBED] = friction;
        }
        after
    }
}

#[inline]
fn add(to: &mut State, column: &State, value: f64) {
    for i in 0..WIDTH {
        to[i] += column[i] * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_as_exact_as_two_shorter_ones() {
        let form = Loop {
            gain: 30.0,
            command_lag: 0.002,
            loop_lag: 0.003,
            feedforward: 0.4,
            integral: 0.7,
            spring_droop: 0.05,
            resonance: 0.004,
            resonance_damping: 0.3,
            fed_back: 0.2,
            friction: None,
        };
        let (length, share, slope) = (0.01, 0.3, 7.0);
        let state: State = [1.0, -2.0, 0.5, 0.1, 3.0, -1.0, 2.0, 0.0];
        let [middle, end] = [share, 1.0].map(|part| 1.0 + part * length * slope);
        let beyond: Option<&fn(f64) -> f64> = None;
        let advance = |state: State, share: f64, ends: [f64; 2]| {
            let step = form.step(share * length, length);
            step.advance(
                state,
                &Course { ends, slope },
                beyond,
                beyond.map(|own| (2, own)),
            )
        };
        let halfway = advance(state, share, [1.0, middle]);
        let expected = advance(halfway, 1.0 - share, [middle, end]);
        let found = advance(state, 1.0, [1.0, end]);
        for (found, expected) in found.iter().zip(&expected) {
            assert!(
                (found - expected).abs() < 1e-9 * expected.abs().max(1.0),
                "{found} {expected}"
            );
        }
    }

    /// Rates of the states under a command and its slope: the equations of which [`Step`] is the solution.
    fn rates(
        form: &Loop,
        y: &State,
        [command, slope]: [f64; 2],
        beyond: fn(f64) -> f64,
        passed: fn(f64) -> f64,
    ) -> State {
        let [lagging, x, flow, sum, speed, pulled, spool, _] = *y;
        let (lags, swings, yields) = (
            form.command_lag > 0.0,
            form.resonance > 0.0,
            form.loop_lag > 0.0,
        );
        let (wanted, rate) = if lags {
            (lagging, (command - lagging) / form.command_lag)
        } else {
            (command, slope)
        };
        let error = wanted - x;
        let rubbed = match form.friction {
            Some(Rubbing {
                most,
                law: Law::Sliding(own),
            }) => most * (if swings { speed } else { flow } / own).tanh(),
            _ => 0.0,
        };
        let mut d: State = [0.0; WIDTH];
        d[0] = if lags { rate } else { 0.0 };
        d[3] = form.integral * error;
        let mut sent = error + form.feedforward / form.gain * rate + sum;
        let own = form.resonance_damping * (1.0 - form.fed_back);
        let pull = pulled - 0.5 / own * rubbed;
        if swings {
            sent -= 2.0 * form.resonance_damping * form.fed_back / form.gain * pull;
        }
        let asked = form.gain * sent + beyond(sent);
        let droop = form.gain * form.spring_droop * x;
        let half = 0.5 * form.loop_lag;
        d[6] = if yields { (asked - spool) / half } else { 0.0 };
        if swings {
            d[2] = (spool - flow) / half;
            d[1] = speed;
            d[4] = pull / form.resonance;
            let pushed = flow + passed(flow) - droop - speed - 2.0 * own * pulled;
            d[5] = pushed / form.resonance;
        } else if yields {
            d[2] = (spool + passed(spool) - droop - rubbed - flow) / half;
            d[1] = flow;
        } else {
            d[1] = asked - droop;
        }
        d
    }

    /// The largest difference of displacements from the classical Runge-Kutta method with a fortieth of the step, over
    /// the largest displacement.
    fn away(form: &Loop, beyond: fn(f64) -> f64, passed: fn(f64) -> f64) -> f64 {
        let (length, inner) = (1e-3, 40);
        let step = form.step(length, length);
        let h = length / f64::from(inner);
        let command = |k: i32| (5.0 * length * f64::from(k)).sin() + 0.3;
        let (mut own, mut other): (State, State) = ([0.0; WIDTH], [0.0; WIDTH]);
        let (mut most, mut size) = (0.0_f64, 0.0_f64);
        for k in 0..600 {
            let ends = [command(k), command(k + 1)];
            let slope = (ends[1] - ends[0]) / length;
            let passes = step.spool.map(|at| (at, &passed));
            own = step.advance(own, &Course { ends, slope }, Some(&beyond), passes);
            for i in 0..inner {
                let at = |share: f64| ends[0] + slope * h * (f64::from(i) + share);
                let along =
                    |by: f64, d: &State| -> State { std::array::from_fn(|n| other[n] + by * d[n]) };
                let of = |y: &State, share: f64| rates(form, y, [at(share), slope], beyond, passed);
                let a = of(&other, 0.0);
                let b = of(&along(0.5 * h, &a), 0.5);
                let c = of(&along(0.5 * h, &b), 0.5);
                let d = of(&along(h, &c), 1.0);
                for n in 0..WIDTH {
                    other[n] += h / 6.0 * (a[n] + 2.0 * (b[n] + c[n]) + d[n]);
                }
            }
            most = most.max((own[1] - other[1]).abs());
            size = size.max(other[1].abs());
        }
        most / size
    }

    #[test]
    fn steps_follow_the_equations_of_the_loop() {
        let plain = Loop {
            gain: 30.0,
            command_lag: 0.0,
            loop_lag: 0.0,
            feedforward: 0.4,
            integral: 0.7,
            spring_droop: 0.05,
            resonance: 0.0,
            resonance_damping: 0.3,
            fed_back: 0.2,
            friction: None,
        };
        let lagging = Loop {
            command_lag: 0.02,
            loop_lag: 0.012,
            ..plain
        };
        let swinging = Loop {
            resonance: 0.008,
            ..lagging
        };
        let rubbing = Some(Rubbing {
            most: 1.5,
            law: Law::Sliding(2.0),
        });
        let none: fn(f64) -> f64 = |_| 0.0;
        // A valve that opens less the farther it does, and one through which less passes.
        let beyond: fn(f64) -> f64 = |sent| -40.0 * sent.powi(3);
        let passed: fn(f64) -> f64 = |flow| -4e-3 * flow.powi(3);
        for form in [plain, lagging, swinging] {
            let name = (form.loop_lag, form.resonance);
            let found = [
                away(&form, none, none),
                away(&form, beyond, none),
                away(&form, beyond, passed),
            ];
            assert!(found.iter().all(|own| *own < 2e-5), "{name:?}: {found:?}");
            if form.loop_lag > 0.0 {
                let rubbed = Loop {
                    friction: rubbing,
                    ..form
                };
                let found = away(&rubbed, beyond, passed);
                assert!(found < 2e-3, "{name:?}: {found:?}");
            }
        }
    }

    /// From rest, as sliding as fast as it is left.
    #[test]
    fn friction_takes_of_a_speed_what_its_law_says() {
        let (most, sliding) = (0.3, 0.05);
        for free in [0.9, 0.31, 0.2, 1e-3, -0.4] {
            let taken = rubbing([0.0, free], most, sliding);
            let left = free - most * taken;
            assert!(
                (taken - (left / sliding).tanh()).abs() < 1e-6,
                "{free}: {taken}"
            );
        }
        // From 0.1 to -0.2 it turns where friction has the rest of the step.
        let end = -0.2 - most * (0.1_f64 / sliding).tanh();
        let part = end / (end - 0.1);
        let taken = rubbing([0.1, -0.2], most, sliding);
        let left = -0.2 - most * taken;
        let turned = part * (-0.2 - 0.1) - left;
        let expected = part * most * (left / sliding).tanh();
        assert!((turned - expected).abs() < 1e-6, "{turned} {expected}");
        // Bristles of 0.1 mm, bent by half, after a step of 10 ms.
        let (deflection, length) = (1e-4, 0.01);
        for (now, free, bent) in [(0.2, 0.3, 0.5), (0.01, 0.02, -0.5), (-0.1, -0.4, 0.9)] {
            let taken = bending(deflection, [now, free], most, bent, length);
            let left = free - most * taken;
            let way = 0.5 * length * (now + left) / deflection;
            let side = way.signum();
            let decay = 1.0 + way.abs() + 0.5 * way * way;
            let expected = side - (side - bent) / decay;
            assert!((taken - expected).abs() < 1e-4, "{now}: {taken} {expected}");
        }
    }

    #[test]
    fn the_quick_tanh_is_the_library_s() {
        for k in -4000..4000 {
            let x = 0.01 * f64::from(k);
            assert!((tanh(x) - x.tanh()).abs() < 1e-15, "{x}");
        }
    }
}
