//! The file header: compression, streams and where the packets end.

use evtach_core::Geometry;

use super::flat::Table;
use super::{Compression, MAGIC};
use crate::recording::error::{Place, RecordingError};
use crate::recording::input::Input;

/// Longest description of the streams that is read.
const MAX_HEADER_BYTES: usize = 16 << 20;

/// One recorded stream of events.
#[derive(Clone, Debug)]
pub struct Stream {
    pub id: i32,
    /// Type identifier: EVTS, FRME, IMUS, TRIG.
    pub kind: String,
    pub geometry: Option<Geometry>,
    pub source: Option<String>,
}

/// What stands before the packets.
#[derive(Debug)]
pub struct Header {
    pub compression: Compression,
    /// Offset of the table behind the last packet; `None` when the recording was not closed.
    pub packets_end: Option<u64>,
    pub streams: Vec<Stream>,
}

fn damaged(offset: u64, what: impl Into<String>) -> RecordingError {
    RecordingError::Damaged { format: "AEDAT4", place: Place::Byte(offset), what: what.into() }
}

impl Header {
    /// Reads and consumes magic and header.
    pub fn read(input: &mut Input) -> Result<Self, RecordingError> {
        let start = MAGIC.len();
        let offset = start as u64;
        let prefix = input.peek(start + 4)?;
        let size = prefix
            .get(start..start + 4)
            .and_then(|bytes| <[u8; 4]>::try_from(bytes).ok())
            .map(|bytes| u32::from_le_bytes(bytes) as usize)
            .ok_or_else(|| damaged(offset, "the file ends inside its header"))?;
        if size > MAX_HEADER_BYTES {
            return Err(damaged(offset, format!("a header of {size} bytes")));
        }
        let end = start + 4 + size;
        let buffer = input
            .peek(end)?
            .get(start + 4..end)
            .ok_or_else(|| damaged(offset, "the file ends inside its header"))?;
        let header = Self::parse(buffer, offset)?;
        input.consume(end);
        Ok(header)
    }

    fn parse(buffer: &[u8], offset: u64) -> Result<Self, RecordingError> {
        let table = Table::root(buffer, b"IOHE")
            .ok_or_else(|| damaged(offset, "the header is not an IOHE table"))?;
        let code = table.i32(0).unwrap_or(0);
        let compression = Compression::from_code(code)
            .ok_or_else(|| damaged(offset, format!("unknown compression {code}")))?;
        let packets_end =
            table.i64(1).and_then(|end| u64::try_from(end).ok()).filter(|&end| end > 0);
        let xml =
            table.string(2).ok_or_else(|| damaged(offset, "the header describes no streams"))?;
        Ok(Self { compression, packets_end, streams: streams(xml, offset)? })
    }

    /// Streams of one kind.
    pub fn of_kind<'h>(&'h self, kind: &'h str) -> impl Iterator<Item = &'h Stream> {
        self.streams.iter().filter(move |stream| stream.kind == kind)
    }
}

/// The streams that the XML lists: `<node name="outInfo"><node name="0"><attr key="typeIdentifier">EVTS</attr>...`.
fn streams(xml: &str, offset: u64) -> Result<Vec<Stream>, RecordingError> {
    let document = roxmltree::Document::parse(xml.trim_end_matches('\0'))
        .map_err(|error| damaged(offset, format!("the header's XML: {error}")))?;
    let attribute = |node: roxmltree::Node<'_, '_>, key: &str| {
        node.children()
            .find(|child| child.has_tag_name("attr") && child.attribute("key") == Some(key))
            .and_then(|child| child.text())
            .map(|text| text.trim().to_owned())
    };
    let is_node = |node: &roxmltree::Node<'_, '_>| node.has_tag_name("node");
    Ok(document
        .descendants()
        .filter(|node| is_node(node) && node.attribute("name") == Some("outInfo"))
        .flat_map(|node| node.children().filter(is_node).collect::<Vec<_>>())
        .filter_map(|node| {
            let info = node
                .children()
                .find(|child| is_node(child) && child.attribute("name") == Some("info"));
            let of_info = |key| info.and_then(|info| attribute(info, key));
            let side = |key| of_info(key).and_then(|text| text.parse().ok());
            Some(Stream {
                id: node.attribute("name")?.parse().ok()?,
                kind: attribute(node, "typeIdentifier")?,
                geometry: side("sizeX").zip(side("sizeY")).and_then(|(w, h)| Geometry::new(w, h)),
                source: of_info("source"),
            })
        })
        .collect())
}
