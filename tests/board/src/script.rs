//! What a person does with the device, one line each; every line is answered by one line.
//!
//! | line | does |
//! |---|---|
//! | `run S`, `run_until S` | lets so many seconds pass, or until this time since power came |
//! | `plug davis346 FILE.ev8`, `plug dvxplorer FILE.ev8`, `plug stick` | plugs something into the host port |
//! | `firmware N`, `roll RAD_S`, `swing RAD_S`, `repeat S` | of the next camera: the version of its firmware; what its gyro measures, and how far that swings to and fro; what it sees comes again after so many seconds |
//! | `cover` | a cap on the lens of the camera: nothing happens any more |
//! | `unplug`, `unplug quiet`, `unplug errors` | with all signs; without errors; without a word from the port |
//! | `camera` | what the camera has seen, left out and dropped, as JSON |
//! | `fault halt`, `fault dead`, `fault odd`, `fault clock` | the camera's endpoint halts, for good, sends an odd byte, resets its clock |
//! | `break_wire N` | the next N transactions are not answered |
//! | `crash panic HANDLER`, `undefined`, `hang` | the program goes wrong in the handler of this exception |
//! | `touch X Y`, `lift`, `press`, `release` | a finger on the screen; the blue button |
//! | `serial TEXT`, `read` | to and from the serial port, escaped as Rust does |
//! | `query S TEXT` | sends a line and waits so many seconds for one |
//! | `lcd FILE.png`, `log FILE` | what is on the panel; what the device logged so far |
//! | `pc plug`, `pc unplug` | the cable of the PC |
//! | `break_sdram OFFSET` | one bit of SDRAM reads as zero |
//! | `stop_crystal` | the crystal stops |
//! | `mend` | SDRAM and crystal are as good as new |
//! | `flash OFFSET FILE` | a programmer writes a file into the serial flash |
//! | `power_cut`, `power_cut_writing` | power goes and comes back; in the middle of the next write to the serial flash |
//! | `reset` | the black button |
//! | `report` | instructions, interrupts, traffic, faults, as JSON |

use std::cell::RefCell;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::rc::Rc;

use anyhow::{Context as _, Result, anyhow, bail};
use evtach_core::Event;
use evtach_firmware::record::{Decoder, Header, RECORD_BYTES};
use evtach_firmware::sensor::usb::Model;
use evtach_firmware::sensor::usb::emulated::{Camera, Fault};
use serde_json::json;

use crate::chip::rcc::Cause;
use crate::cpu;
use crate::cpu::nvic;
use crate::injury::Injury;
use crate::machine::Machine;
use crate::time::{MS, S};
use crate::usb::camera::{Plugged, Stick};
use crate::usb::host::Unplug;

/// How far time goes between two looks at an answer.
const STEP_PS: u64 = MS;

/// A device with someone at it.
pub struct Script {
    /// The device.
    pub machine: Machine,
    camera: Option<Rc<RefCell<Camera>>>,
    firmware: Option<u8>,
    roll_rad_s: f32,
    swing_rad_s: f32,
    repeat_us: Option<u64>,
}

fn ps(seconds: &str) -> Result<u64> {
    let seconds: f64 = seconds.parse().with_context(|| format!("{seconds:?} is no time"))?;
    if !(0.0..1e6).contains(&seconds) {
        bail!("{seconds} s is out of range");
    }
    Ok((seconds * 1e6).round() as u64 * (S / 1_000_000))
}

fn number<T: std::str::FromStr>(text: &str) -> Result<T> {
    text.parse().map_err(|_| anyhow!("{text:?} is no number in range"))
}

/// Undoes the escapes of [`u8::escape_ascii`].
fn unescape(text: &str) -> Result<Vec<u8>> {
    let (mut bytes, mut rest) = (Vec::new(), text.bytes());
    while let Some(byte) = rest.next() {
        if byte != b'\\' {
            bytes.push(byte);
            continue;
        }
        bytes.push(match rest.next() {
            Some(b'n') => b'\n',
            Some(b'r') => b'\r',
            Some(b't') => b'\t',
            Some(b'x') => {
                let digits = [rest.next().unwrap_or(b' '), rest.next().unwrap_or(b' ')];
                let digits = str::from_utf8(&digits)?;
                u8::from_str_radix(digits, 16).with_context(|| format!("\\x{digits}"))?
            }
            Some(other @ (b'\\' | b'"' | b'\'')) => other,
            _ => bail!("{text:?} ends or goes on in a strange way behind a backslash"),
        });
    }
    Ok(bytes)
}

fn events(path: &str) -> Result<Vec<Event>> {
    let bytes = std::fs::read(path).with_context(|| path.to_owned())?;
    let (header, records) =
        bytes.split_first_chunk().ok_or_else(|| anyhow!("{path}: too short"))?;
    let header = Header::parse(header).map_err(|error| anyhow!("{path}: {error}"))?;
    let mut decoder = Decoder::new(header.first_us);
    let (records, _) = records.as_chunks::<RECORD_BYTES>();
    Ok(records.iter().map(|record| decoder.decode(*record)).collect())
}

impl Script {
    /// Someone at a device.
    pub fn new(machine: Machine) -> Self {
        Self {
            machine,
            camera: None,
            firmware: None,
            roll_rad_s: 0.0,
            swing_rad_s: 0.0,
            repeat_us: None,
        }
    }

    /// Carries out a line and says what comes of it.
    ///
    /// # Errors
    /// When it is no line that is known, or cannot be carried out.
    pub fn line(&mut self, line: &str) -> Result<String> {
        let (word, rest) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
        let rest = rest.trim();
        match word {
            "run" => self.run_until(self.machine.now() + ps(rest)?)?,
            "run_until" => self.run_until(ps(rest)?)?,
            "plug" => self.plug(rest)?,
            "firmware" => self.firmware = Some(number(rest)?),
            "roll" => {
                self.roll_rad_s = number(rest)?;
                if let Some(camera) = &self.camera {
                    camera.borrow_mut().roll_rad_s = self.roll_rad_s;
                }
            }
            "swing" => self.swing_rad_s = number(rest)?,
            "repeat" => self.repeat_us = Some(ps(rest)? / crate::time::US),
            "cover" => {
                let camera = self.camera.as_ref().ok_or_else(|| anyhow!("there is no camera"))?;
                camera.borrow_mut().cover();
            }
            "unplug" => self.unplug(rest)?,
            "camera" => return self.camera(),
            "fault" => self.fault(rest)?,
            "crash" => self.machine.injury = Some(Injury::parse(rest)?),
            "break_wire" => self.machine.board.borrow_mut().host.broken = number(rest)?,
            "touch" => {
                let (x, y) = rest.split_once(' ').ok_or_else(|| anyhow!("touch X Y"))?;
                let finger = Some((number(x)?, number(y.trim())?));
                self.machine.board.borrow_mut().touch(finger);
            }
            "lift" => self.machine.board.borrow_mut().touch(None),
            "press" => self.machine.board.borrow_mut().button(true),
            "release" => self.machine.board.borrow_mut().button(false),
            "serial" => self.send(&unescape(rest)?),
            "read" => return Ok(self.received().escape_ascii().to_string()),
            "query" => return self.query(rest),
            "lcd" => return self.lcd(rest.as_ref()),
            "log" => {
                let lines = &self.machine.rtt.lines;
                std::fs::write(rest, lines.join("\n")).with_context(|| rest.to_owned())?;
                return Ok(format!("{} lines", lines.len()));
            }
            "pc" => {
                let mut board = self.machine.board.borrow_mut();
                board.port.pc.plugged = rest == "plug";
                board.disturbed();
            }
            "break_sdram" => self.machine.break_sdram(number(rest)?)?,
            "stop_crystal" => {
                let mut board = self.machine.board.borrow_mut();
                if board.rcc.stop_crystal() {
                    board.nvic.pend(nvic::NMI);
                }
                board.clocks_changed();
                board.disturbed();
            }
            "mend" => self.machine.mend(),
            "flash" => {
                let (at, path) =
                    rest.split_once(' ').ok_or_else(|| anyhow!("flash OFFSET FILE"))?;
                let (at, bytes): (usize, _) =
                    (number(at)?, std::fs::read(path).with_context(|| path.to_owned())?);
                let mut board = self.machine.board.borrow_mut();
                let cells = board.quadspi.flash.cells.get_mut(at..at + bytes.len());
                cells.ok_or_else(|| anyhow!("{path} does not fit"))?.copy_from_slice(&bytes);
            }
            "power_cut" => {
                self.machine.board.borrow_mut().power_off();
                self.run_until(self.machine.now() + MS)?;
            }
            "power_cut_writing" => self.machine.cut_while_writing(),
            "reset" => {
                self.machine.board.borrow_mut().ask(Cause::Pin);
                self.run_until(self.machine.now() + MS)?;
            }
            "report" => return Ok(self.report()),
            _ => bail!("{word:?} is nothing that can be done here"),
        }
        Ok(String::new())
    }

    fn run_until(&mut self, until: u64) -> Result<()> {
        self.machine.run_until(until)
    }

    fn plug(&mut self, what: &str) -> Result<()> {
        let (kind, file) = what.split_once(' ').unwrap_or((what, ""));
        let now = self.machine.now();
        let model = match kind {
            "davis346" => Model::Davis346,
            "dvxplorer" => Model::Dvxplorer,
            "stick" => {
                let mut board = self.machine.board.borrow_mut();
                board.host.plug(Box::new(Stick), now);
                board.disturbed();
                return Ok(());
            }
            // The camera that was pulled out.
            "again" => {
                let camera = self.camera.clone().ok_or_else(|| anyhow!("there was no camera"))?;
                let mut board = self.machine.board.borrow_mut();
                board.host.plug(Box::new(Plugged(camera)), now);
                board.disturbed();
                return Ok(());
            }
            _ => bail!("{kind:?} cannot be plugged in"),
        };
        let events = events(file)?;
        let last_us = events.last().map_or(0, |event| event.t_us);
        let mut camera = Camera::new(model, events);
        if let Some(period_us) = self.repeat_us.take() {
            if period_us <= last_us {
                bail!("{file} lasts longer than it is to take to come again");
            }
            camera.repeat(period_us);
        }
        camera.roll_rad_s = self.roll_rad_s;
        camera.swing_rad_s = self.swing_rad_s;
        if let Some(firmware) = self.firmware {
            camera.firmware = firmware;
        }
        camera.run_until(now / crate::time::US);
        let camera = Rc::new(RefCell::new(camera));
        self.camera = Some(Rc::clone(&camera));
        let mut board = self.machine.board.borrow_mut();
        board.host.plug(Box::new(Plugged(camera)), now);
        board.disturbed();
        Ok(())
    }

    fn unplug(&mut self, how: &str) -> Result<()> {
        let how = match how {
            "" => Unplug::Plain,
            "quiet" => Unplug::Quiet,
            "errors" => Unplug::ErrorsOnly,
            _ => bail!("unplug, unplug quiet, unplug errors"),
        };
        let mut board = self.machine.board.borrow_mut();
        if board.host.unplug(how).is_none() {
            bail!("nothing is plugged in");
        }
        board.host_disturbed();
        Ok(())
    }

    fn fault(&mut self, what: &str) -> Result<()> {
        let fault = match what {
            "halt" => Fault::Halt,
            "dead" => Fault::Dead,
            "odd" => Fault::Odd,
            "clock" => Fault::ClockReset,
            _ => bail!("fault halt, dead, odd, clock"),
        };
        let camera = self.camera.as_ref().ok_or_else(|| anyhow!("there is no camera"))?;
        camera.borrow_mut().fail(fault);
        Ok(())
    }

    fn camera(&self) -> Result<String> {
        let camera = self.camera.as_ref().ok_or_else(|| anyhow!("there is no camera"))?;
        let camera = camera.borrow();
        Ok(json!({
            "model": camera.model.name(),
            "seen": camera.seen,
            "filtered": camera.filtered,
            "skipped": camera.skipped,
            "skip_orders": camera.skip_orders(),
            "dropped": camera.dropped,
            "waiting_bytes": camera.waiting_bytes(),
            "done": camera.is_done(),
            "requests": camera.log.len(),
        })
        .to_string())
    }

    /// Sends bytes to the serial port.
    pub fn send(&mut self, bytes: &[u8]) {
        let mut board = self.machine.board.borrow_mut();
        board.port.pc.to_send.extend(bytes);
        board.disturbed();
    }

    /// What came from the serial port.
    pub fn received(&mut self) -> Vec<u8> {
        self.machine.board.borrow_mut().port.pc.received.drain(..).collect()
    }

    fn query(&mut self, rest: &str) -> Result<String> {
        let (seconds, text) = rest.split_once(' ').ok_or_else(|| anyhow!("query S TEXT"))?;
        let until = self.machine.now() + ps(seconds)?;
        let mut line = unescape(text)?;
        line.push(b'\n');
        self.send(&line);
        let mut answer = Vec::new();
        while self.machine.now() < until && !answer.ends_with(b"\n") {
            let step = (self.machine.now() + STEP_PS).min(until);
            self.run_until(step)?;
            answer.extend(self.received());
        }
        if !answer.ends_with(b"\n") {
            bail!("no answer to {text}, but {:?}", answer.escape_ascii().to_string());
        }
        answer.pop();
        Ok(answer.escape_ascii().to_string())
    }

    /// Writes what is on the panel to a file.
    ///
    /// # Errors
    /// When the panel is off, or the file cannot be written.
    pub fn lcd(&mut self, path: &Path) -> Result<String> {
        let picture = self.machine.picture().ok_or_else(|| anyhow!("the panel is off"))?;
        let file = File::create(path).with_context(|| format!("{}", path.display()))?;
        let mut encoder =
            png::Encoder::new(BufWriter::new(file), picture.width_px, picture.height_px);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header()?.write_image_data(&picture.rgb)?;
        Ok(format!("{}x{}", picture.width_px, picture.height_px))
    }

    fn report(&mut self) -> String {
        let stack = ["_stack_end", "_stack_start"].map(|name| self.machine.image.symbol(name));
        let untouched = match stack {
            [Some(low), Some(high)] => Some(self.machine.stack_untouched(low, high)),
            _ => None,
        };
        let machine = &self.machine;
        let board = machine.board.borrow();
        let instructions: serde_json::Map<String, serde_json::Value> = machine
            .pulse
            .instructions
            .iter()
            .enumerate()
            .filter(|(_, count)| count.get() > 0)
            .map(|(level, count)| (cpu::name(level), count.get().into()))
            .collect();
        let unknown: Vec<String> = board
            .unknown
            .iter()
            .map(|(at, (reads, writes))| format!("{at:#010x}: {reads} reads, {writes} writes"))
            .collect();
        let traffic = board.host.traffic;
        let clocks = board.rcc.clocks();
        json!({
            "seconds": machine.now() as f64 / S as f64,
            "slept_seconds": machine.slept as f64 / S as f64,
            "place": machine.place(),
            "instructions": instructions,
            "exceptions": machine.entered,
            "resets": machine.resets.iter().map(|cause| format!("{cause:?}")).collect::<Vec<_>>(),
            "faults": machine.faults,
            "remarks": board.remarks,
            "unknown_registers": unknown,
            "unknown_flash_commands": board.quadspi.flash.unknown,
            "flash_changes": board.quadspi.flash.changes,
            "hclk_hz": clocks.hclk_hz,
            "on_crystal": board.rcc.on_crystal(),
            "panel_on": board.panel_on(),
            "frames": board.ltdc.frames,
            "serial_open": board.port.pc.is_open(),
            "serial_names": board.port.pc.strings,
            "serial_retries": board.port.pc.retries,
            "packets": traffic.packets,
            "bytes": traffic.bytes,
            "naks": traffic.naks,
            "toggle_errors": traffic.toggle_errors,
            "wire_errors": traffic.errors,
            "stack_untouched_bytes": untouched,
        })
        .to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_go_there_and_back() {
        let bytes: Vec<u8> = (0..=255).collect();
        assert_eq!(unescape(&bytes.escape_ascii().to_string()).expect("escapes"), bytes);
        assert!(unescape("\\").is_err() && unescape("\\xg0").is_err());
    }
}
