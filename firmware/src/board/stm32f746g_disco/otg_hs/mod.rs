//! The high-speed USB host port: a driver of its own for the chip's DesignWare OTG core with its internal DMA, behind the
//! host traits of `embassy-usb-driver`.
//!
//! The published driver moves data by the processor, one interrupt for each answer: a camera that has nothing to say
//! answers a million times a second. Here the core asks again by itself, and interrupts once for each transfer of
//! up to four packets; while one is handled the next are under way. ARCHITECTURE.md, "USB host", has the figures.
//!
//! Only what cameras need: control and bulk transfers, no hubs. The order of registers is that of ST RM0385, chapter 32, and of
//! the driver of Linux for the same core.
#![expect(unsafe_code, reason = "registers, and memory that the core reads and writes by itself")]

mod channel;
mod host;
mod memory;
mod phy;
mod pipe;
mod port;
mod registers;
mod ring;

pub use host::Host;
pub use phy::start;

use critical_section::Mutex;
use embassy_sync::waitqueue::AtomicWaker;

use channel::Channel;
use memory::CHANNELS;
use port::Port;
use ring::Ring;

/// All that interrupts and tasks share.
struct State {
    port: Port,
    channels: [Channel; CHANNELS],
    ring: Ring,
}

static STATE: Mutex<core::cell::RefCell<State>> = Mutex::new(core::cell::RefCell::new(State {
    port: Port::OFF,
    channels: [const { Channel::FREE }; CHANNELS],
    ring: Ring::FREE,
}));

/// Woken when something happens to the port, to a channel.
static PORT_WAKER: AtomicWaker = AtomicWaker::new();
static CHANNEL_WAKERS: [AtomicWaker; CHANNELS] = [const { AtomicWaker::new() }; CHANNELS];

/// Works on the shared state, while no interrupt does.
fn with<T>(work: impl FnOnce(&mut State) -> T) -> T {
    critical_section::with(|section| work(&mut STATE.borrow_ref_mut(section)))
}

/// To be called by the core's interrupt.
pub fn on_interrupt() {
    with(|state| {
        let pending = registers::OTG.gintsts().read();
        let State { port, channels, ring } = state;
        if pending.hprtint() || pending.discint() {
            registers::OTG.gintsts().write(|w| w.set_discint(pending.discint()));
            if port.on_interrupt(pending.discint()) {
                channels.iter_mut().for_each(Channel::lose);
                ring.lose();
                CHANNEL_WAKERS.iter().for_each(AtomicWaker::wake);
            }
            PORT_WAKER.wake();
        }
        if pending.hcint() {
            let halted = registers::OTG.haint().read().haint();
            for (index, (channel, waker)) in channels.iter_mut().zip(&CHANNEL_WAKERS).enumerate() {
                if halted & 1 << index != 0 && channel.on_interrupt(index, ring) {
                    waker.wake();
                }
            }
        }
    });
}
