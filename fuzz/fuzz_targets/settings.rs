//! Preferences in flash: any content of the flash, any block, and a cut of power at any step.
#![no_main]

use embassy_futures::block_on;
use evtach_firmware::instrument::{Fault, Preferences};
use evtach_firmware::settings::{MemoryFlash, Store, decode, encode};
use libfuzzer_sys::fuzz_target;

const BYTES: usize = 1024;

fn load(flash: &mut MemoryFlash<BYTES>) -> (Preferences, Option<Fault>) {
    block_on(Store::new(flash, 0, BYTES as u32).load())
}

fn save(flash: &mut MemoryFlash<BYTES>, preferences: &Preferences) -> bool {
    block_on(Store::new(flash, 0, BYTES as u32).save(preferences)).is_ok()
}

fuzz_target!(|data: &[u8]| {
    if let Ok(preferences) = decode(data) {
        assert_eq!(decode(&encode(&preferences)), Ok(preferences));
    }
    let Some((&[saves, steps, share], content)) = data.split_first_chunk() else { return };
    let mut bytes = [0xff; BYTES];
    bytes.iter_mut().zip(content).for_each(|(byte, found)| *byte = *found);
    let mut flash = MemoryFlash::new(bytes);
    let numbered = |number| Preferences { blades: Some(1 + number % 32), ..Preferences::default() };
    for number in 0..saves % 64 {
        assert!(save(&mut flash, &numbered(number)), "a flash with power can be saved to");
    }
    let (old, fault) = load(&mut flash);
    assert!(fault.is_none() || old == Preferences::default());

    let new = numbered(saves % 64);
    flash.cut_power(u32::from(steps), share);
    let saved = save(&mut flash, &new);
    assert!(flash.restore_power() || saved, "not cut, so saved");
    let (after, fault) = load(&mut flash);
    // Of a region that was damaged before, an older block may be all that is left.
    let foreign = content.iter().any(|byte| *byte != 0xff);
    assert!(fault.is_some() || after == new || after == old || foreign);
    assert!(save(&mut flash, &new) && load(&mut flash) == (new, None));
});
