//! One recording, read and measured from its first event to its last.

use std::ops::Range;

use evtach_core::{CLOCK_RESET_US, Event, GyroSample, Ignored, Reading, Settings};

use super::letters::Letters;
use super::pause::Pauses;
use super::piece::window_us;
use super::wait::Wait;
use super::{Capacity, FileFacts, Parts, Since, Timeline, drain, feed, with_tachometer};
use crate::recording::{ImuSample, Recording, RecordingError};

/// How a recording is to be measured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is known better than the tachometer finds it.
    pub settings: Settings,
    /// The memory it is lent.
    pub capacity: Capacity,
    /// Whether the recording's gyro is to be taken.
    pub takes_gyro: bool,
    /// The part that is measured, in microseconds from the first event.
    pub since_us: Range<u64>,
}

/// What came of it.
#[derive(Debug)]
pub struct Run {
    /// The file, and the part of it that was measured.
    pub facts: FileFacts,
    /// The series of readings, parts of a clock that is set back laid end to end.
    pub readings: Vec<Reading>,
    /// Events of the whole file.
    pub events_read: u64,
    /// Events that the tachometer did not use, by cause; `facts.lost` counts those out of order, too.
    pub ignored: Ignored,
    /// Whether there were gyro samples that were to be taken.
    pub has_gyro: bool,
    /// Where the clock was set back.
    pub timeline: Timeline,
    /// The damage that the file ends with; what came before it is measured.
    pub damage: Option<RecordingError>,
    /// Whether the last event lies behind the part that was to be measured.
    pub is_past_end: bool,
}

impl Run {
    /// Measures a recording, named `file`. `seen` is handed the events of the part that is measured as they are read, by the camera's
    /// clock, which the timeline lays end to end.
    pub fn over(
        file: String,
        recording: &mut Recording,
        plan: &Plan,
        seen: impl FnMut(&[Event], &Timeline),
    ) -> Self {
        let mut facts = FileFacts {
            file,
            format: recording.format.to_owned(),
            size_px: (recording.geometry.width_px, recording.geometry.height_px),
            ..FileFacts::default()
        };
        let mut readings = Vec::new();
        let (mut has_gyro, mut is_past_end) = (false, false);
        let mut parts = Parts::of(recording, plan.capacity);
        let ignored = with_tachometer(plan.settings, plan.capacity, |tachometer| {
            let since_us = plan.since_us.clone();
            let mut chosen = Chosen {
                since_us,
                since: Since::default(),
                origin_us: None,
                is_inside: plan.since_us.start == 0,
                starts_anew: true,
                is_past_end: false,
                facts: &mut facts,
                seen,
            };
            let mut part = Vec::new();
            let mut letters = Letters::default();
            let (mut rolls, mut wait) = (Vec::<GyroSample>::new(), Wait::default());
            let mut rolled_us = 0;
            let mut pauses = Pauses::within(plan.settings.roi);
            while !parts.is_done() {
                let set_back_us = parts.next(&mut part);
                chosen.leave(&mut part, &parts.timeline);
                let lost = parts.newly_lost();
                if chosen.is_inside {
                    tachometer.lost(lost);
                    chosen.facts.lost += lost;
                }
                let samples = parts.recording.take_imu();
                if plan.takes_gyro {
                    has_gyro |= !samples.is_empty();
                    rolls.extend(samples.iter().map(ImuSample::roll));
                    rolls.retain(|sample| parts.timeline.is_of_part(sample.t_us));
                    wait.hold(&mut part, &rolls, parts.more && set_back_us.is_none());
                }
                // A recorder that writes samples before the events of their time has told some of the next part.
                let of_part = Timeline::samples_of_part(rolled_us, &rolls);
                let mut ahead = &rolls[..of_part];
                // The device forgets a window that is not full when its clock leaves it behind. What is out of order throughout will be
                // refused.
                let keeps_last = plan.capacity == Capacity::Full && !parts.recording.is_shuffled();
                let mut keep = |reading| {
                    readings.push(letters.lettered(parts.timeline.laid(reading)));
                };
                let mut rest = &part[..];
                while !rest.is_empty() {
                    let (stretch, later) = rest.split_at(pauses.before(rest));
                    feed(tachometer, stretch, &mut ahead, &mut keep);
                    if keeps_last && !later.is_empty() {
                        tachometer.finish();
                        drain(tachometer, &mut keep);
                    }
                    rest = later;
                }
                let used = of_part - ahead.len();
                rolled_us = rolls.drain(..used).next_back().map_or(rolled_us, |sample| sample.t_us);
                if keeps_last && set_back_us.is_some() || parts.is_done() {
                    tachometer.finish();
                    drain(tachometer, &mut keep);
                }
                if let Some(t_us) = set_back_us {
                    if parts.timeline.starts_anew() {
                        letters.start_anew();
                        chosen.since.start_anew();
                        chosen.starts_anew = true;
                    }
                    if parts.set_back_to(t_us) {
                        tachometer.configure(plan.settings);
                    }
                    // A window that reaches as far ahead holds wrong times: it was at none that could be told.
                    let ahead_us = parts.timeline.at(t_us).saturating_add(CLOCK_RESET_US);
                    let told =
                        readings.iter().rposition(|reading| window_us(reading).end < ahead_us);
                    readings.truncate(told.map_or(0, |last| last + 1));
                    (wait, rolled_us) = (Wait::default(), 0);
                    pauses = Pauses::within(plan.settings.roi);
                }
            }
            chosen.facts.thinned = tachometer.thinned();
            is_past_end = chosen.is_past_end;
            tachometer.ignored()
        });
        let Parts { timeline, events_read, damage, .. } = parts;
        facts.lost += ignored.out_of_order;
        Self { facts, readings, events_read, ignored, has_gyro, timeline, damage, is_past_end }
    }
}

/// The part of a recording that is to be measured.
struct Chosen<'a, S> {
    since_us: Range<u64>,
    /// Not the timeline: it takes fewer times that are far ahead for wrong ones.
    since: Since,
    /// The first event of all.
    origin_us: Option<u64>,
    /// Whether the last event so far was of the part: what is lost then is lost of it.
    is_inside: bool,
    /// Whether no event of the recording at hand was of the part.
    starts_anew: bool,
    /// Whether the last event so far lies behind the part.
    is_past_end: bool,
    facts: &'a mut FileFacts,
    seen: S,
}

impl<S: FnMut(&[Event], &Timeline)> Chosen<'_, S> {
    /// Leaves of the next events those of the part, and counts them.
    fn leave(&mut self, events: &mut Vec<Event>, timeline: &Timeline) {
        let Some(first) = events.first() else { return };
        self.facts.origin_us = *self.origin_us.get_or_insert(first.t_us);
        if self.since_us != (0..u64::MAX) {
            events.retain(|event| {
                let since_us = self.since.of(event);
                self.is_inside = self.since_us.contains(&since_us);
                self.is_past_end = since_us >= self.since_us.end;
                self.is_inside
            });
        }
        let (Some(first), Some(last)) = (events.first(), events.last()) else { return };
        if self.facts.events == 0 {
            self.facts.first_us = timeline.at(first.t_us);
        }
        self.facts.last_us = timeline.at(last.t_us);
        if std::mem::take(&mut self.starts_anew) {
            let first_us = timeline.at(first.t_us);
            self.facts.streams_us.push(first_us..first_us);
        }
        if let Some(stream_us) = self.facts.streams_us.last_mut() {
            stream_us.end = self.facts.last_us;
        }
        self.facts.events += events.len() as u64;
        (self.seen)(events, timeline);
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::{Geometry, Polarity};

    use super::*;
    use crate::recording::write::{WriteFormat, create};
    use crate::recording::{OpenOptions, open};

    #[test]
    fn what_is_lost_outside_of_a_part_is_not_lost_of_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("damaged.spi");
        let geometry = Geometry::new(64, 48).expect("a sensor in range");
        let event = |t_us| Event { t_us, x: 5, y: 7, polarity: Polarity::On };
        let mut writer = create(&path, WriteFormat::Spi, geometry).expect("a file");
        writer.write(&(0..150_000).map(event).collect::<Vec<_>>()).expect("events that fit");
        writer.finish().expect("room on the disk");
        // No frame of the middle third is whole.
        let mut bytes = std::fs::read(&path).expect("what was written");
        let third = bytes.len() / 3;
        bytes[third..2 * third].iter_mut().step_by(100).for_each(|byte| *byte ^= 0x55);
        std::fs::write(&path, bytes).expect("room on the disk");

        // As the file's facts and its readings tell it.
        let lost = |since_us| {
            let mut recording = open(&path, &OpenOptions::default()).expect("a recording");
            let settings = Settings::new(geometry);
            let plan = Plan { settings, capacity: Capacity::Device, takes_gyro: false, since_us };
            let run = Run::over(String::new(), &mut recording, &plan, |_, _| ());
            assert!(run.facts.events > 0 && !run.readings.is_empty());
            (run.facts.lost, run.readings.iter().map(|reading| reading.lost).sum())
        };
        let (whole, told): (u64, u64) = lost(0..u64::MAX);
        assert!(whole > 45_000 && told > 45_000, "{whole}, {told}");
        assert_eq!(lost(0..20_000), (0, 0));
        assert_eq!(lost(130_000..u64::MAX), (0, 0));
    }
}
