//! The screen: a [`View`] drawn on any target of 480x272 pixels.
//!
//! Every region is a function of a part of the view, and is drawn again only when that part has changed. What is drawn
//! is the same whether it is drawn at once or region by region. Sizes and places are in pixels of the screen, y down.

mod aim;
#[cfg(test)]
mod fonts;
mod keys;
mod list;
mod number;
mod scene;
mod settings;
mod strip;
mod text;
mod theme;
mod trend;

use embedded_graphics::pixelcolor::Rgb565;
use embedded_graphics::prelude::*;

use crate::instrument::{Instrument, Page, View};

pub use keys::{Press, action_at, button};
pub use theme::SIZE;

/// What the screen shows, so that only what has changed is drawn.
#[derive(Debug, Default)]
pub struct Screen {
    shown: Option<View>,
}

impl Screen {
    /// A screen of which nothing is known: everything is drawn the first time.
    #[must_use]
    pub const fn new() -> Self {
        Self { shown: None }
    }

    /// Draws what has changed since the last time. Not inlined, so that there is one of it in the device.
    ///
    /// # Errors
    ///
    /// Whatever the target reports; then everything is drawn the next time.
    #[inline(never)]
    pub fn draw<D: DrawTarget<Color = Rgb565>>(
        &mut self,
        target: &mut D,
        instrument: &Instrument,
    ) -> Result<(), D::Error> {
        let view = instrument.view();
        let before = self.shown.take().filter(|before| before.page == view.page);
        if before.is_none() {
            target.clear(theme::BACK)?;
        }
        let dirty = |changed: fn(&View, &View) -> bool| {
            before.as_ref().is_none_or(|before| changed(before, &view))
        };
        match view.page {
            Page::Main => {
                if dirty(strip::changed) {
                    strip::draw(target, &view)?;
                }
                if dirty(number::changed) {
                    number::draw(target, &view)?;
                }
                if dirty(number::details_changed) {
                    number::draw_details(target, &view)?;
                }
                if dirty(scene::changed) {
                    scene::draw_thumbnail(target, instrument.picture(), &view)?;
                }
                if dirty(list::changed) {
                    list::draw(target, &view)?;
                }
                if dirty(trend::changed) {
                    trend::draw(target, instrument.trend(), &view)?;
                }
            }
            Page::Aim => {
                if dirty(scene::changed) {
                    scene::draw_large(target, instrument.picture(), &view)?;
                }
                if dirty(aim::changed) {
                    aim::draw(target, &view)?;
                }
            }
            Page::Settings => {
                if dirty(settings::changed) {
                    settings::draw(target, &view)?;
                }
            }
        }
        if dirty(keys::changed) {
            keys::draw(target, &view)?;
        }
        self.shown = Some(view);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
