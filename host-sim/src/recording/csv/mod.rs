//! Text: one event a line, separated by commas, semicolons, tabs or blanks.

mod layout;
mod read;
mod write;

pub(crate) use layout::{order_from_numbers, unit_of_name};
pub(crate) use read::{is_text, open};
pub(crate) use write::CsvWriter;
