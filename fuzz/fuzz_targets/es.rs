//! Event Stream.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"Event Stream\x02\x00\x00", data);
});
