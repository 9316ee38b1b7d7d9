//! The port: what is plugged in, and how fast it speaks.

use embassy_usb_driver::Speed;

use super::registers::{OTG, port};

/// What has happened to the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Whether the core has been started.
    pub started: bool,
    /// Something was plugged in, and has not been reset yet.
    pub connected: bool,
    /// What was plugged in is gone, and nobody has been told.
    pub disconnected: bool,
    /// Too much current is drawn, and nobody has been told.
    pub overcurrent: bool,
    /// Speed of what is plugged in, once it has been reset and while it is there.
    pub enabled: Option<Speed>,
}

impl Port {
    /// Without power.
    pub const OFF: Self = Self {
        started: false,
        connected: false,
        disconnected: false,
        overcurrent: false,
        enabled: None,
    };

    /// Looks at what changed; whether transfers have lost their device.
    pub fn on_interrupt(&mut self, gone: bool) -> bool {
        let now = OTG.hprt().read();
        if now.pcdet() {
            self.connected = true;
        }
        if now.penchng() {
            self.enabled = now.pena().then(|| speed(now.pspd()));
        }
        if now.pocchng() && now.poca() {
            self.overcurrent = true;
        }
        port(|w| {
            w.set_pcdet(now.pcdet());
            w.set_penchng(now.penchng());
            w.set_pocchng(now.pocchng());
        });
        let disabled = now.penchng() && !now.pena();
        if disabled && now.pcsts() {
            // The core gave the device up: it is there, and wants a reset.
            self.connected = true;
        }
        if gone {
            self.disconnected = true;
            // What was plugged in since is still there.
            self.connected = now.pcsts() && now.pcdet();
            self.enabled = None;
        }
        gone || disabled
    }
}

const fn speed(code: u8) -> Speed {
    match code {
        0 => Speed::High,
        2 => Speed::Low,
        _ => Speed::Full,
    }
}
