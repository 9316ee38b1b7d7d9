//! CRC-32 (ISO-HDLC), four bytes at a time.
//!
//! The tables are the crate's. Its own loops take one byte at a time from a table of 1 KiB, or sixteen from tables of 16 KiB:
//! the first costs 25 instructions an event of EVT 2, the second more flash than there is. Four at a time cost 14, and 4 KiB.
//!
//! On the STM32F746G-DISCO only a recording in its own flash comes this way, and flash is shorter than time: there it is the
//! crate's first.

#[cfg(not(feature = "stm32f746g-disco"))]
pub(super) use by_four::checksum_of;

/// The checksum of bytes.
#[cfg(feature = "stm32f746g-disco")]
pub(super) fn checksum_of(bytes: &[u8]) -> u32 {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};
    static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
    CRC.checksum(bytes)
}

#[cfg(not(feature = "stm32f746g-disco"))]
mod by_four {
    use crc::{CRC_32_ISO_HDLC, Crc, Table};

    /// What a byte adds to the remainder, by how many bytes stand behind it in its word. One by one, so that each has a register.
    static BEHIND_0: [u32; 256] = table(0);
    static BEHIND_1: [u32; 256] = table(1);
    static BEHIND_2: [u32; 256] = table(2);
    static BEHIND_3: [u32; 256] = table(3);

    const fn table(behind: usize) -> [u32; 256] {
        Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC).table()[behind]
    }

    /// The checksum of bytes.
    pub(in super::super) fn checksum_of(bytes: &[u8]) -> u32 {
        let (words, rest) = bytes.as_chunks::<4>();
        let (fours, words) = words.as_chunks::<4>();
        let mut remainder = CRC_32_ISO_HDLC.init;
        for [a, b, c, d] in fours {
            remainder = add(add(add(add(remainder, a), b), c), d);
        }
        for word in words {
            remainder = add(remainder, word);
        }
        for byte in rest {
            remainder = BEHIND_0[usize::from(remainder as u8 ^ byte)] ^ remainder >> 8;
        }
        remainder ^ CRC_32_ISO_HDLC.xorout
    }

    #[inline(always)]
    fn add(remainder: u32, word: &[u8; 4]) -> u32 {
        let [b0, b1, b2, b3] = (remainder ^ u32::from_le_bytes(*word)).to_le_bytes();
        BEHIND_3[usize::from(b0)]
            ^ BEHIND_2[usize::from(b1)]
            ^ BEHIND_1[usize::from(b2)]
            ^ BEHIND_0[usize::from(b3)]
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
    }

    proptest! {
        #[test]
        fn is_what_the_crate_computes(bytes in proptest::collection::vec(any::<u8>(), 0..70)) {
            let one_by_one = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);
            prop_assert_eq!(checksum_of(&bytes), one_by_one.checksum(&bytes));
        }
    }
}
