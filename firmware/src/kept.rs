//! A fault kept over a reset, in memory that the start-up code does not clear.
//!
//! The panic and exception handlers [`encode`] what happened into a block of such memory; the next start
//! [`take`]s it. After power-on the block holds anything: a magic number and a checksum tell. Only the board knows
//! where the block lies; here are plain bytes.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::String;

use crate::instrument::Fault;

/// Bytes of a block.
pub const KEPT_BYTES: usize = 128;
/// Room for the message of a fault.
pub const TEXT_BYTES: usize = KEPT_BYTES - 10;
const MAGIC: [u8; 4] = *b"EvF1";
/// Without its table of 1 KB: it runs once a start.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What happened, and in which words.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct KeptFault {
    /// What happened.
    pub fault: Fault,
    /// The message of the panic, or the address of the exception; cut to its room.
    pub text: String<TEXT_BYTES>,
}

impl KeptFault {
    /// A fault and its message, anything that prints.
    #[must_use]
    pub fn new(fault: Fault, message: impl fmt::Display) -> Self {
        let mut text = Cut(String::new());
        // What does not fit is cut.
        fmt::write(&mut text, format_args!("{message}")).ok();
        Self { fault, text: text.0 }
    }
}

/// A text that takes what fits.
struct Cut(String<TEXT_BYTES>);

impl fmt::Write for Cut {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.chars().try_for_each(|character| self.0.push(character)).map_err(|_| fmt::Error)
    }
}

const fn code(fault: Fault) -> u8 {
    match fault {
        Fault::Panic => 1,
        Fault::Exception => 2,
        Fault::Watchdog => 3,
        Fault::Preferences => 4,
        Fault::Crystal => 5,
        Fault::Memory => 6,
    }
}

fn fault(code: u8) -> Option<Fault> {
    Fault::ALL.into_iter().find(|&fault| self::code(fault) == code)
}

/// The block of a fault: magic, kind, length of the text, text, checksum of all before.
#[must_use]
pub fn encode(kept: &KeptFault) -> [u8; KEPT_BYTES] {
    let mut block = [0; KEPT_BYTES];
    let head = MAGIC.into_iter().chain([code(kept.fault), kept.text.len() as u8]);
    let bytes = head.chain(kept.text.bytes());
    block.iter_mut().zip(bytes).for_each(|(at, byte)| *at = byte);
    let checksum = CRC.checksum(&block[..KEPT_BYTES - 4]);
    block[KEPT_BYTES - 4..].copy_from_slice(&checksum.to_le_bytes());
    block
}

/// The fault of a block, where there is one; the block is wiped, so that it is told once.
#[must_use]
pub fn take(block: &mut [u8; KEPT_BYTES]) -> Option<KeptFault> {
    let kept = decode(block);
    block.fill(0);
    kept
}

fn decode(block: &[u8; KEPT_BYTES]) -> Option<KeptFault> {
    let (body, checksum) = block.split_last_chunk::<4>()?;
    if CRC.checksum(body) != u32::from_le_bytes(*checksum) {
        return None;
    }
    let ([m0, m1, m2, m3, kind, length], text) = body.split_first_chunk::<6>()?;
    if [*m0, *m1, *m2, *m3] != MAGIC {
        return None;
    }
    let text = core::str::from_utf8(text.get(..usize::from(*length))?).ok()?;
    Some(KeptFault { fault: fault(*kind)?, text: text.try_into().ok()? })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn told_once() {
        let kept = KeptFault::new(Fault::Panic, "store.rs:12: index out of bounds");
        let mut block = encode(&kept);
        assert_eq!(take(&mut block), Some(kept));
        assert_eq!(take(&mut block), None);
    }

    #[test]
    fn an_empty_memory_is_no_fault() {
        // A checksum over zeros that is not zero, else this block would pass.
        for byte in [0x00, 0xff, 0xa5] {
            assert_eq!(take(&mut [byte; KEPT_BYTES]), None);
        }
    }

    proptest! {
        #[test]
        fn any_message_comes_back_as_far_as_there_is_room(text in ".{0,200}", which in 1_u8..7) {
            let kept = KeptFault::new(fault(which).expect("a fault"), &text);
            prop_assert!(text.starts_with(kept.text.as_str()));
            prop_assert!(kept.text.as_str() == text || kept.text.len() > TEXT_BYTES - 4);
            prop_assert_eq!(take(&mut encode(&kept)), Some(kept));
        }

        #[test]
        fn a_flipped_bit_is_seen(byte in 0..KEPT_BYTES, bit in 0_u32..8) {
            let mut block = encode(&KeptFault::new(Fault::Exception, "0x0800_1234"));
            block[byte] ^= 1 << bit;
            prop_assert_eq!(take(&mut block), None);
        }

        #[test]
        fn any_memory_is_looked_at(bytes in prop::collection::vec(any::<u8>(), KEPT_BYTES), sealed in any::<bool>()) {
            let mut block: [u8; KEPT_BYTES] = bytes.try_into().expect("its length");
            if sealed {
                block[..4].copy_from_slice(&MAGIC);
                let checksum = CRC.checksum(&block[..KEPT_BYTES - 4]);
                block[KEPT_BYTES - 4..].copy_from_slice(&checksum.to_le_bytes());
            }
            // With a right checksum, whatever it says must still be checked.
            if let Some(kept) = take(&mut block) {
                prop_assert_eq!(take(&mut encode(&kept)), Some(kept));
            }
        }
    }
}
