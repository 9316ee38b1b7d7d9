//! iniVation DAVIS (DAVIS346 and kin): 16-bit USB words.

use super::inivation::{CLOCK_RESET, Clock};
use super::{Packed, polarity};
use crate::event::{Event, GyroSample, PackedEvent};

/// Bytes of an inertial sample: acceleration, temperature, rate, each big-endian.
const IMU_BYTES: u8 = 14;
/// Where the rate about the optical axis stands in it.
const GYRO_Z_AT: u8 = 12;
/// 250 degrees per second over 2^15 steps, in rad/s: the finest range of the gyroscope.
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

/// Decoder of DAVIS USB words (facts: libcaer, "davis_common").
#[derive(Clone, Debug)]
pub struct Davis {
    mounting: Mounting,
    clock: Clock,
    /// The address a row word set, until the next one.
    row: u16,
    imu: Imu,
    unknown: u64,
}

/// An inertial sample on its way, byte by byte.
#[derive(Clone, Debug)]
struct Imu {
    t_us: u64,
    /// Next byte; `IMU_BYTES` and beyond when none is expected.
    at: u8,
    /// Which quantities come: bit 2 acceleration, bit 1 rate, bit 0 temperature.
    kinds: u8,
    high: u8,
    gyro_z: i16,
    /// Range of the gyroscope: 250 deg/s times two to this power.
    gyro_range: u8,
}

impl Davis {
    /// A decoder at the start of a stream.
    #[must_use]
    pub const fn new(mounting: Mounting) -> Self {
        let imu = Imu { t_us: 0, at: IMU_BYTES, kinds: 0b111, high: 0, gyro_z: 0, gyro_range: 0 };
        Self { mounting, clock: Clock::new(), row: 0, imu, unknown: 0 }
    }

    /// Takes in one word; hands out the event in it, and returns the gyro sample that it completes.
    #[inline]
    pub fn decode(&mut self, word: u16, mut emit: impl FnMut(Event)) -> Option<GyroSample> {
        if word & 0x8000 != 0 {
            self.clock.low(word);
            return None;
        }
        let data = word & 0x0fff;
        match word >> 12 {
            1 => self.row = data,
            code @ (2 | 3) => {
                let (x, y) =
                    if self.mounting.swap_xy { (self.row, data) } else { (data, self.row) };
                emit(Event { t_us: self.clock.t_us(), x, y, polarity: polarity(code == 3) });
            }
            0 => return self.special(data),
            5 => self.imu_byte((data >> 8) as u8, data as u8),
            7 => self.clock.wrap(data),
            // Frame samples and exposure.
            4 | 6 => {}
            _ => self.unknown += 1,
        }
        None
    }

    /// Decodes words into `events`, until either is used up, or a gyro sample is complete, or
    /// the clock is set to zero. Times are `offset_us` later than
    /// the camera's, and never earlier than `reached_us`, which they move on.
    // Not inlined: what calls it is built for size.
    #[inline(never)]
    pub fn pack(
        &mut self,
        words: &[[u8; 2]],
        offset_us: u64,
        reached_us: &mut u64,
        events: &mut [PackedEvent],
    ) -> Packed {
        let room = events.len();
        let mut places = events.iter_mut();
        let mut t_us = *reached_us;
        // Where in a packed event what row and event words tell stands.
        let (row_at, at) = if self.mounting.swap_xy {
            (PackedEvent::COLUMN_AT, 0)
        } else {
            (0, PackedEvent::COLUMN_AT)
        };
        let mut row = PackedEvent::side(self.row, row_at);
        for (index, word) in words.iter().enumerate() {
            let word = u16::from_le_bytes(*word);
            let data = word & 0x0fff;
            match word >> 12 {
                8.. => {
                    self.clock.low(word);
                    t_us = t_us.max(offset_us.wrapping_add(self.clock.t_us()));
                }
                1 => {
                    self.row = data;
                    row = PackedEvent::side(data, row_at);
                }
                2 | 3 => {
                    let Some(place) = places.next() else {
                        *reached_us = t_us;
                        return Packed { words: index, events: room, sample: None, reset: false };
                    };
                    let brighter = u32::from(word >> 12 & 1) << PackedEvent::BRIGHTER_AT;
                    let word = brighter | PackedEvent::side(data, at) | row;
                    *place = PackedEvent::of_word(t_us as u32, word);
                }
                _ if word == CLOCK_RESET => {
                    let reset = index == 0;
                    if reset {
                        self.clock.reset();
                    }
                    *reached_us = t_us;
                    let events = room - places.len();
                    return Packed { words: index.max(1), events, sample: None, reset };
                }
                _ => {
                    let sample = self.decode(word, |_| {});
                    t_us = t_us.max(offset_us.wrapping_add(self.clock.t_us()));
                    if let Some(sample) = sample {
                        *reached_us = t_us;
                        let words = index + 1;
                        let t_us = offset_us.wrapping_add(sample.t_us);
                        let sample = Some(GyroSample { t_us, ..sample });
                        let events = room - places.len();
                        return Packed { words, events, sample, reset: false };
                    }
                }
            }
        }
        *reached_us = t_us;
        Packed { words: words.len(), events: room - places.len(), sample: None, reset: false }
    }

    fn special(&mut self, data: u16) -> Option<GyroSample> {
        match data {
            1 => self.clock.reset(),
            5 => {
                self.imu.t_us = self.clock.t_us();
                self.imu.at = 0;
            }
            7 => {
                let complete = self.imu.at == IMU_BYTES && self.imu.kinds & 2 != 0;
                self.imu.at = u8::MAX;
                return complete.then(|| self.imu.sample(self.mounting.flip_gyro_z));
            }
            _ => {}
        }
        None
    }

    fn imu_byte(&mut self, kind: u8, byte: u8) {
        match kind {
            0 => self.imu.byte(byte),
            3 => self.imu.format(byte),
            // Regions of the frame.
            _ => {}
        }
    }

    /// Times the wire's 15-bit clock wrapped (every 32.768 ms).
    #[must_use]
    pub const fn wraps(&self) -> u32 {
        self.clock.wraps()
    }

    /// Times the camera set its clock to zero: time starts anew there.
    #[must_use]
    pub const fn resets(&self) -> u32 {
        self.clock.resets()
    }

    /// Words of a kind the camera does not send: many of them mean lost bytes.
    #[must_use]
    pub const fn unknown(&self) -> u64 {
        self.unknown
    }
}

impl Imu {
    fn format(&mut self, byte: u8) {
        self.gyro_range = byte & 3;
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

    fn sample(&self, flip: bool) -> GyroSample {
        let steps = if flip { -f32::from(self.gyro_z) } else { f32::from(self.gyro_z) };
        let range = f32::from(1_u8 << self.gyro_range);
        // The axis points out of the lens: a positive rate turns the camera clockwise and the picture back.
        GyroSample { t_us: self.t_us, roll_rad_s: -steps * range * RAD_S_PER_STEP }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Polarity;

    extern crate std;
    use std::vec::Vec;

    fn decode(mounting: Mounting, words: &[u16]) -> (Vec<Event>, Vec<GyroSample>) {
        let mut decoder = Davis::new(mounting);
        let mut events = Vec::new();
        let mut samples = Vec::new();
        for &word in words {
            samples.extend(decoder.decode(word, |event| events.push(event)));
        }
        (events, samples)
    }

    #[test]
    fn row_then_columns() {
        let words = [0x8005, 0x1007, 0x3009, 0x2008];
        let on = Event { t_us: 5, x: 9, y: 7, polarity: Polarity::On };
        let off = Event { t_us: 5, x: 8, y: 7, polarity: Polarity::Off };
        assert_eq!(decode(Mounting::default(), &words).0, [on, off]);
        let swapped = Mounting { swap_xy: true, ..Mounting::default() };
        assert_eq!(decode(swapped, &words).0[0], Event { x: 7, y: 9, ..on });
    }

    #[test]
    fn wrap_words_carry_their_number() {
        let words = [0xffff, 0x3001, 0x7003, 0x8002, 0x3001, 0x0001, 0x8004, 0x3001];
        let times: Vec<u64> =
            decode(Mounting::default(), &words).0.iter().map(|event| event.t_us).collect();
        assert_eq!(times, [0x7fff, 3 * 0x8000 + 2, 4]);
    }

    fn imu(kinds: u16, range: u16, bytes: &[u8]) -> Vec<u16> {
        let mut words = std::vec![0x8064, 0x0005, 0x5300 | kinds << 5 | range];
        words.extend(bytes.iter().map(|&byte| 0x5000 | u16::from(byte)));
        words.push(0x0007);
        words
    }

    #[test]
    fn gyro_about_the_optical_axis() {
        // 0x4000 is half of the 500 deg/s range.
        let mut bytes = [0; 14];
        bytes[12] = 0x40;
        let (_, samples) = decode(Mounting::default(), &imu(7, 1, &bytes));
        assert_eq!(samples.len(), 1);
        assert_eq!(samples[0].t_us, 100);
        assert!((samples[0].roll_rad_s + 250_f32.to_radians()).abs() < 1e-4);
        let flipped = Mounting { flip_gyro_z: true, ..Mounting::default() };
        let (_, samples) = decode(flipped, &imu(7, 1, &bytes));
        assert!((samples[0].roll_rad_s - 250_f32.to_radians()).abs() < 1e-4);
    }

    #[test]
    fn quantities_that_are_off_are_not_sent() {
        assert_eq!(decode(Mounting::default(), &imu(2, 0, &[0, 0, 0, 0, 0x7f, 0xff])).1.len(), 1);
        assert_eq!(decode(Mounting::default(), &imu(6, 0, &[0; 12])).1.len(), 1);
        assert_eq!(decode(Mounting::default(), &imu(5, 0, &[0; 8])).1.len(), 0);
        // Bytes were lost, or there are too many.
        assert_eq!(decode(Mounting::default(), &imu(7, 0, &[0; 13])).1.len(), 0);
        assert_eq!(decode(Mounting::default(), &imu(7, 0, &[0; 15])).1.len(), 0);
    }
}
