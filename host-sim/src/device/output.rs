//! What the firmware prints, read back.

use super::DeviceError;

/// Cost of a kind of call, in timer ticks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallCost {
    /// Stage of the measurement; "push" for taking in events.
    pub name: String,
    /// Number of calls.
    pub calls: u64,
    /// Ticks in all of them.
    pub ticks: u64,
    /// Ticks in the longest.
    pub longest_ticks: u64,
}

/// One reading as the device printed it, floats as bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceReading {
    /// The lines, each ended by a newline, as `evtach_firmware::report::Lines` writes them.
    pub lines: String,
    /// Ticks of taking in since the reading before.
    pub push_ticks: u64,
    /// Ticks of measuring since the reading before.
    pub poll_ticks: u64,
}

impl DeviceReading {
    /// The value of a key in the reading's first line.
    #[must_use]
    pub fn field(&self, key: &str) -> Option<&str> {
        field(self.lines.lines().next()?, key)
    }
}

/// Bytes of the device's RAM by use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUse {
    /// The tachometer's own state.
    pub tachometer_bytes: u64,
    /// Event store.
    pub store_bytes: u64,
    /// Heat map.
    pub heat_bytes: u64,
    /// Blocks between intake and measurement.
    pub blocks_bytes: u64,
    /// The deepest that the stack has been.
    pub stack_bytes: u64,
}

/// What acquisition over SPI counted; the names are those of `evtach_firmware::sensor::spi`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acquired {
    /// Events that the sensor sent.
    pub sent: u64,
    /// Events that came.
    pub received: u64,
    /// Events left out evenly before measuring.
    pub thinned: u64,
    /// Events that found no free block.
    pub overrun: u64,
    /// Events lost by the bridge.
    pub bridge: u64,
    /// Events lost in damaged frames.
    pub damaged: u64,
    /// Events lost in missing frames.
    pub missing: u64,
    /// Events lost in words that hold none.
    pub undecoded: u64,
}

/// Everything that one run says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Readings in order.
    pub readings: Vec<DeviceReading>,
    /// Events taken in.
    pub events: u64,
    /// What taking in cost.
    pub push: CallCost,
    /// What each stage cost.
    pub stages: Vec<CallCost>,
    /// Events in windows that were given up, because measuring took too long.
    pub overrun: u64,
    /// Memory in use.
    pub memory: MemoryUse,
    /// What came over SPI, when that is where events came from.
    pub acquired: Option<Acquired>,
}

fn field<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    line.split(' ').filter_map(|word| word.split_once('=')).find(|(k, _)| *k == key).map(|(_, v)| v)
}

fn number(line: &str, key: &str) -> Option<u64> {
    field(line, key)?.parse().ok()
}

fn call_cost(line: &str, name: &str) -> Option<CallCost> {
    Some(CallCost {
        name: name.to_owned(),
        calls: number(line, "calls")?,
        ticks: number(line, "ticks")?,
        longest_ticks: number(line, "longest")?,
    })
}

fn memory(line: &str) -> Option<MemoryUse> {
    Some(MemoryUse {
        tachometer_bytes: number(line, "tachometer")?,
        store_bytes: number(line, "store")?,
        heat_bytes: number(line, "heat")?,
        blocks_bytes: number(line, "blocks")?,
        stack_bytes: number(line, "stack")?,
    })
}

fn acquired(line: &str) -> Option<Acquired> {
    Some(Acquired {
        sent: number(line, "sent")?,
        received: number(line, "received")?,
        thinned: number(line, "thinned")?,
        overrun: number(line, "overrun")?,
        bridge: number(line, "bridge")?,
        damaged: number(line, "damaged")?,
        missing: number(line, "missing")?,
        undecoded: number(line, "undecoded")?,
    })
}

#[derive(Default)]
struct Reader {
    readings: Vec<DeviceReading>,
    pending: String,
    push: Option<(u64, CallCost)>,
    stages: Vec<CallCost>,
    overrun: Option<u64>,
    memory: Option<MemoryUse>,
    acquired: Option<Acquired>,
}

impl Reader {
    /// Takes a line; `None` when it makes no sense.
    fn take(&mut self, line: &str) -> Option<()> {
        match line.split(' ').next()? {
            "reading" | "rotor" => self.pending += &format!("{line}\n"),
            "spent" => self.readings.push(DeviceReading {
                lines: std::mem::take(&mut self.pending),
                push_ticks: number(line, "push")?,
                poll_ticks: number(line, "poll")?,
            }),
            "push" => self.push = Some((number(line, "events")?, call_cost(line, "push")?)),
            "stage" => self.stages.push(call_cost(line, line.split_once(" name=")?.1)?),
            "overrun" => self.overrun = Some(number(line, "events")?),
            "memory" => self.memory = Some(memory(line)?),
            "acquired" => self.acquired = Some(acquired(line)?),
            _ => return None,
        }
        Some(())
    }
}

impl Output {
    /// Reads what the firmware printed.
    ///
    /// # Errors
    ///
    /// When a line is not understood, or the closing lines are missing.
    pub fn parse(text: &str) -> Result<Self, DeviceError> {
        let mut reader = Reader::default();
        let mut lines = 0;
        for line in text.lines() {
            lines += 1;
            reader
                .take(line)
                .ok_or_else(|| DeviceError::Line { line: lines, text: line.to_owned() })?;
        }
        let Reader {
            readings,
            push: Some((events, push)),
            stages,
            overrun: Some(overrun),
            memory: Some(memory),
            acquired,
            ..
        } = reader
        else {
            return Err(DeviceError::Line { line: lines + 1, text: String::new() });
        };
        Ok(Self { readings, events, push, stages, overrun, memory, acquired })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
reading t_us=5 window_us=10 events=3 thinned=0 lost=0 status=locked
rotor id=0 x_px=3f800000
spent push=7 poll=9
push events=3 calls=1 ticks=7 longest=7
stage calls=2 ticks=9 longest=5 name=fine scan
overrun events=6
memory tachometer=1 store=2 heat=3 blocks=4 stack=5
";

    #[test]
    fn reads_a_run() {
        let output = Output::parse(TEXT).expect("a whole run");
        assert_eq!(output.readings.len(), 1);
        let reading = &output.readings[0];
        assert_eq!(reading.lines.lines().count(), 2);
        assert_eq!(reading.field("status"), Some("locked"));
        assert_eq!((reading.push_ticks, reading.poll_ticks), (7, 9));
        assert_eq!((output.events, output.push.ticks), (3, 7));
        assert_eq!(
            (output.stages[0].name.as_str(), output.stages[0].longest_ticks),
            ("fine scan", 5)
        );
        assert_eq!((output.overrun, output.memory.stack_bytes), (6, 5));
    }

    #[test]
    fn says_which_line_is_foreign_or_missing() {
        let foreign = TEXT.replace("ticks=9", "ticks=x");
        assert!(matches!(Output::parse(&foreign), Err(DeviceError::Line { line: 5, .. })));
        let cut = &TEXT[..TEXT.find("memory").unwrap_or(0)];
        assert!(matches!(Output::parse(cut), Err(DeviceError::Line { line: 7, .. })));
    }
}
