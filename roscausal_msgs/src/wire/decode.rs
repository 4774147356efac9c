//! The decoder for both wire formats.

use serde::de::{DeserializeSeed, Deserializer, SeqAccess, Visitor};

use super::{Fault, Layout};

/// Reads the fields of a message one after the other. Every length is checked against the remaining bytes before
/// anything is allocated for it.
pub(crate) struct Decoder<'de> {
    layout: Layout,
    bytes: &'de [u8],
    offset: usize,
    /// The position from which alignment counts.
    origin: usize,
    /// `seq` of the first header seen.
    seq: Option<u32>,
}

impl<'de> Decoder<'de> {
    /// Reads from `origin` on, from which alignment counts.
    pub(crate) fn new(layout: Layout, bytes: &'de [u8], origin: usize) -> Self {
        Self { layout, bytes, offset: origin, origin, seq: None }
    }

    /// The `seq` of the first header, once the whole message has been read; up to `spare` bytes may remain.
    pub(crate) fn finish(self, spare: usize) -> Result<Option<u32>, Fault> {
        match self.left() {
            left if left > spare => Err(Fault::Trailing { left }),
            _ => Ok(self.seq),
        }
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.offset
    }

    fn take(&mut self, count: usize) -> Result<&'de [u8], Fault> {
        let (offset, left) = (self.offset, self.left());
        match self.bytes.get(offset..).and_then(|rest| rest.get(..count)) {
            Some(taken) => {
                self.offset += count;
                Ok(taken)
            }
            None => Err(Fault::Truncated { offset, needed: count, left }),
        }
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        self.take(self.layout.padding(self.offset - self.origin, N))?;
        let mut little_endian = [0; N];
        little_endian.copy_from_slice(self.take(N)?);
        if self.layout.big_endian {
            little_endian.reverse();
        }
        Ok(little_endian)
    }

    /// A length of elements that have at least one byte each.
    fn length(&mut self) -> Result<usize, Fault> {
        let length = u32::from_le_bytes(self.number()?);
        let left = self.left();
        match usize::try_from(length) {
            Ok(count) if count <= left => Ok(count),
            _ => Err(Fault::Length { offset: self.offset - 4, length, left }),
        }
    }

    fn prefixed(&mut self) -> Result<&'de [u8], Fault> {
        let length = self.length()?;
        self.take(length)
    }
}

macro_rules! numbers {
    ($($method:ident $visit:ident $type:ty),*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
            visitor.$visit(<$type>::from_le_bytes(self.number()?))
        })*
    };
}

macro_rules! unsupported {
    ($($method:ident($($arg:ty),*) $what:literal),*) => {
        $(fn $method<V: Visitor<'de>>(self, $(_: $arg,)* _visitor: V) -> Result<V::Value, Fault> {
            Err(Fault::Unsupported($what))
        })*
    };
}

/// What is read as something else is, or is nothing.
macro_rules! plain {
    ($($method:ident($($name:ident: $arg:ty),*) |$this:ident, $visitor:ident| $value:expr;)*) => {
        $(fn $method<V: Visitor<'de>>($this, $($name: $arg,)* $visitor: V) -> Result<V::Value, Fault> {
            $value
        })*
    };
}

impl<'de> Deserializer<'de> for &mut Decoder<'de> {
    type Error = Fault;

    numbers!(
        deserialize_i8 visit_i8 i8, deserialize_i16 visit_i16 i16, deserialize_i32 visit_i32 i32,
        deserialize_i64 visit_i64 i64, deserialize_u8 visit_u8 u8, deserialize_u16 visit_u16 u16,
        deserialize_u32 visit_u32 u32, deserialize_u64 visit_u64 u64, deserialize_f32 visit_f32 f32,
        deserialize_f64 visit_f64 f64
    );

    unsupported!(
        deserialize_any() "a value of unknown type",
        deserialize_ignored_any() "a value of unknown type",
        deserialize_identifier() "a name",
        deserialize_char() "a char",
        deserialize_option() "an optional field",
        deserialize_map() "a map",
        deserialize_enum(&'static str, &'static [&'static str]) "an enum"
    );

    plain!(
        deserialize_str() |self, visitor| self.deserialize_string(visitor);
        deserialize_bytes() |self, visitor| visitor.visit_borrowed_bytes(self.prefixed()?);
        deserialize_byte_buf() |self, visitor| self.deserialize_bytes(visitor);
        deserialize_tuple(len: usize) |self, visitor| visitor.visit_seq(Elements { decoder: self, left: len });
        deserialize_tuple_struct(_name: &'static str, len: usize) |self, visitor| self.deserialize_tuple(len, visitor);
        deserialize_newtype_struct(_name: &'static str) |self, visitor| visitor.visit_newtype_struct(self);
        deserialize_unit() |self, visitor| visitor.visit_unit();
        deserialize_unit_struct(_name: &'static str) |self, visitor| visitor.visit_unit();
    );

    /// Anything except 0 is true, as in C.
    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let [byte] = self.number()?;
        visitor.visit_bool(byte != 0)
    }

    /// Bytes that are not UTF-8 become U+FFFD, because ROS 1 does not define the encoding of strings.
    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let mut bytes = self.prefixed()?;
        if self.layout.cdr
            && let Some((0, text)) = bytes.split_last()
        {
            bytes = text;
        }
        visitor.visit_str(&String::from_utf8_lossy(bytes))
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let left = self.length()?;
        visitor.visit_seq(Elements { decoder: self, left })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        if self.layout.has_seq(name) {
            let seq = u32::from_le_bytes(self.number()?);
            self.seq.get_or_insert(seq);
        }
        self.deserialize_tuple(fields.len(), visitor)
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

struct Elements<'a, 'de> {
    decoder: &'a mut Decoder<'de>,
    left: usize,
}

impl<'de> SeqAccess<'de> for Elements<'_, 'de> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Fault> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        seed.deserialize(&mut *self.decoder).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.left)
    }
}
