//! The host's side: starts the guest, waits for its answers, and says what became of it.

use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::super::call::{Call, Lost, Values};
use super::super::error::InstanceError;
use super::super::native::Sink;
use super::frame::Frame;
use super::leftovers::{self, Mark};
use super::listen::{Sinks, listen};
use super::program::Program;
use super::requests::Requests;
use super::turn::{GUEST, HOST, Patience, take_short_turns};
use super::{COMMAND, parcel};

/// How often a host that waits looks whether its guest is alive.
const LOOK: Duration = Duration::from_millis(10);
/// Time for a guest to end after a request.
const FAREWELL: Duration = Duration::from_millis(500);
/// Time for what a guest printed last to arrive; another process may hold the other end of the pipe.
const LAST_WORDS: Duration = Duration::from_millis(500);
/// Messages that are passed on after a call; an FMU may log faster than anybody can read.
const MESSAGES: usize = 10_000;

/// A guest process with FMUs in it.
pub(in super::super) struct Host {
    child: Child,
    /// The guest ends when it closes.
    stdin: Option<ChildStdin>,
    pub(super) frame: Frame,
    patience: Patience,
    /// What the processes that FMUs start inherit.
    mark: Mark,
    limit: Duration,
    pub(super) sinks: Sinks,
    readers: Vec<JoinHandle<()>>,
    /// What became of the guest, once it is gone.
    pub(super) gone: Option<String>,
    pub(super) requests: Requests,
    /// How often the guest had its turn.
    pub(super) exchanges: u64,
    pub(super) program: Program,
}

/// What came of several calls that travelled together.
pub(super) enum Answer {
    /// What was called before went well; this is the outcome of the call.
    Called(Result<i32, Lost>),
    /// Another call that travelled along did not go well: its parcel, and its outcome.
    Other(Vec<u8>, Result<i32, Lost>),
}

impl Host {
    /// Starts a guest: `program` with its hidden command.
    ///
    /// # Errors
    /// It cannot be started.
    pub(in super::super) fn start(program: &Path, limit: Duration) -> Result<Self, InstanceError> {
        let (frame, way) = Frame::create().map_err(InstanceError::Memory)?;
        let mark = Mark::new();
        let mut command = Command::new(program);
        command
            .arg(COMMAND)
            .arg(&way.path)
            .env(leftovers::VARIABLE, mark.value())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is this process's business.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        #[cfg(unix)]
        if let Some(descriptor) = way.inherited {
            let inherit = move || {
                // SAFETY: it changes a flag of a descriptor, and may be called after a fork.
                unsafe { libc::fcntl(descriptor, libc::F_SETFD, 0) };
                Ok(())
            };
            // SAFETY: as above.
            unsafe { std::os::unix::process::CommandExt::pre_exec(&mut command, inherit) };
        }
        let mut child = command.spawn().map_err(|error| InstanceError::NotStarted {
            program: program.to_path_buf(),
            error,
        })?;
        let sinks = Sinks::default();
        let readers = vec![
            listen(child.stdout.take(), "standard output", sinks.clone()),
            listen(child.stderr.take(), "standard error", sinks.clone()),
        ];
        let mut host = Self {
            stdin: child.stdin.take(),
            child,
            frame,
            patience: Patience::new(),
            mark,
            limit,
            sinks,
            readers: readers.into_iter().flatten().collect(),
            gone: None,
            requests: Requests::default(),
            exchanges: 0,
            program: Program::default(),
        };
        take_short_turns();
        // The first answer says that the memory is mapped there; then its name can go.
        host.frame.turn().give(GUEST);
        host.wait(Duration::from_secs(30))
            .map_err(|gone| InstanceError::Gone {
                program: program.to_path_buf(),
                gone,
            })?;
        drop(way);
        Ok(host)
    }

    /// Makes room for an instance and gives its number.
    pub(super) fn enroll(&self, sink: Arc<dyn Sink>) -> u32 {
        let mut all = self
            .sinks
            .all
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        all.push(sink);
        (all.len() - 1) as u32
    }

    /// Carries out the calls in `before`, then `call`, then the one in `after` that gives numbers, whose
    /// parcel is replaced by the answer, or emptied where it did not go well.
    pub(super) fn call(
        &mut self,
        instance: u32,
        before: &[u8],
        call: &mut Call,
        after: &mut Vec<u8>,
    ) -> Answer {
        self.send_requests();
        self.program.forget(instance);
        if let Some(gone) = &self.gone {
            return Answer::Called(Err(is_gone(gone)));
        }
        let next = before.len() + parcel::size(call);
        let length = next + after.len();
        let room = self.frame.room();
        let texts = if matches!(call.values, Values::TextsOut(_)) {
            1 << 20
        } else {
            0
        };
        if length + texts > room.len() {
            let reason = format!(
                "passes {} MB, more than an FMU in a separate process can receive; choose \
                 --isolate none",
                length >> 20
            );
            return Answer::Called(Err(Lost(reason)));
        }
        room[..before.len()].copy_from_slice(before);
        parcel::place(&mut room[before.len()..], instance, call);
        room[next..length].copy_from_slice(after);
        if let Err(lost) = self.take_turn(instance, length) {
            // Which of them was it?
            let at = self.frame.began_at();
            let room = self.frame.room();
            let parcel = room.get(at..length).filter(|_| at != before.len());
            return match parcel.and_then(parcel::head) {
                Some(head) => Answer::Other(room[at..at + head.size as usize].to_vec(), Err(lost)),
                None => Answer::Called(Err(lost)),
            };
        }
        read(self.frame.room(), before.len(), call, after)
    }

    /// Lets the guest carry out calls, and waits for it.
    pub(super) fn exchange(&mut self, instance: u32, parcels: &[u8]) -> Result<(), Lost> {
        if let Some(gone) = &self.gone {
            return Err(is_gone(gone));
        }
        self.frame.room()[..parcels.len()].copy_from_slice(parcels);
        self.take_turn(instance, parcels.len())
    }

    /// Gives the guest its turn with the first `length` bytes of the room, and waits for it.
    fn take_turn(&mut self, instance: u32, length: usize) -> Result<(), Lost> {
        self.frame.set_length(length);
        self.sinks
            .current
            .store(instance as usize, Ordering::Relaxed);
        self.exchanges += 1;
        self.frame.turn().give(GUEST);
        let done = self.wait(self.limit);
        self.hear();
        done
    }

    /// Waits for the guest's answer.
    fn wait(&mut self, limit: Duration) -> Result<(), Lost> {
        if self.frame.turn().wait(HOST, LOOK, &mut self.patience) {
            return Ok(());
        }
        let begin = Instant::now();
        loop {
            if self.frame.turn().wait(HOST, LOOK, &mut self.patience) {
                return Ok(());
            }
            if let Ok(Some(status)) = self.child.try_wait() {
                // It may have answered as its last act.
                if self
                    .frame
                    .turn()
                    .wait(HOST, Duration::ZERO, &mut self.patience)
                {
                    return Ok(());
                }
                return Err(self.lose(how(status)));
            }
            if begin.elapsed() > limit {
                self.kill();
                return Err(self.lose(format!(
                    "did not return within {} s and was stopped (--call-limit)",
                    limit.as_secs_f64()
                )));
            }
        }
    }

    fn lose(&mut self, how: String) -> Lost {
        self.gone = Some(how.clone());
        let at = self.frame.began_at();
        if let Some(head) = self.frame.room().get(at..).and_then(parcel::head) {
            // Its last words are those of the FMU that was called.
            let instance = head.instance as usize;
            self.sinks.current.store(instance, Ordering::Relaxed);
        }
        self.kill();
        self.hear_last_words();
        Lost(how)
    }

    /// Ends the guest and every process that its FMUs have started and left.
    fn kill(&mut self) {
        leftovers::kill(self.child.id(), &self.mark);
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// What the guest printed last may say why it ended. Nobody waits long for it: a process that left
    /// the guest's group may still hold the pipe.
    fn hear_last_words(&mut self) {
        let begin = Instant::now();
        while self.readers.iter().any(|reader| !reader.is_finished())
            && begin.elapsed() < LAST_WORDS
        {
            std::thread::sleep(Duration::from_millis(1));
        }
        for reader in self.readers.drain(..).filter(JoinHandle::is_finished) {
            let _ = reader.join();
        }
        self.hear();
    }

    /// Passes on what was logged.
    pub(super) fn hear(&self) {
        for _ in 0..MESSAGES {
            if !self.frame.ring().has_some() {
                return;
            }
            let Some(logged) = self.frame.ring().take() else {
                return;
            };
            let instance = logged.instance as usize;
            self.sinks
                .message(instance, logged.status, &logged.category, &logged.text);
        }
    }

    /// Ends the guest and passes on what it printed.
    pub(super) fn end(&mut self) {
        drop(self.stdin.take());
        let begin = Instant::now();
        while self.gone.is_none() {
            match self.child.try_wait() {
                Ok(None) if begin.elapsed() < FAREWELL => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Ok(None) | Err(_) => {
                    self.gone = Some("was stopped".to_string());
                }
                Ok(Some(_)) => self.gone = Some("has ended".to_string()),
            }
        }
        if !self.readers.is_empty() {
            self.kill();
            self.hear_last_words();
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.end();
    }
}

/// What came of the calls in `room`, of which the one that was asked for begins at `place`.
pub(super) fn read(room: &[u8], place: usize, call: &mut Call, after: &mut Vec<u8>) -> Answer {
    let strange = || Answer::Called(Err(Lost("received an answer out of order".to_string())));
    let mut at = 0;
    while at < place {
        let Some(head) = parcel::head(&room[at..]) else {
            return strange();
        };
        let outcome = parcel::outcome(&room[at..], &head);
        let next = at + head.size as usize;
        if !matches!(outcome, Ok(0 | 1)) {
            return Answer::Other(room[at..next].to_vec(), outcome);
        }
        at = next;
    }
    let Some(head) = room.get(place..).and_then(parcel::head) else {
        return strange();
    };
    let outcome = parcel::outcome(&room[place..], &head);
    call.culprit = parcel::culprit(&head, call);
    if outcome.is_ok() {
        parcel::give_back(&room[place..], &head, call);
    } else {
        call.numbers = head.numbers;
    }
    let next = place + head.size as usize;
    let answer = &room[next..(next + after.len()).min(room.len())];
    let went_well = |(at, head): (usize, parcel::Head)| {
        matches!(parcel::outcome(&answer[at..], &head), Ok(0 | 1))
    };
    let is_sound = matches!(outcome, Ok(0 | 1))
        && answer.len() == after.len()
        && parcel::all(answer).all(went_well);
    match is_sound {
        true => after.copy_from_slice(answer),
        false => after.clear(),
    }
    Answer::Called(outcome)
}

fn is_gone(how: &str) -> Lost {
    Lost(format!("cannot be made: its process {how}"))
}

/// How a process ended, as a clause.
fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt;
        if let Some(signal) = status.signal() {
            let name = match signal {
                libc::SIGSEGV => "segmentation fault",
                libc::SIGABRT => "abort",
                libc::SIGFPE => "division by zero or the like",
                libc::SIGILL => "illegal instruction",
                libc::SIGBUS => "bus error",
                libc::SIGKILL => "killed",
                libc::SIGTERM => "terminated",
                _ => "a signal",
            };
            return format!("ended its process ({name}, signal {signal})");
        }
    }
    match status.code() {
        Some(code) => format!("ended its process by exit({code})"),
        None => "ended its process".to_string(),
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    #[test]
    fn the_end_of_a_process_is_told_by_its_signal_or_code() {
        for (signal, name) in [
            (libc::SIGSEGV, "segmentation fault"),
            (libc::SIGABRT, "abort"),
            (libc::SIGFPE, "division by zero or the like"),
            (libc::SIGILL, "illegal instruction"),
            (libc::SIGBUS, "bus error"),
            (libc::SIGKILL, "killed"),
            (libc::SIGTERM, "terminated"),
            (libc::SIGHUP, "a signal"),
        ] {
            let expected = format!("ended its process ({name}, signal {signal})");
            assert_eq!(how(ExitStatus::from_raw(signal)), expected);
        }
        let code = ExitStatus::from_raw(3 << 8);
        assert_eq!(how(code), "ended its process by exit(3)");
    }
}
