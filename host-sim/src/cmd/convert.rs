//! `evtach convert`.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use evtach_core::{Event, Polarity, Roi};
use evtach_host::measure::{LONGEST_WAIT_US, Since, Timeline};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, ImuSample};
use indicatif::{ProgressBar, ProgressStyle};

use super::how::parse_roi;
use super::span::Span;
use super::stated::Stated;
use super::{keep_apart, tell};

/// Arguments of `evtach convert`.
#[derive(clap::Args)]
pub struct Args {
    /// Recording to read; "-" reads stdin.
    input: PathBuf,
    /// Recording to write, its format by the extension (.raw is EVT3, .evt2.raw is EVT2); "-" writes to stdout.
    output: PathBuf,
    /// Format to write, whatever the extension: evt2, evt3, dat, aedat4, csv, npy, es, spi, ev8.
    #[arg(long, value_name = "FORMAT")]
    to: Option<WriteFormat>,
    #[command(flatten)]
    stated: Stated,
    /// Keep only the events in this rectangle of pixels; places stay as they are.
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_roi)]
    roi: Option<Roi>,
    #[command(flatten)]
    span: Span,
    /// Keep one event in N.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    decimate: u64,
    /// Let time begin at zero. Without it times stay as they are wherever the format can hold them.
    #[arg(long)]
    rebase: bool,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let Some(format) = args.to.or_else(|| WriteFormat::from_path(&args.output)) else {
        bail!(
            "cannot tell the format to write from \"{}\"\nhelp: give it with --to",
            args.output.display()
        );
    };
    keep_apart(&args.input, &args.output)?;
    let since_us = args.span.since_us()?;
    let name = args.input.display().to_string();
    let options = args.stated.into();
    let mut recording = recording::open(&args.input, &options).with_context(|| name.clone())?;
    for sentence in &recording.assumed {
        tell(format!("assumed: {sentence}"));
    }
    let mut writer = write::create(&args.output, format, recording.geometry)
        .with_context(|| args.output.display().to_string())?;
    let bar = progress_bar(&args.input);
    let mut picker = Picker::new(&args, format, since_us);
    let mut chunk: Vec<Event> = Vec::new();
    let mut picked: Vec<Event> = Vec::new();
    let mut samples: Vec<ImuSample> = Vec::new();
    let mut failure = None;
    loop {
        chunk.clear();
        picked.clear();
        // What came before the damage is written all the same.
        let more = recording.read_chunk(&mut chunk).unwrap_or_else(|error| {
            failure = Some(error);
            false
        });
        let more = picker.take(&chunk, &mut picked) && more;
        if !more {
            picker.flush(&mut picked);
        }
        samples.append(&mut recording.take_imu());
        writer
            .write_imu(&picker.take_imu(&mut samples))
            .and_then(|()| writer.write(&picked))
            .with_context(|| args.output.display().to_string())?;
        if recording.starts_anew() {
            picker.start_anew();
        }
        bar.set_position(recording.bytes_read());
        if !more {
            break;
        }
    }
    writer.finish().with_context(|| args.output.display().to_string())?;
    bar.finish_and_clear();
    for note in &recording.side().notes {
        tell(format!("note: {note}"));
    }
    picker.report(recording.out_of_bounds());
    match failure {
        // What is damaged is not wanted.
        Some(error) if picker.is_past_end => {
            tell(format!("note: behind what is kept, {error}"));
            Ok(ExitCode::SUCCESS)
        }
        Some(error) => Err(error).with_context(|| name),
        None => Ok(ExitCode::SUCCESS),
    }
}

fn progress_bar(input: &Path) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:30} {bytes}/{total_bytes} {eta}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    match std::fs::metadata(input) {
        Ok(file) if file.is_file() => ProgressBar::new(file.len()).with_style(style),
        _ => ProgressBar::no_length(),
    }
}

/// Chooses, shifts and, where the format needs it, sorts the events.
struct Picker {
    roi: Option<Roi>,
    start_us: u64,
    end_us: u64,
    decimate: u64,
    rebase: bool,
    latest_us: u64,
    format: WriteFormat,
    /// The part that is to be kept, in words, where it is not all.
    part: Option<String>,
    since: Since,
    /// The clock of the inertial samples, which need not come with the events of their time.
    imu_timeline: Timeline,
    /// Time of the first event.
    first_us: Option<u64>,
    /// What is taken off every time, once an event of the part that is kept has come.
    shift_us: Option<u64>,
    seen: u64,
    written: u64,
    /// Events whose time would lie before zero.
    early: u64,
    /// Events one after the other that lie so far behind the end that nothing is waited for.
    beyond: u64,
    /// Whether the last event lies behind the end.
    is_past_end: bool,
    /// Inertial samples that the format has no place for.
    imu_left_out: usize,
    sorter: Option<Sorter>,
}

impl Picker {
    fn new(args: &Args, format: WriteFormat, since_us: Range<u64>) -> Self {
        let (latest_us, ordered) = format.limits();
        let Range { start: start_us, end: end_us } = since_us;
        Self {
            roi: args.roi,
            start_us,
            end_us,
            decimate: args.decimate,
            rebase: args.rebase,
            latest_us,
            format,
            part: args.span.part(args.roi),
            since: Since::default(),
            imu_timeline: Timeline::default(),
            first_us: None,
            shift_us: None,
            seen: 0,
            written: 0,
            early: 0,
            beyond: 0,
            is_past_end: false,
            imu_left_out: 0,
            sorter: ordered.then(Sorter::default),
        }
    }

    /// Says that what comes next is another recording.
    const fn start_anew(&mut self) {
        self.since.start_anew();
    }

    /// So many events behind the end are no wrong times among right ones.
    const MOST_BEYOND: u64 = 65_536;

    /// Takes in events; `false` when none behind them will be wanted.
    fn take(&mut self, events: &[Event], out: &mut Vec<Event>) -> bool {
        for event in events {
            self.first_us.get_or_insert(event.t_us);
            let since_us = self.since.of(event);
            // Recorders write inertial samples behind the events of their time.
            let is_beyond = since_us.saturating_sub(self.end_us) > LONGEST_WAIT_US;
            self.beyond = if is_beyond { self.beyond + 1 } else { 0 };
            self.is_past_end = since_us >= self.end_us;
            if self.is_past_end || since_us < self.start_us {
                continue;
            }
            let shift_us = self.shift_us(event.t_us, since_us - self.start_us);
            if self.roi.is_some_and(|roi| !roi.contains(event.x, event.y)) {
                continue;
            }
            self.seen += 1;
            if !(self.seen - 1).is_multiple_of(self.decimate) {
                continue;
            }
            let Some(t_us) = event.t_us.checked_sub(shift_us) else {
                self.early += 1;
                continue;
            };
            let event = Event { t_us, ..*event };
            self.written += 1;
            match &mut self.sorter {
                Some(sorter) => sorter.push(event),
                None => out.push(event),
            }
        }
        if let Some(sorter) = &mut self.sorter {
            sorter.release(out, false);
        }
        self.beyond < Self::MOST_BEYOND
    }

    /// The inertial samples of the part that is wanted. They wait for its first event, which says when it begins.
    fn take_imu(&mut self, samples: &mut Vec<ImuSample>) -> Vec<ImuSample> {
        let (Some(first_us), Some(shift_us)) = (self.first_us, self.shift_us) else {
            return Vec::new();
        };
        let from_us = if self.start_us > 0 { first_us.saturating_add(self.start_us) } else { 0 };
        let wanted_us = from_us..first_us.saturating_add(self.end_us);
        let at =
            |sample: &ImuSample| Event { t_us: sample.t_us, x: 0, y: 0, polarity: Polarity::On };
        let times: Vec<Event> = samples.iter().map(at).collect();
        let mut is_wanted = Vec::new();
        self.imu_timeline.lay(&times, |laid| is_wanted.push(wanted_us.contains(&laid.t_us)));
        let wanted =
            samples.drain(..).zip(is_wanted).filter_map(|(sample, is)| is.then_some(sample));
        let mut wanted: Vec<ImuSample> = wanted
            .filter_map(|sample| {
                Some(ImuSample { t_us: sample.t_us.checked_sub(shift_us)?, ..sample })
            })
            .collect();
        if !self.format.holds_imu() {
            self.imu_left_out += wanted.len();
            wanted.clear();
        }
        wanted
    }

    /// What is taken off every time, as told by the first event of the part that is kept, so long after it begins.
    fn shift_us(&mut self, t_us: u64, since_start_us: u64) -> u64 {
        *self.shift_us.get_or_insert_with(|| {
            // A minute of headroom: the recording goes on from its first event.
            let shift = self.rebase || t_us.saturating_add(60_000_000) > self.latest_us;
            if shift && !self.rebase {
                tell(format!(
                    "note: time begins at zero, because {} cannot hold {t_us} us",
                    self.format.as_str()
                ));
            }
            // Zero is where the kept part begins.
            if shift { t_us.saturating_sub(since_start_us) } else { 0 }
        })
    }

    fn flush(&mut self, out: &mut Vec<Event>) {
        if let Some(sorter) = &mut self.sorter {
            sorter.release(out, true);
        }
    }

    fn report(&self, out_of_bounds: u64) {
        let left_out = self.seen - self.written - self.early;
        tell(format!("{} events written", self.written));
        if let Some(part) = self.part.as_ref().filter(|_| self.seen == 0) {
            tell(format!("note: nothing is kept: no events {part}; widen what is stated"));
        }
        if left_out > 0 {
            tell(format!("{left_out} events left out by --decimate"));
        }
        if self.early > 0 {
            tell(format!(
                "{} events left out: their time lies before the first event's, where time begins at zero; other formats, without --rebase, hold it",
                self.early
            ));
        }
        if self.imu_left_out > 0 {
            tell(format!(
                "{} inertial samples left out: {} has no place for them, aedat4 has",
                self.imu_left_out,
                self.format.as_str()
            ));
        }
        if out_of_bounds > 0 {
            tell(format!("{out_of_bounds} events outside the sensor left out"));
        }
        if let Some(sorter) = &self.sorter
            && sorter.moved > 0
        {
            tell(format!(
                "{} events put into the order of time, which {} needs",
                sorter.moved,
                self.format.as_str()
            ));
        }
    }
}

/// Puts events into the order of time within a span; what comes later than that is for the writer to refuse.
#[derive(Default)]
struct Sorter {
    held: Vec<Event>,
    latest_us: u64,
    moved: u64,
    /// Whether one came later than that.
    gave_up: bool,
}

impl Sorter {
    /// Sensors mix up events within microseconds, recorders within some packets.
    const SPAN_US: u64 = 20_000;

    fn push(&mut self, event: Event) {
        self.gave_up |= self.latest_us.saturating_sub(event.t_us) > Self::SPAN_US;
        self.moved += u64::from(event.t_us < self.latest_us);
        self.latest_us = self.latest_us.max(event.t_us);
        self.held.push(event);
    }

    fn release(&mut self, out: &mut Vec<Event>, all: bool) {
        if self.gave_up {
            out.append(&mut self.held);
            return;
        }
        if self.moved > 0 {
            // Stable: events of one microsecond stay in their order.
            self.held.sort_by_key(|event| event.t_us);
        }
        let until = if all { u64::MAX } else { self.latest_us.saturating_sub(Self::SPAN_US) };
        let ready = self.held.partition_point(|event| event.t_us <= until);
        out.extend(self.held.drain(..ready));
    }
}

#[cfg(test)]
mod tests {
    use evtach_core::Polarity;

    use super::*;

    #[test]
    fn sorter_leaves_a_large_step_back_to_the_writer() {
        let at = |t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On };
        let (mut sorter, mut out) = (Sorter::default(), Vec::new());
        for t_us in [0, 30_000, 5, 30_001] {
            sorter.push(at(t_us));
        }
        sorter.release(&mut out, false);
        let times: Vec<u64> = out.iter().map(|event| event.t_us).collect();
        assert_eq!(times, [0, 30_000, 5, 30_001]);
    }

    #[test]
    fn sorter_mends_small_steps_back() {
        let at = |t_us| Event { t_us, x: 0, y: 0, polarity: Polarity::On };
        let mut sorter = Sorter::default();
        let mut out = Vec::new();
        for t_us in [0, 5, 3, 30_000, 29_999, 60_000] {
            sorter.push(at(t_us));
            sorter.release(&mut out, false);
        }
        sorter.release(&mut out, true);
        let times: Vec<u64> = out.iter().map(|event| event.t_us).collect();
        assert_eq!(times, [0, 3, 5, 29_999, 30_000, 60_000]);
        assert_eq!(sorter.moved, 2);
    }
}
