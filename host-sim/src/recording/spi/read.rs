//! Reading a stream of frames.

use evtach_core::Event;
use evtach_firmware::sensor::spi::{Account, Hello, Kind, Lost, Parser, Words};

use crate::recording::error::RecordingError;
use crate::recording::geometry::KnownSize;
use crate::recording::input::Input;
use crate::recording::{Opened, Side, Source};

/// Bytes before the first hello: a bridge says it every 100 ms, which is 1.25 MB on a bus of 100 MHz.
const LATEST_HELLO_BYTES: u64 = 1 << 21;

/// Opens a stream; events before its first hello, of a sensor whose size is not known yet, are passed over as on
/// the device.
pub(crate) fn open(mut input: Input) -> Result<Opened, RecordingError> {
    let (mut parser, mut account) = (Parser::new(), Account::default());
    let hello = loop {
        if let Some(hello) = next_hello(&mut parser, &mut account) {
            break hello;
        }
        if input.offset() > LATEST_HELLO_BYTES || fill(&mut parser, &mut input)? == 0 {
            return Err(RecordingError::Unsupported {
                what: "this is a stream from an SPI bridge in which no frame tells the sensor"
                    .to_owned(),
                advice: "record again: a bridge tells its sensor every 100 ms".to_owned(),
            });
        }
    };
    Ok(Opened {
        format: "SPI",
        geometry: Some(KnownSize::new(hello.geometry, "from the stream")),
        assumed: Vec::new(),
        about: vec![("sensor".to_owned(), hello.name().to_owned())],
        source: Box::new(Stream { input, parser, account, ended: false }),
    })
}

/// The next frame that says what the sensor is: the account begins with it.
fn next_hello(parser: &mut Parser, account: &mut Account) -> Option<Hello> {
    loop {
        let frame = parser.next_frame()?;
        if frame.header.kind == Kind::Hello
            && let Some(hello) = Hello::parse(frame.payload)
        {
            account.frame(&frame);
            return Some(hello);
        }
    }
}

/// Moves bytes from the file to the parser, and says how many.
fn fill(parser: &mut Parser, input: &mut Input) -> Result<usize, RecordingError> {
    let space = parser.space();
    let bytes = input.peek(space.len())?;
    let filled = bytes.len().min(space.len());
    space[..filled].copy_from_slice(&bytes[..filled]);
    input.consume(filled);
    parser.filled(filled);
    Ok(filled)
}

struct Stream {
    input: Input,
    parser: Parser,
    account: Account,
    ended: bool,
}

impl Source for Stream {
    fn read(&mut self, events: &mut Vec<Event>, side: &mut Side) -> Result<bool, RecordingError> {
        let filled = fill(&mut self.parser, &mut self.input)?;
        while let Some(frame) = self.parser.next_frame() {
            self.account.frame(&frame);
            self.ended = frame.header.kind == Kind::End;
            let before = events.len();
            Words::new(&frame).decode(usize::MAX, |event| events.push(event));
            self.account.events((events.len() - before) as u32);
        }
        side.lost = self.account.lost.total();
        if filled == 0 {
            self.tell(side);
        }
        Ok(filled > 0)
    }
}

impl Stream {
    fn tell(&self, side: &mut Side) {
        let Account { frames_damaged, frames_missing, restarts, lost, .. } = self.account;
        let Lost { bridge, damaged, missing, undecoded } = lost;
        if lost.total() > 0 {
            side.notes.push(format!(
                "events lost: {damaged} in {frames_damaged} damaged frames, {missing} in {frames_missing} missing frames, \
                 {bridge} by the bridge, {undecoded} in words that hold none"
            ));
        }
        if restarts > 0 {
            side.notes.push(format!(
                "the bridge restarted {restarts} times: what was lost meanwhile is not known"
            ));
        }
        if !self.ended {
            side.notes
                .push("the stream ends without the frame that marks its end: cut short".to_owned());
        }
    }
}
