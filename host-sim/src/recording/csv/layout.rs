//! Which column is what, found from a header line or from the first rows.

use evtach_core::Geometry;

use crate::recording::TimeUnit;
use crate::recording::error::{Place, RecordingError};
use crate::recording::geometry;

/// Layout of a text recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Columns of t, x, y and polarity, counted from 0.
    pub columns: [usize; 4],
    pub unit: TimeUnit,
    pub geometry: Option<Geometry>,
    /// Lines before the first event.
    pub skip_lines: u64,
    /// One sentence each on how this was found.
    pub assumed: Vec<String>,
}

/// Whether a byte separates fields: commas, semicolons, tabs and runs of blanks all do.
pub const fn separates(byte: u8) -> bool {
    matches!(byte, b',' | b';' | b'\t' | b' ' | b'\r')
}

/// Fields of a line.
pub fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| u8::try_from(c).is_ok_and(separates)).filter(|field| !field.is_empty())
}

/// Finds the layout from the first lines of a file; the unit of its times may be stated.
pub fn find(head: &str, stated_unit: Option<TimeUnit>) -> Result<Layout, RecordingError> {
    let mut names: Option<Vec<String>> = None;
    let mut layout = Layout {
        columns: [0, 1, 2, 3],
        unit: TimeUnit::Microseconds,
        geometry: None,
        skip_lines: 0,
        assumed: Vec::new(),
    };
    let mut rows: Vec<Vec<&str>> = Vec::new();
    let mut vendor_order = false;
    for line in head.lines() {
        let whole = line.trim_start_matches('\u{feff}');
        let line = whole.trim();
        let numeric = fields(line).next().is_some_and(|field| field.parse::<f64>().is_ok());
        if rows.is_empty() && !numeric {
            layout.skip_lines += 1;
            let bare = line.trim_start_matches(['#', '%']).trim();
            // A tab in front stands behind a column without a name.
            let named = names_in(if whole.starts_with('\t') { whole } else { bare });
            if let Some(value) = bare.strip_prefix("geometry:") {
                layout.geometry = geometry::parse(value.trim());
                vendor_order = true;
            } else if columns_from_names(&named).is_some() {
                layout.geometry = size_from_names(bare).or(layout.geometry);
                names = Some(named);
            } else if !line.is_empty() && !line.starts_with(['#', '%']) {
                return Err(not_events(layout.skip_lines, line));
            }
            continue;
        }
        let row: Vec<&str> = fields(line).collect();
        if rows.is_empty() && row.len() == 2 && layout.skip_lines == 0 {
            layout.skip_lines += 1;
            layout.geometry = geometry::parse(&format!("{},{}", row[0], row[1]));
            continue;
        }
        if row.len() < 4 {
            // The last line of the look-ahead may be cut.
            break;
        }
        rows.push(row);
        if rows.len() == 256 {
            break;
        }
    }
    // What tells the columns and has no row is a recording without events.
    if rows.is_empty() && names.is_none() && !vendor_order {
        let first = head.lines().next().unwrap_or_default();
        return Err(not_events(1, first.trim_start_matches('\u{feff}')));
    }
    let mut told_unit = None;
    if let Some(found) = names.and_then(|names| columns_of_rows(names, &rows)) {
        for (column, found) in layout.columns.iter_mut().zip(&found) {
            *column = found.0;
        }
        told_unit = found[0].1;
    } else {
        layout.columns = if vendor_order { [3, 0, 1, 2] } else { columns_from_rows(&rows) };
        let order = order(layout.columns);
        layout.assumed.push(format!(
            "columns {order}{}",
            if vendor_order { " (as %geometry files have them)" } else { " from the first rows" }
        ));
    }
    let seen = TimeUnit::from_times(&column(&rows, layout.columns[0]), f64::EPSILON);
    let (unit, sentence) = TimeUnit::settle(stated_unit, told_unit, "column", seen)?;
    layout.unit = unit;
    // Without a row, what was seen was nothing.
    if !rows.is_empty() || stated_unit.or(told_unit).is_some() {
        layout.assumed.push(sentence);
    }
    Ok(layout)
}

fn not_events(line: u64, text: &str) -> RecordingError {
    let shown: String = text.chars().take(40).collect();
    RecordingError::Unknown {
        found: format!("text whose {} is \"{shown}\"", Place::Line(line)),
        advice: "a text recording has one event a line, t,x,y,p, with or without a line of column names",
    }
}

fn order(columns: [usize; 4]) -> String {
    let mut named: Vec<(usize, &str)> = columns.into_iter().zip(["t", "x", "y", "p"]).collect();
    named.sort_unstable();
    named.iter().map(|(_, name)| *name).collect::<Vec<_>>().join(",")
}

/// Splits "timestamp [us]" or "t_us" into name and unit.
pub fn unit_of_name(name: &str) -> (String, Option<TimeUnit>) {
    // faery writes the size into the names: "x@640".
    let (stem, suffix) = name.split_once(['_', '[', '(', ' ', '@']).unwrap_or((name, ""));
    // Unicode has two that look alike: the micro sign and the Greek letter.
    let suffix = suffix.replace(['\u{b5}', '\u{3bc}'], "u");
    // What remains of another alphabet stays: it must not leave an "s" behind.
    let unit = match suffix.trim_matches(|c: char| !c.is_alphabetic()) {
        "s" | "sec" | "seconds" => Some(TimeUnit::Seconds),
        "ms" | "msec" | "millis" | "milliseconds" => Some(TimeUnit::Milliseconds),
        "us" | "usec" | "micros" | "microseconds" => Some(TimeUnit::Microseconds),
        "ns" | "nsec" | "nanos" | "nanoseconds" => Some(TimeUnit::Nanoseconds),
        _ => None,
    };
    (stem.trim().to_owned(), unit)
}

/// Size in names such as "x@640,y@480".
fn size_from_names(line: &str) -> Option<Geometry> {
    let side = |axis: &str| {
        let name =
            line.split([',', ';', '\t', ' ']).find_map(|name| name.trim().strip_prefix(axis))?;
        name.parse().ok()
    };
    Geometry::new(side("x@")?, side("y@")?)
}

/// One column of the first rows as numbers.
fn column(rows: &[Vec<&str>], index: usize) -> Vec<f64> {
    rows.iter()
        .map(|row| row.get(index).and_then(|field| field.parse().ok()).unwrap_or(f64::NAN))
        .collect()
}

/// Columns t, x, y, p of a table of numbers, with the sentence that says so.
pub fn order_from_numbers(rows: &[Vec<f64>]) -> ([usize; 4], String) {
    let text: Vec<Vec<String>> =
        rows.iter().map(|row| row.iter().map(f64::to_string).collect()).collect();
    let rows: Vec<Vec<&str>> =
        text.iter().map(|row| row.iter().map(String::as_str).collect()).collect();
    let columns = columns_from_rows(&rows);
    (columns, format!("columns {} from the first rows", order(columns)))
}

/// Whether a line names the columns.
pub fn names_columns(line: &[u8]) -> bool {
    std::str::from_utf8(line).is_ok_and(|line| columns_from_names(&names_in(line.trim())).is_some())
}

/// Names in a line. One that is empty keeps its place, as that of the index which pandas puts in front; blanks make none.
fn names_in(line: &str) -> Vec<String> {
    let blanks = !line.contains([',', ';', '\t']);
    let mut names: Vec<String> = line
        .split(|c: char| matches!(c, ',' | ';' | '\t') || blanks && c == ' ')
        .map(|name| name.trim().trim_matches(['"', '\'']).to_ascii_lowercase())
        .filter(|name| !(blanks && name.is_empty()))
        .collect();
    while names.pop_if(|name| name.is_empty()).is_some() {}
    names
}

/// Columns t, x, y, p among the fields of rows with these names. A field that is empty counts for none in a row, so where
/// rows have too few, the names that are empty count for none either.
fn columns_of_rows(
    mut names: Vec<String>,
    rows: &[Vec<&str>],
) -> Option<Vec<(usize, Option<TimeUnit>)>> {
    if rows.first().is_some_and(|row| row.len() < names.len()) {
        names.retain(|name| !name.is_empty());
    }
    columns_from_names(&names)
}

/// Columns t, x, y, p with the unit their name tells, or `None` when not all four are named.
fn columns_from_names(names: &[String]) -> Option<Vec<(usize, Option<TimeUnit>)>> {
    [
        &["t", "time", "timestamp", "timestamps", "ts"][..],
        &["x", "col", "column"],
        &["y", "row"],
        &["p", "pol", "polarity", "polarities", "on"],
    ]
    .into_iter()
    .map(|wanted| {
        names.iter().enumerate().find_map(|(column, name)| {
            let (stem, unit) = unit_of_name(name);
            wanted.contains(&stem.as_str()).then_some((column, unit))
        })
    })
    .collect()
}

/// Columns t, x, y, p by what the numbers look like.
fn columns_from_rows(rows: &[Vec<&str>]) -> [usize; 4] {
    let value = |row: &Vec<&str>, column: usize| {
        row.get(column).and_then(|field| field.parse::<f64>().ok()).unwrap_or(f64::NAN)
    };
    let is_polarity = |column: usize| {
        rows.iter().all(|row| {
            row.get(column).is_some_and(|field| super::read::polarity(field.as_bytes()).is_some())
        })
    };
    // Last, then third: the places in use.
    let p = [3, 2, 0, 1].into_iter().find(|&column| is_polarity(column)).unwrap_or(3);
    let rises = |column: usize| {
        rows.windows(2).all(|pair| value(&pair[0], column) <= value(&pair[1], column))
    };
    let largest = |column: usize| rows.iter().map(|row| value(row, column)).fold(0.0, f64::max);
    let fractional = |column: usize| rows.iter().any(|row| value(row, column).fract() != 0.0);
    let mut others: Vec<usize> = (0..4).filter(|&column| column != p).collect();
    // Time has a fraction, or else never falls, or else is the largest number.
    let t = others
        .iter()
        .copied()
        .max_by(|&a, &b| {
            let key = |column| (fractional(column), rises(column));
            key(a).cmp(&key(b)).then(largest(a).total_cmp(&largest(b))).then(b.cmp(&a))
        })
        .unwrap_or(0);
    others.retain(|&column| column != t);
    [t, others[0], others[1], p]
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    use super::*;

    fn columns(head: &str) -> ([usize; 4], TimeUnit) {
        let layout = find(head, None).unwrap();
        (layout.columns, layout.unit)
    }

    #[test]
    fn header_names_map_the_columns() {
        assert_eq!(
            columns("x,y,polarity,timestamp\n1,2,0,5\n"),
            ([3, 0, 1, 2], TimeUnit::Microseconds)
        );
        assert_eq!(columns("t,x,y,on\n5,1,2,1\n"), ([0, 1, 2, 3], TimeUnit::Microseconds));
        assert_eq!(
            columns("# timestamp [ns], x, y, p\n5000,1,2,1\n"),
            ([0, 1, 2, 3], TimeUnit::Nanoseconds)
        );
        for (name, unit) in [
            ("t [\u{b5}s]", TimeUnit::Microseconds),
            ("t_\u{b5}s", TimeUnit::Microseconds),
            ("timestamp (\u{3bc}s)", TimeUnit::Microseconds),
            ("t_\u{3bc}sec", TimeUnit::Microseconds),
            ("t_usec", TimeUnit::Microseconds),
            ("t_msec", TimeUnit::Milliseconds),
            ("t_nsec", TimeUnit::Nanoseconds),
        ] {
            let head = format!("{name},x,y,p\n5000,1,2,1\n");
            assert_eq!(columns(&head), ([0, 1, 2, 3], unit), "{name}");
        }
        let faery = find("t,x@320,y@240,on\n5,1,2,1\n", None).unwrap();
        assert_eq!((faery.columns, faery.geometry), ([0, 1, 2, 3], Geometry::new(320, 240)));
        assert_eq!(columns("t_s x y p\n0.5 1 2 1\n"), ([0, 1, 2, 3], TimeUnit::Seconds));
    }

    #[test]
    fn a_column_without_a_name_keeps_its_place() {
        let us = TimeUnit::Microseconds;
        assert_eq!(columns(",t,x,y,p\n0,5,1,2,1\n"), ([1, 2, 3, 4], us));
        assert_eq!(columns("\"\",t,x,y,p,\n0,5,1,2,1,\n"), ([1, 2, 3, 4], us));
        assert_eq!(columns("\tt\tx\ty\tp\n0\t5\t1\t2\t1\n"), ([1, 2, 3, 4], us));
        assert_eq!(columns("t;;x;y;p\n5;0;1;2;1\n"), ([0, 2, 3, 4], us));
        // Without fields either.
        assert_eq!(columns(",t,x,y,p\n,5,1,2,1\n"), ([0, 1, 2, 3], us));
        assert_eq!(columns("t,\tx,\ty,\tp\n5,\t1,\t2,\t1\n"), ([0, 1, 2, 3], us));
    }

    #[test]
    fn columns_without_a_row_are_a_recording_without_events() {
        let none = find("t,x,y,p\n", None).unwrap();
        assert_eq!((none.skip_lines, none.geometry, none.assumed.len()), (1, None, 0));
        let named = find("x@320,y@240,t_ms,on", None).unwrap();
        assert_eq!((named.columns, named.geometry), ([2, 0, 1, 3], Geometry::new(320, 240)));
        assert_eq!((named.unit, named.assumed.len()), (TimeUnit::Milliseconds, 1));
        let vendor = find("%geometry:640,480\n", None).unwrap();
        assert_eq!((vendor.columns, vendor.geometry), ([3, 0, 1, 2], Geometry::new(640, 480)));
    }

    #[test]
    fn the_line_shown_is_the_line_told() {
        for (head, told) in [
            ("# notes\n\n1 2\n", "line 1 is \"# notes\""),
            ("\u{feff}1\n2\n", "line 1 is \"1\""),
            ("t,x,y,p\nDear reader\n", "line 2 is \"Dear reader\""),
        ] {
            let error = find(head, None).unwrap_err().to_string();
            assert!(error.contains(told), "{error}");
        }
    }

    #[test]
    fn first_rows_show_the_order() {
        assert_eq!(columns("10,5,6,1\n12,3,4,0\n"), ([0, 1, 2, 3], TimeUnit::Microseconds));
        assert_eq!(
            columns("5,6,1,1000\n3,4,0,1001\n9,1,0,1002\n"),
            ([3, 0, 1, 2], TimeUnit::Microseconds)
        );
        assert_eq!(columns("5,6,1000,1\n3,4,1001,-1\n"), ([2, 0, 1, 3], TimeUnit::Microseconds));
        assert_eq!(
            columns("0.003811 96 133 0\n0.003820 11 22 1\n"),
            ([0, 1, 2, 3], TimeUnit::Seconds)
        );
    }

    #[test]
    fn nanoseconds_since_1970_are_told_by_their_size() {
        let head = "1700000000000001000,5,6,1\n1700000000000003000,3,4,0\n";
        assert_eq!(columns(head), ([0, 1, 2, 3], TimeUnit::Nanoseconds));
        let head = "1700000000000001,5,6,1\n1700000000000003,3,4,0\n";
        assert_eq!(columns(head), ([0, 1, 2, 3], TimeUnit::Microseconds));
    }

    #[test]
    fn rpg_size_line_and_vendor_geometry_line() {
        let layout = find("240 180\n0.003811 96 133 0\n0.003820 11 22 1\n", None).unwrap();
        assert_eq!((layout.geometry, layout.unit), (Geometry::new(240, 180), TimeUnit::Seconds));
        let layout = find("%geometry:640,480\n0,0,1,7\n1,0,1,8\n", None).unwrap();
        assert_eq!((layout.geometry, layout.columns), (Geometry::new(640, 480), [3, 0, 1, 2]));
    }

    #[test]
    fn prose_is_refused() {
        assert!(find("Dear reader,\nthis is a letter\n", None).is_err());
        assert!(find("1\n2\n3\n", None).is_err());
    }

    #[test]
    fn floats_that_are_whole_are_microseconds() {
        let head = "1.304e+06 1.0e+00 2.0e+00 1.0e+00\n1.305e+06 3.0e+00 2.0e+00 0.0e+00\n";
        assert_eq!(columns(head), ([0, 1, 2, 3], TimeUnit::Microseconds));
    }
}
