//! Events as the USB words of iniVation's cameras: the other direction of `evtach_core::decode`.

use std::vec::Vec;

use evtach_core::{Event, GyroSample, Polarity};

/// Span of the words' clock in microseconds; beyond it the camera sends a wrap word.
const SPAN_US: u64 = 1 << 15;
/// Most wraps that one word tells.
const MOST_WRAPS: u64 = 0xfff;
/// Most groups between the two of one word.
const MOST_GROUPS_APART: u16 = 0x1f;

/// Special words.
const TIMESTAMP_RESET: u16 = 1;
const IMU_START: u16 = 5;
const IMU_END: u16 = 7;
/// What follows, of which only the rate; the number of its range comes in the lowest bits.
const IMU_RATE: u16 = 0x5300 | 2 << 5;

/// Range of a camera's gyro, as its register for that says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GyroRange {
    /// Its number.
    pub number: u16,
    /// Degrees per second over 2^15 steps.
    pub degrees_s: u16,
}

impl GyroRange {
    /// Of a DAVIS346 (InvenSense), by the two bits of the register.
    #[must_use]
    pub const fn davis346(register: u32) -> Self {
        let number = register as u16 & 3;
        Self { number, degrees_s: 250 << number }
    }

    /// Of a DVXplorer (Bosch), by the three bits of the register.
    #[must_use]
    pub const fn dvxplorer(register: u32) -> Self {
        let number = register as u16 & 7;
        Self { number, degrees_s: 2000 >> number }
    }
}

/// Adds the words of a gyro sample, to the nearest step of the range.
fn gyro(clock: &mut Clock, sample: &GyroSample, range: GyroRange, out: &mut Vec<u16>) {
    clock.at(sample.t_us, out);
    // The decoder turns the sign: what turns the camera clockwise turns the picture back.
    let z = (-sample.roll_rad_s.to_degrees() * 32768.0 / f32::from(range.degrees_s)).round() as i16;
    out.extend([IMU_START, IMU_RATE | range.number]);
    let [high, low] = z.to_be_bytes();
    out.extend([0, 0, 0, 0, high, low].map(|byte| 0x5000 | u16::from(byte)));
    out.push(IMU_END);
}

/// The 15-bit clock of the words.
#[derive(Clone, Debug, Default)]
struct Clock {
    base_us: u64,
    /// Low 15 bits that were sent last.
    sent: Option<u16>,
}

impl Clock {
    /// Sends what must stand before a word of this time. Time before the last wrap cannot be told: it is sent as that.
    fn at(&mut self, t_us: u64, out: &mut Vec<u16>) {
        let mut wraps = t_us.saturating_sub(self.base_us) / SPAN_US;
        while wraps > 0 {
            let told = wraps.min(MOST_WRAPS);
            out.push(0x7000 | told as u16);
            self.base_us += told * SPAN_US;
            self.sent = None;
            wraps -= told;
        }
        let low = t_us.saturating_sub(self.base_us) as u16;
        if self.sent != Some(low) {
            out.push(0x8000 | low);
            self.sent = Some(low);
        }
    }

    fn reset(&mut self, out: &mut Vec<u16>) {
        *self = Self::default();
        out.push(TIMESTAMP_RESET);
    }
}

/// Words of a DAVIS346.
#[derive(Clone, Debug, Default)]
pub struct DavisWords {
    clock: Clock,
    row: Option<u16>,
    /// Whether columns are sent as rows, as bit 2 of the orientation register says.
    pub swap_xy: bool,
}

impl DavisWords {
    /// Words from the start of a stream, of a camera whose columns are sent as rows, or are not.
    #[must_use]
    pub fn new(swap_xy: bool) -> Self {
        Self { swap_xy, ..Self::default() }
    }

    /// Adds the words of an event. Events come in the order of their times.
    pub fn event(&mut self, event: &Event, out: &mut Vec<u16>) {
        let (row, column) = if self.swap_xy { (event.x, event.y) } else { (event.y, event.x) };
        self.clock.at(event.t_us, out);
        if self.row != Some(row) {
            out.push(0x1000 | row & 0xfff);
            self.row = Some(row);
        }
        let code = if event.polarity == Polarity::On { 0x3000 } else { 0x2000 };
        out.push(code | column & 0xfff);
    }

    /// Adds the words of a gyro sample, to the nearest step of the range.
    pub fn gyro(&mut self, sample: &GyroSample, range: GyroRange, out: &mut Vec<u16>) {
        gyro(&mut self.clock, sample, range, out);
    }

    /// The clock is set to zero.
    pub fn reset(&mut self, out: &mut Vec<u16>) {
        self.clock.reset(out);
    }
}

/// Words of a DVXplorer: eight pixels of a column at a time, where events follow each other so.
#[derive(Clone, Debug, Default)]
pub struct DvxplorerWords {
    clock: Clock,
    column: Option<u16>,
    /// The two groups of eight rows that masks can be for.
    groups: Option<[u16; 2]>,
    pending: Option<Pixels>,
}

/// Pixels of one group that changed at once.
#[derive(Clone, Copy, Debug)]
struct Pixels {
    t_us: u64,
    x: u16,
    group: u16,
    polarity: Polarity,
    mask: u16,
}

impl Pixels {
    /// Whether the event's pixel can join: the mask is read from its lowest bit.
    fn joins(&self, event: &Event) -> bool {
        (self.t_us, self.x, self.group, self.polarity)
            == (event.t_us, event.x, event.y / 8, event.polarity)
            && self.mask < 1 << (event.y % 8)
    }
}

impl DvxplorerWords {
    /// Adds the words of an event, or keeps it until [`flush`](Self::flush) because the next may share them.
    pub fn event(&mut self, event: &Event, out: &mut Vec<u16>) {
        let bit = 1 << (event.y % 8);
        match &mut self.pending {
            Some(pixels) if pixels.joins(event) => pixels.mask |= bit,
            _ => {
                self.flush(out);
                let &Event { t_us, x, y, polarity } = event;
                self.pending = Some(Pixels { t_us, x, group: y / 8, polarity, mask: bit });
            }
        }
    }

    /// Adds what was kept.
    pub fn flush(&mut self, out: &mut Vec<u16>) {
        let Some(pixels) = self.pending.take() else { return };
        self.clock.at(pixels.t_us, out);
        if self.column != Some(pixels.x) {
            out.push(0x1000 | pixels.x & 0x3ff);
            self.column = Some(pixels.x);
        }
        let code = self.group(pixels.group, out);
        let darker = if pixels.polarity == Polarity::Off { 0x100 } else { 0 };
        out.push(code | darker | pixels.mask);
    }

    /// Adds what was kept, and the words of a gyro sample, to the nearest step of the range.
    pub fn gyro(&mut self, sample: &GyroSample, range: GyroRange, out: &mut Vec<u16>) {
        self.flush(out);
        gyro(&mut self.clock, sample, range, out);
    }

    /// The code of masks for a group, which becomes the first of the two unless it is one of them.
    fn group(&mut self, group: u16, out: &mut Vec<u16>) -> u16 {
        match self.groups {
            Some([first, _]) if first == group => return 0x3000,
            Some([_, second]) if second == group => return 0x2000,
            _ => {}
        }
        let before = self.groups.map_or(group, |[first, _]| first);
        let second = if before.abs_diff(group) <= MOST_GROUPS_APART { before } else { group };
        let above = if second < group { 0x800 } else { 0 };
        out.push(0x4000 | above | second.abs_diff(group) << 6 | group & 0x3f);
        self.groups = Some([group, second]);
        0x3000
    }

    /// The clock is set to zero.
    pub fn reset(&mut self, out: &mut Vec<u16>) {
        self.flush(out);
        self.clock.reset(out);
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::decode::{Davis, Dvxplorer, Mounting};
    use proptest::prelude::*;

    use std::vec::Vec;

    use super::*;

    fn events(width: u16, height: u16) -> impl Strategy<Value = Vec<Event>> {
        let event = (0..200_000_u64, 0..width, 0..height, any::<bool>(), 1..20_u16);
        proptest::collection::vec(event, 0..200).prop_map(move |steps| {
            let mut t_us = 0;
            let mut events = Vec::new();
            for (step_us, x, y, on, run) in steps {
                t_us += step_us * u64::from(step_us % 3 == 0);
                let polarity = if on { Polarity::On } else { Polarity::Off };
                events.extend((y..(y + run).min(height)).map(|y| Event { t_us, x, y, polarity }));
            }
            events
        })
    }

    proptest! {
        #[test]
        fn davis_words_give_the_events_again(events in events(346, 260), swap_xy: bool) {
            let mut words = Vec::new();
            let mut encoder = DavisWords::new(swap_xy);
            events.iter().for_each(|event| encoder.event(event, &mut words));
            let mut decoder = Davis::new(Mounting { swap_xy, flip_gyro_z: false });
            let mut decoded = Vec::new();
            for word in words {
                decoder.decode(word, |event| decoded.push(event));
            }
            prop_assert_eq!(decoder.unknown(), 0);
            prop_assert_eq!(decoded, events);
        }

        #[test]
        fn dvxplorer_words_give_the_events_again(events in events(640, 480)) {
            let mut words = Vec::new();
            let mut encoder = DvxplorerWords::default();
            events.iter().for_each(|event| encoder.event(event, &mut words));
            encoder.flush(&mut words);
            let mut decoder = Dvxplorer::new(Mounting::default());
            let mut decoded = Vec::new();
            for word in words {
                decoder.decode(word, |event| decoded.push(event));
            }
            prop_assert_eq!(decoder.unknown(), 0);
            prop_assert_eq!(decoded, events);
        }
    }

    #[test]
    fn gyro_samples_come_back_with_their_sign() {
        let sample = GyroSample { t_us: 70_000, roll_rad_s: -1.25 };
        let mut words = [Vec::new(), Vec::new()];
        for number in 0..4 {
            let [davis, dvxplorer] = &mut words;
            DavisWords::default().gyro(&sample, GyroRange::davis346(number), davis);
            DvxplorerWords::default().gyro(&sample, GyroRange::dvxplorer(number), dvxplorer);
        }
        let [davis, dvxplorer] = words;
        let mut decoder = Davis::new(Mounting::default());
        let mut samples: Vec<_> =
            davis.iter().filter_map(|&word| decoder.decode(word, |_| {})).collect();
        let mut decoder = Dvxplorer::new(Mounting::default());
        samples.extend(dvxplorer.iter().filter_map(|&word| decoder.decode(word, |_| {})));
        assert_eq!(samples.len(), 8);
        for found in samples {
            assert!((found.roll_rad_s - sample.roll_rad_s).abs() < 6e-4, "{found:?}");
        }
    }
}
