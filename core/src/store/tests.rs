use super::*;
use crate::event::{Event, PackedEvent, Polarity};

fn event(t_us: u64) -> Event {
    Event { t_us, x: (t_us % 300) as u16, y: 7, polarity: Polarity::On }
}

fn fill(store: &mut Store<'_>, times: impl Iterator<Item = u64>) {
    for t_us in times {
        while t_us >= store.open_end_us() {
            store.close_segment();
        }
        store.push(&[PackedEvent::pack(&event(t_us))]);
    }
}

fn times(store: &Store<'_>) -> Vec<i32> {
    store.window(SEGMENTS, u64::MAX).events().map(|event| event.since(0)).collect()
}

#[test]
fn a_segment_keeps_a_dense_burst_then_thins_evenly_and_counts_all() {
    let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
    let mut store = Store::new(&mut memory, 100_000);
    fill(&mut store, 0..5_000);
    let kept = times(&store);
    assert_eq!(&kept[..16], &(0..16).collect::<Vec<_>>()[..]);
    assert!(kept.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(kept.len() <= 64 && kept.len() > 44);
    assert!(*kept.last().unwrap_or(&0) > 4_500);
    let account = store.account(1);
    assert_eq!((account.counted, account.kept), (5_000, kept.len() as u64));
}

#[test]
fn a_segment_that_is_not_full_keeps_all() {
    let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
    let mut store = Store::new(&mut memory, 100);
    fill(&mut store, 0..64);
    assert_eq!(times(&store), (0..64).collect::<Vec<_>>());
    let one = |event: StoredEvent| event.weight_log2() == 0;
    assert!(store.window(1, u64::MAX).events().all(one));
}

#[test]
fn behind_the_burst_each_octave_is_half_as_dense() {
    let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
    let mut store = Store::new(&mut memory, 100_000);
    fill(&mut store, 0..5_000);
    // What a kept event stands for is what goes before the next.
    let window = store.window(1, u64::MAX);
    let kept: Vec<_> = window.events().map(|e| (e.since(0), 1 << e.weight_log2())).collect();
    assert!(kept.windows(2).all(|pair| pair[1].0 - pair[0].0 == pair[0].1), "{kept:?}");
    let octaves: Vec<i32> = [16, 20, 24].map(|i| kept[i].1).into();
    assert_eq!(octaves, [2, 4, 8]);
}

#[test]
fn even_events_stand_for_the_same_number_each() {
    let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
    let mut store = Store::new(&mut memory, 10_000);
    fill(&mut store, 0..60_000);
    let (window, mut even, mut kept) = (store.window(6, u64::MAX), Even::default(), Vec::new());
    let since = |event: StoredEvent| Some(event.since(0));
    while !even.step(&window, 100, since, |_, t_us| kept.push(t_us)) {}
    assert!(kept.len() > 80 && kept.len() <= 101, "{}", kept.len());
    // The reservoir itself comes in steps of 512, and begins anew behind each burst.
    let gaps: Vec<i32> = kept.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.iter().all(|gap| (1..=1_536).contains(gap)), "{gaps:?}");
    let first_half = kept.iter().filter(|t_us| **t_us < 30_000).count();
    assert!(first_half.abs_diff(kept.len() - first_half) <= 2);
}

#[test]
fn lengthening_keeps_order_counts_and_the_first_burst() {
    let mut memory = [StoredEvent::default(); 64 * SEGMENTS];
    let mut store = Store::new(&mut memory, 1_000);
    fill(&mut store, (0..6_500).step_by(3));
    let before = store.account(SEGMENTS);
    assert_eq!(store.closed(), 6);
    for segment_us in [2_000, 2_700, 5_400] {
        store.lengthen(segment_us);
        let kept = times(&store);
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]), "{kept:?}");
        assert_eq!(&kept[..4], &[0, 3, 6, 9]);
        assert!(*kept.last().unwrap_or(&0) > 6_000);
        assert_eq!(store.account(SEGMENTS).counted, before.counted);
    }
    assert_eq!(store.closed(), 1);
    fill(&mut store, 6_500..40_000);
    assert!(times(&store).windows(2).all(|pair| pair[0] < pair[1]));
}
