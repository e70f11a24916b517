//! The file that both processes map: whose turn it is, what was logged, and the calls.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use memmap2::MmapMut;

use super::ring::Ring;
use super::turn::Turn;

/// Bytes for calls and their values. The file is sparse: what is not used takes no memory.
const ROOM: usize = 256 << 20;

#[repr(C)]
struct Header {
    turn: Turn,
    /// Bytes of calls in the room.
    length: u64,
    ring: Ring,
}

/// The mapped file.
pub(super) struct Frame {
    map: MmapMut,
    file: File,
}

impl Frame {
    /// Where the room begins.
    const ROOM_AT: usize = size_of::<Header>().next_multiple_of(4096);

    /// Makes the file, in memory where the system has a place for that.
    ///
    /// # Errors
    /// No file can be made or mapped.
    pub(super) fn create() -> io::Result<(Self, tempfile::TempPath)> {
        let memory = Path::new("/dev/shm");
        let folder = if memory.is_dir() {
            memory.to_path_buf()
        } else {
            std::env::temp_dir()
        };
        let made = |folder: PathBuf| {
            tempfile::Builder::new()
                .prefix("shakebench-calls-")
                .tempfile_in(folder)
        };
        let file = made(folder).or_else(|_| made(std::env::temp_dir()))?;
        file.as_file().set_len((Self::ROOM_AT + ROOM) as u64)?;
        let frame = Self::map(file.as_file())?;
        Ok((frame, file.into_temp_path()))
    }

    /// Opens the file that another process made.
    ///
    /// # Errors
    /// It is not there or not as long as it should be.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        if file.metadata()?.len() != (Self::ROOM_AT + ROOM) as u64 {
            return Err(io::Error::other("the file has another length"));
        }
        Self::map(&file)
    }

    fn map(file: &File) -> io::Result<Self> {
        // SAFETY: only the two processes have the file, and take turns.
        let map = unsafe { MmapMut::map_mut(file) }?;
        Ok(Self {
            map,
            file: file.try_clone()?,
        })
    }

    /// Maps the same file once more.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn open_again(&self) -> io::Result<Self> {
        Self::map(&self.file)
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

    /// How many bytes of calls are in the room.
    pub(super) fn length(&self) -> usize {
        (self.header().length as usize).min(ROOM)
    }

    /// The room for calls.
    pub(super) fn room(&mut self) -> &mut [u8] {
        &mut self.map[Self::ROOM_AT..]
    }
}
