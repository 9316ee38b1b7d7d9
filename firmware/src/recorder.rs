//! Recording events into memory outside of the processor's own: record on the device, replay on the PC.
//!
//! What is kept is the file of [`crate::record`]: its header is made when it is read, its records lie in the memory.

use embedded_storage::Storage;
use evtach_core::{Geometry, PackedEvent};

use crate::record::{Header, RECORD_BYTES, encode_packed};

/// Records that are written at once.
const AT_ONCE: usize = 16;

/// Why a recording stopped or cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[error("the memory for recordings failed at byte {offset}: record again")]
pub struct MemoryError {
    /// Where in the memory.
    pub offset: u32,
}

/// A recorder over a memory that the board lends.
#[derive(Debug)]
pub struct Recorder<M> {
    memory: M,
    geometry: Option<Geometry>,
    first_us: u64,
    /// Records in the memory.
    events: u32,
    /// Records at which the recording ends.
    wanted: u32,
    running: bool,
}

impl<M: Storage> Recorder<M> {
    /// Nothing recorded yet.
    pub const fn new(memory: M) -> Self {
        Self { memory, geometry: None, first_us: 0, events: 0, wanted: 0, running: false }
    }

    /// Records there is room for.
    #[must_use]
    pub fn capacity(&self) -> u32 {
        // The length of the file must fit as well.
        let room = self.memory.capacity().min(u32::MAX as usize - Header::BYTES);
        (room / RECORD_BYTES) as u32
    }

    /// Records held.
    #[must_use]
    pub const fn events(&self) -> u32 {
        self.events
    }

    /// Whether what comes is recorded.
    #[must_use]
    pub const fn is_running(&self) -> bool {
        self.running
    }

    /// Whether the recording holds all it was to hold.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.wanted > 0 && self.events == self.wanted
    }

    /// Begins anew, for at most so many events.
    pub fn start(&mut self, geometry: Geometry, events: u32) {
        self.geometry = Some(geometry);
        self.events = 0;
        self.wanted = events.min(self.capacity());
        self.running = self.wanted > 0;
    }

    /// Ends the recording.
    pub const fn stop(&mut self) {
        self.running = false;
    }

    /// Keeps events while it runs; `first_us` is the time of the first of them in microseconds.
    ///
    /// # Errors
    /// When the memory fails, which ends the recording; what was kept before stays.
    pub fn push(&mut self, first_us: u64, events: &[PackedEvent]) -> Result<(), MemoryError> {
        let room = (self.wanted - self.events) as usize;
        let events = &events[..events.len().min(room)];
        if !self.running || events.is_empty() {
            return Ok(());
        }
        if self.events == 0 {
            self.first_us = first_us;
        }
        for events in events.chunks(AT_ONCE) {
            let mut bytes = [[0; RECORD_BYTES]; AT_ONCE];
            for (record, event) in bytes.iter_mut().zip(events) {
                *record = encode_packed(*event);
            }
            let offset = self.events * RECORD_BYTES as u32;
            let bytes = &bytes.as_flattened()[..events.len() * RECORD_BYTES];
            if self.memory.write(offset, bytes).is_err() {
                self.running = false;
                return Err(MemoryError { offset });
            }
            self.events += events.len() as u32;
        }
        self.running = self.events < self.wanted;
        Ok(())
    }

    /// Bytes of the recording as a file; 0 before the first.
    #[must_use]
    pub const fn length(&self) -> u32 {
        match self.geometry {
            Some(_) => Header::BYTES as u32 + self.events * RECORD_BYTES as u32,
            None => 0,
        }
    }

    /// Copies the file from a byte on, as much of it as there is.
    ///
    /// # Errors
    /// When the memory fails.
    pub fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        let Some(geometry) = self.geometry else { return Ok(()) };
        let left = self.length().saturating_sub(offset) as usize;
        let count = bytes.len().min(left);
        let bytes = &mut bytes[..count];
        let header = Header { geometry, first_us: self.first_us, events: self.events }.encode();
        let of_header = header.get(offset as usize..).unwrap_or_default();
        let in_header = of_header.len().min(bytes.len());
        let (head, body) = bytes.split_at_mut(in_header);
        head.copy_from_slice(&of_header[..in_header]);
        if body.is_empty() {
            return Ok(());
        }
        let offset = (offset as usize + in_header - Header::BYTES) as u32;
        self.memory.read(offset, body).map_err(|_| MemoryError { offset })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use embedded_storage::ReadStorage;
    use evtach_core::{Event, Polarity};

    use super::*;
    use crate::record;

    const GEOMETRY: Geometry = Geometry { width_px: 320, height_px: 240 };

    /// Memory for five records and a bit, which may fail.
    struct Ram {
        bytes: [u8; 43],
        broken: bool,
    }

    impl ReadStorage for Ram {
        type Error = ();

        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), ()> {
            bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
            if self.broken { Err(()) } else { Ok(()) }
        }

        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl Storage for Ram {
        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), ()> {
            self.bytes[offset as usize..][..bytes.len()].copy_from_slice(bytes);
            if self.broken { Err(()) } else { Ok(()) }
        }
    }

    fn events(count: u64) -> Vec<Event> {
        (0..count)
            .map(|index| Event { t_us: 5_000_000_000 + index, x: 3, y: 4, polarity: Polarity::On })
            .collect()
    }

    fn packed(events: &[Event]) -> Vec<PackedEvent> {
        events.iter().map(PackedEvent::pack).collect()
    }

    fn recorder() -> Recorder<Ram> {
        Recorder::new(Ram { bytes: [0; 43], broken: false })
    }

    #[test]
    fn the_file_holds_what_came_in_any_piecing() {
        let mut recorder = recorder();
        assert_eq!((recorder.capacity(), recorder.length()), (5, 0));
        recorder.push(1, &packed(&events(1))).expect("not running");
        assert_eq!(recorder.events(), 0);
        recorder.start(GEOMETRY, 4);
        let events = events(6);
        recorder.push(events[0].t_us, &packed(&events[..3])).expect("room");
        assert!(recorder.is_running() && !recorder.is_full());
        recorder.push(events[3].t_us, &packed(&events[3..])).expect("room");
        assert!(!recorder.is_running() && recorder.is_full());
        assert_eq!((recorder.events(), recorder.length()), (4, 24 + 32));
        let mut file = [0; 56];
        recorder.read(0, &mut file).expect("memory");
        let (header, body) = file.split_at(Header::BYTES);
        let header = Header::parse(header.try_into().expect("its length")).expect("a header");
        assert_eq!(header, Header { geometry: GEOMETRY, first_us: 5_000_000_000, events: 4 });
        let mut decoder = record::Decoder::new(header.first_us);
        let found: Vec<Event> =
            body.as_chunks().0.iter().map(|&record| decoder.decode(record)).collect();
        assert_eq!(found, events[..4]);
        for step in 1..20 {
            let mut pieces = Vec::new();
            while pieces.len() < 56 {
                let mut piece = [0; 20];
                let offset = pieces.len() as u32;
                recorder.read(offset, &mut piece[..step]).expect("memory");
                pieces.extend_from_slice(&piece[..step]);
            }
            assert_eq!(pieces[..56], file, "in steps of {step}");
        }
    }

    #[test]
    fn no_more_than_there_is_room_for() {
        let mut recorder = recorder();
        recorder.start(GEOMETRY, u32::MAX);
        recorder.push(0, &packed(&events(9))).expect("room for some");
        assert_eq!((recorder.events(), recorder.is_full()), (5, true));
        recorder.start(GEOMETRY, 2);
        assert_eq!((recorder.events(), recorder.is_running()), (0, true));
        recorder.stop();
        recorder.push(0, &packed(&events(1))).expect("stopped");
        assert_eq!(recorder.events(), 0);
    }

    #[test]
    fn a_memory_that_fails_ends_the_recording() {
        let mut recorder = recorder();
        recorder.start(GEOMETRY, 5);
        recorder.push(0, &packed(&events(1))).expect("room");
        recorder.memory.broken = true;
        let error = recorder.push(0, &packed(&events(1)));
        assert_eq!(error, Err(MemoryError { offset: 8 }));
        assert_eq!((recorder.events(), recorder.is_running()), (1, false));
        assert_eq!(recorder.read(20, &mut [0; 8]), Err(MemoryError { offset: 0 }));
    }
}
