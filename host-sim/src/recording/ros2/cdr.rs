//! Reading the little-endian Common Data Representation, in which ROS 2 stores messages.

/// A position in a message. Numbers are aligned to their size, counted from behind the 4-byte header.
pub struct Cdr<'m> {
    bytes: &'m [u8],
    at: usize,
}

impl<'m> Cdr<'m> {
    /// A message with its encapsulation header.
    pub fn new(message: &'m [u8]) -> Result<Self, String> {
        match message {
            [_, 1, _, _, bytes @ ..] => Ok(Self { bytes, at: 0 }),
            [_, 0, _, _, ..] => Err("a big-endian message".to_owned()),
            _ => Err("a message that is no CDR".to_owned()),
        }
    }

    /// The next `count` bytes behind padding to `align`.
    fn take(&mut self, count: usize, align: usize) -> Result<&'m [u8], String> {
        let start = self.at.next_multiple_of(align);
        let end = start.checked_add(count).filter(|&end| end <= self.bytes.len());
        let end =
            end.ok_or_else(|| format!("a message that ends at its byte {}", self.bytes.len() + 4))?;
        self.at = end;
        Ok(&self.bytes[start..end])
    }

    pub fn u8(&mut self) -> Result<u8, String> {
        Ok(self.take(1, 1)?[0])
    }

    pub fn u32(&mut self) -> Result<u32, String> {
        let bytes = self.take(4, 4)?;
        Ok(bytes.iter().rev().fold(0, |sum, &byte| sum << 8 | u32::from(byte)))
    }

    pub fn u64(&mut self) -> Result<u64, String> {
        let bytes = self.take(8, 8)?;
        Ok(bytes.iter().rev().fold(0, |sum, &byte| sum << 8 | u64::from(byte)))
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self) -> Result<&'m [u8], String> {
        let count = self.u32()? as usize;
        self.take(count, 1)
    }

    /// A string, its closing zero left out.
    pub fn string(&mut self) -> Result<&'m str, String> {
        let bytes = self.bytes()?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_| "a string that is not UTF-8".to_owned())
    }
}
