//! What `evtach info` counts while a recording goes by, in bounded memory.

use evtach_core::{Event, Geometry, Polarity};

/// First and last time and number of one kind of events.
#[derive(Clone, Copy, Debug, Default)]
pub struct Count {
    pub count: u64,
    pub first_us: u64,
    pub last_us: u64,
}

impl Count {
    fn add(&mut self, t_us: u64) {
        self.first_us = if self.count == 0 { t_us } else { self.first_us.min(t_us) };
        self.last_us = self.last_us.max(t_us);
        self.count += 1;
    }

    /// Mean rate in events per second over `span_us`.
    pub fn rate(&self, span_us: u64) -> f64 {
        if span_us == 0 { 0.0 } else { self.count as f64 * 1e6 / span_us as f64 }
    }
}

/// A pause in the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// When the last event before it came.
    pub after_us: u64,
    pub length_us: u64,
}

/// Everything counted.
#[derive(Debug)]
pub struct Statistics {
    pub all: Count,
    pub on: Count,
    pub off: Count,
    /// Pauses longer than [`Statistics::GAP_US`].
    pub gaps: u64,
    /// The longest pauses, longest first.
    pub longest: Vec<Gap>,
    pub timeline: Timeline,
    /// Brighter less darker events in steps of [`Statistics::STEP_US`] from the first event, for the spectrum.
    pub balance: Vec<f32>,
    /// The same for each cell of a grid over the sensor, the first second.
    pub cells: Vec<Vec<f32>>,
    geometry: Geometry,
    last_us: Option<u64>,
}

impl Statistics {
    /// A pause that is told, in microseconds.
    pub const GAP_US: u64 = 10_000;
    /// Step of the spectrum's input in microseconds: periodicities up to 2 kHz.
    pub const STEP_US: u64 = 250;
    /// Steps of the spectrum's input: the first 16 s.
    const STEPS: u64 = 1 << 16;
    /// Cells along each side of the sensor, and their steps: 16 MiB.
    const GRID: usize = 32;
    const CELL_STEPS: u64 = 1 << 12;
    const LONGEST: usize = 3;

    pub fn new(geometry: Geometry) -> Self {
        Self {
            all: Count::default(),
            on: Count::default(),
            off: Count::default(),
            gaps: 0,
            longest: Vec::new(),
            timeline: Timeline::new(),
            balance: Vec::new(),
            cells: vec![Vec::new(); Self::GRID * Self::GRID],
            geometry,
            last_us: None,
        }
    }

    pub fn add(&mut self, event: &Event) {
        let t_us = event.t_us;
        self.all.add(t_us);
        let sign = match event.polarity {
            Polarity::On => {
                self.on.add(t_us);
                1.0
            }
            Polarity::Off => {
                self.off.add(t_us);
                -1.0
            }
        };
        let length_us = self.last_us.map_or(0, |last_us| t_us.saturating_sub(last_us));
        if length_us > Self::GAP_US {
            self.gap(Gap { after_us: self.last_us.unwrap_or(0), length_us });
        }
        self.last_us = Some(t_us);
        let since_us = t_us.saturating_sub(self.all.first_us);
        self.timeline.add(since_us);
        let step = since_us / Self::STEP_US;
        if step < Self::STEPS {
            add_at(&mut self.balance, step as usize, sign);
        }
        if step < Self::CELL_STEPS {
            let cell = |at: u16, size: u16| usize::from(at) * Self::GRID / usize::from(size);
            let (column, row) =
                (cell(event.x, self.geometry.width_px), cell(event.y, self.geometry.height_px));
            if let Some(cell) = self.cells.get_mut(row * Self::GRID + column) {
                add_at(cell, step as usize, sign);
            }
        }
    }

    fn gap(&mut self, gap: Gap) {
        self.gaps += 1;
        self.longest.push(gap);
        self.longest.sort_by_key(|gap| std::cmp::Reverse(gap.length_us));
        self.longest.truncate(Self::LONGEST);
    }

    /// From the first event to the last, in microseconds.
    pub const fn span_us(&self) -> u64 {
        self.all.last_us.saturating_sub(self.all.first_us)
    }
}

fn add_at(series: &mut Vec<f32>, at: usize, value: f32) {
    if series.len() <= at {
        series.resize(at + 1, 0.0);
    }
    series[at] += value;
}

/// Events over time in a fixed number of bins, which grow wider as the recording goes on.
#[derive(Debug)]
pub struct Timeline {
    bins: Vec<u64>,
    bin_us: u64,
}

impl Timeline {
    const BINS: usize = 4096;
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

    fn new() -> Self {
        Self { bins: vec![0; Self::BINS], bin_us: 1 }
    }

    fn add(&mut self, since_us: u64) {
        while since_us / self.bin_us >= Self::BINS as u64 {
            for index in 0..Self::BINS / 2 {
                self.bins[index] = self.bins[2 * index] + self.bins[2 * index + 1];
            }
            self.bins[Self::BINS / 2..].fill(0);
            self.bin_us *= 2;
        }
        self.bins[(since_us / self.bin_us) as usize] += 1;
    }

    /// Rates in events per second in about `columns` columns over `span_us`, with the width of a column in
    /// microseconds.
    pub fn columns(&self, span_us: u64, columns: u64) -> (Vec<f64>, u64) {
        let per_column = (span_us / self.bin_us + 1).div_ceil(columns).max(1);
        let column_us = per_column * self.bin_us;
        let used = (span_us / self.bin_us + 1).min(Self::BINS as u64) as usize;
        let rates = self.bins[..used]
            .chunks(per_column as usize)
            .map(|bins| {
                bins.iter().sum::<u64>() as f64 * 1e6 / (bins.len() as u64 * self.bin_us) as f64
            })
            .collect();
        (rates, column_us)
    }

    /// The rates as a row of bars.
    pub fn bars(rates: &[f64]) -> String {
        let peak = rates.iter().copied().fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        rates.iter().map(|rate| Self::BARS[((rate / peak * 8.0) as usize).min(7)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeline_keeps_every_event_as_it_widens() {
        let mut timeline = Timeline::new();
        for index in 0..100_000_u64 {
            timeline.add(index * 100);
        }
        assert_eq!(timeline.bins.iter().sum::<u64>(), 100_000);
        let (rates, column_us) = timeline.columns(10_000_000, 50);
        assert!(rates.len() <= 50 && column_us >= 10_000_000 / 50);
        assert!(rates.iter().all(|rate| (rate - 10_000.0).abs() < 500.0), "{rates:?}");
    }

    #[test]
    fn gaps_are_counted_and_the_longest_kept() {
        let mut statistics = Statistics::new(Geometry { width_px: 640, height_px: 480 });
        for t_us in [0, 20_000, 25_000, 60_000, 100_000, 111_000, 111_001] {
            statistics.add(&Event { t_us, x: 0, y: 0, polarity: Polarity::On });
        }
        assert_eq!(statistics.gaps, 4);
        assert_eq!(statistics.longest[0], Gap { after_us: 60_000, length_us: 40_000 });
        assert_eq!(statistics.longest.len(), 3);
    }
}
