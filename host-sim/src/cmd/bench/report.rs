//! Tables for people, records for programs.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde_json::{Map, Value, json};

use super::spec::SCORED_FROM;
use super::{Common, say};

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
    /// What was read wrongly, or falls short of what is asked: one line each.
    pub short: Vec<String>,
}

impl Report {
    /// Prints in the form that was asked for.
    pub fn print(&self, common: &Common) -> anyhow::Result<()> {
        if self.tables.is_empty() && self.records.is_empty() {
            // Nothing was run: a scene was shown.
            return Ok(());
        }
        let mut out = String::new();
        if common.json {
            writeln!(out, "{}", self.document(common))?;
        } else if common.csv {
            write!(out, "{}", self.csv())?;
        } else {
            for table in &self.tables {
                table.print(&mut out)?;
            }
            if common.tuning {
                writeln!(out, "Tuning seeds: these figures are not results.")?;
            }
        }
        say(out)
    }

    fn document(&self, common: &Common) -> Value {
        let seeds = if common.tuning { "tuning" } else { "scored" };
        json!({
            "schema": 2, "bench": self.name, "seeds": seeds, "scored_from": SCORED_FROM,
            "quick": common.quick, "records": self.records,
        })
    }

    /// A head, and a line for each record; empty where a record has no such field.
    fn csv(&self) -> String {
        let mut names: Vec<&String> = Vec::new();
        for name in self.records.iter().flat_map(Map::keys) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        let cell = |value: Option<&Value>| match value {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => quoted(text),
            Some(value) => value.to_string(),
        };
        let head = names.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(",");
        let rows = self.records.iter().map(|record| {
            names.iter().map(|name| cell(record.get(*name))).collect::<Vec<_>>().join(",")
        });
        std::iter::once(head).chain(rows).map(|line| line + "\n").collect()
    }
}

/// A field of a CSV file (RFC 4180), in quotation marks where it could be taken for more than one.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

impl Table {
    fn print(&self, out: &mut String) -> std::fmt::Result {
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

/// How often each name came, the most frequent first.
pub fn counted<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut counts = BTreeMap::<&str, usize>::new();
    names.into_iter().for_each(|name| *counts.entry(name).or_default() += 1);
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| Reverse(*count));
    counts.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}

/// A progress bar on stderr; nothing where stderr is no terminal.
pub fn progress(steps: usize, what: &str) -> indicatif::ProgressBar {
    let template = "{msg} {bar:40} {pos}/{len} {eta}";
    let style = indicatif::ProgressStyle::with_template(template)
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar());
    indicatif::ProgressBar::new(steps as u64).with_style(style).with_message(what.to_owned())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
pub mod tests {
    use super::*;

    /// The fields of a CSV file, line by line.
    fn fields(csv: &str) -> Vec<Vec<String>> {
        let (mut rows, mut row, mut field, mut inside) = (vec![], vec![], String::new(), false);
        let mut characters = csv.chars().peekable();
        while let Some(c) = characters.next() {
            match c {
                '"' if inside && characters.next_if_eq(&'"').is_some() => field.push('"'),
                '"' => inside = !inside,
                ',' if !inside => row.push(std::mem::take(&mut field)),
                '\n' if !inside => {
                    row.push(std::mem::take(&mut field));
                    rows.push(std::mem::take(&mut row));
                }
                c => field.push(c),
            }
        }
        assert!(!inside && row.is_empty() && field.is_empty(), "cut off: {csv}");
        rows
    }

    /// Reads back what programs are given: all that is in the records, and in each line as many fields as in the head;
    /// and looks that rows of tables are as long as their heads, too.
    pub fn assert_readable(report: &Report) {
        let common = Common { quick: true, json: true, csv: false, jobs: None, tuning: true };
        let text = report.document(&common).to_string();
        let document: Value = serde_json::from_str(&text).unwrap();
        for (name, value) in [
            ("schema", json!(2)),
            ("bench", json!(report.name)),
            ("seeds", json!("tuning")),
            ("scored_from", json!(1000)),
            ("quick", json!(true)),
        ] {
            assert_eq!(document[name], value, "{name}");
        }
        let records = document["records"].as_array().unwrap();
        assert!(!records.is_empty());
        let rows = fields(&report.csv());
        assert_eq!(rows.len(), records.len() + 1);
        for (record, row) in records.iter().zip(&rows[1..]) {
            assert_eq!(row.len(), rows[0].len(), "{row:?} under {:?}", rows[0]);
            assert!(record.as_object().unwrap().keys().all(|name| rows[0].contains(name)));
            for (name, field) in rows[0].iter().zip(row) {
                let expected = match &record[name] {
                    Value::Null => String::new(),
                    Value::String(text) => text.clone(),
                    value @ (Value::Bool(_) | Value::Number(_)) => value.to_string(),
                    value => panic!("{name} is not flat: {value}"),
                };
                assert_eq!(*field, expected, "{name}");
            }
        }
        for Table { title, columns, rows, .. } in &report.tables {
            assert!(rows.iter().all(|row| row.len() == columns.len()), "{title}");
        }
    }

    #[test]
    fn commas_and_quotation_marks_stay_in_their_field() {
        let record = |pairs: &[(&str, Value)]| {
            pairs.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
        };
        let report = Report {
            name: "test",
            records: vec![
                record(&[("off, all", json!(3)), ("name", json!("two \"m\", three"))]),
                record(&[("name", json!("plain")), ("only here", json!(0.5))]),
            ],
            ..Report::default()
        };
        assert_eq!(
            report.csv(),
            "name,\"off, all\",only here\n\"two \"\"m\"\", three\",3,\nplain,,0.5\n"
        );
        assert_readable(&report);
    }

    #[test]
    fn the_most_frequent_is_named_first() {
        assert_eq!(counted(["few", "many", "also", "many"]), "many 2, also 1, few 1");
        assert_eq!(counted([]), "");
    }

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
