//! Messages on their way from the guest: a ring of bytes in shared memory, written by the guest and
//! read by the host. Messages that an FMU logged before its process died therefore survive.

use std::cell::UnsafeCell;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of the ring.
const SIZE: usize = 1 << 20;

/// The ring; it lies in shared memory.
#[repr(C)]
pub(super) struct Ring {
    written: AtomicU64,
    read: AtomicU64,
    bytes: UnsafeCell<[u8; SIZE]>,
}

// SAFETY: one side writes between `read` and `written`, the other reads there.
unsafe impl Sync for Ring {}

/// A message as it travels.
#[derive(Debug)]
pub(super) struct Logged {
    pub instance: u32,
    pub status: i32,
    pub category: String,
    pub text: String,
}

impl Ring {
    /// Adds a message, unless there is no room; callers take turns.
    pub(super) fn write(&self, instance: u32, status: i32, category: &str, text: &str) {
        let category = &category.as_bytes()[..category.len().min(200)];
        let text = &text.as_bytes()[..text.len().min(16_000)];
        let mut entry = Vec::with_capacity(16 + category.len() + text.len());
        entry.extend(instance.to_ne_bytes());
        entry.extend(status.to_ne_bytes());
        entry.extend((category.len() as u32).to_ne_bytes());
        entry.extend((text.len() as u32).to_ne_bytes());
        entry.extend(category);
        entry.extend(text);
        let written = self.written.load(Ordering::Relaxed);
        let used = written.wrapping_sub(self.read.load(Ordering::Acquire)) as usize;
        if used + entry.len() > SIZE {
            return;
        }
        for (at, &byte) in entry.iter().enumerate() {
            let place = (written as usize + at) % SIZE;
            // SAFETY: inside the ring, in the part that is not read.
            unsafe { self.bytes.get().cast::<u8>().add(place).write(byte) };
        }
        self.written
            .store(written + entry.len() as u64, Ordering::Release);
    }

    /// Takes the oldest message.
    pub(super) fn take(&self) -> Option<Logged> {
        let read = self.read.load(Ordering::Relaxed);
        let there = self.written.load(Ordering::Acquire).wrapping_sub(read) as usize;
        if !(16..=SIZE).contains(&there) {
            // Nothing, or numbers that cannot be: what is there is passed over.
            self.read
                .store(read.wrapping_add(there as u64), Ordering::Release);
            return None;
        }
        let bytes = |from: usize, length: usize| -> Vec<u8> {
            let place = |at| (read as usize).wrapping_add(from + at) % SIZE;
            (0..length)
                // SAFETY: inside the ring, in the part that is written.
                .map(|at| unsafe { self.bytes.get().cast::<u8>().add(place(at)).read() })
                .collect()
        };
        let number = |from| {
            let four = bytes(from, 4);
            u32::from_ne_bytes([four[0], four[1], four[2], four[3]])
        };
        let (category, text) = (number(8) as usize, number(12) as usize);
        // A guest gone mad may have written anything.
        if 16 + category + text > there {
            self.read
                .store(read.wrapping_add(there as u64), Ordering::Release);
            return None;
        }
        let words = |from, length| String::from_utf8_lossy(&bytes(from, length)).into_owned();
        let logged = Logged {
            instance: number(0),
            status: number(4) as i32,
            category: words(16, category),
            text: words(16 + category, text),
        };
        let length = (16 + category + text) as u64;
        self.read
            .store(read.wrapping_add(length), Ordering::Release);
        Some(logged)
    }

    /// Whether there is a message.
    pub(super) fn has_some(&self) -> bool {
        self.written.load(Ordering::Acquire) != self.read.load(Ordering::Relaxed)
    }
}
