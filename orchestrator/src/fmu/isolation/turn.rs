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

impl Turn {
    /// Hands the turn over.
    pub(super) fn give(&self, to: u32) {
        self.now.store(to, Ordering::SeqCst);
        if self.sleeping[to as usize].load(Ordering::SeqCst) != 0 {
            wake(&self.now);
        }
    }

    /// Waits until it is the turn of `of`, at most about `limit`; gives whether it is.
    pub(super) fn wait(&self, of: u32, limit: Duration) -> bool {
        let mine = || self.now.load(Ordering::Acquire) == of;
        // With one processor the other side cannot run meanwhile.
        if spins() {
            let begin = Instant::now();
            loop {
                for _ in 0..50 {
                    if mine() {
                        return true;
                    }
                    std::hint::spin_loop();
                }
                if begin.elapsed() > SPIN {
                    break;
                }
            }
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

fn spins() -> bool {
    static SEVERAL: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
    *SEVERAL.get_or_init(|| std::thread::available_parallelism().is_ok_and(|n| n.get() > 1))
}

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
