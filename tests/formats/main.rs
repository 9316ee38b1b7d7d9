//! Recordings, read and written.

mod hostile;
mod interop;
mod round_trip;
mod scratch;
