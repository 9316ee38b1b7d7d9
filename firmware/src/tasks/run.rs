//! The tasks at the front: screen, link, and keeping the preferences. They share one executor, and so the front.

use core::cell::RefCell;

use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Ticker, Timer};
use embedded_io_async::{Read, Write};
use embedded_storage_async::nor_flash::NorFlash;

use super::front::{Front, Panel, Recording};
use super::shared::{Shared, Task};
use crate::instrument::{Fault, Preferences};
use crate::kept::KeptFault;
use crate::scpi::Link;
use crate::settings::Store;
use crate::ui::Screen;

/// Time between two drawings.
const FRAME: Duration = Duration::from_millis(250);

/// Time between drawing two parts of the screen: measuring, which waits for either, takes in what has come meanwhile.
const BREATH: Duration = Duration::from_millis(2);

/// Longest time between two looks at what the link has to say.
const LINK: Duration = Duration::from_millis(50);

/// Time between two looks at the preferences: turning a value up by ten steps is not to be ten writes.
const SAVE: Duration = Duration::from_millis(500);

/// Longest time that a task may be silent. Measuring says that it is alive after every step, the others twice a second.
const HUNG: Duration = Duration::from_secs(3);

/// Draws four times a second, and when a person asks for something, what the instrument shows, and feeds the watchdog while every task is alive; with one that is
/// not, `hung` is told which.
pub async fn show<R: Recording, P: Panel>(
    front: &RefCell<Front<R, P>>,
    shared: &Shared,
    mut feed: impl FnMut(),
    mut hung: impl FnMut(Task),
) {
    let mut ticker = Ticker::every(FRAME);
    let mut screen = Screen::new();
    let mut last_alive = Instant::now();
    loop {
        {
            let front = &mut *front.borrow_mut();
            front.refresh();
            front.look(&mut screen);
        }
        while front.borrow_mut().draw_next(&mut screen) {
            Timer::after(BREATH).await;
        }
        if shared.all_alive() {
            last_alive = Instant::now();
        } else if last_alive.elapsed() > HUNG
            && let Some(task) = shared.missing()
        {
            hung(task);
        }
        feed();
        select(ticker.next(), shared.touched.receive()).await;
    }
}

/// Answers on a port. One that fails is tried again.
pub async fn link<R: Recording, P: Panel>(
    front: &RefCell<Front<R, P>>,
    shared: &Shared,
    port: &mut (impl Read + Write),
) {
    let mut link = Link::new();
    let mut bytes = [0; 64];
    loop {
        shared.alive(Task::Link);
        let mut came = 0;
        select(async { came = port.read(&mut bytes).await.unwrap_or(0) }, Timer::after(LINK)).await;
        let mut rest = &bytes[..came];
        loop {
            let taken = link.receive(rest);
            rest = &rest[taken..];
            answer(front, shared, port, &mut link).await;
            if rest.is_empty() {
                break;
            }
            // A command that waits for a reading holds up what follows it.
            if taken == 0 {
                Timer::after(LINK).await;
            }
        }
    }
}

/// Lets the link work, and sends what it has to say.
async fn answer<R: Recording, P: Panel>(
    front: &RefCell<Front<R, P>>,
    shared: &Shared,
    port: &mut impl Write,
    link: &mut Link,
) {
    loop {
        let mut out = [0; 64];
        let count = {
            let front = &mut *front.borrow_mut();
            front.refresh();
            link.run(Instant::now().as_micros(), front);
            link.transmit(&mut out, front)
        };
        shared.alive(Task::Link);
        if count == 0 {
            return;
        }
        if port.write_all(&out[..count]).await.is_err() {
            // Nobody listens: what is left is not for whoever comes next.
            link.forget();
            return;
        }
    }
}

/// Keeps the preferences as they change.
pub async fn save<R: Recording, P: Panel>(
    front: &RefCell<Front<R, P>>,
    store: &mut Store<impl NorFlash>,
    mut saved: Preferences,
) {
    loop {
        Timer::after(SAVE).await;
        let now = *front.borrow().instrument().preferences();
        if now == saved {
            continue;
        }
        // Told once for each change, not twice a second.
        saved = now;
        if let Err(error) = store.save(&now).await {
            front.borrow_mut().fail(KeptFault::new(Fault::Preferences, error));
        }
    }
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;
    use core::convert::Infallible;
    use core::future::pending;
    use std::string::String;
    use std::vec::Vec;

    use embassy_futures::select::{Either, select};
    use embedded_graphics::Pixel;
    use embedded_graphics::pixelcolor::Rgb565;
    use embedded_graphics::prelude::{DrawTarget, OriginDimensions, Size};
    use embedded_io_async::{ErrorKind, ErrorType};
    use evtach_core::Geometry;

    use super::*;
    use crate::scpi::{RecorderFailed, RecorderStatus};
    use crate::test_time::block_on;

    /// A board without screen and memory for recordings.
    struct Bare;

    impl Recording for Bare {
        fn status(&self) -> RecorderStatus {
            RecorderStatus::default()
        }

        fn start(&mut self, _: Geometry, _: u32) {}

        fn stop(&mut self) {}

        fn read(&mut self, _: u32, _: &mut [u8]) -> Result<(), RecorderFailed> {
            Err(RecorderFailed)
        }
    }

    impl OriginDimensions for Bare {
        fn size(&self) -> Size {
            Size::zero()
        }
    }

    impl DrawTarget for Bare {
        type Color = Rgb565;
        type Error = Infallible;

        fn draw_iter<I: IntoIterator<Item = Pixel<Rgb565>>>(
            &mut self,
            _: I,
        ) -> Result<(), Infallible> {
            Ok(())
        }
    }

    impl Panel for Bare {
        fn bytes(&self) -> &[u8] {
            &[]
        }
    }

    /// What a PC says, how many bytes it still fetches, and what it heard.
    #[derive(Default)]
    struct Pc {
        says: Cell<&'static str>,
        fetches: Cell<usize>,
        heard: RefCell<Vec<u8>>,
    }

    impl ErrorType for &Pc {
        type Error = ErrorKind;
    }

    impl Read for &Pc {
        async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
            let said = self.says.take();
            if said.is_empty() {
                pending::<()>().await;
            }
            bytes[..said.len()].copy_from_slice(said.as_bytes());
            Ok(said.len())
        }
    }

    impl Write for &Pc {
        async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
            let count = bytes.len().min(self.fetches.get());
            if count == 0 {
                return Err(ErrorKind::NotConnected);
            }
            self.fetches.set(self.fetches.get() - count);
            self.heard.borrow_mut().extend_from_slice(&bytes[..count]);
            Ok(count)
        }

        async fn flush(&mut self) -> Result<(), ErrorKind> {
            Ok(())
        }
    }

    impl Pc {
        /// What comes within a second of saying something, of which it fetches so many bytes.
        async fn hears(&self, fetches: usize, says: &'static str) -> String {
            self.fetches.set(fetches);
            self.says.set(says);
            Timer::after_secs(1).await;
            String::from_utf8(self.heard.take()).expect("text")
        }
    }

    #[test]
    fn what_a_pc_that_pauses_did_not_fetch_is_not_told_when_it_comes_back() {
        static SHARED: Shared = Shared::new();
        let pc = Pc::default();
        let talk = async {
            // A block that is sent in many pieces.
            let begun = pc.hears(100, "SYST:HELP:HEAD?\n").await;
            assert!(begun.len() == 100 && begun.starts_with('#'), "{begun}");
            assert_eq!(pc.hears(usize::MAX, "").await, "");
            assert_eq!(pc.hears(usize::MAX, "*OPC?\n").await, "1\n");
        };
        block_on(async {
            let front =
                RefCell::new(Front::new(&SHARED, Preferences::default(), None, Bare, Bare, "0"));
            let ended = select(talk, link(&front, &SHARED, &mut &pc)).await;
            assert!(matches!(ended, Either::First(())));
        });
    }
}
