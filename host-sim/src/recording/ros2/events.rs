//! The encodings of events inside a packet (event_camera_codecs).

use evtach_core::decode::{Evt2, Evt3, Evt21};
use evtach_core::{Event, Polarity};

use super::packet::EventPacket;
use crate::recording::Side;
use crate::recording::error::RecordingError;

/// libcaer's times have 31 bits.
const LIBCAER_WRAP_NS: u64 = (1 << 31) * 1000;

/// Decoder of one encoding; Prophesee's run on from packet to packet.
pub enum PacketDecoder {
    Evt2(Evt2),
    Evt21(Evt21),
    Evt3(Evt3),
    /// 8 bytes: polarity word as in AEDAT 3, time in microseconds.
    Libcaer,
    /// 16-bit words much like EVT 3, with the base time in the packet.
    LibcaerCompressed,
    /// 8 bytes: time in nanoseconds, x, y and polarity.
    Mono,
}

const fn polarity(on: bool) -> Polarity {
    if on { Polarity::On } else { Polarity::Off }
}

impl PacketDecoder {
    /// The decoder of an encoding.
    pub fn new(encoding: &str) -> Result<Self, RecordingError> {
        match encoding {
            "evt2" => Ok(Self::Evt2(Evt2::new())),
            "evt21" => Ok(Self::Evt21(Evt21::new())),
            "evt3" => Ok(Self::Evt3(Evt3::new())),
            "libcaer" => Ok(Self::Libcaer),
            "libcaer_cmp" => Ok(Self::LibcaerCompressed),
            "mono" => Ok(Self::Mono),
            _ => Err(RecordingError::Unsupported {
                what: format!("packets in the encoding \"{encoding}\" are not read"),
                advice: "record evt2, evt21, evt3, libcaer, libcaer_cmp or mono".to_owned(),
            }),
        }
    }

    /// Name of the encoding.
    const fn name(&self) -> &'static str {
        match self {
            Self::Evt2(_) => "evt2",
            Self::Evt21(_) => "evt21",
            Self::Evt3(_) => "evt3",
            Self::Libcaer => "libcaer",
            Self::LibcaerCompressed => "libcaer_cmp",
            Self::Mono => "mono",
        }
    }

    /// Appends the events of a packet.
    pub fn decode(
        &mut self,
        packet: &EventPacket<'_>,
        events: &mut Vec<Event>,
        side: &mut Side,
    ) -> Result<(), String> {
        if packet.encoding != self.name() {
            return Err(format!("the encoding changes to \"{}\"", packet.encoding));
        }
        if packet.is_bigendian {
            return Err("a packet in big-endian order".to_owned());
        }
        let bytes = packet.events;
        match self {
            Self::Evt2(decoder) => {
                for word in bytes.as_chunks().0 {
                    decoder.decode(u32::from_le_bytes(*word), |event| events.push(event));
                }
                side.note(decoder.counts());
            }
            Self::Evt21(decoder) => {
                for word in bytes.as_chunks().0 {
                    decoder.decode(u64::from_le_bytes(*word), |event| events.push(event));
                }
                side.note(decoder.counts());
            }
            Self::Evt3(decoder) => {
                for word in bytes.as_chunks().0 {
                    decoder.decode(u16::from_le_bytes(*word), |event| events.push(event));
                }
                side.note(decoder.counts());
            }
            Self::Libcaer => libcaer(bytes, packet.time_base_ns, events, side),
            Self::LibcaerCompressed => {
                libcaer_compressed(bytes, packet.time_base_ns, events, side);
            }
            Self::Mono => mono(bytes, packet.time_base_ns, events),
        }
        Ok(())
    }
}

fn libcaer(bytes: &[u8], mut base_ns: u64, events: &mut Vec<Event>, side: &mut Side) {
    let mut last = 0;
    for &[d0, d1, d2, d3, t0, t1, t2, t3] in bytes.as_chunks().0 {
        let data = u32::from_le_bytes([d0, d1, d2, d3]);
        let low = u32::from_le_bytes([t0, t1, t2, t3]) & 0x7fff_ffff;
        // Within a packet time only falls where the counter wraps.
        if low < last && last - low > 1 << 30 {
            base_ns = base_ns.saturating_add(LIBCAER_WRAP_NS);
            side.wraps += 1;
        }
        last = low;
        events.push(Event {
            t_us: base_ns / 1000 + u64::from(low),
            x: ((data >> 17) & 0x7fff) as u16,
            y: ((data >> 2) & 0x7fff) as u16,
            polarity: polarity(data & 2 != 0),
        });
    }
}

fn libcaer_compressed(bytes: &[u8], base_ns: u64, events: &mut Vec<Event>, side: &mut Side) {
    let (mut high, mut low, mut x, mut base_y) = (0_u64, 0_u64, 0, 0_u16);
    let mut base_polarity = Polarity::Off;
    for word in bytes.as_chunks().0 {
        let word = u16::from_le_bytes(*word);
        let t_us = base_ns / 1000 + (high << 12 | low);
        match word >> 12 {
            0 => high = u64::from(word & 0xfff),
            1 => low = u64::from(word & 0xfff),
            2 => x = word & 0x7ff,
            3 => events.push(Event {
                t_us,
                x,
                y: word & 0x7ff,
                polarity: polarity(word & 0x800 != 0),
            }),
            4 => {
                base_y = word & 0x7ff;
                base_polarity = polarity(word & 0x800 != 0);
            }
            5 => {
                let set = (0..8).filter(|bit| word & 1 << bit != 0);
                events.extend(set.map(|bit| Event {
                    t_us,
                    x,
                    y: base_y.wrapping_add(bit),
                    polarity: base_polarity,
                }));
                base_y = base_y.wrapping_add(8);
            }
            _ => side.unknown += 1,
        }
    }
}

fn mono(bytes: &[u8], base_ns: u64, events: &mut Vec<Event>) {
    for &[t0, t1, t2, t3, x0, x1, y0, y1] in bytes.as_chunks().0 {
        let y = u16::from_le_bytes([y0, y1]);
        events.push(Event {
            t_us: base_ns.saturating_add(u64::from(u32::from_le_bytes([t0, t1, t2, t3]))) / 1000,
            x: u16::from_le_bytes([x0, x1]),
            y: y & 0x7fff,
            polarity: polarity(y & 0x8000 != 0),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(encoding: &str, base_ns: u64, bytes: &[u8]) -> Vec<Event> {
        decode_beside(encoding, base_ns, bytes, &mut Side::default())
    }

    fn decode_beside(encoding: &str, base_ns: u64, bytes: &[u8], side: &mut Side) -> Vec<Event> {
        let packet = EventPacket {
            frame_id: "",
            height: 480,
            width: 640,
            sequence: 0,
            time_base_ns: base_ns,
            encoding,
            is_bigendian: false,
            events: bytes,
        };
        let mut events = Vec::new();
        let mut decoder = PacketDecoder::new(encoding).expect("a known encoding");
        decoder.decode(&packet, &mut events, side).expect("a good packet");
        events
    }

    #[test]
    fn libcaer_clock_wraps_after_31_bits() {
        let event = |t: u32| [0x02_u32 | 7 << 2 | 9 << 17, t].map(u32::to_le_bytes).concat();
        let bytes = [event(0x7fff_ffff), event(0)].concat();
        let events = decode("libcaer", 5_000_000, &bytes);
        let at = |t_us| Event { t_us, x: 9, y: 7, polarity: Polarity::On };
        assert_eq!(events, [at(5000 + 0x7fff_ffff), at(5000 + 0x8000_0000)]);
    }

    #[test]
    fn compressed_words() {
        let words: [u16; 6] = [0x0001, 0x1002, 0x2005, 0x3807, 0x4010, 0x5081];
        let events = decode("libcaer_cmp", 1_000_000, &words.map(u16::to_le_bytes).concat());
        let at = |y, polarity| Event { t_us: 1000 + 0x1002, x: 5, y, polarity };
        assert_eq!(events, [at(7, Polarity::On), at(16, Polarity::Off), at(23, Polarity::Off)]);
    }

    /// As those of EVT 2, 2.1 and 3 are; packet after packet.
    #[test]
    fn compressed_words_of_unknown_type_are_counted() {
        let mut side = Side::default();
        let bytes = [0x0001_u16, 0x7002, 0x2005, 0x3807, 0xf010].map(u16::to_le_bytes).concat();
        for packets in 1..=2 {
            let events = decode_beside("libcaer_cmp", 0, &bytes, &mut side);
            assert_eq!((events.len(), side.unknown), (1, 2 * packets));
        }
    }

    #[test]
    fn mono_counts_nanoseconds() {
        let event = [2500_u32.to_le_bytes().to_vec(), vec![3, 0, 4, 0x80]].concat();
        let expected = Event { t_us: 12, x: 3, y: 4, polarity: Polarity::On };
        assert_eq!(decode("mono", 10_000, &event), [expected]);
    }
}
