//! What a path means in a schema, and reading it from messages.

use super::{
    Path, Step, Wire,
    cursor::Cursor,
    schema::{Array, Field, Kind, Schema},
};
use crate::{Time, wire::Fault};

/// Most leaves that [`Schema::leaves`] lists.
const MOST_LEAVES: usize = 2000;
/// Most fields that it looks at: a small text can stand for billions.
const MOST_LOOKED_AT: usize = 20_000;

/// What a message has at a path.
#[derive(Clone, Debug, PartialEq)]
pub enum Found {
    /// Its numbers: one, those of an array, or none where an array is too short. Truth values are 0 and 1, times are
    /// seconds.
    Numbers(Vec<f64>),
    /// A text.
    Text(String),
}

/// Why a schema has nothing to read at a path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum QueryError {
    /// A name that no field has.
    #[error("{type_name} has no field '{name}'")]
    NoField {
        /// The type that was reached.
        type_name: String,
        /// The name that it lacks.
        name: String,
    },
    /// An index where there is no array.
    #[error("'{0}' is not an array")]
    NoArray(String),
    /// A field of an array, without saying of which element.
    #[error("'{0}' is an array; write {0}[0] for one element, or {0}[*] for all")]
    WhichElement(String),
    /// An index beyond an array of fixed length.
    #[error("'{path}' has {length} elements, counted from 0")]
    Beyond {
        /// The array.
        path: String,
        /// How many it has.
        length: u32,
    },
    /// A path that ends at a whole message.
    #[error("'{path}' is a whole {type_name}, not a number")]
    Whole {
        /// The path.
        path: String,
        /// What is there.
        type_name: String,
    },
    /// A path that ends at several texts, or at a text that is not read.
    #[error("'{0}' is not a single text that can be read")]
    Texts(String),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hop {
    Field(usize),
    Index(u32),
    All,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Numbers,
    Text,
    Count,
}

/// A path in a schema, checked. It is read from messages of that schema only.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Query {
    hops: Vec<Hop>,
    what: What,
}

/// Where a path ends.
pub(super) struct End {
    pub(super) hops: Vec<Hop>,
    pub(super) kind: Kind,
    pub(super) array: Array,
    several: bool,
}

impl Schema {
    /// The numbers or the text at a path. A path to an array of numbers means all of them.
    ///
    /// # Errors
    /// A path that the schema does not have, or that ends at a whole message.
    pub fn query(&self, path: &Path) -> Result<Query, QueryError> {
        self.query_in(Kind::Struct(0), path)
    }

    /// The same within a value of this kind. An empty path means the value.
    pub(super) fn query_in(&self, from: Kind, path: &Path) -> Result<Query, QueryError> {
        let mut end = self.follow_in(from, path)?;
        match end.kind {
            Kind::Struct(place) => {
                Err(QueryError::Whole { path: path.to_string(), type_name: self.types[place].name.clone() })
            }
            Kind::Text if !end.several && end.array == Array::One => {
                Ok(Query { hops: end.hops, what: What::Text })
            }
            Kind::Text | Kind::WideText => Err(QueryError::Texts(path.to_string())),
            _ => {
                if end.array != Array::One {
                    end.hops.push(Hop::All);
                }
                Ok(Query { hops: end.hops, what: What::Numbers })
            }
        }
    }

    /// The number of elements of the array at a path.
    ///
    /// # Errors
    /// A path that the schema does not have, or that is not an array.
    pub fn count(&self, path: &Path) -> Result<Query, QueryError> {
        let end = self.follow(path)?;
        match end.array {
            Array::One => Err(QueryError::NoArray(path.to_string())),
            _ => Ok(Query { hops: end.hops, what: What::Count }),
        }
    }

    /// The type at a path and its array.
    ///
    /// # Errors
    /// A path that the schema does not have.
    pub fn at(&self, path: &Path) -> Result<(Kind, Array), QueryError> {
        self.follow(path).map(|end| (end.kind, end.array))
    }

    /// The paths to all numbers, in the order of the fields; those in arrays with `[*]`. At most 2000.
    pub fn leaves(&self) -> Vec<Path> {
        let mut leaves = Vec::new();
        self.append_leaves(0, &Path::default(), &mut leaves, &mut { MOST_LOOKED_AT });
        leaves
    }

    fn append_leaves(&self, place: usize, from: &Path, leaves: &mut Vec<Path>, budget: &mut usize) {
        for Field { name, kind, array } in &self.types[place].fields {
            if leaves.len() >= MOST_LEAVES || *budget == 0 {
                return;
            }
            *budget -= 1;
            let path = if *array == Array::One { from.field(name) } else { from.field(name).all() };
            match kind {
                Kind::Struct(nested) => self.append_leaves(*nested, &path, leaves, budget),
                kind if kind.is_number() => leaves.push(path),
                _ => {}
            }
        }
    }

    pub(super) fn follow(&self, path: &Path) -> Result<End, QueryError> {
        self.follow_in(Kind::Struct(0), path)
    }

    fn follow_in(&self, from: Kind, path: &Path) -> Result<End, QueryError> {
        let mut end = End { hops: Vec::new(), kind: from, array: Array::One, several: false };
        for (place, step) in path.0.iter().enumerate() {
            let so_far = || Path(path.0[..place].to_vec()).to_string();
            match step {
                Step::Field(name) => {
                    if end.array != Array::One {
                        return Err(QueryError::WhichElement(so_far()));
                    }
                    let owner = self.nested(end.kind);
                    let type_name = owner.map_or_else(so_far, |owner| owner.name.clone());
                    let found = owner.and_then(|owner| {
                        owner.fields.iter().enumerate().find(|(_, field)| field.name == *name)
                    });
                    let (index, field) =
                        found.ok_or_else(|| QueryError::NoField { type_name, name: name.clone() })?;
                    end.hops.push(Hop::Field(index));
                    (end.kind, end.array) = (field.kind, field.array);
                }
                Step::Index(index) => {
                    match end.array {
                        Array::One => return Err(QueryError::NoArray(so_far())),
                        Array::Fixed(length) if *index >= length => {
                            return Err(QueryError::Beyond { path: so_far(), length });
                        }
                        _ => {}
                    }
                    end.hops.push(Hop::Index(*index));
                    end.array = Array::One;
                }
                Step::All => {
                    if end.array == Array::One {
                        return Err(QueryError::NoArray(so_far()));
                    }
                    end.hops.push(Hop::All);
                    (end.array, end.several) = (Array::One, true);
                }
            }
        }
        Ok(end)
    }
}

impl Query {
    /// What a message has there.
    ///
    /// # Errors
    /// Bytes that are no message of this schema, as far as they were read.
    pub fn read(&self, schema: &Schema, wire: Wire, bytes: &[u8]) -> Result<Found, Fault> {
        self.read_at(schema, Kind::Struct(0), Cursor::new(schema, wire, bytes)?)
    }

    /// The same from a value of this kind that begins at the cursor.
    pub(super) fn read_at(&self, schema: &Schema, from: Kind, cursor: Cursor<'_>) -> Result<Found, Fault> {
        let mut reading = Reading { cursor, schema, query: self, numbers: Vec::new(), text: None };
        reading.field(from, Array::One, &self.hops, false)?;
        Ok(match (self.what, reading.text) {
            (What::Text, Some(text)) => Found::Text(text),
            _ => Found::Numbers(reading.numbers),
        })
    }

    /// Whether it is a text.
    pub fn is_text(&self) -> bool {
        self.what == What::Text
    }

    /// Whether it may find several numbers.
    pub fn is_list(&self) -> bool {
        self.hops.contains(&Hop::All)
    }
}

impl Schema {
    /// When a message was stamped: the stamp of its header; `None` if the type has no header.
    ///
    /// # Errors
    /// Bytes that end within the header.
    pub fn stamp(&self, wire: Wire, bytes: &[u8]) -> Result<Option<Time>, Fault> {
        let Some(Field { kind: Kind::Struct(place), array: Array::One, .. }) =
            self.types[0].fields.first().filter(|field| field.name == "header")
        else {
            return Ok(None);
        };
        let mut cursor = Cursor::new(self, wire, bytes)?;
        for kind in [Kind::Struct(0), Kind::Struct(*place)] {
            cursor.enter(kind)?;
        }
        for field in &self.types[*place].fields {
            if field.kind == Kind::Time && field.array == Array::One && field.name == "stamp" {
                return cursor.time().map(Some);
            }
            cursor.pass(field.kind, field.array)?;
        }
        Ok(None)
    }

    /// The stamps of all headers in a message, each with its place in the bytes.
    ///
    /// # Errors
    /// Bytes that are no message of this schema.
    pub fn header_stamps(&self, wire: Wire, bytes: &[u8]) -> Result<Vec<(usize, Time)>, Fault> {
        let mut stamps = Vec::new();
        Cursor::new(self, wire, bytes)?.stamps(Kind::Struct(0), Array::One, &mut stamps)?;
        Ok(stamps)
    }

    /// Gives the headers of a message another stamp.
    ///
    /// # Errors
    /// As [`header_stamps`](Self::header_stamps); then nothing changes.
    pub fn restamp(&self, wire: Wire, bytes: &mut [u8], stamp: Time) -> Result<(), Fault> {
        let places = self.header_stamps(wire, bytes)?;
        // The second byte of CDR names the byte order.
        let is_big_endian = wire == Wire::Cdr && bytes.get(1).is_some_and(|byte| byte.is_multiple_of(2));
        let in_order =
            |bytes: [u8; 4]| if is_big_endian { [bytes[3], bytes[2], bytes[1], bytes[0]] } else { bytes };
        let halves = [in_order(stamp.sec.to_le_bytes()), in_order(stamp.nanosec.to_le_bytes())].concat();
        for (place, _) in places {
            if let Some(old) = bytes.get_mut(place..place + halves.len()) {
                old.copy_from_slice(&halves);
            }
        }
        Ok(())
    }
}

struct Reading<'a> {
    cursor: Cursor<'a>,
    schema: &'a Schema,
    query: &'a Query,
    numbers: Vec<f64>,
    text: Option<String>,
}

impl Reading<'_> {
    /// Reads a field at which `hops` begin. `whole`: ends behind it, since more of the message is needed.
    fn field(&mut self, kind: Kind, array: Array, hops: &[Hop], whole: bool) -> Result<(), Fault> {
        match (hops.split_first(), kind) {
            (None, _) => self.end(kind, array, whole),
            (Some((Hop::Field(index), rest)), Kind::Struct(place)) => {
                let end = self.cursor.enter(kind)?;
                let fields = &self.schema.types[place].fields;
                self.cursor.pass_all(&fields[..*index])?;
                self.field(fields[*index].kind, fields[*index].array, rest, whole)?;
                if whole {
                    self.cursor.pass_all(&fields[index + 1..])?;
                    self.cursor.leave(end)?;
                }
                Ok(())
            }
            (Some((Hop::Index(index), rest)), _) => {
                let count = self.cursor.count(kind, array)?;
                if *index >= count {
                    return if whole { self.cursor.pass_elements(kind, count) } else { Ok(()) };
                }
                self.cursor.pass_elements(kind, *index)?;
                self.field(kind, Array::One, rest, whole)?;
                if whole { self.cursor.pass_elements(kind, count - index - 1) } else { Ok(()) }
            }
            (Some((Hop::All, rest)), _) => {
                let count = self.cursor.count(kind, array)?;
                // Elements without bytes have no numbers, however many there are.
                if self.cursor.least(kind) == 0 {
                    return Ok(());
                }
                (0..count).try_for_each(|_| self.field(kind, Array::One, rest, true))
            }
            // `follow` lets no field hop begin at a number.
            (Some((Hop::Field(_), _)), _) => Err(Fault::Unsupported("a field of a number")),
        }
    }

    fn end(&mut self, kind: Kind, array: Array, whole: bool) -> Result<(), Fault> {
        match self.query.what {
            What::Numbers => {
                let number = self.cursor.number(kind)?;
                self.numbers.push(number);
                Ok(())
            }
            What::Text => {
                let text = self.cursor.text()?;
                self.text = Some(String::from_utf8_lossy(text).into_owned());
                Ok(())
            }
            What::Count => {
                let count = self.cursor.count(kind, array)?;
                self.numbers.push(f64::from(count));
                if whole { self.cursor.pass_elements(kind, count) } else { Ok(()) }
            }
        }
    }
}
