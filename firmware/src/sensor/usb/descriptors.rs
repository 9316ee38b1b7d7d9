//! The endpoint of the data, from the configuration that a device hands out.

use embassy_usb_driver::{EndpointInfo, EndpointType};

use super::start::DATA;

/// Descriptor types and lengths of the USB 2.0 specification, 9.6.
const ENDPOINT: u8 = 5;
const ENDPOINT_BYTES: usize = 7;
/// Transfer type in an endpoint's attributes.
const BULK: u8 = 2;
/// Payload bytes in an endpoint's packet size; above them stand transactions of other types.
const PACKET_BYTES: u16 = 0x7ff;

/// The bulk endpoint that the data comes from, if there is one. The bytes are believed as far as they make sense.
pub(super) fn data_endpoint(mut configuration: &[u8]) -> Option<EndpointInfo> {
    while let Some(&length) = configuration.first() {
        // A length that leads nowhere ends the search.
        let (descriptor, rest) = configuration.split_at_checked(length.max(1).into())?;
        configuration = rest;
        if let &[_, ENDPOINT, DATA, attributes, size0, size1, ..] = descriptor
            && descriptor.len() >= ENDPOINT_BYTES
            && attributes & 3 == BULK
        {
            return Some(EndpointInfo {
                addr: DATA.into(),
                ep_type: EndpointType::Bulk,
                max_packet_size: u16::from_le_bytes([size0, size1]) & PACKET_BYTES,
                interval_ms: 0,
            });
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn found_among_others() {
        let bytes =
            [9, 2, 25, 0, 1, 1, 0, 0x80, 250, 7, 5, 0x81, 3, 64, 0, 1, 7, 5, 0x82, 2, 0, 2, 0];
        assert_eq!(data_endpoint(&bytes).map(|endpoint| endpoint.max_packet_size), Some(512));
        assert_eq!(data_endpoint(&bytes[..16]), None);
        assert_eq!(data_endpoint(&bytes[..20]), None, "cut off");
    }

    #[test]
    fn nonsense_is_no_endpoint() {
        assert_eq!(data_endpoint(&[0; 40]), None);
        assert_eq!(data_endpoint(&[255, 5, 0x82, 2]), None);
        assert_eq!(data_endpoint(&[3, 5, 0x82, 2, 0, 2, 0]), None);
    }
}
