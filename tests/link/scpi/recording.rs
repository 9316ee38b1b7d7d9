//! Recordings, fetched as blocks.

use evtach_core::{Event, Geometry, Polarity};
use evtach_firmware::record::{Decoder, Header};

use super::Session;
use crate::bench::{Bench, drain, exchange};

fn events(count: u64) -> Vec<Event> {
    (0..count)
        // Every byte there is, newlines too.
        .map(|index| Event { t_us: index, x: 10, y: 0x0a, polarity: Polarity::On })
        .collect()
}

impl Bench {
    /// A recording of so many events that has ended.
    pub(crate) fn start(&mut self, count: u64) {
        evtach_firmware::scpi::Device::start_recording(self, count as u32).expect("room");
        self.record(&events(count));
    }
}

/// A definite length block (IEEE 488.2, 8.7.9) and what follows it.
pub fn block(answer: &[u8]) -> (&[u8], &[u8]) {
    assert_eq!(answer[0], b'#');
    let digits = usize::from(answer[1] - b'0');
    let length: usize =
        std::str::from_utf8(&answer[2..2 + digits]).expect("digits").parse().expect("a length");
    answer[2 + digits..].split_at(length)
}

#[test]
fn a_recording_is_fetched_as_a_block() {
    let mut session = Session::new();
    assert_eq!(session.ask("DATA:REC:STAT?;CAP?;EVEN?"), "IDLE;100;0\n");
    assert_eq!(session.ask("DATA:REC:STAR;STAT?;:STAT:OPER:COND?"), "RUN;784\n");
    session.bench.record(&events(60));
    assert_eq!(session.ask("DATA:REC?"), "");
    assert_eq!(session.error(), -221, "it still runs");
    assert_eq!(session.ask("DATA:REC:STOP;STAT?;EVEN?"), "IDLE;60\n");
    assert_eq!(session.ask("DATA:REC:STAR 50;STAT?"), "RUN\n");
    session.bench.record(&events(60));
    assert_eq!(session.ask("DATA:REC:STAT?;EVEN?"), "FULL;50\n");
    let Session { link, bench } = &mut session;
    let answer = exchange(link, bench, b"*OPC?;:DATA:REC?;*OPC?\n", 0);
    let (file, rest) = block(answer.strip_prefix(b"1;").expect("the answer before"));
    assert_eq!(rest, b";1\n");
    let (header, body) = file.split_first_chunk().expect("a header");
    let header = Header::parse(header).expect("a header");
    assert_eq!((header.events, Some(header.geometry)), (50, Geometry::new(320, 240)));
    let mut decoder = Decoder::new(header.first_us);
    let found: Vec<Event> =
        body.as_chunks().0.iter().map(|&record| decoder.decode(record)).collect();
    assert_eq!(found, events(50));
}

#[test]
fn a_memory_that_fails_is_told_and_the_block_keeps_its_length() {
    let mut session = Session::new();
    session.bench.start(10);
    session.bench.recorder = None;
    assert_eq!(session.ask("DATA:REC?"), "");
    assert_eq!(session.error(), -241);
    assert_eq!(session.ask("DATA:REC:STAT?"), "ABSENT\n");

    let mut session = Session::new();
    session.bench.start(10);
    let Session { link, bench } = &mut session;
    link.receive(b"DATA:REC?\n");
    link.run(0, bench);
    let mut head = [0; 5];
    assert_eq!(link.transmit(&mut head, bench), 5);
    bench.recorder = None;
    let rest = drain(link, bench, 0);
    assert_eq!(block(&[head.as_slice(), &rest].concat()), ([0; 104].as_slice(), b"\n".as_slice()));
    assert_eq!(session.error(), -240);
}
