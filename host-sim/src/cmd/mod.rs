//! One file per subcommand.

use std::io::{ErrorKind, Write as _};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context as _, anyhow, bail};
use evtach_host::recording::{Recording, SHUFFLED};

pub mod bench;
pub mod convert;
mod how;
pub mod info;
pub mod measure;
pub mod plot;
pub mod screen;
mod span;
mod stated;
pub mod synth;
pub mod watch;

/// How it went with a recording, and the exit code that says so: README tells them. Of several recordings the largest counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Outcome {
    /// It was read to its end, and has a speed where one was asked for.
    Done,
    /// It has no speed.
    NoSpeed,
    /// It could not be read to the end of what was asked for: what came before the damage was used all the same.
    Failed,
}

impl Outcome {
    fn of(is_damaged: bool, has_speed: bool) -> Self {
        match (is_damaged, has_speed) {
            (true, _) => Self::Failed,
            (false, true) => Self::Done,
            (false, false) => Self::NoSpeed,
        }
    }
}

impl From<Outcome> for ExitCode {
    fn from(outcome: Outcome) -> Self {
        Self::from(outcome as u8)
    }
}

/// Refuses to write over what is read, by whatever name.
fn keep_apart(input: &Path, output: &Path) -> anyhow::Result<()> {
    // What is not there yet is no other's file.
    let is_same = if input == Path::new("-") {
        let stdin = same_file::Handle::stdin().ok();
        output.is_file() && stdin.is_some() && stdin == same_file::Handle::from_path(output).ok()
    } else {
        input.is_file() && same_file::is_same_file(input, output).unwrap_or(false)
    };
    if is_same { Err(same_file(input, output)) } else { Ok(()) }
}

/// Refuses to write two files to one place, whether there is a file yet or not.
fn keep_new_apart(one: &Path, other: &Path) -> anyhow::Result<()> {
    keep_apart(one, other)?;
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
        Some(folder.join(path.file_name()?))
    };
    let is_same = place(one).is_some_and(|place_of_one| place(other) == Some(place_of_one));
    if is_same { Err(same_file(one, other)) } else { Ok(()) }
}

fn same_file(one: &Path, other: &Path) -> anyhow::Error {
    anyhow!(
        "{} is the same file as {}\nhelp: write to another name",
        other.display(),
        one.display()
    )
}

/// Says what is to be known of a recording once it is read.
fn note(recording: &Recording, name: &str) {
    for note in recording.notes() {
        tell(format!("{name}: {note}"));
    }
}

/// Refuses a recording, once it is read, of which no speed would be right.
fn in_order(recording: &Recording, name: &str) -> anyhow::Result<()> {
    if recording.is_shuffled() {
        bail!("{name}: {SHUFFLED}");
    }
    Ok(())
}

/// Writes what is whole in memory to a file and says on stdout what it is, or to stdout for "-" and says it on stderr.
fn deliver(out: &Path, bytes: &[u8], said: &str) -> anyhow::Result<()> {
    if out == Path::new("-") {
        tell(said);
        return say(bytes);
    }
    std::fs::write(out, bytes)
        .with_context(|| format!("{}: cannot be written; choose another place", out.display()))?;
    say(format!("{said}\n"))
}

/// Says something on stderr. Where nobody hears it, or it has no room, that is no reason to stop, as it is to `eprintln!`.
pub fn tell(line: impl AsRef<str>) {
    let line = format!("{}\n", line.as_ref());
    std::io::stderr().write_all(line.as_bytes()).ok();
}

/// Prints an answer. Where there is no room for it, that is an error as any other; where nobody reads any more, it is none.
fn say(answer: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(answer.as_ref()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("standard output")
        }
        _ => Ok(()),
    }
}
