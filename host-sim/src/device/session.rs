//! The firmware as an instrument in QEMU, spoken to over its serial port.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::image::root;
use super::run::{FLASH_BYTES, STREAM, scratch};
use super::{DeviceError, Image};

/// Instructions in one tick of the board's 25 MHz timers, at QEMU's `-icount shift=2`.
const INSTRUCTIONS_PER_SLOW_TICK: u64 = 10;

/// How long QEMU may take to open the port.
const PATIENCE: Duration = Duration::from_secs(10);

/// How long an answer may take: `MEASure?` waits for 1.5 s of the board's time, which may be slower than ours.
const ANSWER: Duration = Duration::from_secs(10);

/// How long nothing comes when nothing more will.
const QUIET: Duration = Duration::from_millis(500);

/// QEMU with the instrument in it; switched off when this goes away.
#[derive(Debug)]
struct Qemu {
    process: Child,
    // Holds what it reads.
    _folder: TempDir,
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

impl Qemu {
    /// Starts it at 250 million instructions a second, with its serial port led to `serial`, in QEMU's words.
    fn start(
        image: &Image,
        stream: Option<&[u8]>,
        words: &[&str],
        serial: &str,
        stdout: Stdio,
    ) -> Result<Self, DeviceError> {
        let folder = scratch()?;
        let script = root().join("firmware/src/board/mps2_an500/qemu.sh");
        let failed = |source| DeviceError::Start { program: script.display().to_string(), source };
        let mut command = Command::new(fs::canonicalize(&script).map_err(failed)?);
        command.arg(&image.path).arg("instrument").args(words);
        if let Some(stream) = stream {
            if stream.len() > FLASH_BYTES {
                return Err(DeviceError::TooLongStream(stream.len()));
            }
            let path = folder.path().join(STREAM);
            fs::write(&path, stream)
                .map_err(|source| DeviceError::File { path: path.clone(), source })?;
            command.env("EVTACH_FLASH", path);
        }
        command
            .env("EVTACH_ICOUNT_SHIFT", "2")
            .env("EVTACH_SERIAL", serial)
            .stdout(stdout)
            .stderr(Stdio::null());
        Ok(Self { process: command.spawn().map_err(failed)?, _folder: folder })
    }
}

/// A running instrument whose serial port is for another program to open; it is switched off when this goes away.
#[derive(Debug)]
pub struct Plugged {
    _qemu: Qemu,
    /// The port's name, such as `/dev/pts/4`.
    pub port: String,
}

impl Plugged {
    /// Switches it on, with this stream in the flash behind its SPI controller.
    ///
    /// # Errors
    ///
    /// When QEMU is missing, or does not say where the port is.
    pub fn start(image: &Image, stream: &[u8]) -> Result<Self, DeviceError> {
        let mut qemu = Qemu::start(image, Some(stream), &[], "pty", Stdio::piped())?;
        let mut line = String::new();
        if let Some(stdout) = qemu.process.stdout.take() {
            let mut stdout = BufReader::new(stdout);
            let failed =
                |source| DeviceError::Start { program: "qemu-system-arm".to_owned(), source };
            stdout.read_line(&mut line).map_err(failed)?;
            // Left open, so that QEMU may write to it.
            qemu.process.stdout = Some(stdout.into_inner());
        }
        // "char device redirected to /dev/pts/4 (label serial0)"
        match line.split(' ').find(|word| word.starts_with('/')) {
            Some(port) => Ok(Self { _qemu: qemu, port: port.to_owned() }),
            None => Err(DeviceError::Line { line: 1, text: line }),
        }
    }
}

/// A running instrument, spoken to; it is switched off when this goes away.
#[derive(Debug)]
pub struct Session {
    qemu: Qemu,
    port: BufReader<TcpStream>,
}

impl Session {
    /// Switches it on at 250 million instructions a second, with this stream in the flash behind its SPI controller, and
    /// these words behind "instrument" on its command line.
    ///
    /// # Errors
    ///
    /// When QEMU is missing, the port cannot be opened, or the stream is larger than the flash.
    pub fn start(
        image: &Image,
        stream: Option<&[u8]>,
        words: &[&str],
    ) -> Result<Self, DeviceError> {
        Self::start_with(image, stream, words, Stdio::null())
    }

    fn start_with(
        image: &Image,
        stream: Option<&[u8]>,
        words: &[&str],
        stdout: Stdio,
    ) -> Result<Self, DeviceError> {
        let failed = |source| DeviceError::Start { program: "qemu-system-arm".to_owned(), source };
        let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
        let address = free.map_err(failed)?.to_string();
        let serial = format!("tcp:{address},server=on,wait=on");
        let qemu = Qemu::start(image, stream, words, &serial, stdout)?;
        let port = connect(&address).map_err(failed)?;
        Ok(Self { qemu, port: BufReader::new(port) })
    }

    /// Sends a line.
    ///
    /// # Errors
    ///
    /// When the port fails.
    pub fn write(&mut self, line: &str) -> io::Result<()> {
        self.port.get_mut().write_all(format!("{line}\n").as_bytes())
    }

    /// Sends a line and reads the line that answers it.
    ///
    /// # Errors
    ///
    /// When the port fails, or no answer comes in 10 seconds.
    pub fn query(&mut self, line: &str) -> io::Result<String> {
        self.write(line)?;
        let mut answer = String::new();
        self.port.read_line(&mut answer)?;
        Ok(answer.trim_end().to_owned())
    }

    /// Forgets a question that was not answered in time: clears the device, and passes over what still comes.
    ///
    /// # Errors
    ///
    /// When the port fails.
    pub fn clear(&mut self) -> io::Result<()> {
        self.port.get_mut().write_all(b"\x03\n")?;
        self.port.get_ref().set_read_timeout(Some(QUIET))?;
        while self.port.read(&mut [0; 4096]).is_ok_and(|count| count > 0) {}
        self.port.get_ref().set_read_timeout(Some(ANSWER))
    }

    /// Sends a line and reads the definite length block that answers it.
    ///
    /// # Errors
    ///
    /// When the port fails, or no block comes.
    pub fn query_block(&mut self, line: &str) -> io::Result<Vec<u8>> {
        self.write(line)?;
        let mut head = [0; 2];
        self.port.read_exact(&mut head)?;
        let digits = head[1].saturating_sub(b'0');
        if head[0] != b'#' || !(1..=9).contains(&digits) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "no block"));
        }
        let mut length = vec![0; usize::from(digits)];
        self.port.read_exact(&mut length)?;
        let length = String::from_utf8_lossy(&length).parse().map_err(io::Error::other)?;
        let mut block = vec![0; length];
        self.port.read_exact(&mut block)?;
        self.port.read_exact(&mut [0])?;
        Ok(block)
    }
}

/// Who used the processor while the instrument ran.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Used {
    /// Seconds of the board's time.
    pub seconds: u32,
    /// Instructions by task in each second; "sleep" are those that were not carried out.
    pub instructions: Vec<(String, Vec<u64>)>,
    /// Ends of the windows in which each rotor's speed was read, in seconds since the first event, in the order of the
    /// rotors' letters.
    pub read_s: Vec<Vec<f64>>,
    /// Deepest stack while the program started, in bytes.
    pub stack_starting: u64,
    /// Deepest stack since, in bytes.
    pub stack_running: u64,
}

/// Runs the instrument for some seconds of the board's time, with a stream in its flash and its link telling every
/// reading, and says who used the processor.
///
/// # Errors
///
/// When QEMU is missing, or the firmware says something else.
pub fn run_instrument(image: &Image, stream: &[u8], seconds: u32) -> Result<Used, DeviceError> {
    let words = [seconds.to_string()];
    let mut session = Session::start_with(image, Some(stream), &[&words[0]], Stdio::piped())?;
    let failed = |source| DeviceError::Start { program: "qemu-system-arm".to_owned(), source };
    // It ends by itself.
    session.port.get_ref().set_read_timeout(None).map_err(failed)?;
    session.write("SYST:LOG ON").map_err(failed)?;
    let mut told = Vec::new();
    // The port closes, or breaks, when the program ends: what came before is what was told.
    session.port.read_to_end(&mut told).ok();
    let told = String::from_utf8_lossy(&told);
    let mut said = String::new();
    if let Some(stdout) = &mut session.qemu.process.stdout {
        stdout.read_to_string(&mut said).map_err(failed)?;
    }
    let mut used = Used { seconds, ..Used::default() };
    let mut read_s = BTreeMap::<String, Vec<f64>>::new();
    for line in told.lines().filter(|line| line.starts_with('{')) {
        // The last line may be cut.
        let reading = serde_json::from_str::<serde_json::Value>(line).unwrap_or_default();
        let number = |key: &str| reading[key].as_f64().unwrap_or_default();
        let end_s = number("t_s") + 0.5 * number("window_s");
        for rotor in reading["rotors"].as_array().into_iter().flatten() {
            if let Some(id) = rotor["id"].as_str().filter(|_| rotor["rpm"].is_number()) {
                read_s.entry(id.to_owned()).or_default().push(end_s);
            }
        }
    }
    used.read_s = read_s.into_values().collect();
    for (index, line) in said.lines().enumerate() {
        let number = |key: &str| {
            let word = line.split(' ').find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
            word.and_then(|word| word.parse::<u64>().ok())
        };
        let foreign = || DeviceError::Line { line: index + 1, text: line.to_owned() };
        if let Some((_, name)) =
            line.strip_prefix("used ").and_then(|rest| rest.split_once("name="))
        {
            let ticks = number("ticks").ok_or_else(foreign)?;
            let instructions = ticks * INSTRUCTIONS_PER_SLOW_TICK;
            match used.instructions.iter_mut().find(|(known, _)| known == name) {
                Some((_, seconds)) => seconds.push(instructions),
                None => used.instructions.push((name.to_owned(), vec![instructions])),
            }
        } else if line.starts_with("ran ") {
            used.stack_starting = number("stack_starting").ok_or_else(foreign)?;
            used.stack_running = number("stack_running").ok_or_else(foreign)?;
        }
    }
    if used.instructions.is_empty() || used.stack_running == 0 {
        return Err(DeviceError::Line { line: said.lines().count() + 1, text: String::new() });
    }
    Ok(used)
}

/// Connects as soon as QEMU listens.
fn connect(address: &str) -> io::Result<TcpStream> {
    let start = Instant::now();
    loop {
        match TcpStream::connect(address) {
            Ok(port) => {
                port.set_nodelay(true)?;
                port.set_read_timeout(Some(ANSWER))?;
                return Ok(port);
            }
            Err(error) if start.elapsed() > PATIENCE => return Err(error),
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
}
