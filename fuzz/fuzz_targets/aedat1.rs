//! jAER AEDAT 1.0.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"#!AER-DAT1.0\r\n", data);
});
