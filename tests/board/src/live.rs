//! The device in real time: for a person at a keyboard, and programs at its serial port.

use std::io::{BufRead as _, Read as _, Write as _};
use std::path::Path;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::script::Script;
use crate::time::{MS, US};

/// Virtual time between two looks at the world outside.
const SLICE_PS: u64 = 5 * MS;
/// How often the picture of the screen is written, in slices.
const PICTURE_SLICES: u64 = 50;

/// Runs until the input ends.
///
/// # Errors
/// When there are no pseudo-terminals, or the engine gives up.
pub fn run(mut script: Script, screen: &Path) -> Result<()> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).context("a pseudo-terminal")?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    // The other end is kept open, so that programs may come and go; what they write is not echoed.
    let path = name.to_str().context("the name of the pseudo-terminal")?;
    let other = std::fs::OpenOptions::new().read(true).write(true).open(path)?;
    let mut raw = tcgetattr(&other)?;
    raw.make_raw();
    tcsetattr(&other, OptionalActions::Now, &raw)?;
    fcntl_setfl(&master, OFlags::NONBLOCK)?;
    let mut port = std::fs::File::from(master);
    println!("serial port {path}, screen {}", screen.display());

    let (lines, typed) = mpsc::channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if lines.send(line).is_err() {
                break;
            }
        }
    });
    let (began, mut told, mut slices) = (Instant::now(), 0, 0_u64);
    loop {
        loop {
            match typed.try_recv() {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => match script.line(&line) {
                    Ok(answer) => println!("{answer}"),
                    Err(error) => println!("{error:#}"),
                },
                Err(mpsc::TryRecvError::Empty) => break,
                Err(mpsc::TryRecvError::Disconnected) => return Ok(()),
            }
        }
        let mut bytes = [0; 256];
        if let Ok(count) = port.read(&mut bytes)
            && count > 0
        {
            script.send(&bytes[..count]);
        }
        script.machine.run_until(script.machine.now() + SLICE_PS)?;
        let answer = script.received();
        // What nobody reads is lost, as on a real port that nobody has open.
        let _ = port.write(&answer);
        for line in script.machine.rtt.lines.iter().skip(told) {
            eprintln!("{line}");
        }
        told = script.machine.rtt.lines.len();
        slices += 1;
        if slices.is_multiple_of(PICTURE_SLICES) {
            // The panel may be off.
            let _ = script.lcd(screen);
        }
        let virtual_time = Duration::from_micros(script.machine.now() / US);
        std::thread::sleep(virtual_time.saturating_sub(began.elapsed()));
    }
}
