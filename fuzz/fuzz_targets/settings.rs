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
    let Some((&[steps, share, blades], content)) = data.split_first_chunk() else { return };
    let mut bytes = [0xff; BYTES];
    bytes.iter_mut().zip(content).for_each(|(byte, found)| *byte = *found);
    let mut flash = MemoryFlash::new(bytes);
    let (preferences, fault) = load(&mut flash);
    assert!(fault.is_none() || preferences == Preferences::default());

    let new = Preferences { blades: Some(1 + blades % 32), ..Preferences::default() };
    flash.cut_power(u32::from(steps), share);
    let saved = save(&mut flash, &new);
    assert!(flash.restore_power() || saved, "a flash with power can be saved to");
    let (after, fault) = load(&mut flash);
    assert!(fault.is_some() || after == new || after == preferences);
    assert!(save(&mut flash, &new) && load(&mut flash) == (new, None));
});
