//! CRC-32 (ISO-HDLC).
//!
//! On the STM32F746G-DISCO only a recording in its own flash comes this way, and flash is shorter than time: there half a byte is
//! looked up at once, in 64 bytes. Elsewhere it is the core's, which costs a quarter of that for 20 KiB.

#[cfg(feature = "stm32f746g-disco")]
pub(super) use by_halves::checksum_of;
#[cfg(not(feature = "stm32f746g-disco"))]
pub(super) use evtach_core::decode::crc32 as checksum_of;

#[cfg(any(test, feature = "stm32f746g-disco"))]
mod by_halves {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};

    /// What half a byte adds to the remainder of all behind it: what it adds where it is the higher half of one.
    static HALVES: [u32; 16] = {
        let bytes = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
        let (mut halves, mut half) = ([0; 16], 0);
        while half < 16 {
            halves[half] = bytes.table()[0][half << 4];
            half += 1;
        }
        halves
    };

    /// The checksum of bytes.
    pub(in super::super) fn checksum_of(bytes: &[u8]) -> u32 {
        let mut remainder = CRC_32_ISO_HDLC.init;
        for byte in bytes {
            remainder ^= u32::from(*byte);
            for _ in 0..2 {
                remainder = remainder >> 4 ^ HALVES[(remainder & 0xf) as usize];
            }
        }
        remainder ^ CRC_32_ISO_HDLC.xorout
    }
}

#[cfg(test)]
mod tests {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_published_check_value() {
        assert_eq!(checksum_of(b"123456789"), CRC_32_ISO_HDLC.check);
        assert_eq!(by_halves::checksum_of(b"123456789"), CRC_32_ISO_HDLC.check);
    }

    proptest! {
        #[test]
        fn is_what_the_crate_computes(bytes in proptest::collection::vec(any::<u8>(), 0..70)) {
            let expected = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC).checksum(&bytes);
            prop_assert_eq!(checksum_of(&bytes), expected);
            prop_assert_eq!(by_halves::checksum_of(&bytes), expected);
        }
    }
}
