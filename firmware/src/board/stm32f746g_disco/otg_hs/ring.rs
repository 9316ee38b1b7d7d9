//! Data that comes in while what came before is handled.

use embassy_usb_driver::host::PipeError;

use super::channel::{Ended, Endpoint, Transfer};
use super::memory::{self, SLOT_BYTES, SLOTS};
use super::registers::DATA0;

/// The slots, in the order in which they are filled.
pub struct Ring {
    endpoint: Option<Endpoint>,
    /// Bytes of each; what lies from `first` on for `full` slots waits to be fetched.
    bytes: [u16; SLOTS],
    first: usize,
    full: usize,
    /// Bytes of the first that have been fetched.
    fetched: usize,
    /// Packet identifier of the next packet.
    pid: u8,
    /// Why no more comes, behind what is in the slots.
    error: Option<PipeError>,
}

/// What is there to be fetched.
pub enum Waiting {
    /// These bytes, which stay where they are until they are [`Ring::took`].
    Bytes(*const u8, usize),
    /// Nothing more will come.
    Error(PipeError),
    /// Nothing yet.
    Nothing,
}

impl Ring {
    /// Nobody's.
    pub const FREE: Self = Self {
        endpoint: None,
        bytes: [0; SLOTS],
        first: 0,
        full: 0,
        fetched: 0,
        pid: DATA0,
        error: None,
    };

    /// Whether a pipe has it.
    pub const fn is_taken(&self) -> bool {
        self.endpoint.is_some()
    }

    /// For a pipe to this endpoint.
    pub const fn of(endpoint: Endpoint) -> Self {
        Self { endpoint: Some(endpoint), ..Self::FREE }
    }

    /// The next transfer, if there is a slot for it.
    pub fn next(&self) -> Option<Transfer> {
        let endpoint = self.endpoint.filter(|_| self.full < SLOTS && self.error.is_none())?;
        let address = memory::address(memory::slot((self.first + self.full) % SLOTS));
        // Whole packets.
        let packet_bytes = usize::from(endpoint.packet_bytes);
        let bytes = (SLOT_BYTES - SLOT_BYTES.checked_rem(packet_bytes)?) as u32;
        Some(Transfer { endpoint, is_in: true, pid: self.pid, address, bytes })
    }

    /// A transfer has ended: what comes next.
    pub fn filled(&mut self, ended: Ended) -> Option<Transfer> {
        self.pid = ended.pid;
        if ended.bytes > 0 && self.full < SLOTS {
            self.bytes[(self.first + self.full) % SLOTS] = ended.bytes as u16;
            self.full += 1;
        }
        self.error = ended.error;
        self.next()
    }

    /// The device has gone; what came before waits.
    pub fn lose(&mut self) {
        if self.is_taken() {
            self.error = Some(PipeError::Disconnected);
        }
    }

    /// What can be fetched. An error is told once, behind all that came before it.
    pub fn waiting(&mut self) -> Waiting {
        if self.full > 0 {
            let slot = memory::slot(self.first).cast_const().wrapping_add(self.fetched);
            return Waiting::Bytes(slot, self.first_bytes() - self.fetched);
        }
        self.error.take().map_or(Waiting::Nothing, Waiting::Error)
    }

    /// Bytes of the slot that is fetched next.
    fn first_bytes(&self) -> usize {
        self.bytes.get(self.first).copied().unwrap_or(0).into()
    }

    /// So many bytes of what waits have been fetched.
    pub fn took(&mut self, bytes: usize) {
        self.fetched += bytes;
        if self.full > 0 && self.fetched >= self.first_bytes() {
            self.first = (self.first + 1) % SLOTS;
            self.full -= 1;
            self.fetched = 0;
        }
    }

    /// The device begins with DATA0 again.
    pub const fn reset_toggle(&mut self) {
        self.pid = DATA0;
    }
}
