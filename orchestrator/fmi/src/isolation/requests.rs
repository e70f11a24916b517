//! Steps that travel to a guest together, and what is read after them.

use std::sync::atomic::Ordering;

use super::super::call::{Call, Lost, Wire};
use super::host::{Answer, Host, read};
use super::parcel;
use super::program::{Answered, lay};

/// Bytes of steps that travel together.
const MOST_REQUESTS: usize = 512 << 10;

/// Steps of several instances that travel together.
#[derive(Default)]
pub(super) struct Requests {
    /// Their parcels, as they are sent and as they came back.
    sent: Vec<u8>,
    answers: Vec<u8>,
    are_sent: bool,
    /// Those whose outcome nobody has fetched.
    open: usize,
    /// Values flow among them, and no program follows.
    are_wired: bool,
    /// Where the values of the readings begin to which wires may refer.
    readings: Vec<usize>,
    /// Where the last parcel begins that was carried out, or begun.
    last: usize,
    /// The loss after which there are no more answers.
    lost: Option<Lost>,
}

/// A step among those that travel together: its parcels, first what is set before it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Request {
    begin: usize,
    /// Where that begins, where it may be reached by wires.
    wired: Option<usize>,
    /// The step itself, among the parcels.
    step: usize,
    end: usize,
    instance: u32,
}

impl Request {
    /// Whether what is set before the step is known after it only.
    pub(super) fn is_wired(&self) -> bool {
        self.wired.is_some()
    }
}

impl Host {
    /// Takes a step that shall travel with others: what is set before, the step, what is read after it.
    /// None where it has to be called. Where FMUs print each is called by itself, so that their lines
    /// bear their names.
    pub(super) fn request(
        &mut self,
        instance: u32,
        before: &[u8],
        call: &Call,
        after: &[u8],
    ) -> Option<Request> {
        let size = before.len() + parcel::size(call) + after.len();
        let begin = self.next_request(instance, size, false)?;
        let requests = &mut self.requests;
        requests.sent.extend_from_slice(before);
        parcel::append(&mut requests.sent, instance, call);
        requests.sent.extend_from_slice(after);
        requests.open += 1;
        Some(Request {
            begin,
            wired: None,
            step: begin + before.len(),
            end: requests.sent.len(),
            instance,
        })
    }

    /// As [`Host::request`], where `wires` lead to the Float64 that are set before, whose values begin at
    /// `into` there. `read`: where the values that wires may lead from begin in `after`; gives the number of
    /// that reading.
    pub(super) fn request_wired(
        &mut self,
        instance: u32,
        (before, into): (&[u8], Option<usize>),
        wires: &[Wire],
        call: &Call,
        (after, read): (&[u8], Option<usize>),
    ) -> Option<(Request, Option<usize>)> {
        let into = if wires.is_empty() { 0 } else { into? };
        let size = before.len() + parcel::size(call) + after.len() + 64 * (wires.len() + 2);
        let begin = self.next_request(instance, size, true)?;
        let Requests { sent, readings, .. } = &mut self.requests;
        let from = |reading: usize| readings.get(reading).copied();
        lay(sent, instance, wires, from, into);
        let set = sent.len();
        sent.extend_from_slice(before);
        let step = sent.len();
        parcel::append(sent, instance, call);
        let reading = read.map(|read| {
            readings.push(sent.len() + read);
            readings.len() - 1
        });
        sent.extend_from_slice(after);
        let request = Request {
            begin,
            wired: Some(set),
            step,
            end: sent.len(),
            instance,
        };
        self.requests.open += 1;
        Some((request, reading))
    }

    /// Where the parcels of the next request begin; none where it cannot travel with those there are.
    fn next_request(&mut self, instance: u32, size: usize, is_wired: bool) -> Option<usize> {
        self.program.forget(instance);
        let requests = &mut self.requests;
        if requests.are_sent && requests.open == 0 {
            requests.sent.clear();
            requests.readings.clear();
            requests.are_sent = false;
        }
        if requests.sent.is_empty() {
            requests.are_wired = is_wired;
        }
        let begin = requests.sent.len();
        let fits = !requests.are_sent
            && requests.are_wired == is_wired
            && begin + size <= MOST_REQUESTS
            && self.gone.is_none()
            && !self.sinks.heard.load(Ordering::Relaxed);
        fits.then_some(begin)
    }

    /// The outcome of a step that was requested before what is set before it, `kept`, was known.
    pub(super) fn answer_wired(
        &mut self,
        request: Request,
        kept: &[u8],
        call: &mut Call,
        after: &mut Vec<u8>,
    ) -> Answer {
        self.send_requests();
        let requests = &mut self.requests;
        let Request { step, instance, .. } = request;
        if requests.lost.is_none() && requests.last < step {
            // Something before it did not go well.
            requests.open = requests.open.saturating_sub(1);
            if let Some(head) = requests.sent.get(step..).and_then(parcel::head) {
                parcel::give_back(&requests.sent[step..], &head, call);
            }
            return self.call(instance, kept, call, after);
        }
        let set = request.wired.unwrap_or(step);
        let is_as_said = requests.last < step
            || requests
                .answers
                .get(set..step)
                .is_some_and(|set| parcel::are_alike(set, kept));
        if !is_as_said {
            let reason = "was made with other inputs than those that are due";
            return Answer::Called(Err(Lost(reason.to_string())));
        }
        self.answer(request, call, after)
    }

    /// The outcome of a step that was requested; `after` is replaced by what was read after it, or emptied.
    pub(super) fn answer(
        &mut self,
        request: Request,
        call: &mut Call,
        after: &mut Vec<u8>,
    ) -> Answer {
        self.send_requests();
        self.requests.open = self.requests.open.saturating_sub(1);
        let Request {
            begin,
            step,
            end,
            instance,
            ..
        } = request;
        let requests = &mut self.requests;
        let (last, sent) = (requests.last, begin..end);
        if last < begin {
            // One before did not go well.
            if let Some(lost) = &requests.lost {
                return Answer::Called(Err(lost.clone()));
            }
            let sent = requests.sent[sent].to_vec();
            self.requests.lost = self.exchange(instance, &sent).err();
            self.keep_answers(begin, sent.len());
        }
        let requests = &self.requests;
        if let Some(lost) = requests.lost.clone().filter(|_| requests.last < end) {
            let parcel = requests.answers.get(requests.last..end);
            return match parcel
                .filter(|_| requests.last != step)
                .and_then(parcel::head)
            {
                Some(head) => {
                    let size = head.size as usize;
                    Answer::Other(
                        requests.answers[requests.last..][..size].to_vec(),
                        Err(lost),
                    )
                }
                None => Answer::Called(Err(lost)),
            };
        }
        read(&requests.answers[begin..], step - begin, call, after)
    }

    /// Keeps what came of the first `length` bytes that were sent, those of the requests from `begin` on.
    fn keep_answers(&mut self, begin: usize, length: usize) {
        let last = self.frame.began_at().min(length);
        let room = self.frame.room();
        // What did not go well may have taken more room to say why.
        let end = length.max(last + parcel::answered(&room[last..]));
        let answers = &mut self.requests.answers;
        answers.resize(begin, 0);
        answers.extend_from_slice(&room[..end.min(room.len())]);
        self.requests.last = begin + last;
    }

    /// Answers a call from what was read after the steps, where it was.
    pub(super) fn foreseen(
        &mut self,
        instance: u32,
        kept: &[u8],
        call: &mut Call,
    ) -> Option<Result<i32, Lost>> {
        if !self.requests.are_sent && !self.requests.are_wired {
            return None;
        }
        match self.program.answer(instance, kept, call) {
            Answered::No => None,
            Answered::Yes(status) => Some(Ok(status)),
            Answered::Lost(lost) => Some(Err(lost)),
        }
    }

    /// A step that was requested will not be fetched.
    pub(super) fn forget_request(&mut self) {
        self.requests.open = self.requests.open.saturating_sub(1);
    }

    /// Sends the steps that wait.
    pub(super) fn send_requests(&mut self) {
        if self.requests.are_sent || self.requests.sent.is_empty() {
            return;
        }
        let mut requests = std::mem::take(&mut self.requests);
        let first = parcel::head(&requests.sent).map_or(0, |head| head.instance);
        let length = requests.sent.len();
        // What is read after the steps goes with them, and is no request.
        if !requests.are_wired {
            requests.sent.extend_from_slice(self.program.bytes());
        }
        requests.lost = self.exchange(first, &requests.sent).err();
        requests.are_sent = true;
        let (whole, lost) = (requests.sent.len(), requests.lost.clone());
        requests.sent.truncate(length);
        self.requests = requests;
        self.keep_answers(0, length);
        if self.requests.are_wired {
            return;
        }
        let last = self.frame.began_at().checked_sub(length);
        let answers = &self.frame.room()[length..whole];
        self.program.take(answers, last, lost);
    }
}
