use super::*;

/// Events in each frame of a stream.
fn counts(frames: &[Vec<u8>]) -> Vec<u64> {
    frames
        .iter()
        .map(|frame| read(&[&frames[0][..], &frame[..]].concat(), 64).0.len() as u64)
        .collect()
}

#[test]
fn what_is_lost_is_counted_to_the_event_and_by_its_cause() {
    let all = events(20_000);
    for kind in [Kind::Evt2, Kind::Evt3] {
        let mut frames = frames(kind, &all);
        let counts = counts(&frames);
        let (mut damaged, mut missing) = ((0, 0), (0, 0));
        for index in (5..frames.len() - 1).step_by(7) {
            if index % 2 == 0 {
                let middle = frames[index].len() / 2;
                frames[index][middle] ^= 0x10;
                damaged = (damaged.0 + 1, damaged.1 + counts[index]);
            } else {
                frames[index].clear();
                missing = (missing.0 + 1, missing.1 + counts[index]);
            }
        }
        let (received, account) = read(&frames.concat(), 1_000);
        assert!(damaged.1 > 500 && missing.1 > 500);
        assert_eq!((account.frames_damaged, account.lost.damaged), damaged);
        assert_eq!((account.frames_missing, account.lost.missing), missing);
        assert_eq!(account.received, received.len() as u64);
        assert_eq!(account.sent(), 20_000);
    }
}

#[test]
fn damaged_and_missing_side_by_side_are_exact_in_their_sum() {
    let all = events(20_000);
    let mut frames = frames(Kind::Evt2, &all);
    let counts = counts(&frames);
    frames[4].clear();
    frames[5][40] ^= 1;
    frames[6].clear();
    let lost: u64 = counts[4..7].iter().sum();
    let (_, account) = read(&frames.concat(), 333);
    assert_eq!((account.frames_damaged, account.frames_missing), (1, 2));
    assert_eq!(account.lost.total(), lost);
    assert_eq!(account.lost.damaged, lost / 3);
    assert_eq!(account.sent(), 20_000);
}

#[test]
fn the_bridges_own_losses_survive_the_loss_of_a_frame() {
    let mut bridge = Bridge::new(Kind::Evt3, GEOMETRY, "test");
    let mut frames = Vec::new();
    for (index, event) in events(9_000).iter().enumerate() {
        if index % 1_000 == 999 {
            bridge.lost(10);
        } else {
            bridge.push(event, |frame| frames.push(frame.to_vec()));
        }
    }
    bridge.end(|frame| frames.push(frame.to_vec()));
    for index in (3..frames.len() - 1).step_by(3) {
        frames[index].clear();
    }
    let (_, account) = read(&frames.concat(), 64);
    assert_eq!(account.lost.bridge, 90);
    assert_eq!(account.sent(), 9_000 - 9 + 90);
}

#[test]
fn a_bridge_that_restarts_is_told_and_not_taken_for_four_billion_lost_events() {
    let all = events(3_000);
    let once = frames(Kind::Evt2, &all);
    let stream = [once[..once.len() / 2].concat(), once.concat()].concat();
    let (received, account) = read(&stream, 64);
    assert_eq!((account.restarts, account.lost), (1, Lost::default()));
    assert_eq!(account.sent(), received.len() as u64);
}

#[test]
fn counters_wrap() {
    let account = |sequence, events_before| {
        let header = Header {
            kind: Kind::Evt2,
            payload_bytes: 0,
            sequence,
            events_before,
            bridge_lost: u32::MAX,
            t_us: 0,
        };
        Frame { header, payload: &[], damaged_before: 0 }
    };
    let mut counted = Account::default();
    assert_eq!(counted.frame(&account(u32::MAX, u32::MAX - 1)), 0);
    counted.events(3);
    assert_eq!(counted.frame(&account(1, 5)), 4);
    assert_eq!((counted.frames_missing, counted.lost.missing, counted.restarts), (1, 4, 0));
}
