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
fn the_image_for_the_board_fits_it() {
    let image = device::build_for_board().expect("the firmware builds");
    let ram_bytes = image.ram_bytes + image.stack_bytes;
    println!("flash {} B, internal RAM with stack {ram_bytes} B", image.flash_bytes);
    assert!(image.stack_bytes >= 24 * 1024, "memory.x names the stack");
    assert!(ram_bytes <= 320 * 1024);
    assert!(image.flash_bytes <= 256 * 1024);
    assert!(image.unwanted_symbols().is_empty(), "{:?}", image.unwanted_symbols());
    // The vector table: the stack's end, and where the program begins, in Thumb state.
    let word = |at: usize| u32::from_le_bytes(image.flash[at..at + 4].try_into().expect("a word"));
    assert_eq!(word(0), 0x2000_0000 + image.stack_bytes as u32);
    assert!((0x0800_0000..0x0810_0000).contains(&word(4)) && word(4) % 2 == 1);
    assert!(image.flash.len() as u64 >= image.flash_bytes);
}

#[test]
fn the_image_for_qemu_fits_the_board() {
    let image = device::build().expect("the firmware builds");
    println!("flash {} B, variables in RAM {} B", image.flash_bytes, image.ram_bytes);
    // RAM: as on the board.
    assert!(image.flash_bytes <= 256 * 1024);
    assert!(image.ram_bytes + image.stack_bytes <= 320 * 1024);
}
