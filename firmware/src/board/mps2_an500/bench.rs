//! On the bench: a recording is measured, and the readings and what they cost are printed.

use core::cell::Cell;
use core::fmt::Write as _;

use embassy_sync::blocking_mutex::Mutex as BlockingMutex;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use evtach_core::{Reading, Tachometer};
use evtach_firmware::cost::{Costs, Spent};
use evtach_firmware::instrument::{Instrument, Picture, Preferences, Sensor, Traffic};
use evtach_firmware::intake::{self, BLOCKS, Block, Pace};
use evtach_firmware::measure::{Companion, measure};
use evtach_firmware::report::Lines;
use evtach_firmware::sensor::spi::{Acquired, AlwaysReady, Flash, SpiSensor, acquire};
use evtach_firmware::tasks::Panel as _;
use evtach_firmware::ui::Screen;
use semihosting::io::Write as _;
use semihosting::{fs, process};

use crate::console::{Console, File};
use crate::fault::fail;
use crate::memory::{self, Mutex};
use crate::pl022::{AlwaysSelected, Pl022};
use crate::psram::{Panel, Psram};
use crate::stack;
use crate::timers::Ticks;

/// How acquisition over SPI stands.
static ACQUIRED: BlockingMutex<Mutex, Cell<Option<Acquired>>> = BlockingMutex::new(Cell::new(None));

#[embassy_executor::task]
pub async fn take_in_file(mut file: File, pace: Pace, mut blocks: Sender<'static, Mutex, Block>) {
    let header = match intake::open(&mut file).await {
        Ok(header) => header,
        Err(error) => fail(error),
    };
    if let Err(error) = intake::take_in(&mut file, &header, pace, &mut blocks).await {
        fail(error);
    }
}

#[embassy_executor::task]
pub async fn take_in_spi(pace: Pace, mut blocks: Sender<'static, Mutex, Block>) {
    let flash = match Flash::open(Pl022::start(), AlwaysSelected, 0).await {
        Ok(flash) => flash,
        Err(error) => fail(error),
    };
    let mut sensor = SpiSensor::new(flash, AlwaysReady);
    let told = |acquired: &Acquired| ACQUIRED.lock(|cell| cell.set(Some(*acquired)));
    if let Err(error) = acquire(&mut sensor, pace, &mut blocks, told).await {
        fail(error);
    }
}

/// What a person would have seen: drawn after every reading, by event time alone, so that the PC draws the same.
pub struct Film {
    instrument: Instrument,
    screen: Screen,
    picture: Picture,
    panel: Panel,
    traffic: Traffic,
    /// Whether a reading has come that is not drawn yet.
    fresh: bool,
}

impl Film {
    fn new(panel: Panel) -> Self {
        let mut instrument = Instrument::new(Preferences::default());
        instrument.set_sensor(Sensor::Present);
        let (screen, picture) = (Screen::new(), Picture::EMPTY);
        Self { instrument, screen, picture, panel, traffic: Traffic::default(), fresh: false }
    }

    fn observe(&mut self, reading: &Reading) {
        self.traffic.events += reading.events;
        self.traffic.lost += reading.lost;
        self.instrument.observe(reading);
        self.instrument.tick(reading.t_us + u64::from(reading.window_us / 2), self.traffic);
        self.fresh = true;
    }

    fn draw(&mut self, tachometer: &Tachometer<'_>) {
        self.picture.take(tachometer.heat());
        self.instrument.show_picture(&self.picture);
        let Ok(()) = self.screen.draw(&mut self.panel, &self.instrument);
        self.fresh = false;
    }

    /// Writes the pixels to a file of the host, two bytes each, little-endian.
    fn save(&self) {
        let written = fs::File::create(c"screen.rgb565")
            .and_then(|mut file| file.write_all(self.panel.bytes()));
        if let Err(error) = written {
            fail(error);
        }
    }
}

/// Readies the screen, in external memory. Not inlined, because it is built on the stack first.
#[inline(never)]
pub fn film(psram: Psram) -> &'static mut Film {
    let Psram { panel, scratch, .. } = psram;
    scratch.put(Film::new(panel))
}

/// Prints readings as they come.
struct Printer {
    console: Console,
    seen_speed: bool,
    film: Option<&'static mut Film>,
}

impl Companion for Printer {
    fn measured(&mut self, reading: &Reading, Spent { push, poll }: Spent) {
        self.seen_speed |= reading.rotors.iter().any(|rotor| rotor.speed.is_some());
        writeln!(self.console, "{}spent push={push} poll={poll}", Lines(reading)).ok();
        self.console.flush();
        if let Some(film) = &mut self.film {
            film.observe(reading);
        }
    }

    fn between(&mut self, tachometer: &mut Tachometer<'_>) {
        if let Some(film) = self.film.as_mut().filter(|film| film.fresh) {
            film.draw(tachometer);
        }
    }
}

#[embassy_executor::task]
pub async fn measure_all(
    tachometer: &'static mut Tachometer<'static>,
    mut blocks: Receiver<'static, Mutex, Block>,
    pace: Pace,
    film: Option<&'static mut Film>,
) {
    let mut printer = Printer { console: Console::default(), seen_speed: false, film };
    let mut costs = Costs::new(Ticks);
    measure(tachometer, &mut blocks, pace, &mut costs, &mut printer).await;
    printer.between(tachometer);
    let Printer { mut console, seen_speed, film } = printer;
    if let Some(film) = film {
        film.save();
    }
    if let Some(acquired) = ACQUIRED.lock(Cell::get) {
        writeln!(console, "{acquired}").ok();
    }
    let (start_depth, run_depth) = stack::depths();
    writeln!(
        console,
        "{costs}overrun events={}\nmemory tachometer={} store={} heat={} blocks={} stack={}",
        tachometer.ignored().overrun,
        memory::TACHOMETER_BYTES,
        memory::STORE_BYTES,
        memory::HEAT_BYTES,
        size_of::<[Block; BLOCKS]>(),
        start_depth.max(run_depth),
    )
    .ok();
    console.flush();
    process::exit(i32::from(!seen_speed))
}
