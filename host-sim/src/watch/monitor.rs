//! What has been told so far, without a terminal and without a clock.

use std::collections::VecDeque;
use std::time::Duration;

use crate::measure::{ReadingRow, RotorRow};

/// Readings kept for the trend.
const KEPT: usize = 600;
/// Without a reading for this long, the last one is no longer of the present.
const OLD: Duration = Duration::from_secs(2);

/// Without one for this long, nothing is known of the present.
const GONE: Duration = Duration::from_secs(4);

/// What a source tells.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// A reading.
    Reading(ReadingRow),
    /// Something about the source, for the person, as long as nothing else is told.
    Note(String),
    /// What is to be known of a recording once it is played: there is no room for it in the view.
    Remark(String),
    /// There is nothing more to come.
    End,
    /// There is nothing more to come, and why: something failed.
    Failure(String),
    /// No reading is right, those told neither, and why.
    Refusal(String),
}

/// What is shown.
#[derive(Clone, Debug)]
pub struct Monitor {
    name: String,
    readings: VecDeque<ReadingRow>,
    last: Duration,
    note: String,
    remarks: Vec<String>,
    ended: bool,
    failure: Option<String>,
    chosen: usize,
    seen_speed: bool,
}

impl Monitor {
    /// Nothing told yet by the source of this name.
    #[must_use]
    pub fn new(name: String) -> Self {
        Self {
            name,
            readings: VecDeque::new(),
            last: Duration::ZERO,
            note: "waiting for the first reading".to_owned(),
            remarks: Vec::new(),
            ended: false,
            failure: None,
            chosen: 0,
            seen_speed: false,
        }
    }

    /// Takes in what was told at a time since the start.
    pub fn take(&mut self, told: Told, now: Duration) {
        match told {
            Told::Reading(reading) => {
                if self.readings.back().is_some_and(|last| last.t_s > reading.t_s) {
                    // The sensor's clock began anew.
                    self.readings.clear();
                }
                if self.readings.len() == KEPT {
                    self.readings.pop_front();
                }
                self.seen_speed |= reading.rotors.iter().any(|rotor| rotor.rpm.is_some());
                self.readings.push_back(reading);
                self.last = now;
                self.note.clear();
            }
            Told::Note(note) => self.note = note,
            Told::Remark(remark) => self.remarks.push(remark),
            Told::End => {
                "the recording has ended".clone_into(&mut self.note);
                self.ended = true;
            }
            Told::Refusal(why) => {
                self.readings.clear();
                self.seen_speed = false;
                self.take(Told::Failure(why), now);
            }
            Told::Failure(failure) => {
                self.note.clone_from(&failure);
                self.failure = Some(failure);
                self.ended = true;
            }
        }
    }

    /// The next rotor for the big line and the trend.
    pub fn choose_next(&mut self) {
        let rotors = self.readings.back().map_or(0, |reading| reading.rotors.len());
        self.chosen = if rotors == 0 { 0 } else { (self.chosen + 1) % rotors };
    }

    /// Where the readings come from.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What there is to say about the source.
    #[must_use]
    pub fn note(&self) -> &str {
        &self.note
    }

    /// What is to be known of a recording, for when the view is left.
    #[must_use]
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// What failed, in full.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Whether any reading had a speed.
    #[must_use]
    pub const fn seen_speed(&self) -> bool {
        self.seen_speed
    }

    /// The last reading, and whether it is of the present: what a recording ended with stays.
    #[must_use]
    pub fn latest(&self, now: Duration) -> Option<(&ReadingRow, bool)> {
        let fresh = self.ended || now.saturating_sub(self.last) <= OLD;
        self.readings.back().map(|reading| (reading, fresh))
    }

    /// Whether the last reading is so old that its number gives way to dashes.
    #[must_use]
    pub fn is_gone(&self, now: Duration) -> bool {
        !self.ended && now.saturating_sub(self.last) > GONE
    }

    /// The rotor chosen, in the last reading.
    #[must_use]
    pub fn rotor(&self) -> Option<&RotorRow> {
        let rotors = &self.readings.back()?.rotors;
        rotors.get(self.chosen).or(rotors.first())
    }

    /// (time in seconds, rpm, sigma in rpm) of every kept reading that has a speed of the rotor chosen.
    #[must_use]
    pub fn trend(&self) -> Vec<(f64, f64, f64)> {
        let Some(id) = self.rotor().map(|rotor| &rotor.id) else { return Vec::new() };
        let of = |reading: &ReadingRow| {
            let rotor = reading.rotors.iter().find(|rotor| rotor.id == *id)?;
            Some((reading.t_s, rotor.rpm?, rotor.rpm_sigma?))
        };
        self.readings.iter().filter_map(of).collect()
    }
}
