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
        store.push(&[PackedEvent::pack(&event(t_us))], 0, |_, _| {});
    }
}

fn times(store: &Store<'_>) -> Vec<i32> {
    store.window(MOST_SEGMENTS, u64::MAX).events().map(|event| event.since(0)).collect()
}

#[test]
fn a_segment_keeps_a_dense_burst_then_thins_evenly_and_counts_all() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 100_000);
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
fn the_first_window_is_the_one_that_the_stream_begins_with() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 100);
    store.restart(1_000, 100);
    fill(&mut store, 1_000..1_400);
    store.lengthen(200);
    assert!(store.window(2, u64::MAX).is_first());
    store.drop_oldest();
    assert!(!store.window(1, u64::MAX).is_first());
}

#[test]
fn a_segment_that_is_not_full_keeps_all() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 100);
    fill(&mut store, 0..64);
    assert_eq!(times(&store), (0..64).collect::<Vec<_>>());
    let one = |event: StoredEvent| event.weight_log2() == 0;
    assert!(store.window(1, u64::MAX).events().all(one));
}

#[test]
fn behind_the_burst_each_octave_is_half_as_dense() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 100_000);
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
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 10_000);
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

/// Fills a store of which the window is measured; when the ring is full, `make_room` does something about it.
fn fill_behind(
    store: &mut Store<'_>,
    times: core::ops::Range<u64>,
    weight_log2: u8,
    mut make_room: impl FnMut(&mut Store<'_>),
) {
    for t_us in times {
        while t_us >= store.open_end_us() {
            if store.full() {
                make_room(store);
            } else {
                store.close_segment();
            }
            if store.held.segments == 0 && store.closed() == WINDOW_SEGMENTS {
                store.hold(WINDOW_SEGMENTS);
            }
        }
        store.push(&[PackedEvent::pack(&event(t_us))], weight_log2, |_, _| {});
    }
}

#[test]
fn what_comes_while_a_window_is_measured_is_thinned_and_has_no_gap() {
    for until_us in [10_300, 12_500, 13_999, 22_100, 31_000] {
        let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
        let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
        fill_behind(&mut store, 0..until_us, 0, |store| store.lengthen(2 * store.segment_us()));
        let measured = store.window(WINDOW_SEGMENTS, u64::MAX);
        assert_eq!((measured.start_us, measured.duration_us), (0, 6_000));
        assert!(measured.events().all(|event| (0..6_000).contains(&event.since(0))));
        assert_eq!(store.stored_us(until_us - 1), until_us - 1 - 6_000);

        assert!(!store.release(), "longer segments do not go on from shorter ones");
        let segments = store.hold_all(until_us - 1, 1_000);
        assert!((2..=5).contains(&segments), "{segments}");
        let window = store.window(segments, until_us);
        assert_eq!((window.start_us, u64::from(window.duration_us)), (6_000, until_us - 6_000));
        // Each that is kept stands for those up to the next, as well as that can be where bursts were.
        let account = store.account(segments);
        assert_eq!(account.counted, until_us - 6_000);
        let kept: Vec<_> = window.events().map(|e| (e.since(0), e.weight_log2())).collect();
        assert_eq!(kept.first().map(|(t_us, _)| *t_us), Some(6_000));
        let last_us = until_us as i32;
        let next = kept.iter().skip(1).map(|(t_us, _)| *t_us).chain([last_us]);
        for ((t_us, weight_log2), next_us) in kept.iter().zip(next) {
            assert!((1..=512).contains(&(next_us - t_us)), "{t_us} to {next_us}: {weight_log2}");
        }
        let stands_for: u64 = kept.iter().map(|(_, weight_log2)| 1 << weight_log2).sum();
        assert!(stands_for.abs_diff(account.counted) < account.counted / 4, "{stands_for}");

        // It goes on as if nothing had been.
        assert_eq!((store.start_us(), store.segment_us()), (until_us - 1, 1_000));
        fill(&mut store, until_us..until_us + 2_500);
        assert!(!store.release());
        let next = store.window(MOST_SEGMENTS, u64::MAX);
        assert_eq!((next.start_us, next.duration_us), (until_us - 1, 3_000));
        assert_eq!(store.account(3).counted, 2_500);
        assert!(next.segment(0).len() > 40, "{} in the first", next.segment(0).len());
        let all = store.account(MOST_SEGMENTS);
        assert_eq!(store.restart(0, 1_000), all.counted, "only these were not measured");
    }
}

#[test]
fn a_window_that_was_measured_in_time_is_gone_on_from() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
    fill_behind(&mut store, 0..9_900, 0, |_| unreachable!("there is room"));
    assert!(store.release());
    assert_eq!((store.start_us(), store.open_end_us(), store.closed()), (0, 10_000, 9));
    store.drop_oldest();
    assert_eq!((store.start_us(), store.open_end_us(), store.closed()), (1_000, 10_000, 8));
}

#[test]
fn what_no_window_measured_is_counted_once_whatever_it_stands_for() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
    // Seven of eight were left out before.
    let mut given_up = 0;
    fill_behind(&mut store, 0..12_500, 3, |store| given_up += store.give_up());
    assert_eq!(given_up, 3_000);
    let kept = store.account(MOST_SEGMENTS).kept;
    assert_eq!(8 * (12_500 - 3_000), kept + store.thinned());
    assert!(!store.release());
    assert_eq!((store.start_us(), store.closed(), store.open_end_us()), (9_000, 3, 13_000));
    // Four of the next six segments, and the two behind them, are measured once more, and count once.
    let mut never = |_: &mut Store<'_>| unreachable!("there is room");
    fill_behind(&mut store, 12_500..16_500, 3, &mut never);
    assert!(store.release());
    store.drop_oldest();
    store.drop_oldest();
    fill(&mut store, 16_500..17_200);
    store.lengthen(2_000);
    // The stream breaks off: from 15 000 on nothing was measured.
    assert_eq!(store.restart(99_000_000, 1_000), 2_200);
    assert_eq!(store.restart(99_000_000, 1_000), 0);
}

#[test]
fn those_that_are_kept_stand_for_all() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 100_000);
    let mut stands_for = 0;
    for t_us in 0..50_000 {
        store.push(&[PackedEvent::pack(&event(t_us))], 0, |_, weight_log2| {
            stands_for += 1 << weight_log2
        });
    }
    assert!((50_000..52_048).contains(&stands_for), "{stands_for}");
}

#[test]
fn events_that_were_thinned_before_stand_for_those_left_out() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 10_000);
    // A stretch of 15 ms in which one in 8 comes, then one in 512: more than the reservoir leaves out by itself.
    let weight_log2 = |t_us: u64| match t_us {
        20_000..30_000 => 3,
        30_000..35_000 => 9,
        _ => 0,
    };
    for t_us in (0..60_000_u64).filter(|t_us| t_us.trailing_zeros() >= weight_log2(*t_us)) {
        while t_us >= store.open_end_us() {
            store.close_segment();
        }
        store.push(&[PackedEvent::pack(&event(t_us))], weight_log2(t_us) as u8, |_, _| {});
    }
    let account = store.account(6);
    assert!(account.counted.abs_diff(60_000) < 512, "{account:?}");
    assert_eq!(store.thinned(), account.counted - account.kept);
    let window = store.window(6, u64::MAX);
    let stored: u64 = window.events().map(|event| 1 << event.weight_log2()).sum();
    assert!(stored.abs_diff(60_000) < 6_000, "{stored}");
    let (mut even, mut times) = (Even::default(), Vec::new());
    let since = |event: StoredEvent| Some(event.since(0));
    while !even.step(&window, 100, since, |_, t_us| times.push(t_us)) {}
    let gaps: Vec<i32> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(gaps.iter().all(|gap| (1..=1_536).contains(gap)), "{gaps:?}");
    let thinned = times.iter().filter(|t_us| (20_000..35_000).contains(*t_us)).count();
    assert!(thinned.abs_diff(times.len() / 4) <= 3, "{thinned} of {}", times.len());
}

#[test]
fn lengthening_keeps_order_counts_and_the_first_burst() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 1_000);
    fill(&mut store, (0..6_500).step_by(3));
    let before = store.account(MOST_SEGMENTS);
    assert_eq!(store.closed(), 6);
    for segment_us in [2_000, 2_700, 5_400] {
        store.lengthen(segment_us);
        let kept = times(&store);
        assert!(kept.windows(2).all(|pair| pair[0] < pair[1]), "{kept:?}");
        assert_eq!(&kept[..4], &[0, 3, 6, 9]);
        assert!(*kept.last().unwrap_or(&0) > 6_000);
        assert_eq!(store.account(MOST_SEGMENTS).counted, before.counted);
    }
    assert_eq!(store.closed(), 1);
    fill(&mut store, 6_500..40_000);
    assert!(times(&store).windows(2).all(|pair| pair[0] < pair[1]));
}

#[test]
fn a_segment_begins_as_sparse_as_it_will_be_and_keeps_what_it_would_have_kept() {
    for (step_us, segment_us) in [(1, 5_000), (1, 1_000), (3, 700), (7, 300)] {
        let (mut memory, mut fresh) = (
            [StoredEvent::default(); 64 * MOST_SEGMENTS],
            [StoredEvent::default(); 64 * MOST_SEGMENTS],
        );
        let mut store = Store::new(&mut memory, MOST_SPARE, segment_us);
        let last_us = u64::from(segment_us) * 3;
        fill(&mut store, (0..last_us).step_by(step_us));
        let counted = store.account(1).counted;
        assert!(counted < 64 || store.segments[1].stride_log2 > 0);
        for segment in 0..3_u64 {
            // Alone, with nothing before it.
            let first_us = segment * u64::from(segment_us);
            let mut alone = Store::new(&mut fresh, MOST_SPARE, segment_us);
            alone.restart(first_us, segment_us);
            fill(
                &mut alone,
                (first_us.next_multiple_of(step_us as u64)..first_us + u64::from(segment_us))
                    .step_by(step_us),
            );
            let window = store.window(MOST_SEGMENTS, u64::MAX);
            assert_eq!(window.segment(segment as usize), alone.window(1, u64::MAX).segment(0));
        }
    }
}

#[test]
fn a_segment_after_a_far_busier_one_still_begins_with_a_burst_and_tells_what_it_left_out() {
    let mut memory = [StoredEvent::default(); 64 * MOST_SEGMENTS];
    let mut store = Store::new(&mut memory, MOST_SPARE, 10_000);
    fill(&mut store, (0..10_000).chain((10_000..20_000).step_by(100)));
    let window = store.window(2, u64::MAX);
    let quiet = window.segment(1);
    assert!(quiet[..16].windows(2).all(|pair| pair[1].since(0) - pair[0].since(0) == 100));
    let stands_for: i32 = quiet.iter().map(|event| 1 << event.weight_log2()).sum();
    // The last stands for as many as it would have, had as many come as before.
    assert!((100..100 + 256).contains(&stands_for), "{stands_for}");
}

#[test]
fn a_share_of_the_pixels_is_as_large_as_asked_and_spread_evenly() {
    let event = |x, y| {
        let event = Event { t_us: 0, x, y, polarity: Polarity::On };
        StoredEvent::store(PackedEvent::pack(&event), 0)
    };
    for one_of in [1_u32, 3, 11] {
        for (x0, y0) in [(0, 0), (64, 0), (640, 360)] {
            let places = (0..64).flat_map(|y| (0..64).map(move |x| (x0 + x, y0 + y)));
            let taken = places.filter(|&(x, y)| event(x, y).is_of(one_of)).count();
            let expected = 4096.0 / f64::from(one_of);
            assert!((taken as f64 / expected - 1.0).abs() < 0.15, "{taken} for one of {one_of}");
        }
    }
}
