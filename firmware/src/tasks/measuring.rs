//! What goes on around the measurement on the device.

use core::sync::atomic::Ordering;

use evtach_core::{Reading, Settings, Tachometer};

use super::shared::{Shared, Task, Wanted};
use crate::cost::Spent;
use crate::intake::Block;
use crate::measure::Companion;

/// Hands readings and pictures on, and takes what is to be looked at.
pub struct Measuring<R> {
    shared: &'static Shared,
    record: R,
}

impl<R: FnMut(&Block)> Measuring<R> {
    /// `record` gets every block, for the recorder.
    pub const fn new(shared: &'static Shared, record: R) -> Self {
        Self { shared, record }
    }
}

// None is inlined: their temporaries, a reading or two, are not to lie on the stack below the measurement.
impl<R: FnMut(&Block)> Companion for Measuring<R> {
    #[inline(never)]
    fn arrived(&mut self, block: &Block) {
        (self.record)(block);
    }

    #[inline(never)]
    fn measured(&mut self, reading: &Reading, _: Spent) {
        if self.shared.readings.try_send(reading.clone()).is_err() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[inline(never)]
    fn between(&mut self, tachometer: &mut Tachometer<'_>) {
        self.shared.alive(Task::Measure);
        self.shared.tell_late(tachometer.ignored().overrun);
        if let Some(Wanted { blades, roi, window_us }) = self.shared.take_wanted() {
            let settings = Settings { blades, roi, window_us, ..*tachometer.settings() };
            tachometer.configure(settings);
        }
        if let Ok(picture) = self.shared.blank.try_receive() {
            picture.take(tachometer.heat());
            self.shared.taken.try_send(picture).ok();
        }
    }
}
