//! The device's own code: on emulated boards, and task by task on the PC.

mod account;
mod board;
mod compare;
mod dialogue;
mod equals_pc;
mod image;
mod instrument;
mod spi;
mod usb;
