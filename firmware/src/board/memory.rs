//! The device's large variables, each taken once.

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::zerocopy_channel::{Channel, Receiver, Sender};
use evtach_core::limits::{DEVICE_EVENTS, DEVICE_HEAT_CELLS};
use evtach_core::{Geometry, Memory, Settings, StoredEvent, Tachometer, Work};
use evtach_firmware::intake::{BLOCKS, Block};
use static_cell::{ConstStaticCell, StaticCell};

/// How tasks of different priority keep out of each other's way.
pub type Mutex = CriticalSectionRawMutex;

static BUFFERS: ConstStaticCell<[Block; BLOCKS]> =
    ConstStaticCell::new([const { Block::EMPTY }; BLOCKS]);
static CHANNEL: StaticCell<Channel<'_, Mutex, Block>> = StaticCell::new();
/// The store, or, where nothing can be measured, what a board makes of it.
pub static STORE: ConstStaticCell<[StoredEvent; DEVICE_EVENTS]> =
    ConstStaticCell::new([StoredEvent::EMPTY; DEVICE_EVENTS]);
static HEAT: ConstStaticCell<[u16; DEVICE_HEAT_CELLS]> =
    ConstStaticCell::new([0; DEVICE_HEAT_CELLS]);
static WEIGHTS: ConstStaticCell<[u8; DEVICE_HEAT_CELLS]> =
    ConstStaticCell::new([0; DEVICE_HEAT_CELLS]);
static WORK: ConstStaticCell<Work> = ConstStaticCell::new(Work::EMPTY);
static TACHOMETER: StaticCell<Tachometer<'_>> = StaticCell::new();

/// Bytes of the tachometer, with what it works in.
pub const TACHOMETER_BYTES: usize = size_of::<Tachometer<'_>>() + size_of::<Work>();

/// Bytes of the event store.
pub const STORE_BYTES: usize = size_of::<[StoredEvent; DEVICE_EVENTS]>();

/// Bytes of the heat map and its weights.
pub const HEAT_BYTES: usize =
    size_of::<[u16; DEVICE_HEAT_CELLS]>() + size_of::<[u8; DEVICE_HEAT_CELLS]>();

// What the core may take of the 320 KB: the rest is for screen, links and stack.
const _: () = {
    assert!(TACHOMETER_BYTES + HEAT_BYTES <= 96 * 1024);
    assert!(STORE_BYTES <= 128 * 1024);
};

/// The tachometer over the device's memory.
///
/// A function of its own, because parts of it are built on the stack first, and `main` never gives
/// back what its frame takes.
#[inline(never)]
pub fn tachometer() -> &'static mut Tachometer<'static> {
    let memory = Memory {
        events: STORE.take(),
        heat: HEAT.take(),
        weights: WEIGHTS.take(),
        work: WORK.take(),
        more: None,
    };
    // The first block tells the sensor's size, and the tachometer is set to it.
    let size = Geometry { width_px: 320, height_px: 320 };
    TACHOMETER.init_with(|| Tachometer::new(Settings::new(size), memory))
}

/// The two ends of the channel of blocks.
pub fn blocks() -> (Sender<'static, Mutex, Block>, Receiver<'static, Mutex, Block>) {
    CHANNEL.init(Channel::new(BUFFERS.take())).split()
}
