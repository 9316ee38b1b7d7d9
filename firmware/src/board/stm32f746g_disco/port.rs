//! The full-speed USB port as a serial port: to a PC the board is a modem (CDC-ACM) that speaks SCPI.

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt as _, Priority};
use embassy_stm32::{bind_interrupts, pac, peripherals, usb};
use embassy_time::{Duration, with_timeout};
use embassy_usb::class::cdc_acm::{CdcAcmClass, Receiver, Sender, State};
use embassy_usb::{Builder, Config, UsbDevice};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use static_cell::{ConstStaticCell, StaticCell};

use crate::wiring::PortPins;

bind_interrupts!(struct Irqs {
    OTG_FS => usb::InterruptHandler<peripherals::USB_OTG_FS>;
});

type Driver = usb::Driver<'static, peripherals::USB_OTG_FS>;

/// Numbers for tests and for what is not sold, by https://pid.codes/1209/0001.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

/// Largest packet at full speed.
const PACKET_BYTES: usize = 64;

/// How long a PC may take to fetch a packet. One that takes longer has stopped listening, and is not waited for: the
/// link must show that it is alive.
const PATIENCE: Duration = Duration::from_millis(500);

/// Makes the device that a PC sees, to be run for good, and its port.
pub fn start(pins: PortPins, serial: &'static str) -> (UsbDevice<'static, Driver>, Port) {
    static PACKETS: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);
    static CONFIGURATION: ConstStaticCell<[u8; 128]> = ConstStaticCell::new([0; 128]);
    static CAPABILITIES: ConstStaticCell<[u8; 32]> = ConstStaticCell::new([0; 32]);
    static CONTROL: ConstStaticCell<[u8; 64]> = ConstStaticCell::new([0; 64]);
    static STATE: StaticCell<State<'_>> = StaticCell::new();
    // The board does not feed what is a PC here. A pin that is let go floats.
    core::mem::forget(Output::new(pins.feed, Level::High, Speed::Low));
    interrupt::OTG_FS.set_priority(Priority::P5);
    let mut config = usb::Config::default();
    // The wire that would tell of the PC's power leads to a pin that the core does not look at.
    config.vbus_detection = false;
    let driver = usb::Driver::new_fs(pins.usb, Irqs, pins.plus, pins.minus, PACKETS.take(), config);
    let mut config = Config::new(VENDOR, PRODUCT);
    config.manufacturer = Some("EV-Tach");
    config.product = Some("EV-Tach tachometer");
    config.serial_number = Some(serial);
    config.self_powered = true;
    config.max_power = 100;
    let mut builder = Builder::new(
        driver,
        config,
        CONFIGURATION.take(),
        CAPABILITIES.take(),
        &mut [],
        CONTROL.take(),
    );
    let class = CdcAcmClass::new(&mut builder, STATE.init(State::new()), PACKET_BYTES as u16);
    let (sender, receiver) = class.split();
    let port = Port { sender, receiver, packet: [0; PACKET_BYTES], rest: 0..0 };
    (builder.build(), port)
}

/// The serial port that a PC opens.
pub struct Port {
    sender: Sender<'static, Driver>,
    receiver: Receiver<'static, Driver>,
    packet: [u8; PACKET_BYTES],
    /// What of the packet has not been read yet.
    rest: core::ops::Range<usize>,
}

/// The endpoint of the data to the PC, as [`CdcAcmClass`] is given it: the second behind control, after its notifications.
const DATA_IN: usize = 2;

/// Takes back a packet that nobody fetches: it keeps the endpoint taken, over a reset of the bus as well, for whoever opens the port
/// next (ST RM0385, "IN endpoint disable").
fn give_up() {
    let core = pac::USB_OTG_FS;
    core.diepctl(DATA_IN).modify(|w| {
        w.set_snak(true);
        w.set_epdis(true);
    });
    core.grstctl().write(|w| {
        w.set_txfflsh(true);
        w.set_txfnum(DATA_IN as u8);
    });
}

/// Nobody listens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no program listens at the USB port: open it")]
pub struct NotHeard;

impl embedded_io_async::Error for NotHeard {
    fn kind(&self) -> ErrorKind {
        ErrorKind::NotConnected
    }
}

impl ErrorType for Port {
    type Error = NotHeard;
}

impl Read for Port {
    /// May be dropped while it waits: a packet is taken whole or not at all.
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, NotHeard> {
        while self.rest.is_empty() {
            match self.receiver.read_packet(&mut self.packet).await {
                Ok(count) => self.rest = 0..count,
                Err(_) => self.receiver.wait_connection().await,
            }
        }
        let count = self.rest.len().min(bytes.len());
        let end = self.rest.start + count;
        bytes[..count].copy_from_slice(&self.packet[self.rest.start..end]);
        self.rest.start = end;
        Ok(count)
    }
}

impl Write for Port {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, NotHeard> {
        // A packet that is not full ends a transfer, so that no empty one is needed.
        let count = bytes.len().min(PACKET_BYTES - 1);
        if !self.sender.dtr() {
            return Err(NotHeard);
        }
        match with_timeout(PATIENCE, self.sender.write_packet(&bytes[..count])).await {
            Ok(Ok(())) => Ok(count),
            _ => {
                give_up();
                Err(NotHeard)
            }
        }
    }

    async fn flush(&mut self) -> Result<(), NotHeard> {
        Ok(())
    }
}
