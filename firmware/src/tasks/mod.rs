//! The device's tasks, and what they pass each other. A board gives each an executor.
//!
//! | task | priority | wakes | never waits for |
//! |---|---|---|---|
//! | acquire ([`crate::sensor::spi::acquire`]) | 1 | when the sensor is ready | anything but the sensor: what finds no free block is counted |
//! | measure ([`crate::measure::measure`] with [`Measuring`]) | 2 | when a block has come | link and screen: a reading that finds the channel full is counted |
//! | show ([`show`]), link ([`link`]), save ([`save`]) | 3 | 4, 20 and 2 times a second, and on bytes | each other for longer than a drawing |
//!
//! A task interrupts those below it. Measuring leaves those below it a tenth of the time ([`Measuring`]), however many events
//! come, and acquiring pauses when the bus brings nothing, so that nothing starves. Each says that it is
//! [alive](Shared::alive) at least twice a second; [`show`] feeds the watchdog while all do.

mod device;
mod front;
mod measuring;
mod run;
mod shared;

pub use front::{Front, Panel, Recording};
pub use measuring::Measuring;
pub use run::{link, save, show};
pub use shared::{Shared, Task, Wanted};
