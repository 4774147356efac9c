//! The encoder for both wire formats.

use serde::ser::{
    Impossible, Serialize, SerializeSeq, SerializeStruct, SerializeTuple, SerializeTupleStruct, Serializer,
};

use super::{Fault, Layout};

/// Writes the fields of a message one after the other.
pub(crate) struct Encoder {
    layout: Layout,
    pub(crate) bytes: Vec<u8>,
    /// The position from which alignment counts.
    origin: usize,
    /// The `seq` of the next header.
    seq: u32,
}

impl Encoder {
    /// Appends to `prefix`, which does not count for alignment. The first header gets `seq`, later ones 0.
    pub(crate) fn new(layout: Layout, prefix: &[u8], seq: u32) -> Self {
        Self { layout, bytes: prefix.to_vec(), origin: prefix.len(), seq }
    }

    fn number<const N: usize>(&mut self, little_endian: [u8; N]) {
        let padding = self.layout.padding(self.bytes.len() - self.origin, N);
        self.bytes.resize(self.bytes.len() + padding, 0);
        let start = self.bytes.len();
        self.bytes.extend_from_slice(&little_endian);
        if self.layout.big_endian {
            self.bytes[start..].reverse();
        }
    }

    fn length(&mut self, length: usize) -> Result<(), Fault> {
        self.number(u32::try_from(length).map_err(|_| Fault::TooLong(length))?.to_le_bytes());
        Ok(())
    }
}

macro_rules! numbers {
    ($($method:ident $type:ty),*) => {
        $(fn $method(self, value: $type) -> Result<(), Fault> {
            self.number(value.to_le_bytes());
            Ok(())
        })*
    };
}

macro_rules! unsupported {
    ($($method:ident$(<$value:ident>)?($($arg:ty),*) -> $ok:ty, $what:literal;)*) => {
        $(fn $method$(<$value: ?Sized + Serialize>)?(self, $(_: $arg),*) -> Result<$ok, Fault> {
            Err(Fault::Unsupported($what))
        })*
    };
}

impl Serializer for &mut Encoder {
    type Ok = ();
    type Error = Fault;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeTupleStruct = Self;
    type SerializeStruct = Self;
    type SerializeMap = Impossible<(), Fault>;
    type SerializeTupleVariant = Impossible<(), Fault>;
    type SerializeStructVariant = Impossible<(), Fault>;

    numbers!(
        serialize_i8 i8, serialize_i16 i16, serialize_i32 i32, serialize_i64 i64,
        serialize_u8 u8, serialize_u16 u16, serialize_u32 u32, serialize_u64 u64,
        serialize_f32 f32, serialize_f64 f64
    );

    fn serialize_bool(self, value: bool) -> Result<(), Fault> {
        self.serialize_u8(u8::from(value))
    }

    fn serialize_str(self, value: &str) -> Result<(), Fault> {
        self.length(value.len() + usize::from(self.layout.cdr))?;
        self.bytes.extend_from_slice(value.as_bytes());
        if self.layout.cdr {
            self.bytes.push(0);
        }
        Ok(())
    }

    fn serialize_bytes(self, value: &[u8]) -> Result<(), Fault> {
        self.length(value.len())?;
        self.bytes.extend_from_slice(value);
        Ok(())
    }

    fn serialize_seq(self, length: Option<usize>) -> Result<Self, Fault> {
        self.length(length.ok_or(Fault::Unsupported("a sequence of unknown length"))?)?;
        Ok(self)
    }

    fn serialize_tuple(self, _length: usize) -> Result<Self, Fault> {
        Ok(self)
    }

    fn serialize_tuple_struct(self, _name: &'static str, _length: usize) -> Result<Self, Fault> {
        Ok(self)
    }

    fn serialize_struct(self, name: &'static str, _length: usize) -> Result<Self, Fault> {
        if self.layout.has_seq(name) {
            let seq = std::mem::take(&mut self.seq);
            self.number(seq.to_le_bytes());
        }
        Ok(self)
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), Fault> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), Fault> {
        Ok(())
    }

    fn serialize_unit_struct(self, _name: &'static str) -> Result<(), Fault> {
        Ok(())
    }

    unsupported!(
        serialize_char(char) -> (), "a char";
        serialize_none() -> (), "an optional field";
        serialize_some<T>(&T) -> (), "an optional field";
        serialize_unit_variant(&'static str, u32, &'static str) -> (), "an enum";
        serialize_newtype_variant<T>(&'static str, u32, &'static str, &T) -> (), "an enum";
        serialize_tuple_variant(&'static str, u32, &'static str, usize) -> Self::SerializeTupleVariant, "an enum";
        serialize_struct_variant(&'static str, u32, &'static str, usize) -> Self::SerializeStructVariant, "an enum";
        serialize_map(Option<usize>) -> Self::SerializeMap, "a map";
    );

    fn is_human_readable(&self) -> bool {
        false
    }
}

/// Sequences of values: one follows the other, and what else is known of it, such as its name, is not written.
macro_rules! sequence {
    ($($kind:ident: $element:ident($($name:ty)?)),*) => {$(
        impl $kind for &mut Encoder {
            type Ok = ();
            type Error = Fault;

            fn $element<T: ?Sized + Serialize>(&mut self, $(_: $name,)? value: &T) -> Result<(), Fault> {
                value.serialize(&mut **self)
            }

            fn end(self) -> Result<(), Fault> {
                Ok(())
            }
        }
    )*};
}

sequence!(
    SerializeSeq: serialize_element(), SerializeTuple: serialize_element(),
    SerializeTupleStruct: serialize_field(), SerializeStruct: serialize_field(&'static str)
);
