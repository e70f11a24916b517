//! An instance in a guest, called like one in this process.

use std::sync::{Arc, Mutex, PoisonError};

use super::super::call::{
    AHEAD, Call, Culprit, Endpoint, Foreseen, Function, Lost, Scalar, Values, Wire,
};
use super::super::error::InstanceError;
use super::super::native::{Setup, Sink};
use super::host::{Answer, Host};
use super::parcel;
use super::requests::Request;

/// Bytes of settings that are kept until the next call that gives something.
const KEPT: usize = 64 << 10;

/// An instance in a guest.
pub(in super::super) struct Remote {
    host: Arc<Mutex<Host>>,
    instance: u32,
    /// Settings that have not been sent yet.
    kept: Vec<u8>,
    /// Whether settings may wait.
    keeps: bool,
    ahead: Ahead,
    /// What is read after steps is part of the program of its process.
    is_foreseen: bool,
    /// The step whose outcome has not been fetched.
    request: Option<Request>,
}

/// What is read right after each step travels with the step: one way to the guest instead of several.
#[derive(Default)]
struct Ahead {
    /// The readings right after the last step, as parcels.
    habit: Vec<u8>,
    /// The same with their answers; empty where anything else has been called since.
    answers: Vec<u8>,
    /// How many bytes of the habit have been asked for again since the last step.
    asked: usize,
    /// Nothing but these has been called since the last step.
    is_after_step: bool,
}

impl Ahead {
    /// Answers a call from what came with the step, where it did.
    fn answer(&mut self, call: &mut Call) -> Option<i32> {
        let answer = self.answers.get(self.asked..)?;
        let head = parcel::head(answer)?;
        let fits = head.function == call.function.number()
            && head.count == call.count as u64
            && matches!(&call.values, Values::Out(values) if values.len() as u64 == head.length)
            && parcel::are_references(answer, &head, call.references);
        if !fits {
            return None;
        }
        parcel::give_back(answer, &head, call);
        self.asked += head.size as usize;
        Some(head.status)
    }

    /// Notes what is called after a step, and what is no longer called.
    fn learn(&mut self, instance: u32, call: &Call) {
        self.answers.clear();
        if !self.is_after_step {
            return;
        }
        self.habit.truncate(self.asked);
        self.is_after_step = matches!(call.function, Function::Get(_))
            && matches!(&call.values, Values::Out(values) if values.len() + self.asked < KEPT);
        if self.is_after_step {
            parcel::append(&mut self.habit, instance, call);
            parcel::mark(&mut self.habit[self.asked..], AHEAD);
            self.asked = self.habit.len();
        }
    }

    /// Where the values of a reading of Float64 begin among the parcels of the habit.
    fn place_of(&self, references: &[u32], count: usize) -> Option<usize> {
        let number = Function::Get(Scalar::Float64).number();
        parcel::all(&self.habit).find_map(|(at, head)| {
            let is_it = head.function == number
                && head.count == count as u64
                && parcel::are_references(&self.habit[at..], &head, references);
            is_it.then(|| at + parcel::values_of(&head))
        })
    }
}

impl Remote {
    /// Makes an instance in the guest of `host`. Where calls are traced settings do not wait.
    ///
    /// # Errors
    /// As for an instance in this process; or the guest ended.
    pub(in super::super) fn new(
        host: &Arc<Mutex<Host>>,
        setup: &Setup,
        sink: Arc<dyn Sink>,
        is_traced: bool,
    ) -> Result<Self, InstanceError> {
        let text = serde_json::to_vec(setup)?;
        let mut guest = host.lock().unwrap_or_else(PoisonError::into_inner);
        let instance = guest.enroll(sink);
        let mut call = Call::plain(Function::Instantiate);
        call.values = Values::In(&text);
        match guest.call(instance, &[], &mut call, &mut Vec::new()) {
            Answer::Called(Ok(_)) | Answer::Other(..) => {}
            Answer::Called(Err(lost)) => return Err(InstanceError::Apart(lost)),
        }
        drop(guest);
        Ok(Self {
            host: host.clone(),
            instance,
            kept: Vec::new(),
            keeps: !is_traced,
            ahead: Ahead::default(),
            is_foreseen: false,
            request: None,
        })
    }
}

/// Whether a call gives nothing and may travel with the next one.
fn may_wait(function: Function) -> bool {
    matches!(
        function,
        Function::Set(_) | Function::EnterEventMode | Function::EnterStepMode
    )
}

impl Endpoint for Remote {
    fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
        if self.keeps && may_wait(call.function) && self.kept.len() + parcel::size(call) < KEPT {
            self.ahead.learn(self.instance, call);
            parcel::append(&mut self.kept, self.instance, call);
            return Ok(0);
        }
        if self.is_foreseen && self.request.is_none() && matches!(call.function, Function::Get(_)) {
            let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(outcome) = host.foreseen(self.instance, &self.kept, call) {
                self.kept.clear();
                return outcome;
            }
        }
        let mut after = Vec::new();
        if self.keeps {
            if self.kept.is_empty()
                && let Some(status) = self.ahead.answer(call)
            {
                return Ok(status);
            }
            self.ahead.learn(self.instance, call);
            if call.function == Function::DoStep {
                after = std::mem::take(&mut self.ahead.answers);
                after.extend_from_slice(&self.ahead.habit);
            }
        }
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        if self.request.take().is_some() {
            host.forget_request();
        }
        let answer = host.call(self.instance, &self.kept, call, &mut after);
        drop(host);
        self.kept.clear();
        self.came(answer, call, after)
    }

    fn request(&mut self, call: &Call) -> bool {
        if !self.keeps || self.request.is_some() {
            return false;
        }
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_foreseen = self.is_foreseen && host.program.has(self.instance);
        if self.is_foreseen {
            self.ahead.habit.clear();
        }
        self.ahead.learn(self.instance, call);
        self.request = host.request(self.instance, &self.kept, call, &self.ahead.habit);
        if self.request.is_some() {
            self.kept.clear();
        }
        self.request.is_some()
    }

    fn request_wired(
        &mut self,
        call: &Call,
        wires: &[Wire],
        (references, count): (&[u32], usize),
    ) -> Option<Option<usize>> {
        if self.keeps {
            self.ahead.learn(self.instance, call);
            let set = Function::Set(Scalar::Float64).number();
            let into = parcel::all(&self.kept).find(|(_, head)| head.function == set);
            let into = into.map(|(at, head)| at + parcel::values_of(&head));
            let habit = &self.ahead.habit;
            let read = self.ahead.place_of(references, count);
            let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
            let before = (&self.kept[..], into);
            let requested = host.request_wired(self.instance, before, wires, call, (habit, read));
            self.request = requested.map(|(request, _)| request);
            // They are set again when all of them are known.
            self.kept.clear();
            return requested.map(|(_, reading)| reading);
        }
        None
    }

    fn exchanges(&self) -> u64 {
        let host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        host.exchanges
    }

    fn is_settled(&self) -> bool {
        self.keeps && self.kept.is_empty() && self.request.is_none()
    }

    fn foresee(&mut self, foreseen: &Foreseen) -> Option<usize> {
        if !self.keeps {
            return None;
        }
        self.is_foreseen = true;
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        Some(host.program.add(self.instance, foreseen))
    }

    fn answer(&mut self, call: &mut Call) -> Result<i32, Lost> {
        let Some(request) = self.request.take() else {
            return Err(Lost("was not requested".to_string()));
        };
        let mut after = std::mem::take(&mut self.ahead.answers);
        after.clear();
        after.extend_from_slice(&self.ahead.habit);
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = match request.is_wired() {
            true => host.answer_wired(request, &self.kept, call, &mut after),
            false => host.answer(request, call, &mut after),
        };
        drop(host);
        if request.is_wired() {
            self.kept.clear();
        }
        self.came(answer, call, after)
    }
}

impl Remote {
    /// The outcome of a call, with what was read after it.
    fn came(&mut self, answer: Answer, call: &mut Call, after: Vec<u8>) -> Result<i32, Lost> {
        self.ahead.answers = after;
        self.ahead.asked = 0;
        self.ahead.is_after_step = call.function == Function::DoStep;
        match answer {
            Answer::Called(outcome) => outcome,
            Answer::Other(parcel, outcome) => {
                self.ahead = Ahead::default();
                if let Some(head) = parcel::head(&parcel)
                    && let Some(function) = Function::numbered(head.function)
                {
                    call.culprit = Some(Box::new(Culprit {
                        function,
                        references: parcel::references(&parcel, &head),
                    }));
                }
                outcome
            }
        }
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        let mut host = self.host.lock().unwrap_or_else(PoisonError::into_inner);
        // An FMU that does not let itself be freed is ended with its guest.
        let mut call = Call::plain(Function::FreeInstance);
        let _ = host.call(self.instance, &[], &mut call, &mut Vec::new());
        // The last one out.
        if Arc::strong_count(&self.host) == 1 {
            host.end();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reading of so many Float64 from these variables, learned after a step.
    fn learn(ahead: &mut Ahead, function: Function, references: &[u32], count: usize) {
        let mut values = vec![0_u8; 8 * count];
        let mut call = Call::plain(function);
        call.references = references;
        call.count = count;
        call.values = Values::Out(&mut values);
        ahead.learn(3, &call);
    }

    const GET: Function = Function::Get(Scalar::Float64);

    /// After a step in which the guest has answered what it foresaw with `7`.
    fn stepped(ahead: &mut Ahead) {
        ahead.answers = ahead.habit.clone();
        let places: Vec<usize> = parcel::all(&ahead.answers)
            .map(|(at, head)| at + parcel::values_of(&head))
            .collect();
        for at in places {
            ahead.answers[at..at + 8].copy_from_slice(&7.0_f64.to_ne_bytes());
        }
        (ahead.asked, ahead.is_after_step) = (0, true);
    }

    fn ask(ahead: &mut Ahead, references: &[u32]) -> Option<(i32, f64)> {
        let mut values = [0_u8; 8];
        let mut call = Call::plain(GET);
        call.references = references;
        call.count = 1;
        call.values = Values::Out(&mut values);
        let status = ahead.answer(&mut call)?;
        Some((status, f64::from_ne_bytes(values)))
    }

    #[test]
    fn readings_after_a_step_are_learned_and_answered_in_their_order() {
        let mut ahead = Ahead::default();
        // What comes before any step is no habit.
        learn(&mut ahead, GET, &[1], 1);
        assert!(ahead.habit.is_empty());
        stepped(&mut ahead);
        learn(&mut ahead, GET, &[1], 1);
        learn(&mut ahead, GET, &[2], 1);
        let heads: Vec<(u32, u32)> = parcel::all(&ahead.habit)
            .map(|(_, head)| (head.instance, head.function))
            .collect();
        assert_eq!(heads, [(3, GET.number()); 2]);
        let (second, _) = parcel::all(&ahead.habit).nth(1).unwrap();
        let place = ahead.place_of(&[2], 1).unwrap();
        assert!(place > second && place < ahead.habit.len());
        assert!(ahead.place_of(&[9], 1).is_none() && ahead.place_of(&[2], 2).is_none());

        stepped(&mut ahead);
        assert_eq!(ask(&mut ahead, &[1]), Some((0, 7.0)));
        assert_eq!(ask(&mut ahead, &[2]), Some((0, 7.0)));
        // Each once.
        assert_eq!(ask(&mut ahead, &[2]), None);
        stepped(&mut ahead);
        assert_eq!(ask(&mut ahead, &[2]), None);
    }

    #[test]
    fn a_habit_ends_where_anything_else_is_called() {
        let mut ahead = Ahead::default();
        stepped(&mut ahead);
        learn(&mut ahead, GET, &[1], 1);
        learn(&mut ahead, GET, &[2], 1);
        let both = ahead.habit.len();
        // The second one is no longer called.
        stepped(&mut ahead);
        assert_eq!(ask(&mut ahead, &[1]), Some((0, 7.0)));
        learn(&mut ahead, Function::Terminate, &[], 0);
        assert_eq!(ahead.habit.len(), both / 2);
        assert!(ahead.answers.is_empty() && !ahead.is_after_step);
        // What follows is not right after the step.
        learn(&mut ahead, GET, &[5], 1);
        assert_eq!(ahead.habit.len(), both / 2);
        // Nor does a reading travel that is larger than all that may wait.
        stepped(&mut ahead);
        learn(&mut ahead, GET, &[6], KEPT);
        assert!(ahead.habit.is_empty() && !ahead.is_after_step);
    }
}
