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
