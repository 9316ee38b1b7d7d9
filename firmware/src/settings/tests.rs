use std::format;

use embassy_futures::block_on;
use proptest::prelude::*;

use super::*;
use crate::instrument::{Alarm, Unit};

/// Three pages of 256 bytes.
type Flash = MemoryFlash<768>;

fn load(flash: &mut Flash) -> (Preferences, Option<Fault>) {
    block_on(Store::new(flash, 0, 768).load())
}

fn save(flash: &mut Flash, preferences: &Preferences) -> Result<(), SaveError> {
    block_on(Store::new(flash, 0, 768).save(preferences))
}

/// Preferences that differ from each other in every field.
fn numbered(number: u32) -> Preferences {
    Preferences {
        unit: [Unit::Hertz, Unit::RadPerS, Unit::MsPerTurn][number as usize % 3],
        alarm: Alarm {
            low_rpm: number.is_multiple_of(2).then_some(100.0 + number as f32),
            high_rpm: Some(5_000.0 + number as f32),
        },
        blades: Some(1 + (number % 31) as u8),
        clock_trim_ppm: -0.5 * number as f32,
    }
}

fn any_preferences() -> impl Strategy<Value = Preferences> {
    let rpm = || prop::option::of(1e-3_f32..=1e6);
    let unit = prop::sample::select(&[Unit::Rpm, Unit::Hertz, Unit::RadPerS, Unit::MsPerTurn]);
    (unit, rpm(), rpm(), prop::option::of(1_u8..=32), -1000_f32..=1000.0).prop_map(
        |(unit, low_rpm, high_rpm, blades, clock_trim_ppm)| Preferences {
            unit,
            alarm: Alarm { low_rpm, high_rpm },
            blades,
            clock_trim_ppm,
        },
    )
}

#[test]
fn a_new_flash_gives_the_defaults() {
    assert_eq!(load(&mut Flash::default()), (Preferences::default(), None));
}

#[test]
fn what_was_saved_last_comes_back() {
    let mut flash = Flash::default();
    // Far beyond what three pages hold at once.
    for number in 0..200 {
        save(&mut flash, &numbered(number)).expect("room");
        assert_eq!(load(&mut flash), (numbered(number), None), "number {number}");
    }
}

/// Every word written and page erased in saving, from a fresh region, in the midst of a page, and when pages turn over.
#[test]
fn power_cut_at_every_step_leaves_the_old_or_the_new() {
    let mut flash = Flash::default();
    let mut cuts = 0;
    for number in 0..60 {
        let old = load(&mut flash);
        let new = (numbered(number), None);
        for share in [0, 1, 77, 128, 200, 255] {
            for steps in 0.. {
                let mut torn = flash.clone();
                torn.cut_power(steps, share);
                let result = save(&mut torn, &new.0);
                if !torn.restore_power() {
                    assert_eq!(result, Ok(()), "not cut, so saved");
                    break;
                }
                cuts += 1;
                let found = load(&mut torn);
                // The very first save has no old block to fall back to: a torn one is told.
                let first =
                    number == 0 && found == (Preferences::default(), Some(Fault::Preferences));
                let place = format!("number {number}, cut after {steps} steps and {share}/256");
                assert!(found == old || found == new || first, "{place}: {found:?}");
                assert_eq!(load(&mut torn), found, "{place}: loading again");
                save(&mut torn, &numbered(number + 1)).expect(&place);
                assert_eq!(load(&mut torn), (numbered(number + 1), None), "{place}: saving again");
            }
        }
        save(&mut flash, &new.0).expect("room");
    }
    // A save writes half a dozen words: it has been cut within.
    assert!(cuts > 60 * 6 * 5, "{cuts} cuts");
}

#[test]
fn a_region_that_is_none_is_refused() {
    let mut flash = Flash::default();
    let mut store = Store::new(&mut flash, 0, 256);
    assert_eq!(block_on(store.save(&numbered(1))), Err(SaveError::Region));
    let mut store = Store::new(&mut flash, 512, 4096);
    assert_eq!(block_on(store.load()).1, Some(Fault::Preferences));
}

#[test]
fn blocks_of_other_firmware() {
    let block = encode(&numbered(4));
    // Longer: fields that are not known here.
    let mut longer = block.to_vec();
    longer.extend([1, 2, 3]);
    assert_eq!(decode(&longer), Ok(numbered(4)));
    // Shorter: fields that were not known there.
    let shorter = Preferences { clock_trim_ppm: 0.0, ..numbered(4) };
    assert_eq!(decode(&block[..12]), Ok(shorter));
    assert_eq!(decode(&block[..1]), Ok(Preferences::default()));
    assert_eq!(decode(&[]), Err(BlockError::Empty));
    let mut next = block;
    next[0] = 2;
    assert_eq!(decode(&next), Err(BlockError::Generation(2)));
}

#[test]
fn a_newer_generation_is_a_fault_and_can_be_overwritten() {
    let mut flash = Flash::default();
    let mut block = encode(&numbered(4));
    block[0] = 2;
    let config = MapConfig::<&mut Flash>::try_new(0..768).expect("a region");
    let mut map = MapStorage::<u8, _, _>::new(&mut flash, config, Cache::new_uncached());
    block_on(map.store_item(&mut [0; 64], &KEY, &block.as_slice())).expect("room");
    assert_eq!(load(&mut flash), (Preferences::default(), Some(Fault::Preferences)));
    save(&mut flash, &numbered(5)).expect("room");
    assert_eq!(load(&mut flash), (numbered(5), None));
}

proptest! {
    #[test]
    fn any_preferences_come_back(preferences in any_preferences()) {
        prop_assert_eq!(decode(&encode(&preferences)), Ok(preferences));
    }

    #[test]
    fn what_is_taken_is_in_range(bytes in prop::collection::vec(any::<u8>(), 0..40), known in any::<bool>()) {
        let mut bytes = bytes;
        if let (true, Some(first)) = (known, bytes.first_mut()) {
            *first = 1;
        }
        if let Ok(preferences) = decode(&bytes) {
            prop_assert_eq!(decode(&encode(&preferences)), Ok(preferences));
        }
    }

    #[test]
    fn a_damaged_flash_is_told_or_gives_what_was_saved(
        saves in 1_u32..30,
        damage in prop::collection::vec((0_usize..768, any::<u8>()), 1..40),
    ) {
        let mut flash = Flash::default();
        for number in 0..saves {
            save(&mut flash, &numbered(number)).expect("room");
        }
        let mut bytes = *flash.bytes();
        for (place, byte) in damage {
            bytes[place] = byte;
        }
        let mut flash = Flash::new(bytes);
        let (preferences, fault) = load(&mut flash);
        match fault {
            None => prop_assert!((0..saves).any(|number| numbered(number) == preferences)),
            Some(fault) => {
                prop_assert_eq!((preferences, fault), (Preferences::default(), Fault::Preferences));
            }
        }
        save(&mut flash, &numbered(77)).expect("a flash that works can be saved to");
        prop_assert_eq!(load(&mut flash), (numbered(77), None));
    }
}
