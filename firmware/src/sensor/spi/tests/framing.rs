use super::*;

#[test]
fn frames_are_laid_out_as_documented() {
    let mut bridge = Bridge::new(Kind::Evt2, GEOMETRY, "GenX320");
    let mut bytes = Vec::new();
    bridge.lost(3);
    let event = Event { t_us: 0x1_0000_0041, x: 5, y: 9, polarity: Polarity::On };
    bridge.push(&event, |frame| bytes.extend_from_slice(frame));
    bridge.flush(|frame| bytes.extend_from_slice(frame));
    let hello: &[u8] = &[
        0xd7, 0xc3, 0x69, 0x96, 0x10, 0, 20, 0, // magic, kind, reserved, bytes of payload
        0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, // sequence, events before, bridge lost
        0x41, 0, 0, 0, 1, 0, 0, 0, // time
        64, 1, 64, 1, b'G', b'e', b'n', b'X', b'3', b'2', b'0', 0, 0, 0, 0, 0, 0, 0, 0, 0,
    ];
    let words: &[u8] = &[
        0xd7, 0xc3, 0x69, 0x96, 0x12, 0, 8, 0, //
        1, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, //
        0x41, 0, 0, 0, 1, 0, 0, 0, //
        1, 0, 0, 0x84, 9, 0x28, 0x40, 0x10, // TIME_HIGH, pixel
    ];
    assert_eq!(&bytes[..48], hello);
    assert_eq!(&bytes[52..88], words);
    // CRC-32/ISO-HDLC from byte 4 on, as `zlib.crc32` gives it.
    assert_eq!(bytes[48..52], 0x8005_8901_u32.to_le_bytes());
    assert_eq!(bytes[88..], 0x9f1b_a2fc_u32.to_le_bytes());
}

#[test]
fn events_come_back_whatever_the_pieces() {
    let events = events(5_000);
    for kind in [Kind::Evt2, Kind::Evt3] {
        let bytes = frames(kind, &events).concat();
        for piece in [1, 7, 512, 1_000_000] {
            let (read, account) = read(&bytes, piece);
            assert!(read == events, "{kind:?} in pieces of {piece}");
            assert_eq!((account.received, account.lost), (5_000, Lost::default()));
            assert_eq!(account.sent(), 5_000);
        }
    }
}

#[test]
fn filler_and_noise_between_frames_are_passed_over() {
    let events = events(2_000);
    let mut bytes = Vec::new();
    for (index, frame) in frames(Kind::Evt2, &events).iter().enumerate() {
        // Among the noise: beginnings of magics, and whole ones in front of nonsense.
        bytes.resize(bytes.len() + index % 40, 0);
        bytes.extend_from_slice(&MAGIC[..index % 5]);
        bytes.resize(bytes.len() + index % 3, 0xff);
        bytes.extend_from_slice(frame);
    }
    let (found, account) = read(&bytes, 100);
    assert!(found == events);
    assert_eq!((account.lost.total(), account.frames_damaged), (0, 0));
}

#[test]
fn time_may_step_back() {
    let mut events = events(3);
    events[2].t_us = 5;
    for kind in [Kind::Evt2, Kind::Evt3] {
        assert_eq!(read(&frames(kind, &events).concat(), 64).0, events);
    }
}

#[test]
fn a_length_that_lies_takes_no_sound_frame_with_it() {
    let events = events(4_000);
    let frames = frames(Kind::Evt2, &events);
    let mut bytes = frames.concat();
    // A frame in the midst claims to be as long as can be.
    let at: usize = frames[..6].iter().map(Vec::len).sum();
    bytes[at + 6..at + 8].copy_from_slice(&1024_u16.to_le_bytes());
    bytes.truncate(at + frames[6].len() + frames[7].len());
    bytes.resize(bytes.len() + MAX_FRAME_BYTES, 0);
    let (found, account) = read(&bytes, 64);
    let in_frame = |index: usize| read(&[&frames[0][..], &frames[index][..]].concat(), 64).0;
    assert!(found.ends_with(&in_frame(7)), "what follows the damaged frame is read");
    assert_eq!((account.frames, account.frames_damaged), (7, 1));
    assert_eq!(account.lost.damaged, in_frame(6).len() as u64);
}

#[test]
fn what_is_no_frame_is_none() {
    let frame = &frames(Kind::Evt2, &events(10))[1];
    let head: &[u8; 28] = frame.first_chunk().expect("a whole header");
    assert!(Header::parse(head).is_some());
    for (place, byte) in [(0, 0), (3, 0), (4, 0x14), (4, 0x22), (5, 1), (6, 3), (7, 9)] {
        let mut head = *head;
        head[place] = byte;
        assert_eq!(Header::parse(&head), None, "byte {place} = {byte}");
    }
    assert_eq!(Hello::parse(&[0; 20]), None, "a sensor without pixels");
    assert_eq!(Hello::parse(&[1; 19]), None);
}
