//! ROS 2 bags in SQLite.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_file(&[b"SQLite format 3\0", data].concat());
});
