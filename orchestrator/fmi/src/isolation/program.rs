//! What is set and read after the steps of the FMUs in a guest. Connections among them travel there as a
//! program behind the steps, so that a communication step is one way there and back.
//!
//! The program is carried out before anybody asks. What it read answers a later call where that call, and
//! what has been set before it, is just what the program did; otherwise the call is made as usual.

use bytemuck::{cast_slice, cast_slice_mut};

use super::super::call::{AHEAD, Call, Foreseen, Function, Linear, Lost, Scalar, Values, Wire};
use super::parcel;

/// Steps in a row after which a program that nobody used is given up.
const UNUSED: u32 = 8;

/// The parcels that follow the steps, and which of them has answered what.
#[derive(Default)]
pub(super) struct Program {
    bytes: Vec<u8>,
    reads: Vec<Reading>,
    /// What came of them after the last steps.
    answers: Vec<u8>,
    /// Where the last parcel begins that was carried out, or begun.
    last: usize,
    /// The guest was lost there.
    lost: Option<Lost>,
    is_used: bool,
    unused: u32,
}

/// A call that reads, with what is set right before it.
struct Reading {
    instance: u32,
    /// Where the parcel that sets begins, if there is one.
    set: Option<usize>,
    get: usize,
    end: usize,
    /// Where the values that are read begin.
    values: usize,
    /// It can still answer.
    is_open: bool,
}

/// What the program knows of a call.
pub(super) enum Answered {
    /// Nothing.
    No,
    /// The status, with the values in the call.
    Yes(i32),
    /// The guest was lost in it.
    Lost(Lost),
}

impl Program {
    /// Adds a reading; gives its number, to which those that come later may refer.
    pub(super) fn add(&mut self, instance: u32, foreseen: &Foreseen) -> usize {
        let mut values = vec![0.0; foreseen.count];
        let mut get = Call::plain(Function::Get(foreseen.scalar));
        get.references = foreseen.read;
        get.count = foreseen.count;
        get.values = Values::Out(cast_slice_mut(&mut values));
        get.flags[AHEAD] = true;
        let set = (!foreseen.set.is_empty()).then(|| {
            let mut call = Call::plain(Function::Set(Scalar::Float64));
            call.references = foreseen.set;
            call.count = foreseen.values.len();
            call.values = Values::In(cast_slice(foreseen.values));
            let reads = &self.reads;
            let from = |reading: usize| reads.get(reading).map(|it| it.values);
            let into = parcel::values_at(&call);
            lay(&mut self.bytes, instance, foreseen.wires, from, into);
            let at = self.bytes.len();
            parcel::append(&mut self.bytes, instance, &call);
            at
        });
        let at = self.bytes.len();
        let values = at + parcel::values_at(&get);
        parcel::append(&mut self.bytes, instance, &get);
        self.reads.push(Reading {
            instance,
            set,
            get: at,
            end: self.bytes.len(),
            values,
            is_open: false,
        });
        self.reads.len() - 1
    }

    /// What follows the steps.
    pub(super) fn bytes(&mut self) -> &[u8] {
        self.unused = if self.is_used { 0 } else { self.unused + 1 };
        self.is_used = false;
        if self.unused > UNUSED {
            self.bytes.clear();
            self.reads.clear();
        }
        &self.bytes
    }

    /// Whether it reads from an instance.
    pub(super) fn has(&self, instance: u32) -> bool {
        self.reads.iter().any(|read| read.instance == instance)
    }

    /// Takes what came of it: `last` is where the last parcel begins that was begun, none where it was not
    /// reached.
    pub(super) fn take(&mut self, answers: &[u8], last: Option<usize>, lost: Option<Lost>) {
        self.answers.clear();
        self.answers.extend_from_slice(answers);
        self.last = last.unwrap_or(0);
        self.lost = lost;
        for read in &mut self.reads {
            read.is_open = last.is_some_and(|last| read.get <= last);
        }
    }

    /// The state of an instance is no longer what the program left, or soon will not be.
    pub(super) fn forget(&mut self, instance: u32) {
        for read in self.reads.iter_mut().filter(|it| it.instance == instance) {
            read.is_open = false;
        }
    }

    /// Answers a call that reads, after what was set in `kept`, where it did just that.
    pub(super) fn answer(&mut self, instance: u32, kept: &[u8], call: &mut Call) -> Answered {
        let mut reads = self.reads.iter_mut();
        let Some(read) = reads.find(|it| it.is_open && it.instance == instance) else {
            return Answered::No;
        };
        read.is_open = false;
        let set = read.set.map_or(&[][..], |at| {
            self.answers.get(at..read.get).unwrap_or_default()
        });
        let parcel = self.answers.get(read.get..read.end).unwrap_or_default();
        let head = parcel::head(parcel);
        let fits = head.is_some_and(|head| {
            head.function == call.function.number()
                && head.count == call.count as u64
                && matches!(&call.values, Values::Out(values) if values.len() as u64 == head.length)
                && parcel::are_references(parcel, &head, call.references)
        });
        let Some(head) = head.filter(|_| fits && set == kept) else {
            self.forget(instance);
            return Answered::No;
        };
        if let Some(lost) = self.lost.clone().filter(|_| read.get == self.last) {
            return Answered::Lost(lost);
        }
        let outcome = parcel::outcome(parcel, &head);
        let Ok(status @ (0 | 1)) = outcome else {
            self.forget(instance);
            return Answered::No;
        };
        self.is_used = true;
        parcel::give_back(parcel, &head, call);
        Answered::Yes(status)
    }
}

/// Bytes that describe a wire on its way to the guest: two places from the beginning of their parcel, factor
/// and offset.
const WIRE: usize = 32;

/// Appends a parcel that lets values flow along wires: from the values of readings, which begin at
/// `from(reading)` among `bytes`, to those of a call, which begin `into` bytes behind it.
pub(super) fn lay(
    bytes: &mut Vec<u8>,
    instance: u32,
    wires: &[Wire],
    from: impl Fn(usize) -> Option<usize>,
    into: usize,
) {
    let ends = wires.iter();
    let ends = ends.filter_map(|wire| Some((from(wire.reading)? + 8 * wire.element, wire)));
    let ends: Vec<(usize, &Wire)> = ends.collect();
    if ends.is_empty() {
        return;
    }
    let begin = bytes.len();
    let mut call = Call::plain(Function::Copy);
    let mut said = vec![[0_u64; WIRE / 8]; ends.len()];
    call.values = Values::In(cast_slice(&said));
    let into = begin + parcel::size(&call) + into;
    for (said, (from, wire)) in said.iter_mut().zip(ends) {
        let place = |at: usize| (at as u64).wrapping_sub(begin as u64);
        let Linear { factor, offset } = wire.change;
        *said = [
            place(from),
            place(into + 8 * wire.place),
            factor.to_bits(),
            offset.to_bits(),
        ];
    }
    let mut call = Call::plain(Function::Copy);
    call.values = Values::In(cast_slice(&said));
    parcel::append(bytes, instance, &call);
}

/// In the guest: lets numbers flow among the parcels of `room`, as the one at `at` says; a place outside is
/// passed over.
pub(super) fn copy(room: &mut [u8], at: usize, head: &parcel::Head) {
    let begin = at + parcel::values_of(head);
    for wire in 0..head.length as usize / WIRE {
        let said = |which: usize| {
            let said = begin + WIRE * wire + 8 * which;
            Some(u64::from_ne_bytes(
                room.get(said..said + 8)?.try_into().ok()?,
            ))
        };
        let place = |which: usize| {
            let by = said(which)?.cast_signed();
            let first = usize::try_from((at as i64).checked_add(by)?).ok()?;
            let end = first.checked_add(8)?;
            (end <= room.len()).then_some(first..end)
        };
        let flow = || {
            let value = f64::from_ne_bytes(room[place(0)?].try_into().ok()?);
            let change = Linear {
                factor: f64::from_bits(said(2)?),
                offset: f64::from_bits(said(3)?),
            };
            Some((place(1)?, change.of(value)))
        };
        if let Some((to, value)) = flow() {
            room[to].copy_from_slice(&value.to_ne_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In place of a guest whose FMUs give twice their input: carries out what it is sent, and gives where
    /// the last parcel begins. From the parcel at `until` on the FMUs refuse.
    fn guest(room: &mut [u8], inputs: &mut [f64; 3], until: usize) -> usize {
        let (mut at, mut last) = (0, 0);
        while at < room.len() {
            last = at;
            let head = parcel::head(&room[at..]).unwrap();
            let next = at + head.size as usize;
            if head.function == Function::Copy.number() {
                copy(room, at, &head);
                at = next;
                continue;
            }
            let input = &mut inputs[head.instance as usize];
            let size = head.size as usize;
            let went_well = parcel::carry_out(&mut room[at..], size, &head, |call| {
                match &mut call.values {
                    Values::In(bytes) => *input = cast_slice::<u8, f64>(bytes)[0],
                    Values::Out(bytes) => cast_slice_mut::<u8, f64>(bytes)[0] = 2.0 * *input,
                    _ => {}
                }
                Ok(if at >= until { 3 } else { 0 })
            });
            if !went_well {
                break;
            }
            at = next;
        }
        last
    }

    fn chain(change: Linear) -> Program {
        let mut program = Program::default();
        let first = Foreseen {
            set: &[],
            values: &[],
            wires: &[],
            read: &[7],
            scalar: Scalar::Float64,
            count: 1,
        };
        let mut reading = program.add(0, &first);
        for instance in 1..3 {
            let wire = Wire {
                reading,
                element: 0,
                place: 0,
                change,
            };
            let next = Foreseen {
                set: &[4],
                values: &[0.0],
                wires: &[wire],
                ..first
            };
            reading = program.add(instance, &next);
        }
        program
    }

    fn settings(instance: u32, value: f64) -> Vec<u8> {
        let (mut kept, value) = (Vec::new(), [value]);
        let mut set = Call::plain(Function::Set(Scalar::Float64));
        (set.references, set.count) = (&[4], 1);
        set.values = Values::In(cast_slice(&value));
        parcel::append(&mut kept, instance, &set);
        kept
    }

    /// What the program answers when `kept` was set before.
    fn asked(program: &mut Program, instance: u32, kept: &[u8]) -> Option<f64> {
        let mut value = [0.0];
        let mut get = Call::plain(Function::Get(Scalar::Float64));
        (get.references, get.count) = (&[7], 1);
        get.values = Values::Out(cast_slice_mut(&mut value));
        match program.answer(instance, kept, &mut get) {
            Answered::Yes(0) => Some(value[0]),
            _ => None,
        }
    }

    #[test]
    fn a_chain_is_read_behind_the_steps_and_answers_what_does_the_same() {
        let mut program = chain(Linear::NOTHING);
        let mut room = program.bytes().to_vec();
        let last = guest(&mut room, &mut [1.5, 0.0, 0.0], usize::MAX);
        program.take(&room, Some(last), None);
        assert_eq!(asked(&mut program, 0, &[]), Some(3.0));
        assert_eq!(asked(&mut program, 1, &settings(1, 3.0)), Some(6.0));
        // Something else was set: the call has to be made, and so has each after it.
        assert_eq!(asked(&mut program, 2, &settings(2, 6.5)), None);
        assert_eq!(asked(&mut program, 2, &settings(2, 6.0)), None);
        // Each answer is given once.
        assert_eq!(asked(&mut program, 0, &[]), None);
    }

    #[test]
    fn values_are_converted_on_their_way_as_the_host_converts_them() {
        let change = Linear {
            factor: 1.0 / 0.0254,
            offset: -0.1,
        };
        let mut program = chain(change);
        let mut room = program.bytes().to_vec();
        let last = guest(&mut room, &mut [1.5, 0.0, 0.0], usize::MAX);
        program.take(&room, Some(last), None);
        assert_eq!(asked(&mut program, 0, &[]), Some(3.0));
        // By hand, each operation rounded.
        let first = 3.0 * (1.0 / 0.0254) + -0.1;
        let second = 2.0 * first * (1.0 / 0.0254) + -0.1;
        let kept = settings(1, first);
        assert_eq!(asked(&mut program, 1, &kept), Some(2.0 * first));
        assert_eq!(
            asked(&mut program, 2, &settings(2, second)),
            Some(2.0 * second)
        );
        // Without an offset the sign of zero is kept.
        let negative = Linear {
            factor: 2.0,
            offset: 0.0,
        };
        assert_eq!(negative.of(-0.0).to_bits(), (-0.0_f64).to_bits());
    }

    #[test]
    fn what_was_not_reached_or_refused_answers_nothing() {
        let mut program = chain(Linear::NOTHING);
        let mut room = program.bytes().to_vec();
        let until = program.reads[1].get;
        let last = guest(&mut room, &mut [1.5, 0.0, 0.0], until);
        program.take(&room, Some(last), None);
        assert_eq!(asked(&mut program, 0, &[]), Some(3.0));
        assert_eq!(asked(&mut program, 1, &settings(1, 3.0)), None);
        assert_eq!(asked(&mut program, 2, &settings(2, 6.0)), None);
        // A guest that died in it: the loss is that of the reading in which it died.
        let lost = Some(Lost("is gone".to_string()));
        program.take(&room, Some(until), lost);
        assert_eq!(asked(&mut program, 0, &[]), Some(3.0));
        let mut get = Call::plain(Function::Get(Scalar::Float64));
        let mut value = [0.0];
        (get.references, get.count) = (&[7], 1);
        get.values = Values::Out(cast_slice_mut(&mut value));
        let kept = settings(1, 3.0);
        assert!(matches!(
            program.answer(1, &kept, &mut get),
            Answered::Lost(_)
        ));
    }

    #[test]
    fn a_call_of_another_function_or_of_other_variables_is_not_answered() {
        let get = Function::Get(Scalar::Float64);
        for (function, references, count, is_answered) in [
            (get, &[7_u32][..], 1, true),
            (Function::Get(Scalar::Int64), &[7], 1, false),
            (get, &[8], 1, false),
            (get, &[7, 7], 1, false),
            (get, &[7], 2, false),
        ] {
            let mut program = chain(Linear::NOTHING);
            let mut room = program.bytes().to_vec();
            let last = guest(&mut room, &mut [1.5, 0.0, 0.0], usize::MAX);
            program.take(&room, Some(last), None);
            let mut values = vec![0.0; count];
            let mut call = Call::plain(function);
            (call.references, call.count) = (references, count);
            call.values = Values::Out(cast_slice_mut(&mut values));
            let answer = program.answer(0, &[], &mut call);
            assert_eq!(matches!(answer, Answered::Yes(0)), is_answered);
        }
    }

    #[test]
    fn a_program_that_nobody_uses_is_given_up() {
        let mut program = chain(Linear::NOTHING);
        for _ in 0..UNUSED {
            assert!(!program.bytes().is_empty());
        }
        assert!(program.bytes().is_empty() && !program.has(1));
    }
}
