//! A device on the table: switched on when it is made, switched off when it goes away.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

use evtach_firmware::record::{self, Header};
use evtach_host::frame::Frame;
use evtach_tests::{Loaded, show};
use serde_json::Value;

/// Least of the stack that is never used.
const STACK_SPARE_BYTES: u64 = 1024;

/// A camera that can be plugged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Camera {
    Davis346,
    Dvxplorer,
}

/// What tells of a plug that is pulled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unplug {
    /// All that tells of it on a real port.
    Plain,
    /// The port says so, but a transfer that was under way never ends.
    Quiet,
    /// Transfers fail, and the port says nothing.
    ErrorsOnly,
}

/// The emulated board with the image in its flash.
pub struct Board {
    process: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    folder: tempfile::TempDir,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Builds something and returns the program that comes of it.
fn build(args: &[&str]) -> Option<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(args)
        .args(["--quiet", "--message-format=json-render-diagnostics"])
        .current_dir(root())
        .stderr(Stdio::inherit())
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "cargo {args:?} fails");
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from))
}

/// The emulator and the image: built once. None, with the reason shown, where the engine cannot be built.
fn programs() -> Option<&'static (PathBuf, PathBuf)> {
    static PROGRAMS: OnceLock<Option<(PathBuf, PathBuf)>> = OnceLock::new();
    let programs = PROGRAMS.get_or_init(|| {
        let cmake = Command::new("cmake").arg("--version").stdout(Stdio::null()).status();
        if !cmake.is_ok_and(|status| status.success()) {
            return None;
        }
        let board = ["build", "--release", "--manifest-path", "tests/board/Cargo.toml"];
        let emulator = build(&[&board[..], &["--target-dir", "target/board"]].concat());
        let image = build(&["fw"]);
        Some((emulator.expect("a program"), image.expect("an image")))
    });
    if programs.is_none() {
        show("skipped: no cmake, which the emulated processor is built with (./ci.sh install)");
    }
    programs.as_ref()
}

impl Board {
    /// Gives a device power. None, with the reason shown, where the emulator cannot be built.
    pub fn switch_on() -> Option<Self> {
        let (emulator, image) = programs()?;
        let mut process = Command::new(emulator)
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the emulator starts");
        let stdin = process.stdin.take().expect("a pipe");
        let stdout = BufReader::new(process.stdout.take().expect("a pipe"));
        Some(Self { process, stdin, stdout, folder: tempfile::tempdir().expect("a folder") })
    }

    /// Says a line to the emulator; what it cannot do is an error.
    pub fn try_say(&mut self, line: &str) -> Result<String, String> {
        writeln!(self.stdin, "{line}").expect("the emulator runs");
        let mut answer = String::new();
        self.stdout.read_line(&mut answer).expect("the emulator answers");
        let answer = answer.trim_end();
        match answer.strip_prefix("ok") {
            Some(rest) => Ok(rest.trim_start().to_owned()),
            None => Err(format!("{line}: {answer}")),
        }
    }

    fn say(&mut self, line: &str) -> String {
        self.try_say(line).unwrap_or_else(|error| {
            let report = self.try_say("report").unwrap_or_else(|error| error);
            unreachable!("{error}\n{report}\n{}", self.defmt_log().join("\n"))
        })
    }

    /// Lets so many seconds pass.
    pub fn run(&mut self, seconds: f64) {
        self.say(&format!("run {seconds}"));
    }

    /// Plugs a camera in that sees these events, from the moment on in which the device starts it.
    pub fn plug_camera(&mut self, camera: Camera, sees: &Loaded) {
        let path = self.folder.path().join("camera.ev8");
        let header = Header {
            geometry: sees.geometry,
            first_us: sees.events.first().map_or(0, |event| event.t_us),
            events: sees.events.len() as u32,
        };
        let mut bytes = header.encode().to_vec();
        bytes.extend(sees.events.iter().flat_map(record::encode));
        std::fs::write(&path, bytes).expect("a file");
        let name = match camera {
            Camera::Davis346 => "davis346",
            Camera::Dvxplorer => "dvxplorer",
        };
        self.say(&format!("plug {name} {}", path.display()));
    }

    /// Plugs a camera in that sees these events again and again, each time so many seconds later.
    pub fn plug_camera_for_good(&mut self, camera: Camera, sees: &Loaded, period_s: f64) {
        self.say(&format!("repeat {period_s}"));
        self.plug_camera(camera, sees);
    }

    /// Puts the cap on the camera's lens.
    pub fn cover(&mut self) {
        self.say("cover");
    }

    /// Plugs the camera in again that was pulled out.
    pub fn plug_again(&mut self) {
        self.say("plug again");
    }

    /// Plugs in something that is no camera.
    pub fn plug_stick(&mut self) {
        self.say("plug stick");
    }

    /// Pulls the plug.
    pub fn unplug(&mut self, how: Unplug) {
        self.say(match how {
            Unplug::Plain => "unplug",
            Unplug::Quiet => "unplug quiet",
            Unplug::ErrorsOnly => "unplug errors",
        });
    }

    /// Taps the screen.
    pub fn tap(&mut self, x: u16, y: u16) {
        self.say(&format!("touch {x} {y}"));
        self.run(0.1);
        self.say("lift");
        self.run(0.4);
    }

    /// Presses the blue button for so long.
    pub fn press(&mut self, seconds: f64) {
        self.say("press");
        self.run(seconds);
        self.say("release");
        self.run(0.4);
    }

    /// Sends a line to the serial port.
    pub fn serial(&mut self, line: &str) {
        self.say(&format!("serial {}\\n", line.as_bytes().escape_ascii()));
    }

    /// What came from the serial port and was not read.
    pub fn read(&mut self) -> String {
        unescape(&self.say("read"))
    }

    /// Sends a line and waits up to five seconds for the one that answers it.
    pub fn query(&mut self, line: &str) -> String {
        unescape(&self.say(&format!("query 5 {}", line.as_bytes().escape_ascii())))
    }

    /// Asks until the answer is as wanted; panics with the last one after so many seconds.
    pub fn wait_for(&mut self, seconds: f64, line: &str, wanted: impl Fn(&str) -> bool) -> String {
        let mut answer = String::new();
        for _ in 0..(seconds * 10.0) as usize {
            answer = self
                .try_say(&format!("query 1 {line}"))
                .map_or_else(|error| error, |a| unescape(&a));
            if wanted(&answer) {
                return answer;
            }
            self.run(0.1);
        }
        assert!(wanted(&answer), "{line} is still answered {answer}\n{}", self.say("report"));
        answer
    }

    /// What is on the panel.
    pub fn lcd(&mut self) -> Frame {
        let path = self.folder.path().join("lcd.png");
        self.say(&format!("lcd {}", path.display()));
        Frame::read_png(&path).expect("a picture")
    }

    /// What the device has logged so far.
    pub fn defmt_log(&mut self) -> Vec<String> {
        let path = self.folder.path().join("log.txt");
        if self.try_say(&format!("log {}", path.display())).is_err() {
            return Vec::new();
        }
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    /// Instructions, traffic and faults.
    pub fn report(&mut self) -> Value {
        serde_json::from_str(&self.say("report")).expect("JSON")
    }

    /// What the camera has seen, left out and dropped.
    pub fn camera(&mut self) -> Value {
        serde_json::from_str(&self.say("camera")).expect("JSON")
    }

    /// Writes something into the serial flash, as a programmer does.
    pub fn flash(&mut self, at: u32, bytes: &[u8]) {
        let path = self.folder.path().join("flash.bin");
        std::fs::write(&path, bytes).expect("a file");
        self.say(&format!("flash {at} {}", path.display()));
    }

    /// The blue button goes down, and stays there.
    pub fn hold_button(&mut self) {
        self.say("press");
    }

    /// Something goes wrong, in the emulator's words.
    pub fn break_(&mut self, what: &str) {
        self.say(what);
    }

    /// Nothing went wrong that nobody asked for: no fault of the processor, no reset, no register that is not modelled, and the stack
    /// was never nearly used up.
    pub fn assert_sound(&mut self) {
        let report = self.report();
        for empty in ["faults", "remarks", "unknown_registers", "unknown_flash_commands"] {
            assert_eq!(report[empty].as_array().map(Vec::len), Some(0), "{empty}: {report}");
        }
        assert_eq!(report["resets"], serde_json::json!(["Power"]), "{report}");
        assert_eq!(report["toggle_errors"], 0, "{report}");
        let untouched = report["stack_untouched_bytes"].as_u64();
        show(&format!("stack: {untouched:?} B never used"));
        assert!(untouched > Some(STACK_SPARE_BYTES), "{report}");
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Undoes the escapes of [`u8::escape_ascii`], as far as text goes.
fn unescape(text: &str) -> String {
    text.replace("\\n", "\n").replace("\\r", "\r").replace("\\\"", "\"").replace("\\'", "'")
}
