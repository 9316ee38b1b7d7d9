//! A stream from an SPI bridge, as a recording.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(&[0xd7, 0xc3, 0x69, 0x96], data);
});
