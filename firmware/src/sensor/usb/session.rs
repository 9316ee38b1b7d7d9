//! A session with one camera: reading it until it goes.

use embassy_futures::select::{Either3, select3};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embassy_usb_driver::host::{DeviceEvent, PipeError, UsbHostController, UsbPipe, pipe};
use embassy_usb_host::{BusController, BusHandle};

use super::account::Acquired;
use super::found::{COLUMNS, DROPPED, Found, Reached, find, start};
use super::limit::{Governor, Limit};
use super::stream::Stream;
use super::trouble::{End, Trouble};
use crate::sensor::outlet::Outlet;

/// How long nothing may come from a camera before it is asked whether it is there.
pub(super) const SILENCE: Duration = Duration::from_millis(500);

/// Bytes that are asked for at once: four packets at high speed, so that there is one wake for a thousand events.
pub(super) const TRANSFER_BYTES: usize = 2048;

/// Times in a row that data may stop, or come damaged, before it is given up.
const PATIENCE: u32 = 5;

/// Time for a port to say that its device has gone, after a transfer that failed.
const PORT: Duration = Duration::from_millis(20);

/// However much comes, acquiring rests once in such a time, for so much of it: a fifth in all.
const WORK: Duration = Duration::from_millis(1);
const SHARE: u32 = 4;

/// What goes on beside the camera itself.
pub(super) struct Surroundings<'s, 'o, 'b, M: RawMutex, T> {
    pub outlet: &'s mut Outlet<'o, 'b, M>,
    pub acquired: &'s mut Acquired,
    pub told: &'s mut T,
    /// Events a second that the instrument can use.
    pub most_ev_s: u32,
    /// Bytes of one transfer.
    pub buffer: &'s mut [u8; TRANSFER_BYTES],
}

impl<M: RawMutex, T: FnMut(&Acquired)> Surroundings<'_, '_, '_, M, T> {
    fn tell(&mut self) {
        self.acquired.delivered = self.outlet.delivered;
        (self.told)(self.acquired);
    }
}

/// Talks to what was enumerated until it goes, or will not do.
pub(super) async fn run<'d, H, M, T>(
    port: &mut BusController<'d, H>,
    bus: &BusHandle<'d, H::Allocator>,
    reached: Reached<'_>,
    around: &mut Surroundings<'_, '_, '_, M, T>,
) -> End
where
    H: UsbHostController<'d>,
    M: RawMutex,
    T: FnMut(&Acquired),
{
    let mut found = match find(bus, &reached).await {
        Ok(found) => found,
        Err(end) => return end,
    };
    if let Err(end) = start(&mut found).await {
        return end;
    }
    let before_us = (around.acquired.sessions > 0).then_some(around.acquired.latest_us);
    let stream = Stream::new(found.camera.model, found.mounting, before_us);
    around.acquired.sessions = around.acquired.sessions.saturating_add(1);
    around.acquired.camera = Some(found.camera);
    around.acquired.trouble = None;
    around.acquired.limit = Limit::NONE;
    let before = arrived(around.outlet, around.acquired);
    let governor = Governor::new(&found.abilities, around.most_ev_s, before);
    let mut reading = Reading { found, stream, governor };
    let end = reading.read(port, around).await;
    around.acquired.camera = None;
    around.acquired.limit = Limit::NONE;
    end
}

/// A camera that sends.
struct Reading<C, D> {
    found: Found<C, D>,
    stream: Stream,
    governor: Governor,
}

impl<C, D> Reading<C, D>
where
    C: UsbPipe<pipe::Control, pipe::InOut>,
    D: UsbPipe<pipe::Bulk, pipe::In>,
{
    async fn read<'d, H, M, T>(
        &mut self,
        port: &mut BusController<'d, H>,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> End
    where
        H: UsbHostController<'d>,
        M: RawMutex,
        T: FnMut(&Acquired),
    {
        let mut failures = 0;
        let mut rested = Instant::now();
        loop {
            around.tell();
            let reading = self.found.data.request_in(&mut around.buffer[..]);
            let event = port.wait_for_device_event();
            let outcome = match select3(reading, event, Timer::after(SILENCE)).await {
                Either3::First(Ok(bytes)) => {
                    failures = 0;
                    let outcome = self.take(bytes, around).await;
                    if rested.elapsed() >= WORK {
                        // The camera's FIFO waits, and counts what it drops.
                        Timer::after(WORK / SHARE).await;
                        rested = Instant::now();
                    }
                    outcome
                }
                Either3::First(Err(error)) => {
                    failures += 1;
                    self.mend(error, failures, port, around).await
                }
                Either3::Second(event) => match after(event) {
                    Some(end) => Err(end),
                    None => Ok(()),
                },
                // A register that answers: the camera is there, and has nothing to say.
                Either3::Third(()) => match self.found.registers.read(COLUMNS).await {
                    Ok(_) => Ok(()),
                    Err(PipeError::Disconnected) => Err(End::Gone),
                    Err(_) => Err(End::Trouble(Trouble::NoAnswer)),
                },
            };
            if let Err(end) = outcome {
                around.acquired.delivered = around.outlet.delivered;
                return end;
            }
        }
    }

    /// Takes in a transfer of so many bytes.
    async fn take<M: RawMutex, T>(
        &mut self,
        bytes: usize,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End> {
        let Surroundings { outlet, acquired, buffer, .. } = around;
        let bytes = buffer.get(..bytes).unwrap_or_default();
        let before = self.damage();
        let words = self.stream.words(bytes);
        let events = outlet.deliver(words, self.found.camera.geometry).await;
        acquired.latest_us = self.stream.reached_us();
        if acquired.limit.skips {
            acquired.thinned_by_camera += u64::from(events);
        }
        let after = self.damage();
        acquired.damaged_words += after.0 - before.0;
        acquired.clock_resets += after.1 - before.1;
        self.look_after(around).await
    }

    fn damage(&self) -> (u64, u32) {
        (self.stream.unknown() + u64::from(self.stream.odd_bytes), self.stream.clock_resets)
    }

    /// Has the camera send fewer events, or more again, and asks what it lost.
    async fn look_after<M: RawMutex, T>(
        &mut self,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End> {
        let Surroundings { outlet, acquired, .. } = around;
        let now = Instant::now();
        if !self.governor.is_due(now) {
            return Ok(());
        }
        // Before the limit changes: what was dropped until now was dropped under the one before.
        if let Some(before) = self.found.dropped {
            let dropped =
                self.found.registers.read_counter(DROPPED).await.map_err(End::at(DROPPED))?;
            self.found.dropped = Some(dropped);
            // A counter that steps back began anew.
            let lost = dropped.checked_sub(before).unwrap_or(dropped);
            acquired.lost_by_camera += lost;
            outlet.lost += lost;
            if acquired.limit.skips {
                acquired.thinned_by_camera += lost;
            }
        }
        if let Some(limit) = self.governor.update(now, arrived(outlet, acquired)) {
            self.found.limit(&limit).await?;
            acquired.limit = limit;
        }
        Ok(())
    }

    /// After a transfer that failed: has the port lost its device? If not, is made to go on, so many times in a row.
    async fn mend<'d, H, M, T>(
        &mut self,
        error: PipeError,
        failures: u32,
        port: &mut BusController<'d, H>,
        around: &mut Surroundings<'_, '_, '_, M, T>,
    ) -> Result<(), End>
    where
        H: UsbHostController<'d>,
        M: RawMutex,
    {
        if error == PipeError::Stall {
            around.acquired.stalls = around.acquired.stalls.saturating_add(1);
            if failures > PATIENCE {
                return Err(Trouble::Stalled.into());
            }
            return self.found.clear_halt().await;
        }
        around.acquired.errors = around.acquired.errors.saturating_add(1);
        match with_timeout(PORT, port.wait_for_device_event()).await {
            Ok(event) => match after(event) {
                Some(end) => Err(end),
                None => Ok(()),
            },
            // The port says that its device is there; a reset may help.
            Err(_) if failures > PATIENCE && error == PipeError::Disconnected => {
                Err(Trouble::NoAnswer.into())
            }
            Err(_) if failures > PATIENCE => Err(Trouble::Damaged.into()),
            // The words before and after may not fit together: what is damaged is counted by the decoder.
            Err(_) => Ok(()),
        }
    }
}

/// Events that the camera had to send so far: those that came, and those that its FIFO had no room for.
const fn arrived<M: RawMutex>(outlet: &Outlet<'_, '_, M>, acquired: &Acquired) -> u64 {
    outlet.delivered.received.saturating_add(acquired.lost_by_camera)
}

/// What an event of the port means for a session.
pub(super) fn after(event: DeviceEvent) -> Option<End> {
    match event {
        DeviceEvent::Disconnected => Some(End::Gone),
        DeviceEvent::Connected(speed) => Some(End::Anew(speed)),
        DeviceEvent::Overcurrent => Some(End::Trouble(Trouble::Overcurrent)),
        _ => None,
    }
}
