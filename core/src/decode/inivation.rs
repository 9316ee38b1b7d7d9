//! What the USB words of iniVation's cameras have in common: 16 bits, a 15-bit clock with wrap words, and the inertial sensor's
//! samples byte by byte (facts: libcaer, "davis_common" and "dvxplorer").

use crate::event::GyroSample;

/// The word by which a camera tells that its clock was set to zero.
pub(super) const CLOCK_RESET: u16 = 1;
/// Highest number of a special word.
const LAST_SPECIAL: u16 = 17;

/// Bytes of an inertial sample: acceleration, temperature, rate, each big-endian.
const IMU_BYTES: u8 = 14;
/// Where the rate about the optical axis stands in it.
const GYRO_Z_AT: u8 = 12;
/// 250 degrees per second over 2^15 steps, in rad/s.
const RAD_S_PER_STEP: f32 = 250.0 / 32768.0 * core::f32::consts::PI / 180.0;

/// How the chips sit in the camera: asked of the camera at start-up, never assumed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mounting {
    /// Columns are sent as rows (bit 2 of the orientation register of the pixel array).
    pub swap_xy: bool,
    /// The inertial sensor's z axis is turned round (bit 0 of the orientation register of the inertial sensor).
    pub flip_gyro_z: bool,
}

/// Maker of the inertial sensor, which numbers the ranges of its gyroscope in its own way.
#[derive(Clone, Copy, Debug)]
pub(super) enum ImuMaker {
    /// InvenSense, in a DAVIS: 250 degrees per second, and twice as many with each number, in two bits.
    InvenSense,
    /// Bosch, in a DVXplorer: 2000 degrees per second, and half as many with each number up to 4, in three bits.
    Bosch,
}

impl ImuMaker {
    /// The range of a number in multiples of 250 degrees per second; `None`: there is no such number.
    fn range(self, format: u8) -> Option<f32> {
        match (self, format & 7) {
            (Self::InvenSense, number) => Some(f32::from(1_u8 << (number & 3))),
            (Self::Bosch, number @ 0..=4) => Some(16.0 / f32::from(2_u8 << number)),
            (Self::Bosch, _) => None,
        }
    }
}

/// All words that are neither a time nor about pixels.
#[derive(Clone, Debug)]
pub(super) struct Common {
    pub clock: Clock,
    imu: Imu,
    unknown: u64,
}

impl Common {
    pub(super) const fn new(maker: ImuMaker, flip_gyro_z: bool) -> Self {
        Self { clock: Clock::new(), imu: Imu::new(maker, flip_gyro_z), unknown: 0 }
    }

    /// Words of a kind the camera does not send.
    pub(super) const fn unknown(&self) -> u64 {
        self.unknown
    }

    /// The camera's clock was set to zero: time starts anew, and a sample on its way is of no time.
    pub(super) fn reset(&mut self) {
        self.clock = Clock::new();
        self.imu.at = u8::MAX;
    }

    /// Takes in such a word, and returns the gyro sample that it completes.
    // Rare, and the same for both cameras.
    #[inline(never)]
    pub(super) fn other(&mut self, word: u16) -> Option<GyroSample> {
        let data = word & 0x0fff;
        match (word >> 12, data) {
            (0, CLOCK_RESET) => self.reset(),
            (0, 5) => self.imu.begin(self.clock.t_us()),
            (0, 7) => return self.imu.end(),
            // External inputs, parts of frames.
            (0, 2..=LAST_SPECIAL) => {}
            (5, _) => self.imu.take(data),
            (7, _) => self.clock.wrap(data),
            _ => self.unknown += 1,
        }
        None
    }
}

/// Clock behind words with bit 15 set (low 15 bits of the time) and wrap words (multiples of 2^15 us).
#[derive(Clone, Debug, Default)]
pub(super) struct Clock {
    base_us: u64,
    t_us: u64,
}

impl Clock {
    const fn new() -> Self {
        Self { base_us: 0, t_us: 0 }
    }

    pub(super) const fn t_us(&self) -> u64 {
        self.t_us
    }

    #[inline]
    pub(super) fn low(&mut self, word: u16) {
        self.t_us = self.base_us + u64::from(word & 0x7fff);
    }

    /// A wrap word: the camera folds wraps in which nothing happened into one word with their number.
    fn wrap(&mut self, count: u16) {
        self.base_us += u64::from(count) << 15;
        self.t_us = self.base_us;
    }
}

/// An inertial sample on its way, byte by byte.
#[derive(Clone, Debug)]
struct Imu {
    maker: ImuMaker,
    flip_z: bool,
    t_us: u64,
    /// Next byte; `IMU_BYTES` and beyond when none is expected.
    at: u8,
    /// Which quantities come: bit 2 acceleration, bit 1 rate, bit 0 temperature.
    kinds: u8,
    high: u8,
    gyro_z: i16,
    /// Range of the gyroscope in multiples of 250 degrees per second; `None`: of a number that there is not.
    range: Option<f32>,
}

impl Imu {
    const fn new(maker: ImuMaker, flip_z: bool) -> Self {
        let (t_us, at, kinds, high, gyro_z) = (0, IMU_BYTES, 0b111, 0, 0);
        Self { maker, flip_z, t_us, at, kinds, high, gyro_z, range: None }
    }

    fn begin(&mut self, t_us: u64) {
        self.t_us = t_us;
        self.at = 0;
    }

    /// What the sample says, if all of it has come.
    fn end(&mut self) -> Option<GyroSample> {
        let complete = self.at == IMU_BYTES && self.kinds & 2 != 0;
        self.at = u8::MAX;
        let range = self.range.filter(|_| complete)?;
        let steps = if self.flip_z { -f32::from(self.gyro_z) } else { f32::from(self.gyro_z) };
        // The axis points out of the lens: a positive rate turns the camera clockwise and the picture back.
        Some(GyroSample { t_us: self.t_us, roll_rad_s: -steps * range * RAD_S_PER_STEP })
    }

    /// A byte, and what it is.
    fn take(&mut self, data: u16) {
        let byte = data as u8;
        match data >> 8 {
            0 => self.byte(byte),
            3 => self.format(byte),
            // Regions of the frame.
            _ => {}
        }
    }

    fn format(&mut self, byte: u8) {
        self.range = self.maker.range(byte);
        self.kinds = byte >> 5;
        // What is switched off is not sent: its bytes are skipped.
        self.at = match self.kinds {
            kinds if kinds & 4 != 0 => 0,
            kinds if kinds & 1 != 0 => 6,
            kinds if kinds & 2 != 0 => 8,
            _ => IMU_BYTES,
        };
    }

    fn byte(&mut self, byte: u8) {
        if self.at >= IMU_BYTES {
            self.at = u8::MAX;
            return;
        }
        if self.at.is_multiple_of(2) {
            self.high = byte;
        } else if self.at == GYRO_Z_AT + 1 {
            self.gyro_z = i16::from_be_bytes([self.high, byte]);
        }
        self.at += 1;
        if self.at == 6 && self.kinds & 1 == 0 {
            self.at = 8;
        }
        if self.at == 8 && self.kinds & 2 == 0 {
            self.at = IMU_BYTES;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    /// What comes of a sample at 100 us of these quantities, range and bytes.
    fn sample(maker: ImuMaker, flip_z: bool, format: u16, bytes: &[u8]) -> Option<GyroSample> {
        let mut common = Common::new(maker, flip_z);
        common.clock.low(0x8064);
        let mut words = std::vec![0x0005, 0x5300 | format];
        words.extend(bytes.iter().map(|&byte| 0x5000 | u16::from(byte)));
        words.push(0x0007);
        let samples: Vec<_> = words.iter().filter_map(|&word| common.other(word)).collect();
        assert!(samples.len() <= 1);
        assert_eq!(common.unknown(), 0);
        samples.first().copied()
    }

    /// Half of the range.
    const HALF: [u8; 14] = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x40, 0];

    #[test]
    fn gyro_about_the_optical_axis() {
        for (flip_z, sign) in [(false, -1.0), (true, 1.0)] {
            let found = sample(ImuMaker::InvenSense, flip_z, 7 << 5 | 1, &HALF).expect("a sample");
            assert_eq!(found.t_us, 100);
            assert!((found.roll_rad_s - sign * 250_f32.to_radians()).abs() < 1e-4);
        }
    }

    #[test]
    fn each_maker_numbers_its_ranges() {
        let roll = |maker, number| {
            sample(maker, true, 7 << 5 | number, &HALF).map(|sample| sample.roll_rad_s)
        };
        for (number, half_deg_s) in [125.0_f32, 250.0, 500.0, 1000.0].into_iter().enumerate() {
            let found = roll(ImuMaker::InvenSense, number as u16).expect("a rate");
            assert!((found - half_deg_s.to_radians()).abs() < 1e-4);
        }
        for (number, half_deg_s) in [1000.0_f32, 500.0, 250.0, 125.0, 62.5].into_iter().enumerate()
        {
            let found = roll(ImuMaker::Bosch, number as u16).expect("a rate");
            assert!((found - half_deg_s.to_radians()).abs() < 1e-4);
        }
        assert_eq!(roll(ImuMaker::Bosch, 5), None);
        // The accelerometer's range is beside the gyroscope's: from bit 2 on there, from bit 3 on here.
        assert_eq!(roll(ImuMaker::InvenSense, 1 | 3 << 2), roll(ImuMaker::InvenSense, 1));
        assert_eq!(roll(ImuMaker::Bosch, 2 | 3 << 3), roll(ImuMaker::Bosch, 2));
    }

    #[test]
    fn quantities_that_are_off_are_not_sent() {
        let rate = |kinds: u16, bytes: &[u8]| {
            sample(ImuMaker::Bosch, true, kinds << 5 | 2, bytes).map(|sample| sample.roll_rad_s)
        };
        let whole = rate(7, &HALF);
        assert!(whole.is_some_and(|rate| rate > 4.0));
        assert_eq!(rate(2, &HALF[8..]), whole);
        assert_eq!(rate(6, &HALF[2..]), whole);
        assert_eq!(rate(5, &HALF[6..]), None);
        // Bytes were lost, or there are too many.
        assert_eq!(rate(7, &HALF[1..]), None);
        assert_eq!(rate(7, &[&HALF[..], &[0]].concat()), None);
    }

    #[test]
    fn a_sample_that_the_clock_was_set_to_zero_in_is_of_no_time() {
        let mut common = Common::new(ImuMaker::Bosch, false);
        let words =
            [0x0005, 0x5300 | 2 << 5, 0x0001, 0x5000, 0x5000, 0x5000, 0x5000, 0x5000, 0x5000];
        for word in words.into_iter().chain([0x0007]) {
            assert_eq!(common.other(word), None);
        }
    }

    #[test]
    fn special_words_that_there_are_not_are_counted() {
        let mut common = Common::new(ImuMaker::Bosch, false);
        for word in [0x0000, 0x0012, 0x0fff, 0x6001] {
            assert_eq!(common.other(word), None);
        }
        assert_eq!(common.unknown(), 4);
        for word in [0x0001, 0x0004, 0x0010, 0x7001] {
            assert_eq!(common.other(word), None);
        }
        assert_eq!((common.unknown(), common.clock.t_us()), (4, 0x8000));
    }
}
