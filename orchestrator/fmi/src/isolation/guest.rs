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

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers with its own number after some time.
    struct Slow(i32);

    impl Endpoint for Slow {
        fn call(&mut self, call: &mut Call) -> Result<i32, Lost> {
            if call.function == Function::DoStep {
                std::thread::sleep(Duration::from_millis(5));
                call.numbers[0] += call.numbers[1];
            }
            Ok(self.0)
        }
    }

    /// Memory that lives as long as the test, once for the guest and once for the host.
    fn frames() -> (&'static Mutex<Frame>, Frame) {
        let (host, _) = Frame::create().unwrap();
        let guest = host.open_again().unwrap();
        (Box::leak(Box::new(Mutex::new(guest))), host)
    }

    #[test]
    fn calls_go_to_the_instance_of_their_number_until_it_is_freed() {
        let (ring, _host) = frames();
        let mut instances: HashMap<u32, Box<dyn Endpoint>> = HashMap::new();
        instances.insert(4, Box::new(Slow(1)));
        instances.insert(7, Box::new(Slow(2)));
        let mut ask =
            |number, function| carry_out(&mut instances, number, &mut Call::plain(function), ring);
        let gone = Err(Lost("is for an instance that does not exist".to_string()));
        assert_eq!(ask(4, Function::Terminate), Ok(1));
        assert_eq!(ask(7, Function::Terminate), Ok(2));
        assert_eq!(ask(5, Function::Terminate), gone);
        assert_eq!(ask(4, Function::FreeInstance), Ok(0));
        assert_eq!(ask(4, Function::Terminate), gone);
        assert_eq!(ask(7, Function::Terminate), Ok(2));
    }

    #[test]
    fn a_step_is_measured_where_the_host_asks_for_it() {
        let (ring, _host) = frames();
        let mut instances: HashMap<u32, Box<dyn Endpoint>> = HashMap::new();
        instances.insert(0, Box::new(Slow(0)));
        let mut step = |function, is_measured| {
            let mut call = Call::plain(function);
            call.numbers = [0.25, 0.5, -1.0];
            call.flags[MEASURED] = is_measured;
            assert_eq!(carry_out(&mut instances, 0, &mut call, ring), Ok(0));
            call.numbers
        };
        assert_eq!(step(Function::DoStep, false), [0.75, 0.5, -1.0]);
        let [time, _, took] = step(Function::DoStep, true);
        assert!(time == 0.75 && (0.005..5.0).contains(&took), "{took}");
        assert_eq!(step(Function::Terminate, true), [0.25, 0.5, -1.0]);
    }

    #[test]
    fn an_instance_is_not_made_without_a_description() {
        let (ring, _host) = frames();
        let mut instances = HashMap::new();
        let mut call = Call::plain(Function::Instantiate);
        let outcome = carry_out(&mut instances, 0, &mut call, ring);
        assert_eq!(outcome, Err(Lost("has no description".to_string())));
        call.values = Values::In(b"{");
        let Lost(told) = carry_out(&mut instances, 0, &mut call, ring).unwrap_err();
        assert!(told.starts_with("EOF while parsing"), "{told}");
        assert!(instances.is_empty());
    }

    #[test]
    fn messages_reach_the_host_in_their_order_and_without_more() {
        let (ring, host) = frames();
        assert!(!host.ring().has_some());
        let reporter = |instance| Reporter { instance, ring };
        reporter(3).message(1, "logStatusWarning", "first");
        reporter(5).message(-7, "", &"\u{e9}".repeat(10_000));
        assert!(host.ring().has_some());
        let first = host.ring().take().unwrap();
        assert_eq!(
            (first.instance, first.status, &*first.category, &*first.text),
            (3, 1, "logStatusWarning", "first")
        );
        // A text is cut where it is longer than 16000 bytes.
        let second = host.ring().take().unwrap();
        assert_eq!(
            (second.instance, second.status, &*second.category),
            (5, -7, "")
        );
        assert_eq!(second.text, "\u{e9}".repeat(8_000));
        assert!(host.ring().take().is_none() && !host.ring().has_some());
    }

    /// Many times the size of the ring, so that messages lie across its end.
    #[test]
    fn the_ring_takes_messages_while_they_are_read_and_drops_those_without_room() {
        let (ring, host) = frames();
        let reporter = Reporter { instance: 1, ring };
        for number in 0..300 {
            let text = format!("{number} {}", "x".repeat(15_000));
            reporter.message(number, "events", &text);
            let read = host.ring().take().unwrap();
            assert_eq!((read.status, read.text), (number, text));
        }
        for number in 0..200 {
            reporter.message(number, "", &"y".repeat(15_984));
        }
        // 16 bytes before each text: 65 messages of 16000 bytes in 1048576.
        let read: Vec<i32> = std::iter::from_fn(|| host.ring().take())
            .map(|read| read.status)
            .collect();
        assert_eq!(read, (0..65).collect::<Vec<i32>>());
    }
}
