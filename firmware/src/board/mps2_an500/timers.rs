//! Time for embassy, from the board's CMSDK timers.
//!
//! The dual timer runs through 32 bits at 25 MHz and counts its wraps by interrupt; timer 0 rings
//! when the next task is due. Arm "Cortex-M System Design Kit" TRM, chapter 4; addresses and interrupts
//! from Arm's application note AN500.
#![expect(unsafe_code, reason = "the vector table's link to its handlers")]

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Waker;

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::{Driver, time_driver_impl};
use embassy_time_queue_utils::Queue;
use evtach_firmware::cost::Clock;

/// Timer ticks in a microsecond: the board's 25 MHz.
const TICKS_PER_US: u64 = 25;

/// Timer 0: counts down once and rings.
mod alarm {
    use crate::register::Register;

    pub const CONTROL: Register = Register(0x4000_0000);
    pub const VALUE: Register = Register(0x4000_0004);
    pub const RELOAD: Register = Register(0x4000_0008);
    pub const CLEAR: Register = Register(0x4000_000C);
    /// Counter and its interrupt on.
    pub const ON: u32 = 1 << 3 | 1;
    pub const OFF: u32 = 0;
}

/// First half of the dual timer: runs freely, downwards.
mod counter {
    use crate::register::Register;

    pub const LOAD: Register = Register(0x4000_2000);
    pub const VALUE: Register = Register(0x4000_2004);
    pub const CONTROL: Register = Register(0x4000_2008);
    pub const CLEAR: Register = Register(0x4000_200C);
    pub const WRAPPED: Register = Register(0x4000_2010);
    /// On, periodic, interrupt, 32 bits.
    pub const ON: u32 = 1 << 7 | 1 << 6 | 1 << 5 | 1 << 1;
}

/// The board's interrupts that are in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Irq {
    /// UART 0 has received a byte.
    Receive = 0,
    /// Timer 0.
    Alarm = 8,
    /// Dual timer.
    Counter = 10,
    /// A pin's interrupt that nothing is wired to: runs screen and link, by software.
    Front = 29,
    /// Another of them: runs the measurement.
    Measure = 30,
    /// Another: reads the sensor.
    Acquire = 31,
}

// SAFETY: the numbers are those of the board's vector table.
unsafe impl InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

impl Irq {
    /// The interrupt of this number, when it is one of these.
    pub fn from_number(number: i16) -> Option<Self> {
        [Self::Receive, Self::Alarm, Self::Counter, Self::Front, Self::Measure, Self::Acquire]
            .into_iter()
            .find(|irq| *irq as i16 == number)
    }

    /// Lower is more urgent: time, then acquiring, screen and link, measuring.
    pub fn set_priority(self, nvic: &mut NVIC, priority: u8) {
        // SAFETY: no critical section here rests on a priority; they all mask every interrupt.
        unsafe { nvic.set_priority(self, priority) }
    }
}

struct Timers {
    wraps: AtomicU32,
    queue: Mutex<RefCell<Queue>>,
}

time_driver_impl!(static TIMERS: Timers = Timers {
    wraps: AtomicU32::new(0),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

/// Starts the clock.
pub fn start(nvic: &mut NVIC) {
    counter::LOAD.write(u32::MAX);
    counter::CONTROL.write(counter::ON);
    for irq in [Irq::Alarm, Irq::Counter] {
        irq.set_priority(nvic, 0x40);
        // SAFETY: the handlers only touch what a critical section guards.
        unsafe { NVIC::unmask(irq) }
    }
}

/// Serves [`Irq::Alarm`].
pub fn on_alarm() {
    critical_section::with(|cs| {
        alarm::CLEAR.write(1);
        TIMERS.ring(cs);
    });
}

/// Serves [`Irq::Counter`].
pub fn on_wrap() {
    critical_section::with(|_| {
        counter::CLEAR.write(1);
        TIMERS.wraps.fetch_add(1, Ordering::Relaxed);
    });
}

/// Counts the board's timer ticks. With QEMU's `-icount shift=N` one is 40 / 2^N instructions.
#[derive(Debug)]
pub struct Ticks;

impl Clock for Ticks {
    fn ticks(&self) -> u64 {
        critical_section::with(|_| {
            let mut wraps = TIMERS.wraps.load(Ordering::Relaxed);
            let mut low = !counter::VALUE.read();
            if counter::WRAPPED.read() & 1 != 0 {
                // It has wrapped, and the interrupt still waits for this critical section to end.
                wraps = wraps.wrapping_add(1);
                low = !counter::VALUE.read();
            }
            u64::from(wraps) << 32 | u64::from(low)
        })
    }
}

/// Microseconds in ticks, by 32-bit divisions by a constant, which are multiplications: one of 64 bits is a loop, and the time is
/// asked for many times in a wait.
const fn micros(ticks: u64) -> u64 {
    const DIVISOR: u32 = TICKS_PER_US as u32;
    /// Quotient and remainder of 2^32.
    const QUOTIENT: u32 = ((1_u64 << 32) / TICKS_PER_US) as u32;
    const REMAINDER: u32 = ((1_u64 << 32) % TICKS_PER_US) as u32;
    let (high, low) = ((ticks >> 32) as u32, ticks as u32);
    let carried = high % DIVISOR;
    let rest = (carried * REMAINDER + low % DIVISOR) / DIVISOR;
    let low_part = (carried * QUOTIENT) as u64 + (low / DIVISOR + rest) as u64;
    (((high / DIVISOR) as u64) << 32) + low_part
}

const _: () = {
    assert!(micros(u64::MAX) == u64::MAX / TICKS_PER_US);
    assert!(micros(0x12_3456_789a_bcde) == 0x12_3456_789a_bcde / TICKS_PER_US);
    assert!(micros((25 << 32) - 1) == ((25 << 32) - 1) / TICKS_PER_US);
};

impl Timers {
    /// Wakes every task that is due, and sets the alarm for the next.
    fn ring(&self, cs: CriticalSection<'_>) {
        let mut queue = self.queue.borrow_ref_mut(cs);
        loop {
            let next = queue.next_expiration(self.now());
            if next == u64::MAX {
                return alarm::CONTROL.write(alarm::OFF);
            }
            if let Some(wait_us @ 1..) = next.checked_sub(self.now()) {
                let ticks = u32::try_from(wait_us * TICKS_PER_US).unwrap_or(u32::MAX);
                alarm::CONTROL.write(alarm::OFF);
                alarm::RELOAD.write(ticks);
                alarm::VALUE.write(ticks);
                alarm::CLEAR.write(1);
                return alarm::CONTROL.write(alarm::ON);
            }
        }
    }
}

impl Driver for Timers {
    fn now(&self) -> u64 {
        micros(Ticks.ticks())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            if self.queue.borrow_ref_mut(cs).schedule_wake(at, waker) {
                self.ring(cs);
            }
        });
    }
}
