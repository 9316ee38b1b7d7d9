//! What the linker made of the firmware.

use evtach_host::device;

#[test]
fn measuring_takes_neither_double_precision_nor_a_heap() {
    let image = device::build().expect("the firmware builds");
    // The stripped image would pass whatever it holds.
    assert!(
        image.symbols.iter().any(|name| name.contains("evtach_core")),
        "{} names no function of the core",
        image.path.display()
    );
    assert_eq!(image.unwanted_symbols(), [""; 0]);
}

#[test]
fn image_fits_the_board() {
    let image = device::build().expect("the firmware builds");
    println!("flash {} B, variables in RAM {} B", image.flash_bytes, image.ram_bytes);
    // RAM: what the stack leaves of 320 KB.
    assert!(image.flash_bytes <= 256 * 1024);
    assert!(image.ram_bytes <= 288 * 1024);
}
