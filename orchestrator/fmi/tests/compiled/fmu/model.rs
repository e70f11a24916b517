//! The model: its equations, events and modes.

use std::ffi::{CString, c_int};

pub(crate) const OK: c_int = 0;
pub(crate) const WARNING: c_int = 1;
pub(crate) const DISCARD: c_int = 2;
pub(crate) const ERROR: c_int = 3;

// Value references of Float64; those of the other types are multiples of 10.
pub(crate) const U: u32 = 1;
pub(crate) const GAIN: u32 = 2;
pub(crate) const Y: u32 = 3;
pub(crate) const X: u32 = 4;
pub(crate) const SLOPE: u32 = 5;
pub(crate) const PAIR: u32 = 6;
pub(crate) const FLOOR: u32 = 7;
pub(crate) const PERIOD: u32 = 8;
pub(crate) const TOLERANCE: u32 = 9;
pub(crate) const STOP: u32 = 10;
pub(crate) const FAILS: u32 = 11;

/// What a step does in place of a status.
pub(crate) const ABORT: c_int = 100;
pub(crate) const EXIT: c_int = 101;
pub(crate) const HANG: c_int = 102;
pub(crate) const ROUND_DOWN: c_int = 103;
/// Its derivatives are a tenth too large.
pub(crate) const TOO_LARGE: c_int = 104;
/// It discards derivatives, or refuses them.
pub(crate) const NO_DERIVATIVE: c_int = 105;
pub(crate) const WRONG_DERIVATIVE: c_int = 106;
pub(crate) const PRINT: c_int = 107;
/// Its output is that of the last step.
pub(crate) const LATE: c_int = 108;
/// It gives no outputs between a setting and the next step, which FMI 2.0 forbids (4.2.4).
pub(crate) const REFUSES: c_int = 109;

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Mode {
    Instantiated,
    Configuring,
    Initializing,
    Event,
    Stepping,
    Continuous,
    Terminated,
}
pub(crate) use Mode::*;

/// What a saved state holds.
#[derive(Clone, Copy)]
pub(crate) struct State {
    pub(crate) time: f64,
    pub(crate) u: f64,
    pub(crate) gain: f64,
    pub(crate) x: f64,
    pub(crate) pair: [f64; 2],
    pub(crate) floor: f64,
    pub(crate) period: f64,
    pub(crate) next: f64,
    pub(crate) fails: f64,
    pub(crate) tolerance: f64,
    pub(crate) stop: f64,
    pub(crate) count: i32,
    pub(crate) ticks: i32,
}

pub(crate) const BYTES: usize = size_of::<State>();

/// Values of the other types, each of which keeps what is set.
#[derive(Default)]
pub(crate) struct Kept {
    pub(crate) float32: [f32; 2],
    pub(crate) int8: [i8; 2],
    pub(crate) uint8: [u8; 2],
    pub(crate) int16: [i16; 2],
    pub(crate) uint16: [u16; 2],
    pub(crate) uint32: [u32; 2],
    pub(crate) int64: [i64; 2],
    pub(crate) uint64: [u64; 2],
    pub(crate) string: [CString; 2],
    pub(crate) binary: [Vec<u8>; 2],
}

pub(crate) struct Instance {
    pub(crate) mode: Mode,
    /// Where the run goes on from event mode.
    pub(crate) running: Mode,
    pub(crate) handles_events: bool,
    pub(crate) now: State,
    pub(crate) kept: Kept,
    pub(crate) answer: i32,
    pub(crate) is_early: bool,
    pub(crate) is_over: bool,
    pub(crate) is_reset: bool,
    pub(crate) is_ticked: bool,
    /// The input at the last step, and whether it was set since.
    pub(crate) stepped_with: f64,
    pub(crate) is_set: bool,
    pub(crate) discarded_at: f64,
    pub(crate) log: Box<dyn Fn(c_int, &str)>,
}

impl Instance {
    pub(crate) fn new(
        answer: Option<c_int>,
        handles_events: bool,
        running: Mode,
        log: Box<dyn Fn(c_int, &str)>,
    ) -> *mut Self {
        let now = State {
            time: 0.0,
            u: 0.0,
            gain: 2.0,
            x: 1.0,
            pair: [0.0; 2],
            floor: 0.0,
            period: 0.0,
            next: f64::INFINITY,
            fails: f64::INFINITY,
            tolerance: -1.0,
            stop: -1.0,
            count: 0,
            ticks: 0,
        };
        Box::into_raw(Box::new(Self {
            mode: Instantiated,
            running,
            handles_events,
            now,
            kept: Kept::default(),
            answer: answer.unwrap_or(OK),
            is_early: false,
            is_over: false,
            is_reset: false,
            is_ticked: false,
            stepped_with: 0.0,
            is_set: false,
            discarded_at: 0.0,
            log,
        }))
    }

    /// Goes from one of the modes `from` to `to`.
    pub(crate) fn goes(&mut self, name: &str, from: &[Mode], to: Mode) -> c_int {
        (self.log)(OK, name);
        if !from.contains(&self.mode) {
            (self.log)(ERROR, &format!("{name} in mode {:?}", self.mode));
            return ERROR;
        }
        self.mode = to;
        OK
    }

    pub(crate) fn initialize(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) {
        self.now.time = start;
        self.now.stop = stop.unwrap_or(-1.0);
        self.now.tolerance = tolerance.unwrap_or(-1.0);
    }

    pub(crate) fn leave_initialization(&mut self) -> c_int {
        let next = self.now.time + self.now.period;
        self.now.next = if self.now.period > 0.0 {
            next
        } else {
            f64::INFINITY
        };
        let is_stepped = self.running == Stepping && !self.handles_events;
        let to = if is_stepped { Stepping } else { Event };
        self.goes("ExitInitializationMode", &[Initializing], to)
    }

    /// How long until `x` falls to its floor.
    pub(crate) fn left(&self) -> f64 {
        let now = &self.now;
        if now.floor > 0.0 {
            (now.x / now.floor).ln()
        } else {
            f64::INFINITY
        }
    }

    /// An event: what is due happens.
    pub(crate) fn update(&mut self) {
        let now = &mut self.now;
        self.is_reset = false;
        if now.x <= now.floor {
            (now.x, self.is_reset) = (1.0, true);
            now.count += 1;
        }
        if now.time >= now.next - 1e-9 {
            now.next += now.period;
            now.count += 1;
        }
        if std::mem::take(&mut self.is_ticked) {
            now.ticks += 1;
        }
    }

    /// Steps; gives the status, how far it came, and whether it is an event that ended it.
    pub(crate) fn step(&mut self, time: f64, step: f64) -> (c_int, f64, bool) {
        if self.mode != Stepping || !((time - self.now.time).abs() < 1e-9) || step <= 0.0 {
            return (ERROR, self.now.time, false);
        }
        (self.stepped_with, self.is_set) = (self.now.u, false);
        let answer = if time >= self.now.fails {
            ERROR
        } else {
            self.answer
        };
        match answer {
            WARNING => (self.log)(WARNING, "the step is rough"),
            DISCARD => {
                self.discarded_at = time + step / 2.0;
                return (DISCARD, self.discarded_at, false);
            }
            OK => {}
            ROUND_DOWN => round_down(),
            PRINT => println!("a line"),
            TOO_LARGE | NO_DERIVATIVE | WRONG_DERIVATIVE | LATE | REFUSES => {}
            ABORT => {
                eprintln!("the last words");
                std::process::abort();
            }
            EXIT => std::process::exit(3),
            HANG => loop {
                std::thread::park();
            },
            status => {
                (self.log)(status, "the step is 100 % wrong");
                // How far it came does not count then.
                return (status, time + step / 2.0, false);
            }
        }
        let whole = if self.is_early { step / 2.0 } else { step };
        let mut left = whole;
        while self.left() < left {
            left -= self.left();
            self.now.x = self.now.floor;
            if self.handles_events {
                self.now.time = time + whole - left;
                return (self.status(), self.now.time, true);
            }
            self.now.time = time + whole - left;
            self.update();
        }
        self.now.x *= (-left).exp();
        self.now.time = time + whole;
        if !self.handles_events && self.now.time >= self.now.next - 1e-9 {
            self.update();
        }
        (self.status(), self.now.time, false)
    }

    /// The status of a step that was made.
    pub(crate) fn status(&self) -> c_int {
        if self.answer == WARNING { WARNING } else { OK }
    }

    pub(crate) fn real(&mut self, reference: u32) -> Option<&mut [f64]> {
        let now = &mut self.now;
        let one = match reference {
            U => &mut now.u,
            GAIN => &mut now.gain,
            X => &mut now.x,
            FLOOR => &mut now.floor,
            PERIOD => &mut now.period,
            FAILS => &mut now.fails,
            PAIR => return Some(&mut now.pair),
            _ => return None,
        };
        Some(std::slice::from_mut(one))
    }

    pub(crate) fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> c_int {
        let mut at = 0;
        for &reference in references {
            let now = &self.now;
            let u = if self.answer == LATE {
                self.stepped_with
            } else {
                now.u
            };
            if self.answer == REFUSES && self.is_set {
                return ERROR;
            }
            let derived = match reference {
                Y => vec![now.gain * u],
                SLOPE => vec![-now.x],
                TOLERANCE => vec![now.tolerance],
                STOP => vec![now.stop],
                _ => match self.real(reference) {
                    Some(own) => own.to_vec(),
                    None => return ERROR,
                },
            };
            let Some(places) = values.get_mut(at..at + derived.len()) else {
                return ERROR;
            };
            places.copy_from_slice(&derived);
            at += derived.len();
        }
        if at == values.len() { OK } else { ERROR }
    }

    pub(crate) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> c_int {
        self.is_set = self.mode == Stepping;
        let mut at = 0;
        for &reference in references {
            let Some(own) = self.real(reference) else {
                return ERROR;
            };
            let Some(new) = values.get(at..at + own.len()) else {
                return ERROR;
            };
            own.copy_from_slice(new);
            at += own.len();
        }
        if at != values.len() {
            return ERROR;
        }
        if self.now.gain < 0.0 {
            (self.log)(ERROR, "the gain is negative");
            return ERROR;
        }
        OK
    }

    /// The variable of type Int32 of this reference.
    pub(crate) fn integer(&mut self, reference: u32) -> Option<&mut i32> {
        match reference {
            70 => Some(&mut self.answer),
            71 => Some(&mut self.now.count),
            72 => Some(&mut self.now.ticks),
            _ => None,
        }
    }

    /// The variable of type Boolean of this reference.
    pub(crate) fn truth(&mut self, reference: u32) -> Option<&mut bool> {
        match reference {
            120 => Some(&mut self.is_early),
            121 => Some(&mut self.is_over),
            _ => None,
        }
    }

    /// `d unknown / d known`.
    pub(crate) fn partial(&self, unknown: u32, known: u32) -> f64 {
        let true_one = match (unknown, known) {
            (Y, U) => self.now.gain,
            (SLOPE, X) => -1.0,
            _ => 0.0,
        };
        if self.answer == TOO_LARGE {
            1.1 * true_one
        } else {
            true_one
        }
    }
}

/// Rounds down from now on, in both units, as an FMU must not.
fn round_down() {
    #[cfg(target_arch = "x86_64")]
    unsafe {
        let (sse, x87) = (0x3f80_u32, 0x077f_u16);
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const sse, options(nostack));
        std::arch::asm!("fldcw [{}]", in(reg) &raw const x87, options(nostack));
    }
}
