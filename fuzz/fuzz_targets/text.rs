//! Text, with the pass that looks for the size; and whatever else the bytes look like.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_file(data);
});
