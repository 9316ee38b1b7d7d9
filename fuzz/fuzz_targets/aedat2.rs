//! jAER AEDAT 2.0.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"#!AER-DAT2.0\r\n", data);
});
