//! Values on their way between signals and FMUs: value references prepared once, nothing allocated
//! afterwards.

use super::signals::{Place, Signals};
use fmi_import::{CallError, Datum, Instance, Kind, Linear, Variability, Variable};
use fmi_system::Passage;

type Outcome = Result<(), Box<CallError>>;

/// Connected inputs of an instance, grouped by type; an array is set as a whole, with the start
/// values of elements that nothing drives.
#[derive(Default)]
pub(super) struct Inputs {
    groups: Vec<InputGroup>,
    exact: Vec<ExactGroup>,
    /// Whether some of it may only change at events; they change in one.
    is_discrete: bool,
}

/// References, values, and where which signal goes among them.
type ForeseenInputs<'a> = (&'a [u32], &'a [f64], Vec<Driven>);

/// A Float64 among the values that are set, and the number that drives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Driven {
    /// Its place among the values.
    pub place: usize,
    /// The number.
    pub signal: usize,
    /// What is done to it on its way.
    pub change: Linear,
}

struct InputGroup {
    kind: Kind,
    references: Vec<u32>,
    /// Driven values that are taken as they are and do not change between samples.
    copies: Vec<Copied>,
    /// Driven values that are taken as they are and change between samples.
    smooth: Vec<Smooth>,
    /// The other driven values.
    sources: Vec<InputSource>,
    values: Vec<f64>,
}

/// Values side by side that are those of signals side by side.
struct Copied {
    /// Place of the first among the values.
    place: usize,
    /// The first signal.
    signal: usize,
    count: usize,
}

struct InputSource {
    /// Place among the values.
    place: usize,
    signal: Place,
    passage: Passage,
    /// It changes between samples.
    is_smooth: bool,
}

/// A number that another continuous component gives, taken as it is.
struct Smooth {
    /// Place among the values.
    place: usize,
    signal: usize,
}

struct ExactGroup {
    kind: Kind,
    references: Vec<u32>,
    sources: Vec<(usize, Place)>,
    data: Vec<Datum>,
}

/// How an input follows a signal.
#[derive(Debug, Clone)]
pub(super) struct Drive {
    pub signal: Place,
    pub passage: Passage,
    pub is_smooth: bool,
}

/// Outputs of an instance, grouped by type; each group's signals are adjacent.
#[derive(Default, Clone)]
pub(super) struct Outputs {
    groups: Vec<OutputGroup>,
    exact: Vec<ExactOutputs>,
}

#[derive(Clone)]
struct OutputGroup {
    kind: Kind,
    references: Vec<u32>,
    first: usize,
    /// What was read, until all of it is known to be good.
    values: Vec<f64>,
}

#[derive(Clone)]
struct ExactOutputs {
    kind: Kind,
    references: Vec<u32>,
    first: usize,
    count: usize,
}

impl Inputs {
    /// Adds a variable (all elements of an array): how each element is driven, if it is, and its
    /// value if it is not.
    pub(super) fn add(&mut self, variable: &Variable, elements: &[(Option<Drive>, Datum)]) {
        self.is_discrete |= variable.variability != Variability::Continuous;
        if variable.kind.is_exact() {
            return self.add_exact(variable, elements);
        }
        let fits = |group: &InputGroup| group.kind == variable.kind;
        let place = self.groups.iter().position(fits).unwrap_or_else(|| {
            // What a clock lets in is set when it ticks.
            let place = match variable.kind {
                Kind::Clock => 0,
                _ => self.groups.len(),
            };
            self.groups.insert(
                place,
                InputGroup {
                    kind: variable.kind.clone(),
                    references: Vec::new(),
                    copies: Vec::new(),
                    smooth: Vec::new(),
                    sources: Vec::new(),
                    values: Vec::new(),
                },
            );
            place
        });
        let group = &mut self.groups[place];
        group.references.push(variable.reference);
        for (drive, value) in elements {
            if let Some(drive) = drive {
                group.drive(drive);
            }
            group.values.push(value.number());
        }
    }

    fn add_exact(&mut self, variable: &Variable, elements: &[(Option<Drive>, Datum)]) {
        let known = self
            .exact
            .iter()
            .position(|group| group.kind == variable.kind);
        let place = known.unwrap_or_else(|| {
            self.exact.push(ExactGroup {
                kind: variable.kind.clone(),
                references: Vec::new(),
                sources: Vec::new(),
                data: Vec::new(),
            });
            self.exact.len() - 1
        });
        let group = &mut self.exact[place];
        group.references.push(variable.reference);
        for (drive, value) in elements {
            if let Some(drive) = drive {
                group.sources.push((group.data.len(), drive.signal));
            }
            group.data.push(value.clone());
        }
    }

    /// Sets the inputs from the signals.
    pub(super) fn transfer(&mut self, signals: &Signals, instance: &mut Instance) -> Outcome {
        for group in &mut self.groups {
            group.copy(signals);
            for it in &group.smooth {
                group.values[it.place] = signals.numbers[it.signal];
            }
            for source in &group.sources {
                group.values[source.place] = source.passage.of(source.now(signals));
            }
        }
        self.set(signals, instance)
    }

    /// As [`Inputs::transfer`], but inputs that change between samples are set to
    /// `now + share (other - now)`.
    pub(super) fn transfer_between(
        &mut self,
        now: &Signals,
        other: &Signals,
        share: f64,
        instance: &mut Instance,
    ) -> Outcome {
        for group in &mut self.groups {
            group.copy(now);
            for it in &group.smooth {
                let at = now.numbers[it.signal];
                group.values[it.place] = at + share * (other.numbers[it.signal] - at);
            }
            for source in &group.sources {
                let at = source.now(now);
                let change = source.now(other) - at;
                let share = if source.is_smooth { share } else { 0.0 };
                group.values[source.place] = source.passage.of(at + share * change);
            }
        }
        self.set(now, instance)
    }

    /// Sets all values, in an event where some of them need one.
    #[inline]
    fn set(&mut self, signals: &Signals, instance: &mut Instance) -> Outcome {
        if self.is_discrete {
            return self.set_in_event(signals, instance);
        }
        for group in &self.groups {
            instance.set(&group.kind, &group.references, &group.values)?;
        }
        self.transfer_exact(signals, instance)
    }

    #[inline(never)]
    fn set_in_event(&mut self, signals: &Signals, instance: &mut Instance) -> Outcome {
        let is_clock = |group: &&InputGroup| group.kind == Kind::Clock;
        if let Some(clocks) = self.groups.first().filter(is_clock) {
            instance.set(&clocks.kind, &clocks.references, &clocks.values)?;
        }
        instance.begin_event()?;
        for group in self.groups.iter().filter(|group| !is_clock(group)) {
            instance.set(&group.kind, &group.references, &group.values)?;
        }
        self.transfer_exact(signals, instance)?;
        instance.end_event()?;
        Ok(())
    }

    /// What is set where all of it is Float64 and driven by numbers that are converted linearly; none
    /// otherwise.
    pub(super) fn foreseen(&self) -> Option<ForeseenInputs<'_>> {
        let plain = !self.is_discrete && self.exact.is_empty() && self.groups.len() <= 1;
        if !plain {
            return None;
        }
        let Some(group) = self.groups.first() else {
            return Some((&[], &[], Vec::new()));
        };
        if group.kind != Kind::Float64 || !group.sources.iter().all(InputSource::is_linear) {
            return None;
        }
        Some((&group.references, &group.values, group.driven().collect()))
    }

    /// The Float64 that are driven by numbers which are converted linearly.
    pub(super) fn driven(&self) -> impl Iterator<Item = Driven> + '_ {
        let mut groups = self.groups.iter();
        let real = groups.find(|group| group.kind == Kind::Float64);
        real.into_iter().flat_map(InputGroup::driven)
    }

    /// The numbers that drive it otherwise.
    pub(super) fn others(&self) -> impl Iterator<Item = usize> + '_ {
        self.groups.iter().flat_map(|group| {
            let is_real = group.kind == Kind::Float64;
            let plain = group.driven().filter(move |_| !is_real);
            let sources = group.sources.iter();
            let mapped = sources.filter(|it| it.passage.linear().is_none());
            let plain = plain.map(|driven| driven.signal);
            plain.chain(mapped.filter_map(InputSource::number))
        })
    }

    /// Whether all is set without an event, and none of it is of a type that a number does not hold.
    pub(super) fn is_plain(&self, instance: &Instance) -> bool {
        let waits = self.is_discrete && instance.has_events();
        self.exact.is_empty() && !waits
    }

    /// The numbers that drive it.
    pub(super) fn sources(&self) -> impl Iterator<Item = usize> + '_ {
        let groups = self.groups.iter();
        groups.flat_map(|group| {
            let copies = group.copies.iter();
            let copied = copies.flat_map(|it| it.signal..it.signal + it.count);
            let smooth = group.smooth.iter().map(|it| it.signal);
            let others = group.sources.iter().filter_map(InputSource::number);
            copied.chain(smooth).chain(others)
        })
    }

    /// The numbers that drive it and change between samples.
    pub(super) fn smooth_sources(&self) -> impl Iterator<Item = usize> + '_ {
        self.groups.iter().flat_map(|group| {
            let others = group.sources.iter().filter(|source| source.is_smooth);
            let plain = group.smooth.iter().map(|it| it.signal);
            plain.chain(others.filter_map(InputSource::number))
        })
    }

    /// How its Float64 inputs change with the signals, with their references; none where an input of
    /// another type does.
    pub(super) fn change(&self, signals: &[f64]) -> Option<(Vec<u32>, Vec<f64>)> {
        let (mut references, mut changes) = (Vec::new(), Vec::new());
        for group in &self.groups {
            let mut all = vec![0.0; group.values.len()];
            for it in &group.copies {
                let places = it.place..it.place + it.count;
                all[places].copy_from_slice(&signals[it.signal..it.signal + it.count]);
            }
            for it in &group.smooth {
                all[it.place] = signals[it.signal];
            }
            for source in &group.sources {
                let of_signal = source.number().map_or(0.0, |signal| signals[signal]);
                all[source.place] = source.passage.slope() * of_signal;
            }
            if group.kind == Kind::Float64 {
                references.extend_from_slice(&group.references);
                changes.extend(all);
            } else if all.iter().any(|change| *change != 0.0) {
                return None;
            }
        }
        Some((references, changes))
    }

    #[inline(always)]
    fn transfer_exact(&mut self, signals: &Signals, instance: &mut Instance) -> Outcome {
        if self.exact.is_empty() {
            return Ok(());
        }
        self.transfer_all_exact(signals, instance)
    }

    #[cold]
    fn transfer_all_exact(&mut self, signals: &Signals, instance: &mut Instance) -> Outcome {
        for group in &mut self.exact {
            for &(place, signal) in &group.sources {
                group.data[place] = match signal {
                    Place::Exact(signal) => signals.exact[signal].for_kind(&group.kind),
                    Place::Number(signal) => {
                        Datum::from_number(&group.kind, signals.numbers[signal])
                    }
                };
            }
            instance.set_exact(&group.kind, &group.references, &group.data)?;
        }
        Ok(())
    }
}

impl InputGroup {
    /// What is driven by a number that is converted linearly.
    fn driven(&self) -> impl Iterator<Item = Driven> + '_ {
        let plain = |(place, signal)| Driven {
            place,
            signal,
            change: Linear::NOTHING,
        };
        let copies = self.copies.iter();
        let copied = copies.flat_map(|it| (0..it.count).map(|at| (it.place + at, it.signal + at)));
        let smooth = self.smooth.iter().map(|it| (it.place, it.signal));
        let others = self.sources.iter().filter_map(|it| {
            Some(Driven {
                place: it.place,
                signal: it.number()?,
                change: it.passage.linear()?,
            })
        });
        copied.chain(smooth).map(plain).chain(others)
    }

    /// Lets a signal drive the value that is added next.
    fn drive(&mut self, drive: &Drive) {
        let place = self.values.len();
        if let Place::Number(signal) = drive.signal
            && drive.passage.is_nothing()
        {
            if drive.is_smooth {
                self.smooth.push(Smooth { place, signal });
                return;
            }
            match self.copies.last_mut() {
                Some(last)
                    if last.place + last.count == place && last.signal + last.count == signal =>
                {
                    last.count += 1;
                }
                _ => self.copies.push(Copied {
                    place,
                    signal,
                    count: 1,
                }),
            }
            return;
        }
        self.sources.push(InputSource {
            place,
            signal: drive.signal,
            passage: drive.passage.clone(),
            is_smooth: drive.is_smooth,
        });
    }

    #[inline]
    fn copy(&mut self, signals: &Signals) {
        for it in &self.copies {
            // Most are single, for which copying a slice costs more than the value.
            if it.count == 1 {
                self.values[it.place] = signals.numbers[it.signal];
                continue;
            }
            let from = &signals.numbers[it.signal..it.signal + it.count];
            self.values[it.place..it.place + it.count].copy_from_slice(from);
        }
    }
}

impl InputSource {
    fn is_linear(&self) -> bool {
        self.number().is_some() && self.passage.linear().is_some()
    }

    #[inline]
    fn number(&self) -> Option<usize> {
        match self.signal {
            Place::Number(signal) => Some(signal),
            Place::Exact(_) => None,
        }
    }

    #[inline]
    fn now(&self, signals: &Signals) -> f64 {
        match self.signal {
            Place::Number(signal) => signals.numbers[signal],
            Place::Exact(signal) => signals.exact[signal].number(),
        }
    }
}

impl Outputs {
    /// Adds variables of one type with `count` values, whose signals begin at `first`.
    pub(super) fn add(&mut self, kind: &Kind, references: Vec<u32>, count: usize, first: usize) {
        if kind.is_exact() {
            self.exact.push(ExactOutputs {
                kind: kind.clone(),
                references,
                first,
                count,
            });
            return;
        }
        self.groups.push(OutputGroup {
            kind: kind.clone(),
            values: vec![0.0; count],
            references,
            first,
        });
    }

    /// Adds what `other` has.
    pub(super) fn extend(&mut self, other: &Self) {
        self.groups.extend(other.groups.iter().cloned());
        self.exact.extend(other.exact.iter().cloned());
    }

    /// Each reading of numbers: type, references, first signal and how many there are.
    pub(super) fn readings(&self) -> impl Iterator<Item = (&Kind, &[u32], usize, usize)> {
        let groups = self.groups.iter();
        groups.map(|it| (&it.kind, &it.references[..], it.first, it.values.len()))
    }

    /// Whether it gives values that numbers do not hold.
    pub(super) fn has_exact(&self) -> bool {
        !self.exact.is_empty()
    }

    /// The Float64 that it gives: references, first signal and how many values there are.
    pub(super) fn reals(&self) -> Option<(&[u32], usize, usize)> {
        let mut all = self.readings();
        let real = all.find(|(kind, ..)| **kind == Kind::Float64);
        real.map(|(_, references, first, count)| (references, first, count))
    }

    /// The numbers that it gives.
    pub(super) fn signals(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.groups.iter();
        all.flat_map(|group| group.first..group.first + group.values.len())
    }

    /// The numbers that it gives and that may take any value.
    pub(super) fn real_signals(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.groups.iter();
        let real = all.filter(|group| matches!(group.kind, Kind::Float64 | Kind::Float32));
        real.flat_map(|group| group.first..group.first + group.values.len())
    }

    /// Notes how the outputs change with inputs among the changes of signals, as the FMU says; false
    /// where it does not. What is not real does not change.
    pub(super) fn change(
        &self,
        (references, changes): (&[u32], &[f64]),
        signals: &mut [f64],
        instance: &mut Instance,
    ) -> Result<bool, Box<CallError>> {
        for group in &self.groups {
            let (first, count) = (group.first, group.values.len());
            let into = &mut signals[first..first + count];
            into.fill(0.0);
            if changes.iter().all(|change| *change == 0.0) {
                continue;
            }
            match group.kind {
                Kind::Float64 => {}
                Kind::Float32 => return Ok(false),
                _ => continue,
            }
            let unknowns = (&group.references[..], into);
            if !instance.derivative(unknowns, (references, changes))? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads the outputs into the signals.
    #[inline]
    pub(super) fn read(&self, signals: &mut Signals, instance: &mut Instance) -> Outcome {
        for group in &self.groups {
            let into = &mut signals.numbers[group.first..group.first + group.values.len()];
            instance.get(&group.kind, &group.references, into)?;
        }
        for group in &self.exact {
            let data = &mut signals.exact[group.first..group.first + group.count];
            instance.get_exact(&group.kind, &group.references, data)?;
        }
        Ok(())
    }

    /// As [`Outputs::read`], but the signals keep their values where the instance fails.
    pub(super) fn read_all_or_none(
        &mut self,
        signals: &mut Signals,
        instance: &mut Instance,
    ) -> Outcome {
        for group in &mut self.groups {
            instance.get(&group.kind, &group.references, &mut group.values)?;
        }
        for group in &self.exact {
            let data = &mut signals.exact[group.first..group.first + group.count];
            instance.get_exact(&group.kind, &group.references, data)?;
        }
        for group in &self.groups {
            signals.numbers[group.first..group.first + group.values.len()]
                .copy_from_slice(&group.values);
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "transfer_tests.rs"]
mod tests;
