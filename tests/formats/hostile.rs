//! Odd, cut and broken files: what is good in them is delivered, and what is wrong is told with its place.

use evtach_core::{Event, Geometry};
use evtach_host::recording::write::{self, WriteFormat};
use evtach_host::recording::{self, OpenOptions};

use crate::scratch::{Read, Scratch, event, read, read_bytes};

const SIZE: Geometry = Geometry { width_px: 640, height_px: 480 };

fn times(found: &Read) -> Vec<u64> {
    found.events.iter().map(|event| event.t_us).collect()
}

fn le16(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn raw3(header: &str, words: &[u16]) -> Vec<u8> {
    [header.as_bytes(), &le16(words)].concat()
}

const EVT3: &str = "% evt 3.0\n% geometry 640x480\n% end\n";
/// Row 5, then a brighter event in column 3.
const PIXEL: [u16; 2] = [0x0005, 0x2803];

/// A file of a format with these events.
fn bytes_of(format: WriteFormat, events: &[Event]) -> Vec<u8> {
    let scratch = Scratch::new();
    let file = scratch.file("out");
    let mut writer = write::create(&file, format, SIZE).expect("a file");
    writer.write(events).expect("events that fit");
    writer.finish().expect("room on the disk");
    std::fs::read(&file).expect("what was written")
}

fn some_events(count: u64) -> Vec<Event> {
    (0..count)
        .map(|index| event(index * 7, (index % 640) as u16, (index % 480) as u16, index % 2 == 0))
        .collect()
}

/// The message of an error, which must end with what to do.
fn refusal(name: &str, bytes: &[u8]) -> String {
    let message = read_bytes(name, bytes, None).err().map(|error| error.to_string());
    let message = message.expect("not to be read");
    assert!(message.contains("\nhelp: "), "{message}");
    message
}

#[test]
fn evt3_clock_wraps_every_16_8_seconds() {
    let words = [&[0x8fff, 0x6fff][..], &PIXEL, &[0x8000, 0x6001], &PIXEL].concat();
    let found = read_bytes("a.raw", &raw3(EVT3, &words), None).expect("a RAW file");
    assert_eq!(times(&found), [0xff_ffff, 0x100_0001]);
    assert_eq!((found.recording.side().wraps, found.recording.out_of_order()), (1, 0));
}

#[test]
fn evt2_and_dat_clocks_wrap() {
    let words: [u32; 4] = [0x8fff_ffff, 0x1000_0000 | 63 << 22, 0x8000_0000, 0x1000_0000];
    let data: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let bytes = [b"% evt 2.0\n% geometry 640x480\n% end\n", data.as_slice()].concat();
    let found = read_bytes("a.raw", &bytes, None).expect("a RAW file");
    assert_eq!(times(&found), [(1 << 34) - 1, 1 << 34]);

    let mut bytes = b"% Version 2\n% Height 480\n% Width 640\n\x00\x08".to_vec();
    for t in [u32::MAX, 3] {
        bytes.extend(t.to_le_bytes());
        bytes.extend((5_u32 << 14 | 3 | 1 << 28).to_le_bytes());
    }
    let found = read_bytes("a.dat", &bytes, None).expect("a DAT file");
    assert_eq!(
        found.events,
        [event(u64::from(u32::MAX), 3, 5, true), event((1 << 32) + 3, 3, 5, true)]
    );
}

#[test]
fn evt3_vectors_advance() {
    let words = [0x8000, 0x6009, 0x0002, 0x3800 | 20, 0x4fff, 0x50ff, 0x5001];
    let found = read_bytes("a.raw", &raw3(EVT3, &words), None).expect("a RAW file");
    let expected: Vec<Event> = (20..41).map(|x| event(9, x, 2, true)).collect();
    assert_eq!(found.events, expected);
}

#[test]
fn evt21_in_both_byte_orders() {
    let words: [u64; 3] = [
        8 << 60 | 3 << 32,
        1 << 60 | 5 << 54 | 64 << 43 | 9 << 32 | 0x8000_0001,
        6 << 54 | 32 << 43 | 9 << 32 | 0x8400,
    ];
    let expected = [
        event(197, 64, 9, true),
        event(197, 95, 9, true),
        event(198, 42, 9, false),
        event(198, 47, 9, false),
    ];
    let little: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let legacy: Vec<u8> =
        words.iter().flat_map(|word| word.rotate_left(32).to_le_bytes()).collect();
    for (format, data) in [
        ("EVT21;endianness=little;height=480;width=640", &little),
        ("EVT21;endianness=legacy;height=480;width=640", &legacy),
        ("EVT21;height=480;width=640", &little),
        ("EVT21;height=480;width=640", &legacy),
    ] {
        let bytes = [format!("% evt 2.1\n% format {format}\n% end\n").as_bytes(), data].concat();
        let found = read_bytes("a.raw", &bytes, None).expect("a RAW file");
        assert_eq!(found.events, expected, "{format}");
    }
}

#[test]
fn odd_geometry_headers() {
    let words = [&[0x8000, 0x6000][..], &PIXEL].concat();
    for (lines, size) in [
        ("% evt 3.0\n% geometry 640 x 480\n", (640, 480)),
        ("% evt 3.0\n% width 320\n% height 240\n", (320, 240)),
        ("% format EVT3;width=1280;height=720\n", (1280, 720)),
        ("% evt 3.0\n% geometry 0x0\n% format EVT3;height=720;width=1280\n", (1280, 720)),
        ("% evt 3.0\n% geometry -3x9999999999\n% sensor_name IMX636\n", (1280, 720)),
        ("% evt 3.0\n% generation 3.1\n", (640, 480)),
        ("% evt 3.0\n% system_ID 64\n", (320, 320)),
        // Nothing told: from where the events lie.
        ("% evt 3.0\n", (128, 128)),
    ] {
        let found = read_bytes("a.raw", &raw3(lines, &words), None).expect("a RAW file");
        let geometry = found.recording.geometry;
        assert_eq!((geometry.width_px, geometry.height_px), size, "{lines}");
        assert_eq!(found.events.len(), 1, "{lines}");
        assert!(
            found.recording.assumed[0].starts_with(&format!("{}x{}", size.0, size.1)),
            "{lines}"
        );
    }
}

#[test]
fn missing_end_mark_and_data_that_looks_like_a_header() {
    // 0x25 is '%', and the words below even hold a newline; but they are no text.
    let words = [&[0x8000, 0x6000, 0x2025, 0x000a, 0x2025][..], &PIXEL].concat();
    for header in ["% evt 3.0\n% geometry 640x480\n", EVT3] {
        let found = read_bytes("a.raw", &raw3(header, &words), None).expect("a RAW file");
        assert_eq!(found.events.len(), 3, "{header}");
    }
    // Right behind the end mark, '%' is data.
    let words = [&[0x2025, 0x8000, 0x6000][..], &PIXEL].concat();
    let found = read_bytes("a.raw", &raw3(EVT3, &words), None).expect("a RAW file");
    assert_eq!((found.events.len(), found.recording.side().untimed), (1, 1));
}

#[test]
fn header_of_300_kilobytes() {
    let filler: String = (0..6000).map(|line| format!("% setting_{line} {:040}\n", line)).collect();
    assert!(filler.len() > 300_000);
    let header = format!("% evt 3.0\n{filler}% geometry 640x480\n% end\n");
    let words = [&[0x8000, 0x6000][..], &PIXEL].concat();
    let found = read_bytes("a.raw", &raw3(&header, &words), None).expect("a RAW file");
    assert_eq!((found.events.len(), found.recording.geometry), (1, SIZE));
}

#[test]
fn recordings_behind_each_other() {
    let events = some_events(50_000);
    for format in [WriteFormat::Evt2, WriteFormat::Evt3] {
        let one = bytes_of(format, &events);
        let mut two = [one.as_slice(), &one].concat();
        let found = read_bytes("a.raw", &two, None).expect("a RAW file");
        assert!(found.events == [events.as_slice(), &events].concat(), "{}", format.as_str());
        assert!(found.recording.side().notes[0].contains(&format!("byte {}", one.len())));
        assert_eq!(found.recording.out_of_order(), 1);
        // The first one was cut inside a word.
        two.remove(one.len() - 1);
        let found = read_bytes("a.raw", &two, None).expect("a RAW file");
        assert_eq!(found.events.len(), 2 * events.len() - 1, "{}", format.as_str());
    }
    let one = bytes_of(WriteFormat::Csv, &events);
    let found = read_bytes("a.csv", &[one.as_slice(), &one].concat(), None).expect("text");
    assert_eq!(found.events.len(), 2 * events.len());
    let one = bytes_of(WriteFormat::Npy, &events);
    let found = read_bytes("a.npy", &[one.as_slice(), &one].concat(), None).expect("an array");
    assert_eq!(found.events.len(), events.len());
    let told = format!("what follows at byte {} is left out", one.len());
    assert!(found.recording.side().notes[0].contains(&told));
    let one = bytes_of(WriteFormat::Aedat4, &events);
    let found = read_bytes("a.aedat4", &[one.as_slice(), &one].concat(), None).expect("AEDAT4");
    assert_eq!(found.events.len(), events.len());
    assert!(
        found.recording.side().notes[0].contains("another recording"),
        "{:?}",
        found.recording.side().notes
    );
}

#[test]
fn cut_files_give_what_is_there() {
    let events = some_events(30_000);
    for format in WriteFormat::ALL {
        let whole = bytes_of(format, &events);
        for keep in [whole.len() - 1, whole.len() * 2 / 3, whole.len() / 2 + 1] {
            let name = format!("{} cut to {keep}", format.as_str());
            let found = read_bytes("cut", &whole[..keep], Some(SIZE)).expect(&name);
            assert!(found.error.is_none(), "{name}: {:?}", found.error);
            let count = found.events.len();
            assert!(count > 10_000 && found.events == events[..count], "{name}: {count} events");
            // Without its last byte, AEDAT4 lacks a part of its table, text its last newline and SPI the mark of
            // its end: no event.
            let ends_in_event =
                !matches!(format, WriteFormat::Aedat4 | WriteFormat::Csv | WriteFormat::Spi);
            if keep == whole.len() - 1 && ends_in_event {
                assert_eq!(
                    (count, found.recording.side().notes.len()),
                    (events.len() - 1, 1),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn damage_in_the_midst_is_told_with_its_place_behind_the_good_events() {
    let events = some_events(30_000);
    let mut bytes = bytes_of(WriteFormat::Aedat4, &events);
    let middle = bytes.len() / 2;
    bytes[middle..middle + 2000].fill(0xa5);
    let found = read_bytes("a.aedat4", &bytes, None).expect("the header is good");
    let message = found.error.expect("damage").to_string();
    assert!(message.contains("AEDAT4, byte ") && message.contains("help: "), "{message}");
    assert!(found.events.len() > 10_000 && found.events == events[..found.events.len()]);

    let mut text = String::from_utf8(bytes_of(WriteFormat::Csv, &events)).expect("text");
    let line = text.match_indices('\n').nth(20_000).expect("enough lines").0;
    text.insert_str(line + 1, "12,what,3,1\n");
    let found = read_bytes("a.csv", text.as_bytes(), None).expect("text");
    let message = found.error.expect("damage").to_string();
    assert!(message.contains("line 20002") && message.contains("x is \"what\""), "{message}");
    assert!(found.events == events[..20_000]);
}

#[test]
fn damaged_frames_of_an_spi_stream_are_left_out_and_their_events_counted() {
    let events = some_events(30_000);
    let mut bytes = bytes_of(WriteFormat::Spi, &events);
    for at in (10_000..bytes.len() - 1000).step_by(20_000) {
        bytes[at..at + 3].fill(0x55);
    }
    let found = read_bytes("a.spi", &bytes, None).expect("a stream");
    assert!(found.error.is_none(), "{:?}", found.error);
    let lost = events.len() - found.events.len();
    assert!(lost > 500 && found.recording.lost() == lost as u64, "{lost}");
    let notes = &found.recording.side().notes;
    assert!(notes.len() == 1 && notes[0].contains(&format!("{lost} in ")), "{notes:?}");

    // Its first frame tells the sensor; so does each a tenth of a second later.
    bytes[10] ^= 1;
    let found = read_bytes("a.spi", &bytes, None).expect("a stream");
    assert_eq!(found.recording.geometry, SIZE);
    assert!(refusal("a.spi", &bytes[..2000]).contains("no frame tells the sensor"));
}

#[test]
fn what_is_no_recording_is_refused_with_advice() {
    assert!(refusal("a.raw", b"").contains("empty"));
    refusal("a.txt", b"Dear reader,\nthis is a letter.\n");
    refusal("a.json", b"{\"events\": []}\n");
    refusal("a.bin", &[0xde, 0xad, 0xbe, 0xef].repeat(100));
    refusal("a.raw", b"% evt 4.0\n% geometry 640x480\n% end\n\x00\x00");
    refusal("a.raw", b"% camera something\n\xff\xff\xff\xff");
    assert!(refusal("a.hdf5", b"\x89HDF\r\n\x1a\n....").contains("metavision_file_to_csv"));
    assert!(refusal("a.bag", b"#ROSBAG V2.0\n....").contains("rosbags-convert"));
    assert!(refusal("a.db3", b"SQLite format 3\0....").contains("DB3"));
    assert!(refusal("a.es", b"Event Stream\x01\x00\x00\x01").contains("ES"));
    assert!(refusal("a.ev8", b"evtach8\n\x00\x00").contains("EV8, byte 8"));
    assert!(refusal("a.ev8", &[b"evtach8\n".as_slice(), &[0; 16]].concat()).contains("byte 16"));
    assert!(refusal("a.npy", b"\x93NUMPY\x01\x00\xff\xff{").contains("NPY"));
    assert!(refusal("a.aedat4", b"#!AER-DAT4.0\r\n\xff\xff\xff\x7f").contains("byte 14"));
    assert!(refusal("a.gz", b"\x1f\x8b\x08\x00 not gzip").contains("compressed"));
}

#[test]
fn the_devices_recording_is_read_as_far_as_its_header_counts() {
    let events = some_events(100);
    let mut bytes = bytes_of(WriteFormat::Ev8, &events);
    bytes.extend_from_slice(b"what a terminal left behind");
    let found = read_bytes("a.ev8", &bytes, None).expect("EV8");
    assert_eq!(found.events, events);
    assert!(found.recording.side().notes[0].contains(&format!("byte {}", 24 + 100 * 8)));
    // A header that promises four thousand million events.
    bytes[20..24].fill(0xff);
    let found = read_bytes("a.ev8", &bytes, None).expect("EV8");
    assert!(found.events.starts_with(&events) && found.events.len() < 104);
    assert!(found.recording.side().notes[0].contains("before its header says so"));
}

#[test]
fn what_the_devices_recording_cannot_hold_is_refused() {
    let scratch = Scratch::new();
    let far = event(1 << 31, 0, 0, true);
    for wrong in [[event(0, 0, 0, true), far], [far, event(0, 0, 1 << 15, true)]] {
        let mut writer =
            write::create(&scratch.file("a.ev8"), WriteFormat::Ev8, SIZE).expect("a file");
        let error = writer.write(&wrong).expect_err("does not fit").to_string();
        assert!(error.contains("help: "), "{error}");
    }
}

#[test]
fn no_events_and_no_size_asks_for_no_geometry() {
    let message = refusal("a.raw", b"% evt 3.0\n% end\n");
    assert!(message.starts_with("EVT3 without events"), "{message}");
    let found = read_bytes("a.raw", b"% evt 3.0\n% end\n", Some(SIZE)).expect("an empty recording");
    assert_eq!(found.events, []);
}

#[test]
fn events_off_the_sensor_are_counted_and_left_out() {
    let small = Geometry { width_px: 100, height_px: 100 };
    let events = some_events(2000);
    let inside: Vec<Event> =
        events.iter().copied().filter(|event| small.contains(event.x, event.y)).collect();
    for format in WriteFormat::ALL {
        let found = read_bytes("a", &bytes_of(format, &events), Some(small)).expect("readable");
        // Event Stream turns rows round within its own size.
        if format != WriteFormat::Es {
            assert_eq!(found.events, inside, "{}", format.as_str());
        }
        let total = found.events.len() as u64 + found.recording.out_of_bounds();
        assert_eq!(total, events.len() as u64, "{}", format.as_str());
    }
}

#[test]
fn decompressed_twice_is_not_a_way_around() {
    use std::io::Write as _;
    let pack = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).expect("memory");
        encoder.finish().expect("memory")
    };
    let events = some_events(5000);
    let once = pack(&bytes_of(WriteFormat::Evt3, &events));
    assert!(read_bytes("a.raw.gz", &once, None).expect("gzip").events == events);
    refusal("a.raw.gz.gz", &pack(&once));
}

#[test]
fn folders_and_missing_files_are_refused() {
    let scratch = Scratch::new();
    for path in [scratch.path().to_owned(), scratch.file("not there")] {
        let error = recording::open(&path, &OpenOptions::default()).err().expect("refused");
        assert!(error.to_string().contains("help: "), "{error}");
    }
}

#[test]
fn aedat2_of_both_chips() {
    let record = |address: u32, t: u32| [address.to_be_bytes(), t.to_be_bytes()].concat();
    let header = "#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis346blue\r\n";
    let davis = |column: u32, row: u32, on: u32| row << 22 | column << 12 | on << 11;
    let imu =
        |index: u32, value: i16| 0x8000_0c00 | index << 28 | u32::from(value.cast_unsigned()) << 12;
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(record(davis(345, 259, 1), 10));
    // A frame's sample, a trigger.
    bytes.extend(record(0x8000_0000, 10));
    bytes.extend(record(davis(1, 1, 0) | 0x400, 10));
    for (index, value) in [0, 4096, 0, 0, 0, 0, 16384].into_iter().enumerate() {
        bytes.extend(record(imu(index as u32, value), 11));
    }
    bytes.extend(record(davis(0, 0, 0), 0x8000_0000));
    let mut found = read_bytes("a.aedat", &bytes, None).expect("AEDAT2");
    assert_eq!(found.events, [event(10, 0, 0, true), event(0x8000_0000, 345, 259, false)]);
    let samples = found.recording.take_imu();
    assert_eq!(samples.len(), 1);
    // Half of jAER's default range of 1000 deg/s, about the axis to the back: the picture turns clockwise.
    assert!((samples[0].roll().roll_rad_s - 500_f32.to_radians()).abs() < 1e-3, "{samples:?}");
    // A quarter... of 8 g is 1 g; the axis points down.
    assert!((samples[0].accel_m_s2[1] - 9.806_65).abs() < 1e-3, "{samples:?}");

    // Without a chip in the header, as v2e writes it.
    let bytes = [
        b"#!AER-DAT2.0\r\n".as_slice(),
        &record(davis(345, 259, 1), 5),
        &record(davis(7, 9, 0), 6),
    ]
    .concat();
    let found = read_bytes("a.aedat", &bytes, None).expect("AEDAT2");
    assert_eq!(found.events, [event(5, 0, 0, true), event(6, 338, 250, false)]);

    let dvs =
        [b"#!AER-DAT1.0\r\n".as_slice(), &[0x7f, 0xfe, 0, 0, 0, 9], &[0x00, 0x01, 0, 0, 0, 10]]
            .concat();
    let found = read_bytes("a.dat", &dvs, None).expect("AEDAT1");
    assert_eq!(found.events, [event(9, 0, 0, true), event(10, 127, 127, false)]);
}

#[test]
fn aedat3_packets() {
    let header = "#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#!END-HEADER\r\n";
    let packet = |kind: i16, overflow: i32, events: &[[u32; 2]]| {
        let mut bytes = kind.to_le_bytes().to_vec();
        bytes.extend(1_i16.to_le_bytes());
        let count = events.len() as i32;
        for field in [8, 4, overflow, count, count, count] {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend(events.iter().flatten().flat_map(|word| word.to_le_bytes()));
        bytes
    };
    let pixel = |x: u32, y: u32, on: u32| 1 | on << 1 | y << 2 | x << 17;
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(packet(1, 0, &[[pixel(3, 4, 1), 7], [pixel(3, 4, 1) & !1, 8]]));
    bytes.extend(packet(0, 0, &[[1, 9]]));
    bytes.extend(packet(1, 2, &[[pixel(239, 179, 0), 5]]));
    let found = read_bytes("a.aedat", &bytes, None).expect("AEDAT3");
    assert_eq!(found.events, [event(7, 3, 4, true), event((2 << 31) + 5, 239, 179, false)]);
    assert_eq!(found.recording.geometry, Geometry { width_px: 240, height_px: 180 });
    // Packets of other kinds may hold events of any size.
    let mut other = packet(9, 0, &[[0, 0]]);
    other[4..8].copy_from_slice(&1_i32.to_le_bytes());
    other.truncate(28 + 1);
    let with_other = [header.as_bytes(), &other, &packet(1, 0, &[[pixel(3, 4, 1), 7]])].concat();
    let found = read_bytes("a.aedat", &with_other, None).expect("AEDAT3");
    assert_eq!(found.events, [event(7, 3, 4, true)]);
    let cut = read_bytes("a.aedat", &bytes[..bytes.len() - 1], None).expect("AEDAT3");
    assert_eq!((cut.events.len(), cut.recording.side().notes.len()), (1, 1));
}

#[test]
fn event_stream_of_atis_keeps_the_brightness_changes() {
    let mut bytes = b"Event Stream\x02\x00\x00\x02\x40\x01\xf0\x00".to_vec();
    // 63 * 2 us pass, a brighter event 5 us later, an exposure measurement 1 us later, a darker one.
    bytes.push(0xfe);
    bytes.extend([5 << 2 | 2, 3, 0, 239, 0]);
    bytes.extend([1 << 2 | 1, 3, 0, 4, 0]);
    bytes.extend([0, 4, 0, 0, 0]);
    let found = read_bytes("a.es", &bytes, None).expect("ES");
    assert_eq!(found.events, [event(131, 3, 0, true), event(132, 4, 239, false)]);
}

#[test]
fn real_recordings_have_their_counts() {
    let folder = std::env::var("EVTACH_RECORDINGS")
        .unwrap_or_else(|_| format!("{}/../../shared/recordings", env!("CARGO_MANIFEST_DIR")));
    let folder = std::path::Path::new(&folder);
    let mut seen = 0;
    for (name, count) in [
        ("real/spinning-dot.evt2.raw", 539_481),
        ("real/lamp-100hz.davis346.aedat4", 117_667),
        ("real/street.evt3.raw", 219_596),
        ("real/person.aedat4", 111_954),
        ("real/dvs128.aedat2.aedat", 130_114),
        ("real/dvs.es", 473_225),
        ("simulated/dev01_prop2_2987rpm_cw_tripod.aedat4", 498_718),
        ("simulated/dev02_fan3_1453rpm_ccw_handheld.raw", 304_181),
        ("simulated/dev04_blade1_9120rpm_ccw_vibhost.dat", 207_733),
        ("simulated/dev05_drone4_mixed_tripod.raw", 623_105),
        ("simulated/dev06_ramp4_1786rpm_cw.raw", 214_121),
        ("simulated/dev10_edge_REFUSE.csv", 65_486),
    ] {
        let file = folder.join(name);
        if !file.exists() {
            continue;
        }
        let found = read(&file, None).expect(name);
        assert!(found.error.is_none(), "{name}: {:?}", found.error);
        assert_eq!(found.events.len(), count, "{name}");
        assert_eq!(
            (found.recording.out_of_bounds(), found.recording.out_of_order()),
            (0, 0),
            "{name}"
        );
        seen += 1;
    }
    if seen == 0 {
        println!("skipped: no recordings");
    }
}
