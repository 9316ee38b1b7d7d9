//! What a person touches: the screen (FT5336, FocalTech "FT5x36 registers") and the blue button.

use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::i2c::{self, I2c, Master};
use embassy_stm32::mode::Blocking;
use embassy_stm32::time::Hertz;
use embassy_time::{Duration, Instant, Ticker};
use embedded_graphics::prelude::Point;
use evtach_firmware::ui::{Press, action_at, button};

use crate::program::SharedFront;
use crate::wiring::InputPins;

/// Time between two looks: shorter than a tap, longer than a button bounces.
const LOOK: Duration = Duration::from_millis(20);

/// A press as long as this is a long one.
const LONG: Duration = Duration::from_millis(500);

/// Longest time that the bus may take for the few bytes of a look: at 400 kHz they take a fifth of a millisecond.
const BUS: Duration = Duration::from_millis(2);

const ADDRESS: u8 = 0x38;
const CHIP: u8 = 0x51;
const CHIP_REGISTER: u8 = 0xa8;
/// Number of fingers; then of the first, event and x, x, y, y of the chip.
const FINGERS_REGISTER: u8 = 0x02;
/// 0: the interrupt line is low as long as a finger is there.
const LINE_MODE_REGISTER: u8 = 0xa4;
/// More fingers than the chip knows: it has nothing to say yet.
const MOST_FINGERS: u8 = 5;
const LIFTED: u8 = 1;

/// Looks at button and screen for good, and does what they ask for.
pub async fn watch(front: &SharedFront, pins: InputPins) {
    // Held since before the start it asked for the replay, and for nothing else.
    let since = Some((Instant::now(), true));
    let mut knob = Knob { pin: Input::new(pins.button, Pull::Down), since };
    let touched = Input::new(pins.touched, Pull::Up);
    let mut config = i2c::Config::default();
    config.frequency = Hertz(400_000);
    config.timeout = BUS;
    let mut screen = Screen::start(I2c::new_blocking(pins.i2c, pins.scl, pins.sda, config));
    if screen.is_none() {
        defmt::error!("the touch screen does not answer: there is the button");
    }
    let mut ticker = Ticker::every(LOOK);
    loop {
        ticker.next().await;
        let view = || front.borrow().instrument().view();
        if let Some(press) = knob.look() {
            let action = button(&view(), press);
            front.borrow_mut().act(action);
        }
        let touch = screen.as_mut().and_then(|screen| screen.look(touched.is_low()));
        if let Some(action) = touch.and_then(|at| action_at(&view(), at)) {
            front.borrow_mut().act(action);
        }
    }
}

/// The button.
struct Knob {
    pin: Input<'static>,
    /// When it was pressed; then whether the press has been told.
    since: Option<(Instant, bool)>,
}

impl Knob {
    /// A press that has ended, or has become a long one.
    fn look(&mut self) -> Option<Press> {
        let now = Instant::now();
        match (self.pin.is_high(), self.since) {
            (true, None) => self.since = Some((now, false)),
            (true, Some((since, false))) if now - since >= LONG => {
                self.since = Some((since, true));
                return Some(Press::Long);
            }
            (true, Some(_)) => {}
            (false, since) => {
                self.since = None;
                return since.filter(|(_, told)| !told).map(|_| Press::Short);
            }
        }
        None
    }
}

/// The touch screen.
struct Screen {
    bus: I2c<'static, Blocking, Master>,
    /// Whether a finger was there at the last look.
    held: bool,
}

impl Screen {
    /// `None` when the chip does not answer.
    fn start(mut bus: I2c<'static, Blocking, Master>) -> Option<Self> {
        let mut chip = [0];
        bus.blocking_write_read(ADDRESS, &[CHIP_REGISTER], &mut chip).ok()?;
        bus.blocking_write(ADDRESS, &[LINE_MODE_REGISTER, 0]).ok()?;
        (chip == [CHIP]).then_some(Self { bus, held: false })
    }

    /// Where a finger has come down, in pixels.
    fn look(&mut self, touched: bool) -> Option<Point> {
        if !touched && !self.held {
            return None;
        }
        let mut answer = [0; 5];
        // A bus that fails is asked again at the next look.
        self.bus.blocking_write_read(ADDRESS, &[FINGERS_REGISTER], &mut answer).ok()?;
        let [fingers, x_high, x_low, y_high, y_low] = answer;
        let there = (1..=MOST_FINGERS).contains(&(fingers & 0xf)) && x_high >> 6 != LIFTED;
        let came = there && !self.held;
        self.held = there;
        // The chip stands upright in the board's wide screen.
        let twelve = |high: u8, low: u8| i32::from(high & 0xf) << 8 | i32::from(low);
        came.then(|| Point::new(twelve(y_high, y_low), twelve(x_high, x_low)))
    }
}
