//! Whose turn it is: a number in shared memory that both processes wait on.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// It is the host's turn: nothing is asked, or an answer is there.
pub(super) const HOST: u32 = 0;
/// It is the guest's turn: something is asked.
pub(super) const GUEST: u32 = 1;

/// How long is spun before going to sleep: a call of a small FMU comes back meanwhile, and the
/// guest is awake still when the next one comes.
const SPIN: Duration = Duration::from_micros(40);

/// The turn and who sleeps; it lies in shared memory.
#[repr(C)]
pub(super) struct Turn {
    now: AtomicU32,
    sleeping: [AtomicU32; 2],
}

/// Whether one side spins before it sleeps. Spinning pays only while the other side has a processor of
/// its own. Where it has none, the spinner uses up the time that the scheduler would give the other,
/// and is itself kept waiting for milliseconds afterwards. So spins that failed are followed by waits
/// asleep, the more the more often they fail.
#[derive(Debug)]
pub(super) struct Patience {
    /// Waits asleep before the next spin.
    skip: u32,
    /// As many after the next failure.
    after_failure: u32,
    /// Spins in a row that succeeded.
    successes: u32,
}

impl Patience {
    /// Most waits asleep between two spins.
    const MOST: u32 = 1023;
    /// After so many successes a failure costs half as many waits.
    const STREAK: u32 = 64;

    /// With one processor the other side cannot run meanwhile.
    pub(super) fn new() -> Self {
        let several = std::thread::available_parallelism().is_ok_and(|n| n.get() > 1);
        Self {
            skip: if several { 0 } else { u32::MAX },
            after_failure: 0,
            successes: 0,
        }
    }

    fn spins(&mut self) -> bool {
        if self.skip == 0 {
            return true;
        }
        if self.skip < u32::MAX {
            self.skip -= 1;
        }
        false
    }

    fn learn(&mut self, success: bool) {
        if success {
            self.successes += 1;
            if self.successes >= Self::STREAK {
                self.successes = 0;
                self.after_failure /= 2;
            }
        } else {
            self.successes = 0;
            self.after_failure = (2 * self.after_failure + 1).min(Self::MOST);
            self.skip = self.after_failure;
        }
    }
}

impl Turn {
    /// Hands the turn over.
    pub(super) fn give(&self, to: u32) {
        self.now.store(to, Ordering::SeqCst);
        if self.sleeping[to as usize].load(Ordering::SeqCst) != 0 {
            wake(&self.now);
        }
    }

    /// Waits until it is the turn of `of`, at most about `limit`; gives whether it is.
    pub(super) fn wait(&self, of: u32, limit: Duration, patience: &mut Patience) -> bool {
        let mine = || self.now.load(Ordering::Acquire) == of;
        if patience.spins() {
            let begin = Instant::now();
            loop {
                let came = (0..50).any(|_| {
                    let mine = mine();
                    if !mine {
                        std::hint::spin_loop();
                    }
                    mine
                });
                // Whoever was put aside while spinning notices by the clock.
                let in_time = begin.elapsed() <= SPIN;
                if came || !in_time {
                    patience.learn(came && in_time);
                    if came {
                        return true;
                    }
                    break;
                }
            }
        } else if mine() {
            return true;
        }
        let sleeping = &self.sleeping[of as usize];
        sleeping.store(1, Ordering::SeqCst);
        if self.now.load(Ordering::SeqCst) != of {
            sleep(&self.now, 1 - of, limit);
        }
        sleeping.store(0, Ordering::SeqCst);
        mine()
    }
}

/// Asks the scheduler for short turns of this thread: it runs no more than before, but sooner after it
/// was woken (Linux 6.12 and newer; others pay no heed).
#[cfg(target_os = "linux")]
pub(super) fn take_short_turns() {
    /// `struct sched_attr` in its first version.
    #[repr(C)]
    #[derive(Default)]
    struct Attributes {
        size: u32,
        policy: u32,
        flags: u64,
        nice: i32,
        priority: u32,
        /// The slice, ns.
        runtime: u64,
        deadline: u64,
        period: u64,
    }
    let mut attributes = Attributes::default();
    let size = size_of::<Attributes>() as u32;
    // SAFETY: the structure lives and is as large as is said.
    unsafe {
        let read = libc::syscall(libc::SYS_sched_getattr, 0, &raw mut attributes, size, 0);
        let is_usual = attributes.policy == libc::SCHED_OTHER as u32;
        if read == 0 && is_usual {
            attributes.size = size;
            attributes.runtime = 100_000;
            libc::syscall(libc::SYS_sched_setattr, 0, &raw const attributes, 0);
        }
    }
}

/// Asks the scheduler for short turns, where there is a way to.
#[cfg(not(target_os = "linux"))]
pub(super) fn take_short_turns() {}

/// Sleeps while `number` is `while_it_is`, at most `limit`.
#[cfg(target_os = "linux")]
fn sleep(number: &AtomicU32, while_it_is: u32, limit: Duration) {
    let limit = libc::timespec {
        tv_sec: limit.as_secs() as libc::time_t,
        tv_nsec: libc::c_long::from(limit.subsec_nanos() as i32),
    };
    // SAFETY: the number lives; the kernel compares and waits.
    unsafe {
        libc::syscall(
            libc::SYS_futex,
            number.as_ptr(),
            libc::FUTEX_WAIT,
            while_it_is,
            &raw const limit,
        );
    }
}

#[cfg(target_os = "linux")]
fn wake(number: &AtomicU32) {
    // SAFETY: the number lives.
    unsafe {
        libc::syscall(libc::SYS_futex, number.as_ptr(), libc::FUTEX_WAKE, 1);
    }
}

#[cfg(not(target_os = "linux"))]
fn sleep(number: &AtomicU32, while_it_is: u32, limit: Duration) {
    let begin = Instant::now();
    while number.load(Ordering::Acquire) == while_it_is && begin.elapsed() < limit {
        std::thread::sleep(Duration::from_micros(50));
    }
}

#[cfg(not(target_os = "linux"))]
fn wake(_number: &AtomicU32) {}

#[cfg(test)]
mod tests {
    use super::Patience;

    #[test]
    fn spins_that_fail_are_followed_by_ever_more_waits_asleep() {
        let mut patience = Patience {
            skip: 0,
            after_failure: 0,
            successes: 0,
        };
        let mut asleep = Vec::new();
        for _ in 0..12 {
            let before = (0..).take_while(|_| !patience.spins()).count();
            asleep.push(before);
            patience.learn(false);
        }
        assert_eq!(asleep[..5], [0, 1, 3, 7, 15]);
        assert_eq!(asleep[11], 1023);
        // Where spins succeed again they are tried every time, and one failure costs little.
        let _ = (0..).take_while(|_| !patience.spins()).count();
        for _ in 0..64 * 10 {
            assert!(patience.spins());
            patience.learn(true);
        }
        patience.learn(false);
        assert!(!patience.spins());
        assert!(patience.spins());
    }
}
