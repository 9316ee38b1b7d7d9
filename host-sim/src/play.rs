//! A recording played through the device's tachometer and instrument.

use evtach_core::{Event, Settings, Tachometer};
use evtach_firmware::instrument::{Instrument, Picture, Sensor, Traffic};

use crate::measure::{Capacity, Parts, Since, drain, feed, with_tachometer};
use crate::recording::{Recording, RecordingError};

/// How often the instrument is told the time.
const TICK_US: u64 = 10_000;
/// How often it is given a picture: as the device does, four times a second.
const PICTURE_US: u64 = 250_000;

/// What was played of a recording.
#[derive(Debug)]
pub struct Played {
    /// From the first event to the last that was played.
    pub duration_us: u64,
    /// Whether it was played to its end, or to the damage that it ends with.
    pub is_whole: bool,
    /// The damage that the recording ends with.
    pub damage: Option<RecordingError>,
}

/// Plays a recording with the device's memory until its end, or until `until_us` microseconds after its first event.
///
/// # Errors
///
/// When the recording is damaged before its first event; after that, what came before it is played.
pub fn play(
    recording: &mut Recording,
    instrument: &mut Instrument,
    until_us: Option<u64>,
) -> Result<Played, RecordingError> {
    let mut settings = Settings::new(recording.geometry);
    settings.blades = instrument.preferences().blades;
    instrument.set_sensor(Sensor::Present);
    with_tachometer(settings, Capacity::Device, |tachometer| {
        let mut player =
            Player { tachometer, instrument, traffic: Traffic::default(), picture_us: None };
        let (mut part, mut since, mut beyond) = (Vec::new(), Since::default(), 0);
        let mut played = Played { duration_us: 0, is_whole: true, damage: None };
        let mut parts = Parts::of(recording, Capacity::Device);
        while !parts.is_done() && beyond < Since::MOST_WRONG {
            let set_back_us = parts.next(&mut part);
            part.retain(|event| {
                let since_us = since.of(event);
                let is_wanted = until_us.is_none_or(|until_us| since_us <= until_us);
                if is_wanted {
                    played.duration_us = played.duration_us.max(since_us);
                }
                beyond = if is_wanted { 0 } else { beyond + 1 };
                played.is_whole &= is_wanted;
                is_wanted
            });
            player.lost(parts.newly_lost());
            player.events(&part);
            if let Some(t_us) = set_back_us {
                if parts.timeline.starts_anew() {
                    since.start_anew();
                }
                if parts.set_back_to(t_us) {
                    player.tachometer.configure(settings);
                }
            }
        }
        match parts.damage {
            Some(damage) if player.traffic.events == 0 => return Err(damage),
            damage => played.damage = damage,
        }
        player.take_picture();
        if until_us.is_none() {
            player.finish();
        }
        Ok(played)
    })
}

/// The device's tasks, one after the other.
struct Player<'p, 'm> {
    tachometer: &'p mut Tachometer<'m>,
    instrument: &'p mut Instrument,
    traffic: Traffic,
    /// When the last picture was taken.
    picture_us: Option<u64>,
}

impl Player<'_, '_> {
    fn lost(&mut self, lost: u64) {
        self.tachometer.lost(lost);
        self.traffic.lost += lost;
    }

    fn events(&mut self, events: &[Event]) {
        for piece in events.chunk_by(|a, b| a.t_us / TICK_US == b.t_us / TICK_US) {
            let Some(last) = piece.last() else { continue };
            let instrument = &mut *self.instrument;
            feed(self.tachometer, piece, &mut &[][..], |reading| instrument.observe(&reading));
            self.traffic.events += piece.len() as u64;
            self.instrument.tick(last.t_us, self.traffic);
            if self.picture_us.is_none_or(|picture_us| last.t_us.abs_diff(picture_us) >= PICTURE_US)
            {
                self.picture_us = Some(last.t_us);
                self.take_picture();
            }
        }
    }

    fn take_picture(&mut self) {
        let mut picture = Picture::EMPTY;
        picture.take(self.tachometer.heat());
        self.instrument.show_picture(&picture);
    }

    /// Measures what is in the window, as the device does when a recording ends.
    fn finish(&mut self) {
        self.tachometer.finish();
        let instrument = &mut *self.instrument;
        drain(self.tachometer, |reading| instrument.observe(&reading));
    }
}
