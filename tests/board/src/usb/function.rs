//! What hangs on the host's port: a USB device as it looks from the wire.

use std::collections::BTreeMap;

/// What a device says to a token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A packet, with its data toggle.
    Data(Vec<u8>, bool),
    /// Taken.
    Ack,
    /// Not now.
    Nak,
    /// The endpoint is halted, or the request is not known.
    Stall,
    /// Nothing: no such device, or it is broken.
    Silence,
}

/// What a device does beyond the requests that all devices know.
pub trait Function {
    /// The device descriptor.
    fn device_descriptor(&self) -> Vec<u8>;
    /// The configuration with all that belongs to it.
    fn configuration(&self) -> Vec<u8>;
    /// Text of a string descriptor.
    fn string(&self, index: u8) -> Option<&str>;
    /// A vendor's or class request; `data` is what came with it. `None` stalls.
    fn request(&mut self, setup: [u8; 8], data: &[u8], now: u64) -> Option<Vec<u8>>;
    /// The next packet of an endpoint that sends: `None` is "not now", an error is a stall.
    fn input(&mut self, endpoint: u8, now: u64) -> Result<Option<Vec<u8>>, Stall>;
    /// When an endpoint that has nothing now may have something.
    fn ready_at(&self, endpoint: u8, now: u64) -> u64;
    /// The halt of an endpoint is cleared.
    fn clear_halt(&mut self, _endpoint: u8) {}
    /// Plugged in anew.
    fn power_on(&mut self) {}
}

/// An endpoint is halted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stall;

/// A control transfer under way.
enum Control {
    Idle,
    /// Sends an answer, then takes an empty packet.
    Answering {
        bytes: Vec<u8>,
        at: usize,
    },
    /// Takes data for a request.
    Taking {
        setup: [u8; 8],
        bytes: Vec<u8>,
    },
    /// Sends an empty packet; then this address stands.
    Acknowledging {
        address: Option<u8>,
    },
    Stalled,
}

/// A device: addresses, descriptors, toggles.
pub struct Attached {
    /// What it does.
    pub function: Box<dyn Function>,
    address: u8,
    configured: bool,
    control: Control,
    control_toggle: bool,
    /// Toggles of the endpoints that send.
    toggles: BTreeMap<u8, bool>,
}

impl Attached {
    /// A device that has just been plugged in.
    pub fn new(mut function: Box<dyn Function>) -> Self {
        function.power_on();
        Self {
            function,
            address: 0,
            configured: false,
            control: Control::Idle,
            control_toggle: true,
            toggles: BTreeMap::new(),
        }
    }

    /// A reset on the bus.
    pub fn reset(&mut self) {
        self.address = 0;
        self.configured = false;
        self.control = Control::Idle;
        self.toggles.clear();
    }

    /// Takes a setup packet.
    pub fn setup(&mut self, address: u8, setup: [u8; 8], now: u64) -> Answer {
        if address != self.address {
            return Answer::Silence;
        }
        let length = u16::from_le_bytes([setup[6], setup[7]]);
        self.control_toggle = true;
        self.control = if setup[0] & 0x80 == 0 && length > 0 {
            Control::Taking { setup, bytes: Vec::new() }
        } else {
            self.carry_out(setup, &[], now)
        };
        Answer::Ack
    }

    fn carry_out(&mut self, setup: [u8; 8], data: &[u8], now: u64) -> Control {
        let [kind, request, v0, v1, i0, ..] = setup;
        let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
        let mut address = None;
        let answer = match (kind, request) {
            (0x80, 6) => match v1 {
                1 => Some(self.function.device_descriptor()),
                2 => Some(self.function.configuration()),
                3 if v0 == 0 => Some(vec![4, 3, 9, 4]),
                3 => self.function.string(v0).map(|text| {
                    let text = text.encode_utf16().flat_map(u16::to_le_bytes);
                    let mut bytes = vec![0, 3];
                    bytes.extend(text);
                    bytes[0] = bytes.len() as u8;
                    bytes
                }),
                _ => None,
            },
            (0x80, 0) => Some(vec![0, 0]),
            (0x80, 8) => Some(vec![u8::from(self.configured)]),
            (0x00, 5) => {
                address = Some(v0 & 0x7f);
                Some(Vec::new())
            }
            (0x00, 9) => {
                self.configured = v0 != 0;
                self.toggles.clear();
                Some(Vec::new())
            }
            (0x01, 11) => Some(Vec::new()),
            (0x02, 1) => {
                self.toggles.remove(&(i0 & 0xf));
                self.function.clear_halt(i0 & 0xf);
                Some(Vec::new())
            }
            _ if kind & 0x60 != 0 => self.function.request(setup, data, now),
            _ => None,
        };
        match answer {
            Some(mut bytes) if kind & 0x80 != 0 => {
                bytes.truncate(length);
                Control::Answering { bytes, at: 0 }
            }
            Some(_) => Control::Acknowledging { address },
            None => Control::Stalled,
        }
    }

    /// Answers a token that asks for data.
    pub fn input(&mut self, address: u8, endpoint: u8, now: u64) -> Answer {
        if address != self.address {
            return Answer::Silence;
        }
        if endpoint != 0 {
            if !self.configured {
                return Answer::Silence;
            }
            let toggle = self.toggles.entry(endpoint).or_default();
            return match self.function.input(endpoint, now) {
                Ok(Some(bytes)) => {
                    let sent = *toggle;
                    *toggle = !sent;
                    Answer::Data(bytes, sent)
                }
                Ok(None) => Answer::Nak,
                Err(Stall) => Answer::Stall,
            };
        }
        let toggle = self.control_toggle;
        match &mut self.control {
            Control::Answering { bytes, at } => {
                let end = (*at + 64).min(bytes.len());
                let packet = bytes[*at..end].to_vec();
                *at = end;
                self.control_toggle = !toggle;
                Answer::Data(packet, toggle)
            }
            Control::Acknowledging { address } => {
                if let Some(address) = address {
                    self.address = *address;
                }
                self.control = Control::Idle;
                Answer::Data(Vec::new(), true)
            }
            Control::Stalled => Answer::Stall,
            Control::Idle | Control::Taking { .. } => Answer::Nak,
        }
    }

    /// Takes a packet.
    pub fn output(&mut self, address: u8, endpoint: u8, data: &[u8], now: u64) -> Answer {
        if address != self.address || endpoint != 0 {
            return Answer::Silence;
        }
        match &mut self.control {
            Control::Taking { setup, bytes } => {
                bytes.extend_from_slice(data);
                let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
                if bytes.len() >= length || data.len() < 64 {
                    let (setup, bytes) = (*setup, std::mem::take(bytes));
                    self.control = self.carry_out(setup, &bytes, now);
                }
                Answer::Ack
            }
            // The empty packet that ends a transfer to the host.
            Control::Answering { .. } => {
                self.control = Control::Idle;
                Answer::Ack
            }
            Control::Stalled => Answer::Stall,
            Control::Idle | Control::Acknowledging { .. } => Answer::Ack,
        }
    }
}
