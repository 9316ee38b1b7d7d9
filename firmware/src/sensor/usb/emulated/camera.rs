//! A camera with its registers, its clock and its FIFO.

use std::collections::{BTreeMap, VecDeque};
use std::vec::Vec;

use evtach_core::{Event, GyroSample, Roi};

use super::words::{DavisWords, DvxplorerWords, GyroRange};
use crate::sensor::usb::{Model, Module, Register, Transfer};

/// Bytes of the camera's FIFO: four buffers of the FX3's DMA.
const FIFO_BYTES: usize = 32 * 1024;
/// Payload of a high-speed bulk packet.
const PACKET_BYTES: usize = 512;
/// How the pixels lie.
const ORIENTATION: Register = Register::new(Module::Dvs, 2);

/// A request that the camera does not know: it stalls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stalled;

/// What the camera says to a request for data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Packet {
    /// Up to 512 bytes; fewer, or none, end a transfer.
    Data(Vec<u8>),
    /// Nothing yet.
    Nak,
    /// The endpoint is halted until the halt is cleared.
    Stall,
}

/// What goes wrong with the endpoint of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It halts, and is well again when the halt is cleared.
    Halt,
    /// It halts for good.
    Dead,
    /// The next packet loses its last byte.
    Odd,
    /// The camera's clock is set to zero.
    ClockReset,
}

/// Which events the camera leaves out by its own registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Filters {
    /// Events let through before one is left out; `None`: all are let through.
    pub skip_every: Option<u32>,
    /// Part of the pixel array, in its own coordinates; `None`: all of it.
    pub region: Option<Roi>,
}

/// Words of either camera.
#[derive(Clone, Debug)]
enum Words {
    Davis(DavisWords),
    Dvxplorer(DvxplorerWords),
}

/// A camera that plays events, as fast as [`Camera::run_until`] says.
#[derive(Clone, Debug)]
pub struct Camera {
    /// What it is.
    pub model: Model,
    /// Low byte of its device release number.
    pub firmware: u8,
    /// What was asked of its registers, in order.
    pub log: Vec<Transfer>,
    /// Events that happened while it ran.
    pub seen: u64,
    /// Events left out by its filters.
    pub filtered: u64,
    /// Of these, skipped though they were in the region.
    pub skipped: u64,
    /// Events dropped, because the FIFO was full.
    pub dropped: u64,
    /// What the gyro measures all the while, in rad/s.
    pub roll_rad_s: f32,
    /// How far that swings to either side, in rad/s: see [`swinging`].
    pub swing_rad_s: f32,
    registers: BTreeMap<Register, u32>,
    events: Vec<Event>,
    at: usize,
    /// Time after which the events come again, later by as much; `None`: they come once.
    repeat_us: Option<u64>,
    /// Time of the events when the camera's clock is zero.
    origin_us: u64,
    /// What goes wrong, and before which event.
    planned: VecDeque<(usize, Fault)>,
    /// Time of the world when the camera's clock was zero; `None` while it does not run.
    started_us: Option<u64>,
    next_gyro_us: u64,
    words: Words,
    fifo: VecDeque<u8>,
    /// When the oldest byte in the FIFO came, in the world's time.
    oldest_us: u64,
    now_us: u64,
    since_skip: u32,
    halted: bool,
    dead: bool,
    odd: bool,
}

/// What a hand adds to a camera's roll at a time of its clock, in rad/s: to and fro, evenly, by so much to either side.
#[must_use]
pub fn swinging(swing_rad_s: f32, t_us: u64) -> f32 {
    const PERIOD_US: u64 = 700_000;
    let part = (t_us % PERIOD_US) as f32 / PERIOD_US as f32;
    swing_rad_s * (1.0 - 4.0 * (part - 0.5).abs())
}

impl Camera {
    /// A camera that sees these events, in the order of their times: those of time zero when it begins to run. Its firmware
    /// and logic are new enough.
    #[must_use]
    pub fn new(model: Model, events: Vec<Event>) -> Self {
        let size = model.geometry();
        let words = match model {
            Model::Davis346 => Words::Davis(DavisWords::default()),
            Model::Dvxplorer => Words::Dvxplorer(DvxplorerWords::default()),
        };
        let registers = [
            (Register::new(Module::Mux, 80), 1),
            (Register::new(Module::Dvs, 0), size.width_px.into()),
            (Register::new(Module::Dvs, 1), size.height_px.into()),
            (Register::new(Module::Dvs, 40), 1),
            (Register::new(Module::Dvs, 50), 1),
            (Register::new(Module::Imu, 0), if model == Model::Davis346 { 2 } else { 3 }),
            (Register::new(Module::System, 0), 18),
            (Register::new(Module::System, 3), 90),
            (Register::new(Module::System, 4), 30),
            (Register::new(Module::System, 5), 80),
            (Register::new(Module::System, 6), 1000),
            (Register::new(Module::System, 7), 4),
        ];
        Self {
            model,
            firmware: 9,
            log: Vec::new(),
            seen: 0,
            filtered: 0,
            skipped: 0,
            dropped: 0,
            roll_rad_s: 0.0,
            swing_rad_s: 0.0,
            registers: BTreeMap::from(registers),
            events,
            at: 0,
            repeat_us: None,
            origin_us: 0,
            planned: VecDeque::new(),
            started_us: None,
            next_gyro_us: 0,
            words,
            fifo: VecDeque::new(),
            oldest_us: 0,
            now_us: 0,
            since_skip: 0,
            halted: false,
            dead: false,
            odd: false,
        }
    }

    /// Has the events come again and again, each time later by `period_us`, which is more than the time of the last of them.
    pub fn repeat(&mut self, period_us: u64) {
        self.repeat_us = Some(period_us);
    }

    /// A cap on the lens: what was still to happen does not.
    pub fn cover(&mut self) {
        (self.repeat_us, self.at) = (None, self.events.len());
    }

    /// An event with its time, by its number since the start; `None` once all have happened.
    fn event(&self, number: usize) -> Option<Event> {
        let mut event = match self.repeat_us {
            Some(_) => *self.events.get(number.checked_rem(self.events.len())?)?,
            None => *self.events.get(number)?,
        };
        if let Some(period_us) = self.repeat_us {
            event.t_us += (number / self.events.len()) as u64 * period_us;
        }
        Some(event)
    }

    /// Sets what a register says, as another camera of its kind would have it.
    pub fn set(&mut self, register: Register, value: u32) {
        self.registers.insert(register, value);
        let swap = self.swaps_xy();
        if let Words::Davis(words) = &mut self.words {
            words.swap_xy = swap;
        }
    }

    fn get(&self, register: Register) -> u32 {
        self.registers.get(&register).copied().unwrap_or_default()
    }

    fn swaps_xy(&self) -> bool {
        self.get(ORIENTATION) & 4 != 0
    }

    /// The device descriptor.
    #[must_use]
    pub fn device_descriptor(&self) -> [u8; 18] {
        let [v0, v1] = self.model.vendor_id().to_le_bytes();
        let [p0, p1] = self.model.product_id().to_le_bytes();
        [18, 1, 0, 2, 0xff, 0, 0, 64, v0, v1, p0, p1, self.firmware, 0, 1, 2, 3, 1]
    }

    /// The configuration with its interface and endpoints.
    #[must_use]
    pub const fn configuration(&self) -> [u8; 32] {
        [
            9, 2, 32, 0, 1, 1, 0, 0x80, 250, // configuration 1, 500 mA
            9, 4, 0, 0, 2, 0xff, 0, 0, 0, // interface 0 with two endpoints
            7, 5, 0x81, 3, 64, 0, 1, // messages of the controller
            7, 5, 0x82, 2, 0, 2, 0, // data
        ]
    }

    /// Plugged in anew: everything is as after power-on, and the events go on where they were.
    pub fn power_on(&mut self) {
        let mut anew = Self::new(self.model, Vec::new());
        for (register, value) in &self.registers {
            if anew.registers.contains_key(register) || *register == ORIENTATION {
                anew.registers.insert(*register, *value);
            }
        }
        self.stop();
        self.registers = anew.registers;
        self.log.clear();
        self.halted = false;
        self.since_skip = 0;
        self.origin_us = self.event(self.at).map_or(0, |event| event.t_us);
    }

    fn stop(&mut self) {
        self.started_us = None;
        self.fifo.clear();
        self.words = match &self.words {
            Words::Davis(words) => Words::Davis(DavisWords::new(words.swap_xy)),
            Words::Dvxplorer(_) => Words::Dvxplorer(DvxplorerWords::default()),
        };
    }

    /// Answers a vendor's request: the value of a register, or nothing.
    ///
    /// # Errors
    ///
    /// When it is none that the camera knows.
    pub fn vendor(&mut self, setup: &[u8; 8], data: &[u8]) -> Result<Option<[u8; 4]>, Stalled> {
        let &[kind, request, v0, v1, i0, i1, ..] = setup;
        let module = Module::from_number(u16::from_le_bytes([v0, v1])).ok_or(Stalled)?;
        let register = Register::new(module, u16::from_le_bytes([i0, i1]));
        match (kind, request, data) {
            (0xc0, 0xbf, _) => {
                self.log.push(Transfer::Read(register));
                Ok(Some(self.read(register).to_be_bytes()))
            }
            (0x40, 0xbf, &[a, b, c, d]) => {
                let value = u32::from_be_bytes([a, b, c, d]);
                self.log.push(Transfer::Write(register, value));
                self.write(register, value);
                Ok(None)
            }
            _ => Err(Stalled),
        }
    }

    fn read(&self, register: Register) -> u32 {
        match (register.module, register.parameter) {
            (Module::Mux, 83) => (self.dropped >> 32) as u32,
            (Module::Mux, 84) => self.dropped as u32,
            _ => self.get(register),
        }
    }

    fn write(&mut self, register: Register, value: u32) {
        self.registers.insert(register, value);
        if self.runs() && self.started_us.is_none() {
            self.started_us = Some(self.now_us);
            self.next_gyro_us = 0;
        } else if !self.runs() && self.started_us.is_some() {
            self.stop();
        }
    }

    /// Whether everything is on that events need.
    fn runs(&self) -> bool {
        let on = |module, parameter| self.get(Register::new(module, parameter)) != 0;
        let pixels = self.model == Model::Davis346 || on(Module::Chip, 0x3000);
        on(Module::Mux, 0)
            && on(Module::Mux, 1)
            && on(Module::Mux, 3)
            && on(Module::Dvs, 3)
            && on(Module::Usb, 0)
            && pixels
    }

    /// How often a DAVIS was told to skip when it did not.
    #[must_use]
    pub fn skip_orders(&self) -> usize {
        let skips = self.log.iter().filter_map(|transfer| match transfer {
            Transfer::Write(register, value) if *register == Register::new(Module::Dvs, 51) => {
                Some(*value != 0)
            }
            _ => None,
        });
        let mut skipped = false;
        skips.filter(|skips| !core::mem::replace(&mut skipped, *skips) && *skips).count()
    }

    /// What the registers say is left out.
    #[must_use]
    pub fn filters(&self) -> Filters {
        match self.model {
            Model::Davis346 => {
                let of = |parameter| self.get(Register::new(Module::Dvs, parameter));
                let skip_every = (of(51) != 0).then(|| of(52));
                let region = (of(43) != 0).then(|| region([of(41), of(42), of(43), of(44)]));
                Filters { skip_every, region }
            }
            Model::Dvxplorer => {
                let of = |parameter| self.get(Register::new(Module::Chip, parameter));
                let wide = |parameter| of(parameter) << 8 | of(parameter + 1);
                let rows = [of(0x3301) * 8, of(0x3303) * 8 + 7];
                let region = [wide(0x3305), rows[0], wide(0x3307), rows[1]];
                let on = of(0x3300) == 0 && region[2] != 0;
                Filters { skip_every: None, region: on.then(|| self::region(region)) }
            }
        }
    }

    /// Time between two samples of the gyro in microseconds, and its range.
    fn gyro(&self) -> (u64, GyroRange) {
        let of = |parameter| self.get(Register::new(Module::Imu, parameter));
        match self.model {
            // A thousand samples a second, by a divider that counts from zero.
            Model::Davis346 => ((1 + u64::from(of(5))) * 1_000, GyroRange::davis346(of(10))),
            // 25 samples a second, and twice as many with each number.
            Model::Dvxplorer => (40_000 >> of(8).min(7), GyroRange::dvxplorer(of(10))),
        }
    }

    /// Lets the world's time pass: what happens until then comes into the FIFO, or is lost there.
    pub fn run_until(&mut self, now_us: u64) {
        self.now_us = self.now_us.max(now_us);
        let filters = self.filters();
        let gyro = [0, 3].iter().all(|&at| self.get(Register::new(Module::Imu, at)) != 0);
        let (gyro_us, range) = self.gyro();
        while let Some(started_us) = self.started_us {
            let clock_us = self.now_us.saturating_sub(started_us);
            let event = self
                .event(self.at)
                .map(|event| Event { t_us: event.t_us.saturating_sub(self.origin_us), ..event });
            let event_us = event.map_or(u64::MAX, |event| event.t_us);
            if gyro && self.next_gyro_us <= event_us.min(clock_us) {
                let t_us = self.next_gyro_us;
                let roll_rad_s = self.roll_rad_s + swinging(self.swing_rad_s, t_us);
                let sample = GyroSample { t_us, roll_rad_s };
                self.next_gyro_us += gyro_us;
                self.send(started_us + sample.t_us, |words, out| match words {
                    Words::Davis(words) => words.gyro(&sample, range, out),
                    Words::Dvxplorer(words) => words.gyro(&sample, range, out),
                });
            } else if let Some(event) = event.filter(|_| event_us <= clock_us) {
                if let Some((_, fault)) = self.planned.pop_front_if(|(at, _)| *at <= self.at) {
                    self.fail_at(fault, started_us + event_us);
                    continue;
                }
                self.at += 1;
                self.seen += 1;
                self.take(&event, started_us, &filters);
            } else {
                break;
            }
        }
        self.send(self.now_us, |words, out| {
            if let Words::Dvxplorer(words) = words {
                words.flush(out);
            }
        });
    }

    fn take(&mut self, event: &Event, started_us: u64, filters: &Filters) {
        let outside = filters.region.is_some_and(|region| {
            let (x, y) = if self.swaps_xy() { (event.y, event.x) } else { (event.x, event.y) };
            !region.contains(x, y)
        });
        // Of what is in the region every second event is skipped. That the region comes first is not documented; were it the other way
        // round, chance would decide which are, and as many on average.
        let skipped = !outside
            && filters.skip_every.is_some_and(|every| {
                self.since_skip = if self.since_skip >= every { 0 } else { self.since_skip + 1 };
                self.since_skip == 0
            });
        if outside || skipped {
            self.filtered += 1;
            self.skipped += u64::from(skipped);
        } else if self.fifo.len() + 16 > FIFO_BYTES {
            self.dropped += 1;
        } else {
            self.send(started_us + event.t_us, |words, out| match words {
                Words::Davis(words) => words.event(event, out),
                Words::Dvxplorer(words) => words.event(event, out),
            });
        }
    }

    fn send(&mut self, world_us: u64, say: impl FnOnce(&mut Words, &mut Vec<u16>)) {
        let mut out = Vec::new();
        say(&mut self.words, &mut out);
        if self.fifo.is_empty() && !out.is_empty() {
            self.oldest_us = world_us;
        }
        self.fifo.extend(out.iter().flat_map(|word| word.to_le_bytes()));
    }

    /// The next packet: a full one, or after the early-packet delay whatever there is.
    pub fn packet(&mut self) -> Packet {
        if self.halted || self.dead {
            return Packet::Stall;
        }
        let clock_mhz = u64::from(self.get(Register::new(Module::System, 5))).max(1);
        let delay_us = u64::from(self.get(Register::new(Module::Usb, 1))) / clock_mhz;
        let late = self.now_us.saturating_sub(self.oldest_us) >= delay_us;
        if self.fifo.is_empty() || (self.fifo.len() < PACKET_BYTES && !late) {
            return Packet::Nak;
        }
        let bytes = self.fifo.len().min(PACKET_BYTES);
        let mut packet: Vec<u8> = self.fifo.drain(..bytes).collect();
        if core::mem::take(&mut self.odd) {
            packet.pop();
        }
        self.oldest_us = self.now_us;
        Packet::Data(packet)
    }

    /// Something goes wrong before so many events have happened; faults are planned in their order.
    pub fn plan(&mut self, events: usize, fault: Fault) {
        self.planned.push_back((events, fault));
    }

    /// Something goes wrong now.
    pub fn fail(&mut self, fault: Fault) {
        self.fail_at(fault, self.now_us);
    }

    /// Something goes wrong at a time of the world.
    fn fail_at(&mut self, fault: Fault, world_us: u64) {
        match fault {
            Fault::Halt => self.halted = true,
            Fault::Dead => self.dead = true,
            Fault::Odd => self.odd = true,
            Fault::ClockReset => {
                // Events go on, at times that begin anew.
                let Some(started_us) = self.started_us.replace(world_us) else { return };
                self.origin_us += world_us - started_us;
                self.next_gyro_us = 0;
                self.send(world_us, |words, out| match words {
                    Words::Davis(words) => words.reset(out),
                    Words::Dvxplorer(words) => words.reset(out),
                });
            }
        }
    }

    /// The halt of an endpoint is cleared.
    pub fn clear_halt(&mut self, endpoint: u8) {
        self.log.push(Transfer::ClearHalt(endpoint));
        self.halted = false;
    }

    /// Whether every event has happened and been fetched.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.event(self.at).is_none() && self.fifo.is_empty()
    }

    /// Bytes in the FIFO.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
        self.fifo.len()
    }
}

/// A region from its first and last column and row.
fn region([left, top, right, bottom]: [u32; 4]) -> Roi {
    let size = |first: u32, last: u32| (last.saturating_sub(first) + 1) as u16;
    Roi { x: left as u16, y: top as u16, width_px: size(left, right), height_px: size(top, bottom) }
}
