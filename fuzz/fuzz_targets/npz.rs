//! NumPy archives.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_file(&[b"PK\x03\x04", data].concat());
});
