//! The guest's side: loads FMUs and carries out what the host asks.

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::super::call::{Call, Endpoint, Function, Lost, MEASURED, Values};
use super::super::native::{self, Setup, Sink};
use super::frame::Frame;
use super::turn::{GUEST, HOST, Patience, take_short_turns};
use super::{parcel, program};

/// Serves the host that made the file `frame`, until it closes the standard input. What FMUs print
/// goes where the host listens.
pub fn guest(frame: &Path) -> ExitCode {
    let Ok(mut frame) = Frame::open(frame) else {
        eprintln!("error: this command is internal to the program");
        return ExitCode::from(2);
    };
    watch();
    native::print_by_the_line();
    // FMUs may log from threads of their own for as long as the process lives.
    let Ok(ring) = frame.open_again() else {
        return ExitCode::from(2);
    };
    let ring: &'static Mutex<Frame> = Box::leak(Box::new(Mutex::new(ring)));
    let mut instances: HashMap<u32, Box<dyn Endpoint>> = HashMap::new();
    let mut patience = Patience::new();
    take_short_turns();
    loop {
        frame.turn().give(HOST);
        while !frame
            .turn()
            .wait(GUEST, Duration::from_secs(3600), &mut patience)
        {}
        let length = frame.length();
        let mut at = 0;
        while at < length {
            frame.begin_at(at);
            let room = frame.room();
            let Some(head) = parcel::head(&room[at..]) else {
                break;
            };
            let next = at + head.size as usize;
            if head.function == Function::Copy.number() {
                program::copy(room, at, &head);
                at = next;
                continue;
            }
            // Only the last may grow.
            let end = if next < length { next } else { room.len() };
            let went_well = parcel::carry_out(&mut room[at..], end - at, &head, |call| {
                carry_out(&mut instances, head.instance, call, ring)
            });
            if !went_well {
                break;
            }
            at = next;
        }
    }
}

fn carry_out(
    instances: &mut HashMap<u32, Box<dyn Endpoint>>,
    number: u32,
    call: &mut Call,
    ring: &'static Mutex<Frame>,
) -> Result<i32, Lost> {
    match call.function {
        Function::Instantiate => {
            let Values::In(text) = &call.values else {
                return Err(Lost("has no description".to_string()));
            };
            let setup: Setup =
                serde_json::from_slice(text).map_err(|error| Lost(error.to_string()))?;
            let sink = Arc::new(Reporter {
                instance: number,
                ring,
            });
            let endpoint =
                native::instantiate(&setup, sink).map_err(|error| Lost(error.to_string()))?;
            instances.insert(number, endpoint);
            Ok(0)
        }
        Function::FreeInstance => {
            drop(instances.remove(&number));
            Ok(0)
        }
        _ => match instances.get_mut(&number) {
            Some(endpoint) if call.function == Function::DoStep && call.flags[MEASURED] => {
                let begin = Instant::now();
                let outcome = endpoint.call(call);
                call.numbers[2] = begin.elapsed().as_secs_f64();
                outcome
            }
            Some(endpoint) => endpoint.call(call),
            None => Err(Lost("is for an instance that does not exist".to_string())),
        },
    }
}

/// Hands messages of an instance to the host.
struct Reporter {
    instance: u32,
    ring: &'static Mutex<Frame>,
}

impl Sink for Reporter {
    fn message(&self, status: i32, category: &str, text: &str) {
        let frame = self.ring.lock().unwrap_or_else(PoisonError::into_inner);
        frame.ring().write(self.instance, status, category, text);
    }
}

/// Ends this process when the host's end of the standard input closes, even if an FMU never
/// returns. FMUs find nothing on the standard input.
fn watch() {
    #[cfg(unix)]
    let mut input = {
        use std::os::fd::FromRawFd;
        // SAFETY: descriptors of this process; the copy is owned by the file alone.
        unsafe {
            let copy = libc::fcntl(0, libc::F_DUPFD_CLOEXEC, 3);
            let nothing = libc::open(c"/dev/null".as_ptr(), libc::O_RDONLY);
            if nothing >= 0 {
                libc::dup2(nothing, 0);
                libc::close(nothing);
            }
            std::fs::File::from_raw_fd(copy)
        }
    };
    #[cfg(not(unix))]
    let mut input = std::io::stdin();
    std::thread::spawn(move || {
        let mut byte = [0];
        while input.read(&mut byte).is_ok_and(|length| length > 0) {}
        std::process::exit(0);
    });
}
