//! Prophesee RAW, EVT 2.0.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"% evt 2.0\n% geometry 640x480\n", data);
});
