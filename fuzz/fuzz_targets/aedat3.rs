//! cAER AEDAT 3.1.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"#!AER-DAT3.1\r\n", data);
});
