//! Every state and page of the screen, made up so that no recording is needed.

use evtach_core::rotors::HeatMap;
use evtach_core::{
    Evidence, Frame, Geometry, PackedEvent, Polarity, Reading, Reason, RotorReading, Speed, Status,
};
use evtach_firmware::instrument::{
    Action, Alarm, Fault, Instrument, Mode, Page, Picture, Preferences, Sensor, Setting, Step,
    Traffic, Unit,
};

const GEOMETRY: Geometry = Geometry { width_px: 346, height_px: 260 };
const WINDOW_US: u32 = 150_000;
/// When the last reading's window ends.
const NOW_US: u64 = 12_400_000;

/// An instrument in a state, under the name of its picture.
pub struct Scene {
    pub name: String,
    pub instrument: Instrument,
}

/// What the camera looks at.
struct Rotor {
    rpm: f32,
    x_px: f32,
    y_px: f32,
    radius_px: f32,
    blades: u8,
}

const FAN: [Rotor; 1] =
    [Rotor { rpm: 1180.27, x_px: 168.0, y_px: 128.0, radius_px: 78.0, blades: 5 }];

const fn arm(rpm: f32, x_px: f32, y_px: f32) -> Rotor {
    Rotor { rpm, x_px, y_px, radius_px: 38.0, blades: 2 }
}

const HEXACOPTER: [Rotor; 6] = [
    arm(-5412.0, 70.0, 70.0),
    arm(5388.0, 173.0, 52.0),
    arm(-5403.0, 276.0, 70.0),
    arm(5397.0, 70.0, 190.0),
    arm(-5420.0, 173.0, 208.0),
    arm(5379.0, 276.0, 190.0),
];

/// All of them.
pub fn all() -> Vec<Scene> {
    let mut scenes = vec![
        scene("locked", locked()),
        scene("locked-six-rotors", of(&HEXACOPTER, 5e-4)),
        scene("locked-slow-ms", with(of_rpm(146.2, 2e-4), &[Action::Unit(Unit::MsPerTurn)])),
        scene("locked-fast", of_rpm(59_994.2, 2e-5)),
        scene("coarse", coarse()),
        scene("held", held()),
        scene("hold", with(locked(), &[Action::ToggleHold])),
        scene("alarm-high", alarm(None, Some(1100.0))),
        scene("alarm-low", alarm(Some(1200.0), None)),
        scene("events-lost", events_lost()),
        scene("blades-set", with(locked(), &[Action::BladesTwice])),
        scene("aim", with(locked(), &[Action::Page(Page::Aim)])),
        scene("aim-six-rotors", with(of(&HEXACOPTER, 5e-4), &[Action::Page(Page::Aim)])),
        scene("aim-no-rotation", with(refused(Reason::NoRotation), &[Action::Page(Page::Aim)])),
        scene("settings", with(locked(), &[Action::Page(Page::Settings)])),
        scene("settings-set", settings_set()),
    ];
    for unit in [Unit::Hertz, Unit::RadPerS, Unit::MsPerTurn] {
        let name = unit.as_str().to_lowercase().replace('/', "-");
        scenes.push(scene(&format!("unit-{name}"), with(locked(), &[Action::Unit(unit)])));
    }
    for mode in [Mode::Max, Mode::Min, Mode::Mean] {
        let name = mode.as_str().to_lowercase();
        scenes.push(scene(&format!("mode-{name}"), with(locked(), &[Action::Mode(mode)])));
    }
    for reason in Reason::ALL {
        let name = reason.as_str().replace('_', "-");
        scenes.push(scene(&name, refused(reason)));
    }
    for fault in Fault::ALL {
        let mut instrument = locked();
        instrument.fail(fault);
        scenes.push(scene(&format!("fault-{fault:?}").to_lowercase(), instrument));
    }
    scenes
}

/// One instrument through every state, mode, unit and page, shown to `look` after each step.
pub fn play(mut look: impl FnMut(&Instrument)) {
    let mut instrument = Instrument::new(Preferences::default());
    look(&instrument);
    instrument.set_sensor(Sensor::Present);
    look(&instrument);
    let mut now_us = 1_000_000;
    let pages = [Page::Main, Page::Aim, Page::Settings, Page::Main];
    let asked = Unit::ALL.map(Action::Unit).into_iter().chain(Mode::ALL.map(Action::Mode));
    let actions = asked.chain([
        Action::NextRotor,
        Action::BladesTwice,
        Action::Step(Setting::AlarmHigh, Step::Less),
        Action::ClockTrim(3.0),
        Action::Reset,
        Action::Mode(Mode::Live),
    ]);
    let mut step = |instrument: &mut Instrument, status, rotors: &[Rotor], events_per_s| {
        now_us += 300_000;
        let lost = if status == Status::Refused(Reason::Saturated) { now_us } else { 0 };
        instrument.tick(now_us, Traffic { events: now_us * events_per_s / 1_000_000, lost });
        instrument.show_picture(&picture(rotors));
        instrument.observe(&reading(now_us, status, rotors, 5e-4));
        look(instrument);
    };
    for action in actions {
        step(&mut instrument, Status::Locked, &FAN, 420_000);
        instrument.act(action);
        for page in pages {
            instrument.act(Action::Page(page));
            step(&mut instrument, Status::Locked, &HEXACOPTER, 1_700_000);
        }
    }
    for reason in Reason::ALL {
        step(&mut instrument, Status::Refused(reason), &FAN, 9_000);
        step(&mut instrument, Status::Coarse, &HEXACOPTER[..2], 90_000);
    }
    for fault in Fault::ALL {
        instrument.fail(fault);
        step(&mut instrument, Status::Locked, &FAN, 420_000);
        instrument.act(Action::Acknowledge);
        step(&mut instrument, Status::Locked, &FAN, 420_000);
    }
}

fn scene(name: &str, instrument: Instrument) -> Scene {
    Scene { name: name.into(), instrument }
}

fn with(mut instrument: Instrument, actions: &[Action]) -> Instrument {
    for action in actions {
        instrument.act(*action);
    }
    instrument
}

fn locked() -> Instrument {
    of(&FAN, 5e-4)
}

fn of_rpm(rpm: f32, relative_sigma: f32) -> Instrument {
    let [fan] = FAN;
    of(&[Rotor { rpm, ..fan }], relative_sigma)
}

fn coarse() -> Instrument {
    let mut instrument = instrument(&FAN, 180_000);
    instrument.observe(&reading(NOW_US, Status::Coarse, &FAN, 1.4e-2));
    instrument
}

fn held() -> Instrument {
    let mut instrument = locked();
    let status = Status::Refused(Reason::Ambiguous);
    instrument.observe(&reading(NOW_US + 400_000, status, &FAN, 0.0));
    instrument
}

fn alarm(low_rpm: Option<f32>, high_rpm: Option<f32>) -> Instrument {
    let preferences = Preferences { alarm: Alarm { low_rpm, high_rpm }, ..Preferences::default() };
    series(instrument_of(preferences, &FAN, 420_000), &FAN, 5e-4)
}

fn events_lost() -> Instrument {
    let mut instrument = of(&FAN, 2e-3);
    instrument.tick(NOW_US + 1_000, Traffic { events: 0, lost: 0 });
    instrument.tick(NOW_US + 501_000, Traffic { events: 1_500_000, lost: 210_000 });
    instrument
}

fn settings_set() -> Instrument {
    let actions = [
        Action::Page(Page::Settings),
        Action::Unit(Unit::RadPerS),
        Action::Blades(Some(5)),
        Action::Step(Setting::AlarmHigh, Step::More),
        Action::Step(Setting::AlarmLow, Step::Less),
        Action::ClockTrim(-12.5),
    ];
    with(locked(), &actions)
}

fn refused(reason: Reason) -> Instrument {
    let status = Status::Refused(reason);
    match reason {
        Reason::NoSensor => Instrument::new(Preferences::default()),
        Reason::NoEvents => instrument(&[], 0),
        Reason::TooFewEvents | Reason::NoRotation | Reason::Flicker | Reason::Searching => {
            let mut instrument = instrument(&[], 9_000);
            instrument.observe(&reading(NOW_US, status, &[], 0.0));
            instrument
        }
        Reason::Saturated => {
            let mut instrument = instrument(&FAN, 7_200_000);
            instrument.tick(NOW_US + 300_000, Traffic { events: 9_000_000, lost: 5_000_000 });
            instrument.observe(&reading(NOW_US, status, &FAN, 0.0));
            instrument
        }
        _ => {
            let mut instrument = instrument(&FAN, 420_000);
            instrument.observe(&reading(NOW_US, status, &FAN, 0.0));
            instrument
        }
    }
}

/// Ten seconds of readings that waver by their error.
fn of(rotors: &[Rotor], relative_sigma: f32) -> Instrument {
    series(instrument(rotors, 420_000), rotors, relative_sigma)
}

fn series(mut instrument: Instrument, rotors: &[Rotor], relative_sigma: f32) -> Instrument {
    let mut noise = Noise(7);
    for step in (0..64).rev() {
        let wavering: Vec<Rotor> = rotors
            .iter()
            .map(|rotor| Rotor {
                rpm: rotor.rpm * (1.0 + relative_sigma * noise.about_zero()),
                ..*rotor
            })
            .collect();
        let shown = if step == 0 { rotors } else { &wavering };
        let end_us = NOW_US - step * 150_000;
        instrument.observe(&reading(end_us, Status::Locked, shown, relative_sigma));
    }
    instrument
}

fn instrument(rotors: &[Rotor], events_per_s: u64) -> Instrument {
    instrument_of(Preferences::default(), rotors, events_per_s)
}

/// With a sensor, a picture, and events at a rate.
fn instrument_of(preferences: Preferences, rotors: &[Rotor], events_per_s: u64) -> Instrument {
    let mut instrument = Instrument::new(preferences);
    instrument.set_sensor(Sensor::Present);
    instrument.tick(NOW_US - 500_000, Traffic::default());
    instrument.tick(NOW_US, Traffic { events: events_per_s / 2, lost: 0 });
    instrument.show_picture(&picture(rotors));
    instrument
}

fn reading(end_us: u64, status: Status, rotors: &[Rotor], relative_sigma: f32) -> Reading {
    let rotors = rotors.iter().zip(0..).map(|(rotor, id)| {
        let omega_rad_s = rotor.rpm / Speed::RPM_PER_RAD_S;
        let speed = Speed {
            omega_rad_s,
            omega_sigma_rad_s: omega_rad_s.abs() * relative_sigma,
            alpha_rad_s2: None,
            frame: Frame::Camera,
        };
        RotorReading {
            id,
            x_px: rotor.x_px,
            y_px: rotor.y_px,
            radius_px: rotor.radius_px,
            blades: Some(rotor.blades),
            status,
            speed: status.reason().is_none().then_some(speed),
            evidence: Evidence::default(),
        }
    });
    Reading {
        t_us: end_us - u64::from(WINDOW_US / 2),
        window_us: WINDOW_US,
        events: 63_000,
        thinned: 0,
        lost: 0,
        status,
        rotors: rotors.collect(),
    }
}

/// Noise, and rings that grow brighter towards the tips.
fn picture(rotors: &[Rotor]) -> Picture {
    let mut counts = [0; 6_400];
    let mut heat = HeatMap::new(&mut counts, GEOMETRY);
    let mut noise = Noise(3);
    for cell in 0..heat.grid().len() {
        let (x, y) = heat.grid().centre(cell);
        let mut events = 2.0 + noise.about_zero();
        for rotor in rotors {
            let share = (x - rotor.x_px).hypot(y - rotor.y_px) / rotor.radius_px;
            if (0.15..1.0).contains(&share) {
                events += 90.0 * share + 25.0 * noise.about_zero();
            }
        }
        for _ in 0..events.max(0.0) as u32 {
            heat.count(PackedEvent::new(0, x as u16, y as u16, Polarity::On), 0);
        }
    }
    let mut picture = Picture::EMPTY;
    picture.take(&heat);
    picture
}

/// A linear congruential generator (Numerical Recipes): the same picture on every machine.
struct Noise(u32);

impl Noise {
    /// Roughly standard normal: the sum of four uniform numbers.
    fn about_zero(&mut self) -> f32 {
        let mut sum = 0.0;
        for _ in 0..4 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            sum += (self.0 >> 8) as f32 / 16_777_216.0 - 0.5;
        }
        sum * 1.73
    }
}
