//! What screen and link share: the instrument, and what it does not hold.

use embassy_time::Instant;
use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::DrawTarget;
use evtach_core::{Geometry, Roi};
use heapless::String;

use super::shared::{Shared, Wanted};
use crate::instrument::{Action, Fault, Instrument, Preferences, Sensor, Traffic};
use crate::kept::{KeptFault, TEXT_BYTES};
use crate::scpi::{RecorderFailed, RecorderStatus, View};
use crate::ui::Screen;

/// What the recorder's memory belongs to: the board says how it is shared with the task that fills it.
pub trait Recording {
    /// What the recorder does.
    fn status(&self) -> RecorderStatus;

    /// Records the next events, up to so many.
    fn start(&mut self, geometry: Geometry, events: u32);

    /// Ends the recording.
    fn stop(&mut self);

    /// Copies the recording from a byte on.
    ///
    /// # Errors
    ///
    /// When the memory fails.
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RecorderFailed>;
}

/// What is drawn on, and may be read back.
pub trait Panel: DrawTarget<Color = Rgb565> {
    /// The pixels, row by row, two bytes each, little-endian.
    fn bytes(&self) -> &[u8];

    /// A drawing is complete: a panel that is drawn on unseen shows it now.
    fn present(&mut self) {}
}

/// The front of the device: what a person sees and asks, on the screen and over the link.
pub struct Front<R, P> {
    pub(super) shared: &'static Shared,
    pub(super) instrument: Instrument,
    pub(super) recording: R,
    pub(super) panel: P,
    pub(super) serial: &'static str,
    pub(super) view: View,
    /// The words of a fault that has not been acknowledged.
    words: Option<String<TEXT_BYTES>>,
    /// What the measurement was last told to look at.
    told: Wanted,
    /// Sensor time reached, and when it was.
    reached: (u64, Instant),
}

impl<R: Recording, P: Panel> Front<R, P> {
    /// The front with what was kept: the preferences, and a fault before the last start.
    pub fn new(
        shared: &'static Shared,
        preferences: Preferences,
        fault: Option<KeptFault>,
        recording: R,
        panel: P,
        serial: &'static str,
    ) -> Self {
        let mut front = Self {
            shared,
            instrument: Instrument::new(preferences),
            recording,
            panel,
            serial,
            view: View::default(),
            words: None,
            told: Wanted::default(),
            reached: (0, Instant::now()),
        };
        if let Some(KeptFault { fault, text }) = fault {
            front.instrument.fail(fault);
            front.words = Some(text);
        }
        front
    }

    /// What a person sees.
    pub const fn instrument(&self) -> &Instrument {
        &self.instrument
    }

    /// Does what a person asks by touch or button.
    pub fn act(&mut self, action: Action) {
        self.instrument.act(action);
        self.shared.touched.try_send(()).ok();
    }

    /// Shows a fault.
    pub fn fail(&mut self, kept: KeptFault) {
        self.instrument.fail(kept.fault);
        self.words = Some(kept.text);
    }

    /// Draws what has changed.
    pub fn draw(&mut self, screen: &mut Screen) {
        self.look(screen);
        while self.draw_next(screen) {}
    }

    /// Looks at what is to be drawn, for [`draw_next`](Self::draw_next).
    pub(super) fn look(&mut self, screen: &mut Screen) {
        // No picture more often than it is drawn: taking one costs measuring a quarter of a million instructions.
        if let Ok(picture) = self.shared.taken.try_receive() {
            self.instrument.show_picture(picture);
            self.shared.blank.try_send(picture).ok();
        }
        screen.look(&self.instrument);
    }

    /// Draws one part of what has changed; shows it all and says so when there is none left.
    pub(super) fn draw_next(&mut self, screen: &mut Screen) -> bool {
        // A panel that fails is drawn whole the next time.
        let more = screen.draw_next(&mut self.panel, &self.instrument).unwrap_or(false);
        if !more {
            self.panel.present();
        }
        more
    }

    /// Takes in what has come from the other tasks.
    pub fn refresh(&mut self) {
        let standing = self.shared.standing();
        let sensor = if standing.geometry.is_some() { Sensor::Present } else { Sensor::Absent };
        self.instrument.set_sensor(sensor);
        self.instrument.set_trouble(standing.trouble);
        let now = Instant::now();
        if standing.latest_us != self.reached.0 {
            self.reached = (standing.latest_us, now);
        }
        let since = now.saturating_duration_since(self.reached.1);
        self.instrument.tick(
            self.reached.0.saturating_add(since.as_micros()),
            Traffic { events: standing.received, lost: standing.lost() },
        );
        while let Ok(reading) = self.shared.readings.try_receive() {
            self.instrument.take_in(reading);
        }
        // What was asked of another camera.
        let has = |roi: &Roi, geometry: Geometry| {
            roi.x + roi.width_px <= geometry.width_px && roi.y + roi.height_px <= geometry.height_px
        };
        self.view.roi = self.view.roi.filter(|roi| standing.geometry.is_none_or(|g| has(roi, g)));
        let View { roi, window_us } = self.view;
        let wanted = Wanted { blades: self.instrument.preferences().blades, roi, window_us };
        if wanted != self.told {
            self.told = wanted;
            self.shared.want(wanted);
        }
    }

    /// The fault that is shown, in its own words.
    pub(super) fn fault_words(&self) -> Option<(Fault, &str)> {
        let words = self.words.as_deref().unwrap_or_default();
        self.instrument.fault().map(|fault| (fault, words))
    }
}
