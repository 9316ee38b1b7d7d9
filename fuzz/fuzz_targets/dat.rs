//! Prophesee DAT.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"% Version 2\n\x00\x08", data);
});
