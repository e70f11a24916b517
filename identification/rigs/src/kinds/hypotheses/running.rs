//! A hypothesis while a rig is simulated.

use super::compiled::{Compiled, Course, FIRST, POSITION, Place, SIGNAL, SIGNAL_RATE, SPEED, TIME};
use crate::kinds::RigRecording;

/// Steps of a sample in which what is remembered goes on.
const STEPS: usize = 2;
/// Share of its own size by which a remembered value is moved to find how its rate depends on it.
const MOVED: f64 = 1e-6;
/// Growth of a remembered value in a step beyond which it is not finite anyway.
const MOST_GROWTH: f64 = 30.0;

/// What acts inside of a rig's equations.
#[derive(Default)]
pub struct Inside<'a> {
    /// Forces on what moves.
    pub forces: Vec<Running<'a>>,
    /// On what the controller sends.
    pub valves: Vec<Running<'a>>,
}

impl Inside<'_> {
    /// True where nothing acts on what moves.
    pub fn has_no_force(&self) -> bool {
        self.forces.is_empty()
    }

    /// The forces, N, at `time` (s), `ahead` of the begin of the step.
    pub fn force(&mut self, ahead: f64, time: f64, x: f64, v: f64) -> f64 {
        let forces = self.forces.iter_mut();
        forces.map(|own| own.force(ahead, time, x, v)).sum()
    }

    /// Begins a step of `h` s at `time`.
    pub fn begin(&mut self, h: f64, time: f64, x: f64, v: f64) {
        for own in &mut self.forces {
            own.begin(h, time, x, v);
        }
    }

    /// Ends a step of `h` s that began at `time`, at this displacement and velocity.
    pub fn end(&mut self, h: f64, time: f64, x: f64, v: f64) {
        for own in &mut self.forces {
            own.step(h, time, (x, v));
        }
    }

    /// As at the begin of the record, at `time`.
    pub fn restart(&mut self, time: f64, x: f64, v: f64) {
        for own in self.forces.iter_mut().chain(&mut self.valves) {
            own.restart(time, x, v);
        }
    }

    /// What the valve gets of what the controller sends.
    #[inline]
    pub fn valve(&self, time: f64, sent: f64) -> f64 {
        let valves = self.valves.iter();
        valves.fold(sent, |sent, own| own.passed(time, sent))
    }
}

/// An effect with its values.
pub struct Running<'a> {
    of: &'a Compiled,
    /// What its expressions are given at the begin of the step.
    slots: Vec<f64>,
    /// The channels that it may read, and the places of their values.
    channels: Vec<(usize, &'a [f64])>,
    period: f64,
    /// Rates of what is remembered at the begin of the step, and how they depend on it.
    rates: Vec<(f64, f64)>,
    /// Place for values that are tried.
    scratch: Vec<f64>,
}

/// Rate of a sampled signal, by differences to both sides.
pub(super) fn rate(signal: &[f64], period: f64) -> Vec<f64> {
    let last = signal.len().saturating_sub(1);
    let at = |k: usize| {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
        (signal[after] - signal[before]) / ((after - before).max(1) as f64 * period)
    };
    (0..signal.len()).map(at).collect()
}

/// Value of a sampled signal between its samples; at its ends it stays.
fn between(signal: &[f64], place: f64) -> f64 {
    let Some(last) = signal.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = place.clamp(0.0, last as f64);
    let before = place as usize;
    let share = place - before as f64;
    signal[before] + share * (signal[(before + 1).min(last)] - signal[before])
}

/// `(e^a - 1) / a` and `(e^a - 1 - a) / a^2`.
fn growth(a: f64) -> (f64, f64) {
    let a = a.min(MOST_GROWTH);
    if a.abs() < 1e-3 {
        (1.0 + a * (0.5 + a / 6.0), 0.5 + a * (1.0 / 6.0 + a / 24.0))
    } else {
        let more = a.exp_m1();
        (more / a, (more - a) / (a * a))
    }
}

impl<'a> Running<'a> {
    /// With values of its parameters in their units and of the rig's nominal parameters.
    pub(super) fn new(
        of: &'a Compiled,
        values: &[f64],
        nominal: &[f64],
        recording: &'a RigRecording,
    ) -> Self {
        let mut slots = vec![0.0; FIRST];
        slots.extend(
            values
                .iter()
                .zip(&of.factors)
                .map(|(value, factor)| value * factor),
        );
        slots.resize(FIRST + of.parameters.len() + of.memory.len(), 0.0);
        let first = slots.len();
        let all = of.channels.iter().enumerate();
        let channels = all
            .map(|(i, channel)| (first + i, recording.input(*channel)))
            .collect();
        slots.resize(first + of.channels.len(), f64::NAN);
        slots.extend(nominal);
        Self {
            of,
            slots,
            channels,
            period: recording.period(),
            rates: vec![(0.0, 0.0); of.memory.len()],
            scratch: Vec::new(),
        }
    }

    fn memory(&self) -> usize {
        FIRST + self.of.parameters.len()
    }

    /// Fills in the channels at a sample, which may lie between two.
    fn look(&mut self, place: f64) {
        for (slot, signal) in &self.channels {
            self.slots[*slot] = between(signal, place);
        }
        self.slots[TIME] = place * self.period;
    }

    /// The past of a value, as seen from a sample, for a `signal` at its place.
    fn past(&self, slots: &[f64], place: f64, signal: &[f64], slot: usize, by: f64) -> f64 {
        let then = place - by.max(0.0) / self.period;
        if slot == SIGNAL {
            return between(signal, then);
        }
        let channel = self.channels.iter().find(|(own, _)| *own == slot);
        channel.map_or(slots[slot], |(_, signal)| between(signal, then))
    }

    /// The value at `slots`.
    fn value(&self, slots: &[f64], signal: &[f64]) -> f64 {
        let place = slots[TIME] / self.period;
        let past = |slot, by| self.past(slots, place, signal, slot, by);
        self.of.value.value(slots, &past)
    }

    /// The rate of the remembered value `i`, and its next one where it has no rate.
    fn course(&self, i: usize, slots: &[f64], signal: &[f64]) -> f64 {
        let place = slots[TIME] / self.period;
        let past = |slot, by| self.past(slots, place, signal, slot, by);
        match &self.of.memory[i].1 {
            Course::Rate(own) | Course::Next(own) => own.value(slots, &past),
        }
    }

    /// Remembered values at their start; those that have no rate at their first value.
    fn begin_memory(&mut self, signal: &[f64]) {
        let first = self.memory();
        for i in 0..self.of.memory.len() {
            let place = self.slots[TIME] / self.period;
            let past = |slot, by| self.past(&self.slots, place, signal, slot, by);
            let start = self.of.memory[i].0.value(&self.slots, &past);
            self.slots[first + i] = start;
        }
        self.take_next(signal);
    }

    /// The next of the remembered values without a rate.
    fn take_next(&mut self, signal: &[f64]) {
        let first = self.memory();
        for i in 0..self.of.memory.len() {
            if matches!(self.of.memory[i].1, Course::Next(_)) {
                self.slots[first + i] = self.course(i, &self.slots, signal);
            }
        }
    }

    /// Finds the rates at the begin of a step of `h` s.
    fn find_rates(&mut self, h: f64, signal: &[f64]) {
        let first = self.memory();
        for i in 0..self.of.memory.len() {
            if matches!(self.of.memory[i].1, Course::Rate(_)) {
                let rate = self.course(i, &self.slots, signal);
                let own = self.slots[first + i];
                let by = (MOVED * own.abs().max((rate * h).abs())).max(f64::MIN_POSITIVE.sqrt());
                self.slots[first + i] = own + by;
                let moved = self.course(i, &self.slots, signal);
                self.slots[first + i] = own;
                self.rates[i] = (rate, (moved - rate) / by);
            }
        }
    }

    /// Remembered values `h` s after the begin, at which what they follow is in `end`: exact where they are
    /// linear in themselves and in what runs straight (exponential Rosenbrock method).
    fn remember(&mut self, h: f64, end: &[f64], signal: &[f64]) {
        let first = self.memory();
        let count = self.of.memory.len();
        let mut after = end.to_vec();
        after[first..first + count].copy_from_slice(&self.slots[first..first + count]);
        let mut moved = vec![0.0; count];
        for (i, moved) in moved.iter_mut().enumerate() {
            if matches!(self.of.memory[i].1, Course::Rate(_)) {
                let (rate, slope) = self.rates[i];
                let (one, two) = growth(slope * h);
                let then = self.course(i, &after, signal);
                *moved = h * (one * rate + two * (then - rate));
            }
        }
        for (value, moved) in after[first..].iter_mut().zip(moved) {
            *value += moved;
        }
        self.slots = after;
    }

    /// Values sample by sample, of which there are `count`. `fill` puts what they depend on into the slots, at
    /// a sample or between two; `signal` is what a delay of `u` reaches back into. What is remembered begins
    /// again at `begins`.
    fn walk(
        &mut self,
        count: usize,
        begins: &[usize],
        signal: &[f64],
        fill: &dyn Fn(&mut [f64], f64),
    ) -> Vec<f64> {
        let mut values = Vec::with_capacity(count);
        let mut memory = self.of.memory.iter();
        let has_rate = memory.any(|(_, own)| matches!(own, Course::Rate(_)));
        let h = self.period / STEPS as f64;
        for k in 0..count {
            self.look(k as f64);
            fill(&mut self.slots, k as f64);
            if k == 0 || begins.binary_search(&k).is_ok() {
                self.begin_memory(signal);
            } else {
                self.take_next(signal);
            }
            values.push(self.value(&self.slots, signal));
            let steps = if has_rate && k + 1 < count { STEPS } else { 0 };
            for step in 1..=steps {
                self.find_rates(h, signal);
                let place = k as f64 + step as f64 / STEPS as f64;
                let begin = self.slots.clone();
                self.look(place);
                fill(&mut self.slots, place);
                let end = std::mem::replace(&mut self.slots, begin);
                self.remember(h, &end, signal);
            }
        }
        values
    }

    /// What `signal` becomes; what is remembered begins again at `begins`.
    pub(super) fn along(&mut self, signal: &[f64], begins: &[usize]) -> Vec<f64> {
        let rates = rate(signal, self.period);
        self.walk(signal.len(), begins, signal, &|slots, place| {
            slots[SIGNAL] = between(signal, place);
            slots[SIGNAL_RATE] = between(&rates, place);
        })
    }

    /// Adds the force of a device that is moved by `x` and `v` to `out`.
    pub(super) fn add_force(&mut self, x: &[f64], v: &[f64], out: &mut [f64]) {
        let forces = self.walk(out.len(), &[], &[], &|slots, place| {
            slots[POSITION] = between(x, place);
            slots[SPEED] = between(v, place);
        });
        for (sum, force) in out.iter_mut().zip(forces) {
            *sum += force;
        }
    }

    fn place_at(&mut self, time: f64, x: f64, v: f64) {
        self.look(time / self.period);
        self.slots[POSITION] = x;
        self.slots[SPEED] = v;
    }

    fn restart(&mut self, time: f64, x: f64, v: f64) {
        self.place_at(time, x, v);
        self.begin_memory(&[]);
    }

    fn begin(&mut self, h: f64, time: f64, x: f64, v: f64) {
        self.place_at(time, x, v);
        if !self.of.memory.is_empty() {
            self.find_rates(h, &[]);
        }
    }

    /// The force for what moves at `x` with `v`, `ahead` of the begin of the step.
    fn force(&mut self, ahead: f64, time: f64, x: f64, v: f64) -> f64 {
        let mut slots = std::mem::take(&mut self.scratch);
        slots.clone_from(&self.slots);
        slots[TIME] = time;
        slots[POSITION] = x;
        slots[SPEED] = v;
        for (slot, signal) in &self.channels {
            slots[*slot] = between(signal, time / self.period);
        }
        for (value, (rate, slope)) in slots[self.memory()..].iter_mut().zip(&self.rates) {
            *value += ahead * growth(slope * ahead).0 * rate;
        }
        let force = self.value(&slots, &[]);
        self.scratch = slots;
        force
    }

    fn step(&mut self, h: f64, time: f64, end: (f64, f64)) {
        if self.of.memory.is_empty() {
            return;
        }
        let before = self.slots.clone();
        self.place_at(time + h, end.0, end.1);
        let after = std::mem::replace(&mut self.slots, before);
        self.remember(h, &after, &[]);
        self.take_next(&[]);
    }

    fn passed(&self, time: f64, sent: f64) -> f64 {
        let mut slots = self.slots.clone();
        slots[TIME] = time;
        slots[SIGNAL] = sent;
        for (slot, signal) in &self.channels {
            slots[*slot] = between(signal, time / self.period);
        }
        self.value(&slots, &[])
    }

    /// Where it acts.
    pub(super) fn place(&self) -> Place {
        self.of.place
    }
}
