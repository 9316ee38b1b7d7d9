//! The device's tasks, and what they pass each other. A board gives each an executor.
//!
//! | task | priority | wakes | never waits for |
//! |---|---|---|---|
//! | acquire ([`crate::sensor::spi::acquire`]) | 1 | when the sensor is ready | anything but the sensor: what finds no free block is counted |
//! | show ([`show`]), link ([`link`]), save ([`save`]) | 2 | 4, 20 and 2 times a second, and on bytes | measuring |
//! | measure ([`crate::measure::measure`] with [`Measuring`]) | 3 | when a block has come | link and screen: a reading that finds the channel full is counted |
//!
//! A task interrupts those below it. Acquiring leaves those below it a fifth of the time however many events come, and pauses when
//! the bus brings nothing; the front works for milliseconds, four times a second; measuring has the rest. So nothing starves. Each
//! says that it is [alive](Shared::alive) at least twice a second; [`show`] feeds the watchdog while all do.

mod device;
mod front;
mod measuring;
mod run;
mod shared;

pub use front::{Front, Panel, Recording};
pub use measuring::Measuring;
pub use run::{link, save, show};
pub use shared::{Shared, Task, Wanted};
