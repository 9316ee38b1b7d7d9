//! ROS 2 bags in MCAP.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    evtach_fuzz::read_behind(b"\x89MCAP0\r\n", data);
});
