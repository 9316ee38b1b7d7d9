//! Start-up orders, as data (facts: libcaer, "davis_common" and "dvxplorer"; neuromorphic-drivers).

use Module::{Aps, Chip, Dvs, Imu, Input, Mux, Usb};

use super::registers::{Module, Register};

/// Endpoint of the data.
pub(super) const DATA: u8 = 0x82;

/// A step of a start-up order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Registers of a module are written, each by its parameter.
    Write(Module, &'static [(u16, u32)]),
    /// A value of the chip that is longer than a byte: its most significant byte goes to the first of so many
    /// registers.
    Wide { address: u16, bytes: u8, value: u32 },
    /// A register is written only where another has this value.
    Where { asked: Register, is: u32, register: Register, value: u32 },
    /// The camera needs this time.
    WaitMs(u16),
    /// The halt of the data's endpoint is cleared.
    ClearHalt,
    /// Nothing is left out that a session before left out.
    Unlimited,
    /// What has been waiting for a millisecond is sent, even if it does not fill a packet: told in cycles of the
    /// camera's USB clock.
    EarlyPackets,
}

/// Everything off, so that a camera that was left running begins anew.
const STOP: [Step; 6] = [
    Step::Write(Dvs, &[(3, 0)]),
    Step::Write(Aps, &[(4, 0)]),
    Step::Write(Imu, &[(2, 0), (3, 0), (4, 0)]),
    Step::Write(Input, &[(0, 0), (11, 0)]),
    Step::Write(Mux, &[(0, 0), (1, 0)]),
    Step::Write(Usb, &[(0, 0)]),
];

/// Bits of a bias that is an enabled current of normal level, by the transistor it goes to, and of one that is off.
const N: u32 = 0b1111;
const P: u32 = 0b1101;
const N_OFF: u32 = 0b1110;

/// A bias current: about 11, 94, 756, 6054 pA and so on, each eight times the one before, by 255ths.
const fn bias(parameter: u16, kind: u32, coarse: u32, fine: u32) -> (u16, u32) {
    (parameter, kind | fine << 4 | coarse << 12)
}

/// A voltage of the frame's converter.
const fn voltage(parameter: u16, voltage: u32, current: u32) -> (u16, u32) {
    (parameter, voltage | current << 6)
}

/// The pixels' thresholds and speeds, and what the chip needs besides.
const DAVIS346_BIASES: [(u16, u32); 28] = [
    voltage(0, 27, 6),
    voltage(1, 21, 6),
    voltage(2, 32, 7),
    voltage(3, 1, 7),
    voltage(4, 21, 7),
    bias(8, N, 5, 164),     // local buffers
    bias(9, N_OFF, 7, 215), // pad followers
    bias(10, N, 4, 39),     // difference amplifier: with the next two, the thresholds
    bias(11, N, 5, 255),    // brighter
    bias(12, N, 4, 1),      // darker
    bias(13, N, 6, 144),    // pixel inverter
    bias(14, P, 2, 58),     // photoreceptor
    bias(15, P, 1, 16),     // its source follower
    bias(16, P, 4, 25),     // refractory period
    bias(17, P, 6, 20),     // read-out buffer
    bias(18, N, 6, 219),    // read-out source follower
    bias(19, P, 5, 20),     // comparator of the converter
    bias(20, N, 0, 1),      // column select
    bias(21, P, 6, 60),     // buffer of the converter
    bias(22, N, 5, 49),     // column time-out
    bias(23, N, 6, 91),     // pull-down of the event bus
    bias(24, P, 4, 80),     // pull-ups of the event bus
    bias(25, P, 7, 152),
    bias(26, N, 5, 255), // calibration neuron
    bias(27, N, 5, 255),
    bias(34, N, 5, 254),     // buffer of the biases
    (35, 1 << 4 | 33 << 10), // shifted sources
    (36, 1 << 4 | 33 << 10),
];

/// Multiplexers for tests off, calibration and test pixels held in reset, and the grey counter on.
const DAVIS346_CHIP: [(u16, u32); 15] = [
    (128, 0),
    (129, 0),
    (130, 0),
    (131, 0),
    (132, 0),
    (133, 0),
    (134, 0),
    (135, 0),
    (136, 1),
    (137, 0),
    (138, 1),
    (140, 0),
    (141, 0),
    (143, 1),
    (144, 0),
];

/// Which inertial sensor the camera has; 2 is one whose gyro has a filter of its own.
const IMU_TYPE: Register = Register::new(Imu, 0);

/// DAVIS346: events and the gyro, no frames.
pub(super) const DAVIS346: &[Step] = &[
    STOP[0],
    STOP[1],
    STOP[2],
    STOP[3],
    STOP[4],
    STOP[5],
    Step::Write(Mux, &[(3, 0)]),
    Step::WaitMs(100),
    Step::ClearHalt,
    Step::Write(Chip, &DAVIS346_BIASES),
    Step::Write(Chip, &DAVIS346_CHIP),
    Step::Unlimited,
    Step::WaitMs(10),
    Step::Write(Mux, &[(3, 1)]),
    Step::EarlyPackets,
    Step::WaitMs(200),
    Step::Write(Usb, &[(0, 1)]),
    // What finds no room in the camera's FIFO is dropped and counted there; its clock goes on.
    Step::Write(Mux, &[(5, 1), (4, 1), (1, 1), (0, 1)]),
    Step::WaitMs(50),
    Step::Write(Dvs, &[(4, 0), (5, 0), (3, 1)]),
    // A thousand samples a second, 500 degrees per second at most; only the gyro.
    Step::Write(Imu, &[(5, 0), (6, 1)]),
    Step::Where { asked: IMU_TYPE, is: 2, register: Register::new(Imu, 9), value: 1 },
    Step::Write(Imu, &[(10, 1), (3, 1)]),
];

/// MHz of the sensor's clock.
const DVXPLORER_MHZ: u32 = 50;

/// The chip's own run register: 0 off, 2 streaming.
const DVXPLORER_MODE: u16 = 0x3000;

/// DVXplorer: events and the gyro.
pub(super) const DVXPLORER: &[Step] = &[
    STOP[0],
    Step::Write(Chip, &[(DVXPLORER_MODE, 0)]),
    STOP[2],
    STOP[3],
    STOP[4],
    STOP[5],
    Step::Write(Mux, &[(3, 0)]),
    Step::WaitMs(100),
    Step::ClearHalt,
    Step::Write(Mux, &[(3, 1)]),
    Step::WaitMs(10),
    // Biases: trimming, pins, ranges and levels, then amplifier and the thresholds of brighter and darker.
    Step::Write(Chip, &[(0x0d, 0x24), (0x0f, 0), (0x10, 0), (0x13, 3), (0x14, 0x7f), (0x15, 0)]),
    Step::Write(Chip, &[(0x0b, 0), (0x0c, 0x14), (0x12, 0x6f), (0x18, 4), (0x1c, 8), (0x1e, 8)]),
    // Clock divider, parallel output, packets.
    Step::Write(Chip, &[(0x3011, 0xa0), (0x3019, 0), (0x301e, 1), (0x3067, 0x80)]),
    // Mode, boot; time stamps in microseconds.
    Step::Write(Chip, &[(0x3255, 0x0c), (0x3266, 8)]),
    Step::Wide { address: 0x3235, bytes: 2, value: 999 },
    Step::Write(Chip, &[(0x3234, DVXPLORER_MHZ - 1), (0x323d, DVXPLORER_MHZ)]),
    // Timing of the read-out.
    Step::Write(Chip, &[(0x3243, DVXPLORER_MHZ), (0x3247, DVXPLORER_MHZ), (0x3259, DVXPLORER_MHZ)]),
    Step::Wide { address: 0x3244, bytes: 3, value: 0 },
    Step::Wide { address: 0x3256, bytes: 3, value: 1 },
    Step::Write(Chip, &[(0x323c, 4), (0x324c, 6), (0x324e, 4), (0x324f, 6)]),
    Step::Write(Chip, &[(0x3253, 8), (0x3254, 10), (0x324b, 4)]),
    // No decision on activity, no histogram, no trigger, no global reset, no binning, every pixel.
    Step::Write(Chip, &[(0x3500, 1), (0x3600, 1), (0x3260, 0), (0x3248, 0)]),
    Step::Write(Chip, &[(0x3200, 2), (0x3202, 0), (0x3255, 0x0d), (0x3204, 0)]),
    // Up to 5000 read-outs a second, as many as there is something to read.
    Step::Write(Chip, &[(0x3201, 0), (0x325c, 0)]),
    Step::Wide { address: 0x325d, bytes: 2, value: DVXPLORER_MHZ * 900 },
    Step::Write(Chip, &[(0x3240, 0)]),
    Step::Wide { address: 0x3241, bytes: 2, value: 7 },
    Step::Write(Chip, &[(0x3201, 1)]),
    Step::Unlimited,
    Step::Write(Chip, &[(0x3201, 2)]),
    Step::Write(Mux, &[(4, 1), (5, 0)]),
    Step::EarlyPackets,
    Step::Write(Usb, &[(0, 1)]),
    Step::Write(Mux, &[(1, 1), (0, 1)]),
    Step::WaitMs(10),
    Step::Write(Dvs, &[(3, 1)]),
    // 800 samples a second, its own filter at normal width, 500 degrees per second at most; only the gyro.
    Step::Write(Imu, &[(8, 5), (9, 2), (10, 2), (3, 1)]),
    Step::Write(Chip, &[(DVXPLORER_MODE, 2)]),
];
