//! Pipes: transfers of one endpoint, one after another.

use core::future::poll_fn;
use core::marker::PhantomData;
use core::ptr;
use core::task::Poll;

use embassy_time::{Duration, with_timeout};
use embassy_usb_driver::host::{PipeError, TimeoutConfig, UsbPipe, pipe};

use super::channel::{self, Channel, Ended, Endpoint, Transfer};
use super::memory::{self, BUFFER_BYTES};
use super::registers::{DATA0, DATA1, SETUP};
use super::ring::{Ring, Waiting};
use super::{CHANNEL_WAKERS, State, with};

/// A pipe; dropped, it gives its channel back.
pub struct Pipe<T, D> {
    index: usize,
    endpoint: Endpoint,
    /// Packet identifier of the next packet that is sent.
    pid: u8,
    timeout: TimeoutConfig,
    kind: PhantomData<(T, D)>,
}

impl<T: pipe::Type, D: pipe::Direction> Pipe<T, D> {
    /// A pipe on a channel that has been taken for it.
    pub fn new(index: usize, endpoint: Endpoint) -> Self {
        Self { index, endpoint, pid: DATA0, timeout: TimeoutConfig::default(), kind: PhantomData }
    }
}

impl<T, D> Pipe<T, D> {
    /// One transfer through the channel's own buffer.
    async fn transfer(&mut self, is_in: bool, pid: u8, bytes: usize) -> Result<Ended, PipeError> {
        // A transfer that was given up half-way is stopped first.
        let underway = Underway { index: self.index };
        let address = memory::address(memory::buffer(self.index));
        let transfer =
            Transfer { endpoint: self.endpoint, is_in, pid, address, bytes: bytes as u32 };
        with(|State { port, channels, .. }| {
            if port.enabled.is_none() {
                return Err(PipeError::Disconnected);
            }
            channels[self.index].start(self.index, transfer);
            Ok(())
        })?;
        let ended = poll_fn(|context| {
            CHANNEL_WAKERS[self.index].register(context.waker());
            with(|state| state.channels[self.index].take_end()).map_or(Poll::Pending, Poll::Ready)
        })
        .await;
        drop(underway);
        ended.error.map_or(Ok(ended), Err)
    }

    /// A stage that sends, packet by packet.
    async fn send(&mut self, mut pid: u8, bytes: &[u8]) -> Result<u8, PipeError> {
        let packet_bytes = usize::from(self.endpoint.packet_bytes);
        // An empty stage is one empty packet.
        let packets = bytes.len().div_ceil(packet_bytes).max(1);
        for packet in 0..packets {
            let rest = bytes.get(packet * packet_bytes..).unwrap_or_default();
            let now = rest.get(..packet_bytes).unwrap_or(rest);
            // SAFETY: the channel is idle, so that its buffer is ours; a packet fits, as `alloc_pipe` has seen to.
            unsafe {
                ptr::copy_nonoverlapping(now.as_ptr(), memory::buffer(self.index), now.len());
            }
            pid = self.transfer(false, pid, now.len()).await?.pid;
        }
        Ok(pid)
    }

    /// A stage that receives, packet by packet, up to a short one.
    async fn receive(&mut self, mut pid: u8, bytes: &mut [u8]) -> Result<(usize, u8), PipeError> {
        let packet_bytes = usize::from(self.endpoint.packet_bytes);
        let mut received = 0;
        loop {
            // The core writes whole packets.
            let ended = self.transfer(true, pid, packet_bytes).await?;
            pid = ended.pid;
            let came = ended.bytes as usize;
            let room = bytes.get_mut(received..).unwrap_or_default();
            let fits = came.min(room.len());
            // SAFETY: the channel is idle again, so that its buffer is ours, and the core has written so many bytes.
            unsafe {
                ptr::copy_nonoverlapping(memory::buffer(self.index), room.as_mut_ptr(), fits);
            }
            received += fits;
            if fits < came {
                return Err(PipeError::BufferOverflow);
            }
            if came < packet_bytes || received == bytes.len() {
                return Ok((received, pid));
            }
        }
    }

    async fn setup(&mut self, setup: &[u8; 8]) -> Result<(), PipeError> {
        // SAFETY: as in `send`.
        unsafe {
            ptr::copy_nonoverlapping(setup.as_ptr(), memory::buffer(self.index), setup.len())
        };
        self.transfer(false, SETUP, setup.len()).await?;
        Ok(())
    }

    /// The state of a control transfer without data, or behind its data, is told against the direction of the data.
    async fn acknowledge(&mut self, is_in: bool) -> Result<(), PipeError> {
        if is_in {
            self.receive(DATA1, &mut []).await.map(drop)
        } else {
            self.send(DATA1, &[]).await.map(drop)
        }
    }

    const fn limit(&self, has_data: bool) -> core::time::Duration {
        if has_data { self.timeout.data_timeout } else { self.timeout.no_data_timeout }
    }
}

/// A transfer under way: dropped before its end, the core is stopped.
struct Underway {
    index: usize,
}

impl Drop for Underway {
    fn drop(&mut self) {
        if with(|state| state.channels[self.index].is_busy()) {
            channel::halt(self.index);
            with(|state| state.channels[self.index].forget());
        }
    }
}

/// Ends what takes too long.
async fn within<T>(
    limit: core::time::Duration,
    work: impl Future<Output = Result<T, PipeError>>,
) -> Result<T, PipeError> {
    let limit = Duration::from_micros(limit.as_micros() as u64);
    with_timeout(limit, work).await.unwrap_or(Err(PipeError::Timeout))
}

impl<T: pipe::Type, D: pipe::Direction> UsbPipe<T, D> for Pipe<T, D> {
    async fn control_in(&mut self, setup: &[u8; 8], buf: &mut [u8]) -> Result<usize, PipeError>
    where
        T: pipe::IsControl,
        D: pipe::IsIn,
    {
        let has_data = !buf.is_empty();
        within(self.limit(has_data), async {
            self.setup(setup).await?;
            let received = if has_data { self.receive(DATA1, buf).await?.0 } else { 0 };
            self.acknowledge(false).await?;
            Ok(received)
        })
        .await
    }

    async fn control_out(&mut self, setup: &[u8; 8], buf: &[u8]) -> Result<(), PipeError>
    where
        T: pipe::IsControl,
        D: pipe::IsOut,
    {
        let has_data = !buf.is_empty();
        within(self.limit(has_data), async {
            self.setup(setup).await?;
            if has_data {
                self.send(DATA1, buf).await?;
            }
            self.acknowledge(true).await
        })
        .await
    }

    /// Fetches what has come in since, one transfer at most. Dropped before its end, it loses nothing: what comes
    /// in meanwhile waits for the next call.
    async fn request_in(&mut self, buf: &mut [u8]) -> Result<usize, PipeError>
    where
        D: pipe::IsIn,
    {
        let index = self.index;
        let (from, bytes) = poll_fn(|context| {
            CHANNEL_WAKERS[index].register(context.waker());
            with(|State { port, channels, ring }| match ring.waiting() {
                Waiting::Bytes(from, bytes) => Poll::Ready(Ok((from, bytes))),
                Waiting::Error(error) => Poll::Ready(Err(error)),
                Waiting::Nothing if port.enabled.is_none() => {
                    Poll::Ready(Err(PipeError::Disconnected))
                }
                Waiting::Nothing => {
                    go_on(&mut channels[index], index, ring);
                    Poll::Pending
                }
            })
        })
        .await?;
        let bytes = bytes.min(buf.len());
        // SAFETY: the slot is ours until we say that we took it.
        unsafe { ptr::copy_nonoverlapping(from, buf.as_mut_ptr(), bytes) };
        with(|State { port, channels, ring }| {
            ring.took(bytes);
            if port.enabled.is_some() {
                go_on(&mut channels[index], index, ring);
            }
        });
        Ok(bytes)
    }

    async fn request_out(
        &mut self,
        buf: &[u8],
        ensure_transaction_end: bool,
    ) -> Result<(), PipeError>
    where
        D: pipe::IsOut,
    {
        let whole = usize::from(self.endpoint.packet_bytes);
        self.pid = self.send(self.pid, buf).await?;
        if ensure_transaction_end && !buf.is_empty() && buf.len().is_multiple_of(whole) {
            self.pid = self.send(self.pid, &[]).await?;
        }
        Ok(())
    }

    fn set_timeout(&mut self, timeout: TimeoutConfig)
    where
        T: pipe::IsControl,
    {
        self.timeout = timeout;
    }

    fn reset_data_toggle(&mut self)
    where
        T: pipe::IsBulkOrInterrupt,
    {
        self.pid = DATA0;
        if D::is_in() {
            // What is under way has the other one.
            drop(Underway { index: self.index });
            with(|state| state.ring.reset_toggle());
        }
    }
}

/// Fills the next slot, if there is one and the channel has nothing to do.
fn go_on(channel: &mut Channel, index: usize, ring: &Ring) {
    if !channel.is_busy()
        && let Some(transfer) = ring.next()
    {
        channel.start(index, transfer);
    }
}

impl<T, D> Drop for Pipe<T, D> {
    fn drop(&mut self) {
        channel::halt(self.index);
        with(|State { channels, ring, .. }| {
            if channels[self.index].fills_ring {
                *ring = Ring::FREE;
            }
            channels[self.index] = Channel::FREE;
        });
    }
}

/// Whether a channel's buffer holds such packets.
pub const fn fits(packet_bytes: u16) -> bool {
    packet_bytes > 0 && packet_bytes as usize <= BUFFER_BYTES
}
