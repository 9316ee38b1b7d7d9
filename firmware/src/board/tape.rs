//! The recorder, over a piece of external memory that every board has at another place.
#![expect(unsafe_code, reason = "memory at fixed addresses, handed out once")]

use core::cell::RefCell;
use core::convert::Infallible;
use core::ptr;

use embassy_sync::blocking_mutex::Mutex as BlockingMutex;
use embedded_storage::{ReadStorage, Storage};
use evtach_core::Geometry;
use evtach_firmware::intake::Block;
use evtach_firmware::recorder::Recorder;
use evtach_firmware::scpi::{RecorderFailed, RecorderState, RecorderStatus};
use evtach_firmware::tasks::Recording;

use crate::memory::Mutex;

static RECORDER: BlockingMutex<Mutex, RefCell<Option<Recorder<RecordingMemory>>>> =
    BlockingMutex::new(RefCell::new(None));

/// Room for recordings: plain memory that nothing else names.
#[derive(Debug)]
pub struct RecordingMemory {
    start: usize,
    bytes: usize,
}

impl RecordingMemory {
    /// So many bytes from an address on.
    ///
    /// # Safety
    ///
    /// The memory is there, and nothing else names it from now on.
    pub const unsafe fn new(start: usize, bytes: usize) -> Self {
        Self { start, bytes }
    }

    /// Address and number of the bytes from `offset` on that the memory holds.
    fn within(&self, offset: u32, count: usize) -> (usize, usize) {
        let offset = (offset as usize).min(self.bytes);
        (self.start + offset, count.min(self.bytes - offset))
    }
}

impl ReadStorage for RecordingMemory {
    type Error = Infallible;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        let (at, count) = self.within(offset, bytes.len());
        // SAFETY: `within` keeps to the memory for recordings, which only `self` names.
        unsafe {
            ptr::with_exposed_provenance::<u8>(at)
                .copy_to_nonoverlapping(bytes.as_mut_ptr(), count);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes
    }
}

impl Storage for RecordingMemory {
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        let (at, count) = self.within(offset, bytes.len());
        // SAFETY: as above.
        unsafe {
            ptr::with_exposed_provenance_mut::<u8>(at)
                .copy_from_nonoverlapping(bytes.as_ptr(), count);
        }
        Ok(())
    }
}

/// The recorder, which the measuring task fills and the link reads.
pub struct Tape;

impl Tape {
    /// Gives the recorder its memory.
    pub fn lend(memory: RecordingMemory) {
        RECORDER.lock(|recorder| recorder.replace(Some(Recorder::new(memory))));
    }

    /// Records a block, while something is recorded.
    pub fn push(block: &Block) {
        // A memory that fails ends the recording, and the link says so.
        Self::with(|recorder| recorder.push(block.t_us, block.events()).ok());
    }

    fn with<T>(work: impl FnOnce(&mut Recorder<RecordingMemory>) -> T) -> Option<T> {
        RECORDER.lock(|recorder| recorder.borrow_mut().as_mut().map(work))
    }
}

impl Recording for Tape {
    fn status(&self) -> RecorderStatus {
        Self::with(|recorder| RecorderStatus {
            state: if recorder.is_running() {
                RecorderState::Running
            } else if recorder.is_full() {
                RecorderState::Full
            } else {
                RecorderState::Idle
            },
            events: recorder.events(),
            capacity: recorder.capacity(),
        })
        .unwrap_or_default()
    }

    fn start(&mut self, geometry: Geometry, events: u32) {
        Self::with(|recorder| recorder.start(geometry, events));
    }

    fn stop(&mut self) {
        Self::with(Recorder::stop);
    }

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RecorderFailed> {
        let read = Self::with(|recorder| recorder.read(offset, bytes));
        read.and_then(Result::ok).ok_or(RecorderFailed)
    }
}
