//! CRC-32 (ISO-HDLC).
//!
//! On the STM32F746G-DISCO only a recording in its own flash comes this way, and flash is shorter than time: there it is the
//! crate's, a byte at a time from a table of 1 KiB. Elsewhere it is the core's, which costs less than half of that for 20 KiB.

#[cfg(not(feature = "stm32f746g-disco"))]
pub(super) use evtach_core::decode::crc32 as checksum_of;

/// The checksum of bytes.
#[cfg(feature = "stm32f746g-disco")]
pub(super) fn checksum_of(bytes: &[u8]) -> u32 {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};
    static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
    CRC.checksum(bytes)
}

#[cfg(test)]
mod tests {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_published_check_value() {
        assert_eq!(checksum_of(b"123456789"), CRC_32_ISO_HDLC.check);
    }

    proptest! {
        #[test]
        fn is_what_the_crate_computes(bytes in proptest::collection::vec(any::<u8>(), 0..70)) {
            let one_by_one = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
            prop_assert_eq!(checksum_of(&bytes), one_by_one.checksum(&bytes));
        }
    }
}
