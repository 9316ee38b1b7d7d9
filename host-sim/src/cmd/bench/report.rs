//! Tables for people, records for programs.

use std::io::Write as _;

use serde_json::{Map, Value, json};

use super::Common;
use super::spec::SCORED_FROM;

/// A table for people.
#[derive(Debug)]
pub struct Table {
    /// What it shows, one line.
    pub title: String,
    /// What has to be known to read it.
    pub notes: Vec<String>,
    /// Heads of the columns; the first column names the row.
    pub columns: Vec<String>,
    /// Cells.
    pub rows: Vec<Vec<String>>,
}

/// What a benchmark found.
#[derive(Debug, Default)]
pub struct Report {
    /// Name of the benchmark.
    pub name: &'static str,
    /// For people.
    pub tables: Vec<Table>,
    /// For programs: one flat object a cell.
    pub records: Vec<Map<String, Value>>,
    /// What was read wrongly, for a benchmark that must not find any.
    pub wrong: Vec<String>,
}

impl Report {
    /// Prints in the form that was asked for.
    pub fn print(&self, common: &Common) -> anyhow::Result<()> {
        if self.tables.is_empty() && self.records.is_empty() {
            // Nothing was run: a scene was shown.
            return Ok(());
        }
        let mut out = std::io::stdout().lock();
        if common.json {
            let seeds = if common.tuning { "tuning" } else { "scored" };
            let document = json!({
                "schema": 1, "bench": self.name, "seeds": seeds, "scored_from": SCORED_FROM,
                "quick": common.quick, "records": self.records,
            });
            writeln!(out, "{document}")?;
        } else if common.csv {
            self.print_csv(&mut out)?;
        } else {
            for table in &self.tables {
                table.print(&mut out)?;
            }
            if common.tuning {
                writeln!(out, "Tuning seeds: these figures are not results.")?;
            }
        }
        Ok(())
    }

    fn print_csv(&self, out: &mut impl std::io::Write) -> anyhow::Result<()> {
        let mut names: Vec<&String> = Vec::new();
        for name in self.records.iter().flat_map(Map::keys) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let head: Vec<&str> = names.iter().map(|n| n.as_str()).collect();
        writeln!(out, "{}", head.join(","))?;
        for record in &self.records {
            let cells: Vec<String> = names
                .iter()
                .map(|name| match record.get(*name) {
                    None | Some(Value::Null) => String::new(),
                    Some(Value::String(text)) => format!("\"{}\"", text.replace('"', "\"\"")),
                    Some(value) => value.to_string(),
                })
                .collect();
            writeln!(out, "{}", cells.join(","))?;
        }
        Ok(())
    }
}

impl Table {
    fn print(&self, out: &mut impl std::io::Write) -> std::io::Result<()> {
        let lengths = |row: &[String]| row.iter().map(|c| c.chars().count()).collect::<Vec<_>>();
        let mut widths = lengths(&self.columns);
        for row in &self.rows {
            for (width, length) in widths.iter_mut().zip(lengths(row)) {
                *width = (*width).max(length);
            }
        }
        writeln!(out, "{}", self.title)?;
        for note in &self.notes {
            writeln!(out, "  {note}")?;
        }
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            let cells = row.iter().zip(&widths).enumerate();
            let line: Vec<String> = cells
                .map(|(i, (c, &w))| if i == 0 { format!("{c:<w$}") } else { format!("{c:>w$}") })
                .collect();
            writeln!(out, "  {}", line.join("  ").trim_end())?;
        }
        writeln!(out)
    }
}

/// A number with three significant digits, without exponent.
pub fn short(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let digits = if value == 0.0 { 2 } else { 2 - value.abs().log10().floor() as i32 };
    format!("{value:.*}", digits.clamp(0, 5) as usize)
}

/// A progress bar on stderr; nothing where stderr is no terminal.
pub fn progress(steps: usize, what: &str) -> indicatif::ProgressBar {
    let template = "{msg} {bar:40} {pos}/{len} {eta}";
    let style = indicatif::ProgressStyle::with_template(template)
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar());
    indicatif::ProgressBar::new(steps as u64).with_style(style).with_message(what.to_owned())
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn three_digits() {
        for (value, text) in [
            (0.012_345, "0.0123"),
            (1.2345, "1.23"),
            (1234.5, "1234"),
            (0.0, "0.00"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
