//! The firmware as an instrument in QEMU, spoken to over its serial port.

use std::fs;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::image::root;
use super::run::{STREAM, scratch};
use super::{DeviceError, Image};

/// Instructions in one tick of the board's 25 MHz timers, at QEMU's `-icount shift=2`.
const INSTRUCTIONS_PER_SLOW_TICK: u64 = 10;

/// How long QEMU may take to open the port.
const PATIENCE: Duration = Duration::from_secs(10);

/// How long an answer may take: `MEASure?` waits for 1.5 s of the board's time, which may be slower than ours.
const ANSWER: Duration = Duration::from_secs(10);

/// How long nothing comes when nothing more will.
const QUIET: Duration = Duration::from_millis(500);

/// A running instrument; it is switched off when this goes away.
#[derive(Debug)]
pub struct Session {
    qemu: Child,
    port: BufReader<TcpStream>,
    address: String,
    // Holds what QEMU reads.
    _folder: TempDir,
}

impl Drop for Session {
    fn drop(&mut self) {
        self.qemu.kill().ok();
        self.qemu.wait().ok();
    }
}

impl Session {
    /// Switches it on at 250 million instructions a second, with this stream in the flash behind its SPI controller, and
    /// these words behind "instrument" on its command line.
    ///
    /// # Errors
    ///
    /// When QEMU is missing, or the port cannot be opened.
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
        let folder = scratch()?;
        let script = root().join("firmware/src/board/mps2_an500/qemu.sh");
        let failed = |source| DeviceError::Start { program: script.display().to_string(), source };
        let mut command = Command::new(fs::canonicalize(&script).map_err(failed)?);
        command.arg(&image.path).arg("instrument").args(words);
        if let Some(stream) = stream {
            let path = folder.path().join(STREAM);
            fs::write(&path, stream)
                .map_err(|source| DeviceError::File { path: path.clone(), source })?;
            command.env("EVTACH_FLASH", path);
        }
        let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr());
        let address = free.map_err(failed)?.to_string();
        command
            .env("EVTACH_ICOUNT_SHIFT", "2")
            .env("EVTACH_SERIAL", format!("tcp:{address},server=on,wait=on"))
            .stdout(stdout)
            .stderr(Stdio::null());
        let mut qemu = command.spawn().map_err(failed)?;
        match connect(&address) {
            Ok(port) => Ok(Self { qemu, port: BufReader::new(port), address, _folder: folder }),
            Err(source) => {
                qemu.kill().ok();
                qemu.wait().ok();
                Err(failed(source))
            }
        }
    }

    /// Hangs up, so that another program may take the port at the address that is returned.
    ///
    /// # Errors
    ///
    /// When the port cannot be closed.
    pub fn hang_up(&mut self) -> io::Result<&str> {
        self.port.get_ref().shutdown(std::net::Shutdown::Both)?;
        Ok(&self.address)
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
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Used {
    /// Seconds of the board's time.
    pub seconds: u32,
    /// Instructions by task; "sleep" are those that were not carried out.
    pub instructions: Vec<(String, u64)>,
    /// Readings told over the link.
    pub readings: u32,
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
    if let Some(stdout) = &mut session.qemu.stdout {
        stdout.read_to_string(&mut said).map_err(failed)?;
    }
    let mut used = Used { seconds, ..Used::default() };
    used.readings = told.lines().filter(|line| line.starts_with('{')).count() as u32;
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
            used.instructions.push((name.to_owned(), ticks * INSTRUCTIONS_PER_SLOW_TICK));
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
