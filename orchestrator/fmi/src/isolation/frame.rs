//! The memory that both processes map: whose turn it is, what was logged, and the calls.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::MmapMut;

use super::ring::Ring;
use super::turn::Turn;
use crate::folder::{Removed, unused};

/// Bytes for calls and their values, the first that the system grants: a limit of the size of files
/// counts here too. What is not used takes no memory.
const ROOMS: [usize; 3] = [256 << 20, 16 << 20, 1 << 20];

#[repr(C)]
struct Header {
    turn: Turn,
    /// Bytes of calls in the buffer.
    length: u64,
    /// Where the call begins that the guest carries out.
    at: AtomicU64,
    ring: Ring,
}

/// The mapped memory.
pub(super) struct Frame {
    map: MmapMut,
    file: File,
}

/// How a guest finds the memory, and what must live until it has.
pub(super) struct Way {
    /// A path that can be opened in the guest.
    pub path: PathBuf,
    /// The descriptor that the guest inherits.
    pub inherited: Option<i32>,
    _file: Option<Removed>,
}

impl Frame {
    /// Where the room begins.
    const ROOM_AT: usize = size_of::<Header>().next_multiple_of(4096);

    /// Makes the memory. On Linux its length is sealed: an FMU that could shorten it would end the
    /// host with a bus error.
    ///
    /// # Errors
    /// No memory can be made or mapped.
    pub(super) fn create() -> io::Result<(Self, Way)> {
        let (file, way) = anonymous().map_or_else(named, Ok)?;
        let mut granted = Ok(());
        for room in ROOMS {
            granted = file.set_len((Self::ROOM_AT + room) as u64);
            if granted.is_ok() {
                break;
            }
        }
        granted?;
        seal(&file);
        Ok((Self::map(file)?, way))
    }

    /// Opens the memory that another process made.
    ///
    /// # Errors
    /// It is not there or shorter than it should be.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let frame = Self::map(file)?;
        frame.keep_from_children();
        #[cfg(target_os = "linux")]
        if let Some(number) = path.to_str().and_then(|path| path.strip_prefix(INHERITED))
            && let Ok(number) = number.parse::<i32>()
        {
            // SAFETY: the descriptor was inherited for this and is used no more.
            unsafe { libc::close(number) };
        }
        Ok(frame)
    }

    fn map(file: File) -> io::Result<Self> {
        if (file.metadata()?.len() as usize) <= Self::ROOM_AT {
            return Err(io::Error::other("the shared memory has a different length"));
        }
        // SAFETY: only the two processes have the memory, and take turns.
        let map = unsafe { MmapMut::map_mut(&file) }?;
        Ok(Self { map, file })
    }

    /// Maps the same memory once more.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn open_again(&self) -> io::Result<Self> {
        let frame = Self::map(self.file.try_clone()?)?;
        frame.keep_from_children();
        Ok(frame)
    }

    /// A copy of the guest that an FMU makes by `fork` cannot answer in its place.
    fn keep_from_children(&self) {
        #[cfg(target_os = "linux")]
        // SAFETY: the map lives.
        unsafe {
            let start = self.map.as_ptr().cast_mut().cast();
            libc::madvise(start, self.map.len(), libc::MADV_DONTFORK);
        }
    }

    fn header(&self) -> &Header {
        // SAFETY: the map begins with a header, at a page; zeros are a valid one.
        unsafe { &*self.map.as_ptr().cast::<Header>() }
    }

    pub(super) fn turn(&self) -> &Turn {
        &self.header().turn
    }

    pub(super) fn ring(&self) -> &Ring {
        &self.header().ring
    }

    /// Notes how many bytes of calls are in the room.
    pub(super) fn set_length(&mut self, length: usize) {
        // SAFETY: as for the header; it is this side's turn.
        unsafe { (*self.map.as_mut_ptr().cast::<Header>()).length = length as u64 }
    }

    /// Number of bytes of calls in the buffer.
    pub(super) fn length(&self) -> usize {
        (self.header().length as usize).min(self.map.len() - Self::ROOM_AT)
    }

    /// Notes where the call begins that is carried out now.
    pub(super) fn begin_at(&self, at: usize) {
        self.header().at.store(at as u64, Ordering::Relaxed);
    }

    /// Where the call begins that was carried out last.
    pub(super) fn began_at(&self) -> usize {
        self.header().at.load(Ordering::Relaxed) as usize
    }

    /// The room for calls.
    pub(super) fn room(&mut self) -> &mut [u8] {
        &mut self.map[Self::ROOM_AT..]
    }
}

/// The folder of inherited descriptors.
#[cfg(target_os = "linux")]
const INHERITED: &str = "/proc/self/fd/";

/// Memory without a name, which the guest inherits.
#[cfg(target_os = "linux")]
fn anonymous() -> Option<(File, Way)> {
    use std::os::fd::FromRawFd;
    let flags = libc::MFD_CLOEXEC | libc::MFD_ALLOW_SEALING;
    // SAFETY: the descriptor is new and owned by the file alone. The C library has a function for it only
    // since glibc 2.27.
    let (file, number) = unsafe {
        let name = c"shakebench-calls".as_ptr();
        let number = libc::syscall(libc::SYS_memfd_create, name, flags);
        let number = libc::c_int::try_from(number).ok().filter(|own| *own >= 0)?;
        if !Path::new(INHERITED).is_dir() {
            return None;
        }
        (File::from_raw_fd(number), number)
    };
    let way = Way {
        path: PathBuf::from(format!("{INHERITED}{number}")),
        inherited: Some(number),
        _file: None,
    };
    Some((file, way))
}

#[cfg(not(target_os = "linux"))]
fn anonymous() -> Option<(File, Way)> {
    None
}

#[cfg(target_os = "linux")]
fn seal(file: &File) {
    use std::os::fd::AsRawFd;
    let seals = libc::F_SEAL_SHRINK | libc::F_SEAL_GROW | libc::F_SEAL_SEAL;
    // SAFETY: the descriptor lives; a file that is no such memory refuses.
    unsafe { libc::fcntl(file.as_raw_fd(), libc::F_ADD_SEALS, seals) };
}

#[cfg(not(target_os = "linux"))]
fn seal(_file: &File) {}

/// A file, where there is no memory without a name.
fn named() -> io::Result<(File, Way)> {
    let path = unused("shakebench-calls-");
    let mut options = OpenOptions::new();
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let file = options
        .read(true)
        .write(true)
        .create_new(true)
        .open(&path)?;
    let way = Way {
        path: path.clone(),
        inherited: None,
        _file: Some(Removed(path)),
    };
    Ok((file, way))
}
