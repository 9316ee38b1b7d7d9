//! From the sensor to blocks of events, and never late: what finds no place is thinned or dropped, and counted.

use core::fmt;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::zerocopy_channel::Sender;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal_async::digital::Wait;
use embedded_hal_async::spi::SpiDevice;

use super::account::{Account, Lost};
use super::driver::{LinkError, SILENCE, SpiSensor};
use super::frame::{Hello, Kind};
use super::parser::Frame;
use super::words::Words;
use crate::intake::{Block, Pace};
use crate::sensor::outlet::Outlet;

/// Reads without a sound frame after which a recording is held to be over: about 64 KiB.
const SILENT_READS: u32 = 32;

/// Pause before the bus is read again when what was read held no frame: a line that is stuck must not keep the
/// processor busy.
const PAUSE: Duration = Duration::from_millis(1);

/// Acquiring rests for a [`PAUSE`] over this after each: a fifth of the time in all. More often would cost more than it gives.
const SHARE: u32 = 4;

/// How far ahead of its time a recording may play: a timer for every frame costs as much as a tenth of its events.
const AHEAD: Duration = Duration::from_millis(1);

/// How acquisition stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Acquired {
    /// The sensor, while it answers.
    pub sensor: Option<Hello>,
    /// Sensor time that has been reached, in microseconds.
    pub latest_us: u64,
    /// What came and what did not.
    pub account: Account,
    /// Events left out evenly, because the blocks were filling up.
    pub thinned: u64,
    /// Events dropped, because every block was taken.
    pub overrun: u64,
    /// Times the bus or a line failed.
    pub bus_errors: u32,
}

impl Acquired {
    /// Nothing has come yet.
    pub const NONE: Self = Self {
        sensor: None,
        latest_us: 0,
        account: Account::NONE,
        thinned: 0,
        overrun: 0,
        bus_errors: 0,
    };

    /// Events handed on to be measured.
    #[must_use]
    pub const fn delivered(&self) -> u64 {
        self.account.received.saturating_sub(self.thinned).saturating_sub(self.overrun)
    }
}

/// One line that begins with "acquired": every count under its name.
impl fmt::Display for Acquired {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { sensor, latest_us: _, account, thinned, overrun, bus_errors } = self;
        let Account { frames, frames_damaged, frames_missing, restarts, received, lost, .. } =
            account;
        let Lost { bridge, damaged, missing, undecoded } = lost;
        write!(
            f,
            "acquired sent={} received={received} thinned={thinned} overrun={overrun} \
             bridge={bridge} damaged={damaged} missing={missing} undecoded={undecoded} frames={frames} \
             frames_damaged={frames_damaged} frames_missing={frames_missing} restarts={restarts} \
             bus_errors={bus_errors} sensor={}",
            account.sent(),
            // The name stands last, because it may hold spaces.
            sensor.as_ref().map_or("-", Hello::name),
        )
    }
}

/// Reads from a sensor for good, or from a recording up to its end, which is told by a block marked last.
/// `told` hears how it stands after every read.
///
/// Frames before the first [`Hello`] are passed over: where their pixels lie is not known.
///
/// # Errors
///
/// When the bus fails or stays silent while a recording is played. A sensor may come back, so that it is waited
/// for, and its absence told.
pub async fn acquire<D: SpiDevice, R: Wait, M: RawMutex>(
    sensor: &mut SpiSensor<D, R>,
    pace: Pace,
    blocks: &mut Sender<'_, M, Block>,
    mut told: impl FnMut(&Acquired),
) -> Result<(), LinkError<D::Error>> {
    let mut session = Session::new(blocks, pace);
    let mut heard = Instant::now();
    let mut silent_reads = 0;
    let mut rested = Instant::now();
    loop {
        match sensor.read().await {
            Ok(()) => silent_reads += 1,
            Err(error) if pace.is_endless() => session.failed(&error),
            Err(error) => return Err(error),
        }
        while let Some(frame) = sensor.next_frame() {
            heard = Instant::now();
            silent_reads = 0;
            session.take(&frame).await;
        }
        if session.ended || (!pace.is_endless() && silent_reads > SILENT_READS) {
            session.outlet.close().await;
            told(&session.acquired);
            return Ok(());
        }
        if silent_reads > 0 && pace.is_endless() {
            if heard.elapsed() > SILENCE {
                session.acquired.sensor = None;
            }
            Timer::after(PAUSE).await;
        } else if pace.is_endless() && rested.elapsed() > PAUSE {
            // However much comes, those below get their share: the bridge drops what is not fetched, and counts it.
            Timer::after(PAUSE / SHARE).await;
            rested = Instant::now();
        }
        told(&session.acquired);
    }
}

/// What is known of the sensor, and where its events go.
struct Session<'o, 'b, M: RawMutex> {
    outlet: Outlet<'o, 'b, M>,
    pace: Pace,
    acquired: Acquired,
    /// What the sensor said last that it is, even if it is silent now.
    hello: Option<Hello>,
    /// Our time and the recording's at its first frame.
    origin: Option<(Instant, u64)>,
    /// Whether a recording has come to its end.
    ended: bool,
}

impl<'o, 'b, M: RawMutex> Session<'o, 'b, M> {
    const fn new(blocks: &'o mut Sender<'b, M, Block>, pace: Pace) -> Self {
        Self {
            outlet: Outlet::new(blocks, pace.can_wait()),
            pace,
            acquired: Acquired::NONE,
            hello: None,
            origin: None,
            ended: false,
        }
    }

    fn failed<E>(&mut self, error: &LinkError<E>) {
        self.acquired.sensor = None;
        if !matches!(error, LinkError::Silent) {
            self.acquired.bus_errors = self.acquired.bus_errors.saturating_add(1);
        }
    }

    async fn take(&mut self, frame: &Frame<'_>) {
        if frame.header.kind == Kind::Hello {
            self.hello = Hello::parse(frame.payload);
        }
        let Some(hello) = self.hello else { return };
        self.acquired.sensor = Some(hello);
        self.acquired.latest_us = frame.header.t_us;
        self.outlet.lost += self.acquired.account.frame(frame);
        match frame.header.kind {
            Kind::Hello => {}
            Kind::End if self.pace.is_endless() => {
                self.acquired.sensor = None;
                self.origin = None;
            }
            Kind::End => self.ended = true,
            Kind::Evt2 | Kind::Evt3 => {
                self.keep_pace(frame.header.t_us).await;
                let events = self.outlet.deliver(Words::new(frame), hello.geometry).await;
                self.acquired.account.events(events);
                self.acquired.thinned = self.outlet.delivered.thinned;
                self.acquired.overrun = self.outlet.delivered.overrun;
            }
        }
    }

    /// Waits until a recording that is played as fast as it was recorded has come to this time.
    async fn keep_pace(&mut self, t_us: u64) {
        if self.pace.is_timed() {
            let (start, first_us) = *self.origin.get_or_insert_with(|| (Instant::now(), t_us));
            let due = start.checked_add(Duration::from_micros(t_us.saturating_sub(first_us)));
            let due = due.unwrap_or(Instant::MAX);
            if due.saturating_duration_since(Instant::now()) > AHEAD {
                Timer::at(due).await;
            }
        }
    }
}
