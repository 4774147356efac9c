//! Messages of types that this crate does not know: read by the definition that travels with them.
//!
//! [`Schema`] is the parsed text of a type. [`Query`] is a path into it, such as `pose.pose.position.x` or `ranges[3]`, and
//! reads its numbers straight from the bytes of a message, of either wire format. [`Rows`] reads the elements of an array, each
//! with what belongs to it. Texts and bytes may be hostile: no
//! input causes a panic, endless work, or an allocation that the bytes do not pay for.
//!
//! Why not a library: `roslibrust_codegen` and `rosrust_codegen` read one wire format each and make whole values of
//! messages; a point cloud would be copied to read its width.
//!
//! ```
//! use roscausal_msgs::dynamic::{Found, Path, Schema};
//!
//! let schema = Schema::parse("demo/Scan", "float32[] ranges\nbool ok\n").unwrap();
//! let query = schema.query(&"ok".parse::<Path>().unwrap()).unwrap();
//! // Two ranges, then true, as ROS 1 writes it.
//! let bytes = [2, 0, 0, 0, 0, 0, 128, 63, 0, 0, 0, 64, 1];
//! let found = query.read(&schema, roscausal_msgs::dynamic::Wire::Ros1, &bytes).unwrap();
//! assert_eq!(found, Found::Numbers(vec![1.0]));
//! ```

mod cursor;
mod path;
mod query;
mod rows;
mod schema;
mod text;

pub(crate) use cursor::as_first_version;
pub use path::{Path, Step};
pub use query::{Found, Query, QueryError};
pub use rows::Rows;
pub use schema::{Array, Field, Kind, Schema, Struct};

/// The wire format of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    /// As ROS 1 sends and records.
    Ros1,
    /// As ROS 2 sends and records: CDR after four bytes that name the representation.
    Cdr,
}

/// Why a definition cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SchemaError {
    /// There is no text.
    #[error("the definition is empty")]
    Empty,
    /// The text of another language.
    #[error("the definition is written in IDL; only .msg texts are read")]
    Idl,
    /// A line that is not a field, constant or comment.
    #[error("'{0}' is not a field of a message")]
    Line(String),
    /// Two fields of one name.
    #[error("{0} has two fields '{1}'")]
    Twice(String, String),
    /// A type without definition.
    #[error("the definition of {0}, which {1} uses, is missing")]
    Missing(String, String),
    /// A type within itself.
    #[error("{0} contains itself")]
    Cycle(String),
    /// More than any message has.
    #[error("the definition is larger or deeper than that of any message ({0})")]
    Size(&'static str),
}
