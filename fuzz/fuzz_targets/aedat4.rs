//! iniVation AEDAT 4.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"#!AER-DAT4.0\r\n", data);
});
