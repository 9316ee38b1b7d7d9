//! The message event_camera_msgs/msg/EventPacket.

use super::cdr::Cdr;

/// One message.
#[derive(Debug)]
pub struct EventPacket<'m> {
    pub frame_id: &'m str,
    pub height: u32,
    pub width: u32,
    pub sequence: u64,
    /// Base of the events' times in nanoseconds, for the encodings that need one.
    pub time_base_ns: u64,
    pub encoding: &'m str,
    pub is_bigendian: bool,
    pub events: &'m [u8],
}

impl<'m> EventPacket<'m> {
    /// Takes a serialised message apart.
    pub fn parse(message: &'m [u8]) -> Result<Self, String> {
        let mut cdr = Cdr::new(message)?;
        // Time stamp of the header: when the host got the packet, not when the sensor saw it.
        let _ = (cdr.u32()?, cdr.u32()?);
        Ok(Self {
            frame_id: cdr.string()?,
            height: cdr.u32()?,
            width: cdr.u32()?,
            sequence: cdr.u64()?,
            time_base_ns: cdr.u64()?,
            encoding: cdr.string()?,
            is_bigendian: cdr.u8()? != 0,
            events: cdr.bytes()?,
        })
    }
}
