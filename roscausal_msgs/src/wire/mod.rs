//! The serde format behind both wire formats; [`crate::ros1`] and [`crate::cdr`] choose the layout.

mod decode;
mod encode;

pub(crate) use decode::Decoder;
pub(crate) use encode::Encoder;

/// The differences between the two wire formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Layout {
    /// CDR: numbers are aligned to their size, strings end in NUL. ROS 1: neither, and headers carry `seq`.
    pub(crate) cdr: bool,
    /// Byte order of numbers (CDR has both).
    pub(crate) big_endian: bool,
}

impl Layout {
    pub(crate) const ROS1: Self = Self { cdr: false, big_endian: false };
    pub(crate) const CDR: Self = Self { cdr: true, big_endian: false };

    /// Padding before a number of `size` bytes at `offset`.
    fn padding(self, offset: usize, size: usize) -> usize {
        if self.cdr { offset.wrapping_neg() % size } else { 0 }
    }

    /// Whether this struct starts with a `seq` that the Rust type lacks.
    fn has_seq(self, struct_name: &str) -> bool {
        !self.cdr && struct_name == "Header"
    }
}

/// Bytes that do not decode as their message type, or a message that cannot be encoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{type_name}: {fault}")]
pub struct WireError {
    /// `package/Name` of the message.
    pub type_name: String,
    /// What is wrong.
    pub fault: Fault,
}

/// What is wrong with the bytes of a message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The bytes end too early.
    #[error("the message is cut short: {needed} bytes needed at byte {offset}, {left} left")]
    Truncated {
        /// The position, from the first byte of the message.
        offset: usize,
        /// Bytes needed there.
        needed: usize,
        /// Bytes that remain.
        left: usize,
    },
    /// A length that is impossible.
    #[error("a length of {length} at byte {offset}, where only {left} bytes are left; is it another type?")]
    Length {
        /// The position, from the first byte of the message.
        offset: usize,
        /// Elements or bytes claimed.
        length: u32,
        /// Bytes that remain.
        left: usize,
    },
    /// Bytes after the last field of the message.
    #[error("{left} bytes too many after the last field; is it another type or version?")]
    Trailing {
        /// Their number.
        left: usize,
    },
    /// CDR's first four bytes are unknown.
    #[error("the representation {0:#06x}{name} is not read (CDR, PLAIN_CDR2 and DELIMITED_CDR2 are)", name = representation(*.0))]
    Representation(u16),
    /// A sequence or string that is too long for the wire format.
    #[error("{0} elements are more than the wire allows")]
    TooLong(usize),
    /// A Rust type that ROS messages do not have.
    #[error("{0} has no place in a ROS message")]
    Unsupported(&'static str),
    /// An error from the type itself.
    #[error("{0}")]
    Custom(String),
}

/// The name of a representation that is not read, in brackets.
fn representation(number: u16) -> &'static str {
    match number {
        2 | 3 => " (PL_CDR)",
        4 => " (XML)",
        0xa | 0xb => " (PL_CDR2)",
        _ => "",
    }
}

impl Fault {
    pub(crate) fn of<M: crate::Message>(self) -> WireError {
        WireError { type_name: M::type_name(), fault: self }
    }
}

impl serde::ser::Error for Fault {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self::Custom(message.to_string())
    }
}

impl serde::de::Error for Fault {
    fn custom<T: std::fmt::Display>(message: T) -> Self {
        Self::Custom(message.to_string())
    }
}
