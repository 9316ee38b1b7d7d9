//! A checked view into a flatbuffer.
//!
//! The flatbuffers crate reads through generated `unsafe` code, which this workspace does not allow; the little that
//! AEDAT 4 needs is a handful of bounds-checked offsets.

/// A table inside a buffer.
#[derive(Clone, Copy, Debug)]
pub struct Table<'b> {
    buffer: &'b [u8],
    at: usize,
}

fn bytes<const N: usize>(buffer: &[u8], at: usize) -> Option<[u8; N]> {
    buffer.get(at..at.checked_add(N)?)?.try_into().ok()
}

fn offset(buffer: &[u8], at: usize) -> Option<usize> {
    at.checked_add(u32::from_le_bytes(bytes(buffer, at)?) as usize)
}

impl<'b> Table<'b> {
    /// The root table of a buffer (without size prefix) that carries this identifier.
    pub fn root(buffer: &'b [u8], identifier: &[u8; 4]) -> Option<Self> {
        (buffer.get(4..8)? == identifier).then_some(())?;
        Some(Self { buffer, at: offset(buffer, 0)? })
    }

    /// Position of a field in the buffer; `None` when it is absent, which means its default.
    fn field(&self, index: usize) -> Option<usize> {
        let back = i32::from_le_bytes(bytes(self.buffer, self.at)?);
        let vtable = usize::try_from(i64::try_from(self.at).ok()? - i64::from(back)).ok()?;
        let size = usize::from(u16::from_le_bytes(bytes(self.buffer, vtable)?));
        let slot = 4 + 2 * index;
        if slot + 2 > size {
            return None;
        }
        match u16::from_le_bytes(bytes(self.buffer, vtable + slot)?) {
            0 => None,
            field => Some(self.at + usize::from(field)),
        }
    }

    /// A 32-bit integer field.
    pub fn i32(&self, index: usize) -> Option<i32> {
        bytes(self.buffer, self.field(index)?).map(i32::from_le_bytes)
    }

    /// A 64-bit integer field.
    pub fn i64(&self, index: usize) -> Option<i64> {
        bytes(self.buffer, self.field(index)?).map(i64::from_le_bytes)
    }

    /// Start and length of a vector field.
    fn vector(&self, index: usize) -> Option<(usize, usize)> {
        let at = offset(self.buffer, self.field(index)?)?;
        let length = u32::from_le_bytes(bytes(self.buffer, at)?) as usize;
        Some((at + 4, length))
    }

    /// A vector of fixed-size structures; `Some` of an empty slice when the field is absent, `None` when it lies.
    pub fn structs<const N: usize>(&self, index: usize) -> Option<&'b [[u8; N]]> {
        if self.field(index).is_none() {
            return Some(&[]);
        }
        let (start, length) = self.vector(index)?;
        let end = start.checked_add(length.checked_mul(N)?)?;
        Some(self.buffer.get(start..end)?.as_chunks().0)
    }

    /// A 32-bit float field.
    pub fn f32(&self, index: usize) -> Option<f32> {
        bytes(self.buffer, self.field(index)?).map(f32::from_le_bytes)
    }

    /// A vector of tables; empty when the field is absent, `None` when it lies.
    pub fn tables(&self, index: usize) -> Option<Vec<Table<'b>>> {
        let Some((start, length)) = self.vector(index) else {
            return self.field(index).is_none().then(Vec::new);
        };
        // Each table takes at least its own offset: the length cannot claim more than the buffer holds.
        if length > self.buffer.len() / 4 {
            return None;
        }
        (0..length)
            .map(|entry| {
                let at = start.checked_add(4 * entry)?;
                Some(Table { buffer: self.buffer, at: offset(self.buffer, at)? })
            })
            .collect()
    }

    /// A string field.
    pub fn string(&self, index: usize) -> Option<&'b str> {
        let (start, length) = self.vector(index)?;
        std::str::from_utf8(self.buffer.get(start..start.checked_add(length)?)?).ok()
    }
}
