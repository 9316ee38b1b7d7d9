//! The host's console and files, through semihosting.

use core::fmt;

use evtach_firmware::intake::Source;
use heapless::Vec;
use semihosting::io::{self, Read as _, Write as _};

/// Bytes gathered before the host is called: a call costs the emulator far more than a byte does.
const GATHERED: usize = 1024;

/// The host's standard output.
#[derive(Debug, Default)]
pub struct Console {
    gathered: Vec<u8, GATHERED>,
}

impl Console {
    /// Hands over what has been gathered. Without a console there is nobody to tell.
    pub fn flush(&mut self) {
        if let Ok(mut stdout) = io::stdout() {
            stdout.write_all(&self.gathered).ok();
        }
        self.gathered.clear();
    }
}

impl fmt::Write for Console {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for &byte in text.as_bytes() {
            if self.gathered.push(byte).is_err() {
                self.flush();
                self.gathered.push(byte).ok();
            }
        }
        Ok(())
    }
}

/// A file of the host.
#[derive(Debug)]
pub struct File(pub semihosting::fs::File);

impl Source for File {
    type Error = io::Error;

    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, io::Error> {
        let mut filled = 0;
        while filled < bytes.len() {
            match self.0.read(&mut bytes[filled..])? {
                0 => break,
                read => filled += read,
            }
        }
        Ok(filled)
    }
}
