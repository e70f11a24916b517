//! The host's side: starts the guest, waits for its answers, and says what became of it.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::super::call::{Call, Lost, Values};
use super::super::native::Sink;
use super::frame::Frame;
use super::turn::{GUEST, HOST};
use super::{COMMAND, parcel};

/// How often a host that waits looks whether its guest is alive.
const LOOK: Duration = Duration::from_millis(10);
/// How long a guest that was told to go is given.
const FAREWELL: Duration = Duration::from_millis(500);
/// Lines that FMUs may print before the rest is passed over.
const LINES: usize = 1000;

/// A guest process with FMUs in it.
pub(in super::super) struct Host {
    child: Child,
    /// The guest ends when it closes.
    stdin: Option<ChildStdin>,
    frame: Frame,
    limit: Duration,
    sinks: Sinks,
    readers: Vec<JoinHandle<()>>,
    /// What became of the guest, once it is gone.
    gone: Option<String>,
}

/// Where each instance's messages go, and whose call was the last.
#[derive(Clone, Default)]
struct Sinks {
    all: Arc<Mutex<Vec<Arc<dyn Sink>>>>,
    current: Arc<AtomicUsize>,
}

impl Sinks {
    fn message(&self, instance: usize, status: i32, category: &str, text: &str) {
        let all = self.all.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sink) = all.get(instance) {
            sink.message(status, category, text);
        }
    }
}

/// What came of several calls that travelled together.
pub(super) enum Answer {
    /// All went well but perhaps the last, whose outcome this is.
    Last(Result<i32, Lost>),
    /// One before the last did not go well: its parcel, and its outcome.
    Earlier(Vec<u8>, Result<i32, Lost>),
}

impl Host {
    /// Starts a guest: `program` with its hidden command.
    ///
    /// # Errors
    /// It cannot be started.
    pub(in super::super) fn start(program: &Path, limit: Duration) -> Result<Self, String> {
        let no_memory = |error| format!("no memory can be shared with another process: {error}");
        let (frame, file) = Frame::create().map_err(no_memory)?;
        let mut command = Command::new(program);
        command
            .arg(COMMAND)
            .arg(&file)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is this process's business.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| {
            format!(
                "{}: the process for FMUs cannot be started: {error}",
                program.display()
            )
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
            limit,
            sinks,
            readers: readers.into_iter().flatten().collect(),
            gone: None,
        };
        // The first answer says that the file is open there; then its name can go.
        host.frame.turn().give(GUEST);
        host.wait(Duration::from_secs(30)).map_err(|Lost(reason)| {
            format!("{}: the process for FMUs {reason}", program.display())
        })?;
        drop(file);
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

    /// Carries out the calls in `before`, then `call`.
    pub(super) fn call(&mut self, instance: u32, before: &[u8], call: &mut Call) -> Answer {
        if let Some(gone) = &self.gone {
            return Answer::Last(Err(Lost(format!("cannot be made: its process {gone}"))));
        }
        let length = before.len() + parcel::size(call);
        let room = self.frame.room();
        let texts = if matches!(call.values, Values::TextsOut(_)) {
            1 << 20
        } else {
            0
        };
        if length + texts > room.len() {
            let reason = format!(
                "passes {} MB, more than an FMU in a process of its own can be given; \
                 choose --isolate none",
                length >> 20
            );
            return Answer::Last(Err(Lost(reason)));
        }
        room[..before.len()].copy_from_slice(before);
        parcel::place(&mut room[before.len()..], instance, call);
        self.frame.set_length(length);
        self.sinks
            .current
            .store(instance as usize, Ordering::Relaxed);
        self.frame.turn().give(GUEST);
        let done = self.wait(self.limit);
        self.hear();
        if let Err(lost) = done {
            return Answer::Last(Err(lost));
        }
        self.read(call)
    }

    fn read(&mut self, call: &mut Call) -> Answer {
        let length = self.frame.length();
        let room = self.frame.room();
        let mut at = 0;
        loop {
            let Some(head) = parcel::head(&room[at..]) else {
                return Answer::Last(Err(Lost("was answered by what is no answer".to_string())));
            };
            let next = at + head.size as usize;
            let outcome = parcel::outcome(&room[at..], &head);
            if next >= length {
                if outcome.is_ok() {
                    parcel::give_back(&room[at..], &head, call);
                }
                return Answer::Last(outcome);
            }
            if !matches!(outcome, Ok(0 | 1)) {
                return Answer::Earlier(room[at..next].to_vec(), outcome);
            }
            at = next;
        }
    }

    /// Waits for the guest's answer.
    fn wait(&mut self, limit: Duration) -> Result<(), Lost> {
        if self.frame.turn().wait(HOST, LOOK) {
            return Ok(());
        }
        let begin = Instant::now();
        loop {
            if self.frame.turn().wait(HOST, LOOK) {
                return Ok(());
            }
            if let Ok(Some(status)) = self.child.try_wait() {
                // It may have answered as its last act.
                if self.frame.turn().wait(HOST, Duration::ZERO) {
                    return Ok(());
                }
                return Err(self.lose(how(status)));
            }
            if begin.elapsed() > limit {
                let _ = self.child.kill();
                let _ = self.child.wait();
                return Err(self.lose(format!(
                    "did not return within {} s and was stopped (--call-limit)",
                    limit.as_secs_f64()
                )));
            }
        }
    }

    fn lose(&mut self, how: String) -> Lost {
        self.gone = Some(how.clone());
        // What it printed last may say why.
        self.readers.drain(..).for_each(|reader| {
            let _ = reader.join();
        });
        Lost(how)
    }

    /// Passes on what was logged.
    pub(super) fn hear(&self) {
        while self.frame.ring().has_some() {
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
                    let _ = self.child.kill();
                    let _ = self.child.wait();
                    self.gone = Some("was stopped".to_string());
                }
                Ok(Some(_)) => self.gone = Some("has ended".to_string()),
            }
        }
        self.readers.drain(..).for_each(|reader| {
            let _ = reader.join();
        });
        self.hear();
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.end();
    }
}

/// Passes on what a guest prints, line by line, as words of the FMU that was called last.
fn listen(
    stream: Option<impl Read + Send + 'static>,
    name: &'static str,
    sinks: Sinks,
) -> Option<JoinHandle<()>> {
    let stream = stream?;
    Some(std::thread::spawn(move || {
        let mut lines = BufReader::new(stream);
        let mut line = Vec::new();
        let mut count = 0;
        loop {
            line.clear();
            let read = lines.by_ref().take(16_000).read_until(b'\n', &mut line);
            if !read.is_ok_and(|length| length > 0) {
                return;
            }
            count += 1;
            if count <= LINES {
                let text = String::from_utf8_lossy(&line);
                let text = format!("printed on {name}: {}", text.trim_end());
                let instance = sinks.current.load(Ordering::Relaxed);
                sinks.message(instance, 1, "", &text);
            }
        }
    }))
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

/// The program that has the hidden command: the one named in `SHAKEBENCH_PROGRAM`, this one, or one
/// beside it (a test's program lies in a folder below).
///
/// # Errors
/// There is none.
pub(in super::super) fn program() -> Result<PathBuf, String> {
    if let Some(named) = std::env::var_os("SHAKEBENCH_PROGRAM") {
        return Ok(named.into());
    }
    let name = format!("shakebench{}", std::env::consts::EXE_SUFFIX);
    let own = crate::program::file().map_err(|error| error.to_string())?;
    if own.file_name().is_some_and(|file| file == name.as_str()) {
        return Ok(own);
    }
    own.ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join(&name))
        .find(|path| path.is_file())
        .ok_or_else(|| {
            format!("the program {name} is needed for FMUs in processes of their own; name it in SHAKEBENCH_PROGRAM")
        })
}
