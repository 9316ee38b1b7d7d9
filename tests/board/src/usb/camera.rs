//! The cameras of the firmware's own tests, at the end of a real cable; and a device that is none.

use std::cell::RefCell;
use std::rc::Rc;

use evtach_firmware::sensor::usb::emulated::{Camera, Packet};

use super::function::{Function, Stall};
use crate::time::US;

/// Endpoint of the events.
const EVENTS: u8 = 2;
/// How often a camera that has something, or nothing, is looked at again: the core asks all the while, but hears of no
/// refusal.
const SOON_PS: u64 = 20 * US;
const LATER_PS: u64 = 125 * US;

/// A camera, which the script holds as well.
pub struct Plugged(pub Rc<RefCell<Camera>>);

impl Function for Plugged {
    fn device_descriptor(&self) -> Vec<u8> {
        self.0.borrow().device_descriptor().to_vec()
    }

    fn configuration(&self) -> Vec<u8> {
        self.0.borrow().configuration().to_vec()
    }

    fn string(&self, index: u8) -> Option<&str> {
        ["iniVation", "event camera", "00000001"].get(usize::from(index).wrapping_sub(1)).copied()
    }

    fn request(&mut self, setup: [u8; 8], data: &[u8], now: u64) -> Option<Vec<u8>> {
        let mut camera = self.0.borrow_mut();
        camera.run_until(now / US);
        let answer = camera.vendor(&setup, data).ok()?;
        Some(answer.map_or_else(Vec::new, |bytes| bytes.to_vec()))
    }

    fn input(&mut self, endpoint: u8, now: u64) -> Result<Option<Vec<u8>>, Stall> {
        if endpoint != EVENTS {
            return Ok(None);
        }
        let mut camera = self.0.borrow_mut();
        camera.run_until(now / US);
        match camera.packet() {
            Packet::Data(bytes) => Ok(Some(bytes)),
            Packet::Nak => Ok(None),
            Packet::Stall => Err(Stall),
        }
    }

    fn ready_at(&self, _endpoint: u8, now: u64) -> u64 {
        now + if self.0.borrow().waiting_bytes() > 0 { SOON_PS } else { LATER_PS }
    }

    fn clear_halt(&mut self, endpoint: u8) {
        if endpoint == EVENTS {
            self.0.borrow_mut().clear_halt(0x80 | endpoint);
        }
    }

    fn power_on(&mut self) {
        self.0.borrow_mut().power_on();
    }
}

/// A memory stick: answers like any device, and is no camera.
pub struct Stick;

impl Function for Stick {
    fn device_descriptor(&self) -> Vec<u8> {
        vec![18, 1, 0, 2, 0, 0, 0, 64, 0x81, 0x07, 0x67, 0x55, 0, 1, 1, 2, 0, 1]
    }

    fn configuration(&self) -> Vec<u8> {
        vec![
            9, 2, 32, 0, 1, 1, 0, 0x80, 100, // configuration
            9, 4, 0, 0, 2, 8, 6, 0x50, 0, // mass storage, SCSI, bulk only
            7, 5, 0x81, 2, 0, 2, 0, 7, 5, 0x02, 2, 0, 2, 0,
        ]
    }

    fn string(&self, index: u8) -> Option<&str> {
        ["Any", "Memory stick"].get(usize::from(index).wrapping_sub(1)).copied()
    }

    fn request(&mut self, _setup: [u8; 8], _data: &[u8], _now: u64) -> Option<Vec<u8>> {
        None
    }

    fn input(&mut self, _endpoint: u8, _now: u64) -> Result<Option<Vec<u8>>, Stall> {
        Ok(None)
    }

    fn ready_at(&self, _endpoint: u8, now: u64) -> u64 {
        now + LATER_PS
    }
}
