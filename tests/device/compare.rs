//! Readings of the device beside those of the PC.

use std::env;

use evtach_core::{Event, Geometry, Reading, Settings};
use evtach_firmware::report::Lines;
use evtach_host::device::{self, Output};
use evtach_host::measure::{Capacity, measure_events};

/// Whether QEMU is there; without it prints "skipped", but where CI is set that is a failure.
pub fn qemu_present() -> bool {
    let present = device::qemu_present();
    if !present {
        assert!(env::var_os("CI").is_none(), "no qemu-system-arm: ./ci.sh install installs it");
        println!("skipped: qemu-system-arm is not installed; ./ci.sh install installs it");
    }
    present
}

/// Compares what the device said about events with the PC's readings, line by line, and returns these.
pub fn assert_equal(
    name: &str,
    geometry: Geometry,
    events: &[Event],
    output: &Output,
) -> Vec<Reading> {
    // The same capacities, but another rhythm: pieces of another size, each measured in one go.
    let (readings, _) = measure_events(events, &[], Settings::new(geometry), Capacity::Device);
    assert!(!readings.is_empty(), "{name}: {} events and no reading", events.len());
    for (index, (here, there)) in readings.iter().zip(&output.readings).enumerate() {
        let here = Lines(here).to_string();
        for (here, there) in here.lines().zip(there.lines.lines()) {
            assert_eq!(here, there, "{name}: reading {index}: PC on the left, device on the right");
        }
        assert_eq!(here.lines().count(), there.lines.lines().count(), "{name}: reading {index}");
    }
    assert_eq!(readings.len(), output.readings.len(), "{name}: number of readings");
    let lines: usize = readings.iter().map(|reading| 1 + reading.rotors.len()).sum();
    println!("{name}: {} readings, {lines} lines equal", readings.len());
    readings
}
