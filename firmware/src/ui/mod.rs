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

/// A part of the screen, in the order in which parts are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
enum Region {
    /// All of it, empty.
    Ground,
    Strip,
    Number,
    Details,
    Picture,
    List,
    Trend,
    Aim,
    Settings,
    Keys,
}

impl Region {
    const ALL: [Self; 10] = [
        Self::Ground,
        Self::Strip,
        Self::Number,
        Self::Details,
        Self::Picture,
        Self::List,
        Self::Trend,
        Self::Aim,
        Self::Settings,
        Self::Keys,
    ];

    const fn is_on(self, page: Page) -> bool {
        match self {
            Self::Ground | Self::Keys => true,
            Self::Strip | Self::Number | Self::Details | Self::List | Self::Trend => {
                matches!(page, Page::Main)
            }
            Self::Picture => matches!(page, Page::Main | Page::Aim),
            Self::Aim => matches!(page, Page::Aim),
            Self::Settings => matches!(page, Page::Settings),
        }
    }

    fn has_changed(self, a: &View, b: &View) -> bool {
        match self {
            Self::Ground => false,
            Self::Strip => strip::changed(a, b),
            Self::Number => number::changed(a, b),
            Self::Details => number::details_changed(a, b),
            Self::Picture => scene::changed(a, b),
            Self::List => list::changed(a, b),
            Self::Trend => trend::changed(a, b),
            Self::Aim => aim::changed(a, b),
            Self::Settings => settings::changed(a, b),
            Self::Keys => keys::changed(a, b),
        }
    }

    fn draw<D: DrawTarget<Color = Rgb565>>(
        self,
        target: &mut D,
        instrument: &Instrument,
        view: &View,
    ) -> Result<(), D::Error> {
        match self {
            Self::Ground => target.clear(theme::BACK),
            Self::Strip => strip::draw(target, view),
            Self::Number => number::draw(target, view),
            Self::Details => number::draw_details(target, view),
            Self::Picture if view.page == Page::Aim => {
                scene::draw_large(target, instrument.picture(), view)
            }
            Self::Picture => scene::draw_thumbnail(target, instrument.picture(), view),
            Self::List => list::draw(target, view),
            Self::Trend => trend::draw(target, instrument.trend(), view),
            Self::Aim => aim::draw(target, view),
            Self::Settings => settings::draw(target, view),
            Self::Keys => keys::draw(target, view),
        }
    }
}

/// What the screen shows, so that only what has changed is drawn.
#[derive(Debug, Default)]
pub struct Screen {
    shown: Option<View>,
    /// Regions that do not show it yet, a bit each.
    stale: u16,
}

impl Screen {
    /// A screen of which nothing is known: everything is drawn the first time.
    #[must_use]
    pub const fn new() -> Self {
        Self { shown: None, stale: 0 }
    }

    /// Draws what has changed since the last time.
    ///
    /// # Errors
    ///
    /// Whatever the target reports; then everything is drawn the next time.
    pub fn draw<D: DrawTarget<Color = Rgb565>>(
        &mut self,
        target: &mut D,
        instrument: &Instrument,
    ) -> Result<(), D::Error> {
        self.look(instrument);
        while self.draw_next(target, instrument)? {}
        Ok(())
    }

    /// Looks at what has changed, for [`draw_next`](Self::draw_next).
    #[inline(never)]
    pub fn look(&mut self, instrument: &Instrument) {
        let view = instrument.view();
        let before = self.shown.take().filter(|before| before.page == view.page);
        let stale = if before.is_some() { self.stale } else { 0 };
        let is_stale = |region: &Region| {
            let changed = |before: &View| region.has_changed(before, &view);
            region.is_on(view.page) && before.as_ref().is_none_or(changed)
        };
        let changed = Region::ALL.into_iter().filter(is_stale);
        self.stale = changed.fold(stale, |stale, region| stale | 1 << region as u16);
        self.shown = Some(view);
    }

    /// Draws one region that has changed, as it was when last looked at; whether there was one. Not inlined, so that there is one
    /// of it in the device.
    ///
    /// # Errors
    ///
    /// Whatever the target reports; then everything is drawn the next time.
    #[inline(never)]
    pub fn draw_next<D: DrawTarget<Color = Rgb565>>(
        &mut self,
        target: &mut D,
        instrument: &Instrument,
    ) -> Result<bool, D::Error> {
        let next = Region::ALL.into_iter().find(|region| self.stale & 1 << *region as u16 != 0);
        let Some((region, view)) = next.zip(self.shown.as_ref()) else { return Ok(false) };
        self.stale &= !(1 << region as u16);
        let drawn = region.draw(target, instrument, view);
        if drawn.is_err() {
            self.shown = None;
        }
        drawn.map(|()| true)
    }
}

#[cfg(test)]
mod tests;
