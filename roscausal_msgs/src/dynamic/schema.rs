//! A message type that is known only by its text.

use std::collections::HashMap;

use super::{
    SchemaError,
    text::{self, Written},
};

/// Longest definition that is read, bytes. Those of ROS are below 100 kB.
const LONGEST: usize = 1 << 20;
/// Most types in a definition.
const MOST_TYPES: usize = 1000;
/// Most fields in a definition.
const MOST_FIELDS: usize = 20_000;
/// Deepest nesting of types.
const DEEPEST: usize = 32;

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A truth value; as a number 0 or 1.
    Bool,
    /// An integer without sign, of this many bytes.
    Unsigned(u8),
    /// An integer with sign, of this many bytes.
    Signed(u8),
    /// A floating-point number, of 4 or 8 bytes.
    Float(u8),
    /// A moment; as a number its seconds.
    Time,
    /// A span of time; as a number its seconds.
    Duration,
    /// A text.
    Text,
    /// A text of wide characters, whose size on the wire differs between vendors. It is passed over.
    WideText,
    /// Another type, by its place in the schema.
    Struct(usize),
}

/// How many values a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Array {
    /// One.
    One,
    /// Always this many.
    Fixed(u32),
    /// As many as the message says.
    Any,
}

/// A field of a type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// How many of them.
    pub array: Array,
}

/// A type: its fields in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Struct {
    /// `package/Name`.
    pub name: String,
    /// Its fields.
    pub fields: Vec<Field>,
    /// The least bytes that it takes, without padding: in ROS 1, and in CDR.
    pub(super) least: [u64; 2],
}

/// A message type and all types that it uses. None contains itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    pub(super) types: Vec<Struct>,
    /// Whether it has wide texts.
    pub(super) has_wide: bool,
}

impl Kind {
    /// A built-in type. ROS 1's `char` and ROS 2's `byte` and `char` are numbers without sign, ROS 1's `byte` has one.
    fn built_in(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "uint8" | "char" => Self::Unsigned(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "int8" | "byte" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "float32" => Self::Float(4),
            "float64" => Self::Float(8),
            "string" => Self::Text,
            "wstring" => Self::WideText,
            "time" | "builtin_interfaces/Time" | "builtin_interfaces/msg/Time" => Self::Time,
            "duration" | "builtin_interfaces/Duration" | "builtin_interfaces/msg/Duration" => Self::Duration,
            _ => return None,
        })
    }

    /// Whether arrays of it are numbers side by side.
    pub(super) fn is_plain(self) -> bool {
        matches!(self, Self::Bool | Self::Unsigned(_) | Self::Signed(_) | Self::Float(_))
    }

    /// Whether a path to it gives a number.
    pub fn is_number(self) -> bool {
        !matches!(self, Self::Text | Self::WideText | Self::Struct(_))
    }
}

impl Schema {
    /// The type `name` (`package/Name`) from its full definition: its own text, then those of the types that it uses,
    /// each after a line of `=` and `MSG: package/Name`, as bags, connections and MCAP files carry it.
    ///
    /// # Errors
    /// A text that is not a definition, or one that is larger, deeper or more circular than that of any message.
    pub fn parse(name: &str, definition: &str) -> Result<Self, SchemaError> {
        if definition.len() > LONGEST {
            return Err(SchemaError::Size("more than 1 MB"));
        }
        if definition.lines().any(|line| line.trim_start().starts_with("IDL: ")) {
            return Err(SchemaError::Idl);
        }
        let mut sections = text::sections(definition);
        if sections.len() > MOST_TYPES {
            return Err(SchemaError::Size("more than 1000 types"));
        }
        sections[0].0 = name;
        let names: Vec<String> = sections.iter().map(|(name, _)| name.replace("/msg/", "/")).collect();
        // The first text of a name counts.
        let mut places = HashMap::new();
        names.iter().enumerate().for_each(|(place, name)| {
            places.entry(name.as_str()).or_insert(place);
        });
        let mut types = Vec::with_capacity(sections.len());
        let mut n_fields = 0;
        for (name, (_, lines)) in names.iter().zip(&sections) {
            let fields = fields(name, lines, &places)?;
            n_fields += fields.len();
            if n_fields > MOST_FIELDS {
                return Err(SchemaError::Size("more than 20,000 fields"));
            }
            types.push(Struct { name: name.clone(), fields, least: [0; 2] });
        }
        let has_wide = types.iter().flat_map(|one| &one.fields).any(|field| field.kind == Kind::WideText);
        let mut schema = Self { types, has_wide };
        let mut seen = vec![Seen::Not; schema.types.len()];
        schema.measure(0, 0, &mut seen)?;
        Ok(schema)
    }

    /// The type itself.
    pub fn root(&self) -> &Struct {
        &self.types[0]
    }

    /// Whether two types have equal fields, by name, kind and order, whatever their texts and their own names.
    pub fn has_fields_of(&self, other: &Self) -> bool {
        let (mut waiting, mut seen) = (vec![(0, 0)], std::collections::HashSet::from([(0, 0)]));
        while let Some((ours, theirs)) = waiting.pop() {
            let (a, b) = (&self.types[ours].fields, &other.types[theirs].fields);
            let same = |(a, b): (&Field, &Field)| {
                if a.name != b.name || a.array != b.array {
                    return false;
                }
                let (Kind::Struct(x), Kind::Struct(y)) = (a.kind, b.kind) else { return a.kind == b.kind };
                if seen.insert((x, y)) {
                    waiting.push((x, y));
                }
                true
            };
            if a.len() != b.len() || !a.iter().zip(b).all(same) {
                return false;
            }
        }
        true
    }

    /// The type of a field, if it is not a built-in one.
    pub fn nested(&self, kind: Kind) -> Option<&Struct> {
        if let Kind::Struct(place) = kind { self.types.get(place) } else { None }
    }

    /// Fills in the least sizes of a type and of those that it uses. Depth and cycles end it.
    fn measure(&mut self, place: usize, depth: usize, seen: &mut [Seen]) -> Result<[u64; 2], SchemaError> {
        match seen[place] {
            Seen::Whole => return Ok(self.types[place].least),
            Seen::Begun => return Err(SchemaError::Cycle(self.types[place].name.clone())),
            Seen::Not if depth > DEEPEST => return Err(SchemaError::Size("more than 32 levels")),
            Seen::Not => seen[place] = Seen::Begun,
        }
        // CDR gives a type without fields one byte.
        let mut least = [0, u64::from(self.types[place].fields.is_empty())];
        for at in 0..self.types[place].fields.len() {
            let Field { kind, array, .. } = self.types[place].fields[at];
            // A sequence may be empty, but what is in it must be sound all the same.
            let one = match kind {
                Kind::Struct(nested) => self.measure(nested, depth + 1, seen)?,
                kind => [u64::from(width(kind)); 2],
            };
            for (least, one) in least.iter_mut().zip(one) {
                *least = least.saturating_add(match array {
                    Array::One => one,
                    Array::Fixed(count) => one.saturating_mul(u64::from(count)),
                    Array::Any => 4,
                });
            }
        }
        seen[place] = Seen::Whole;
        self.types[place].least = least;
        Ok(least)
    }
}

#[derive(Clone, Copy)]
enum Seen {
    Not,
    Begun,
    Whole,
}

/// Bytes of a built-in type on the wire of ROS 1, at least.
pub(super) fn width(kind: Kind) -> u8 {
    match kind {
        Kind::Bool => 1,
        Kind::Unsigned(bytes) | Kind::Signed(bytes) | Kind::Float(bytes) => bytes,
        Kind::Time | Kind::Duration => 8,
        Kind::Text | Kind::WideText => 4,
        Kind::Struct(_) => 0,
    }
}

fn fields(name: &str, lines: &[&str], places: &HashMap<&str, usize>) -> Result<Vec<Field>, SchemaError> {
    let mut fields: Vec<Field> = Vec::new();
    let mut taken = std::collections::HashSet::new();
    for line in lines {
        let Some(Written { base, array, name: field }) = text::field(line)? else { continue };
        let kind = match Kind::built_in(base) {
            Some(kind) => kind,
            None => Kind::Struct(
                place(base, name, places)
                    .ok_or_else(|| SchemaError::Missing(base.to_owned(), name.to_owned()))?,
            ),
        };
        let array = match array {
            None => Array::One,
            Some(bound) if bound.is_empty() || bound.starts_with("<=") => Array::Any,
            Some(count) => {
                Array::Fixed(count.trim().parse().map_err(|_| SchemaError::Line((*line).trim().to_owned()))?)
            }
        };
        if !taken.insert(field) {
            return Err(SchemaError::Twice(name.to_owned(), field.to_owned()));
        }
        fields.push(Field { name: field.to_owned(), kind, array });
    }
    Ok(fields)
}

/// The place of a type that `user` names: in full, of its own package, or ROS 1's bare `Header`.
fn place(named: &str, user: &str, places: &HashMap<&str, usize>) -> Option<usize> {
    let full = named.replace("/msg/", "/");
    if full.contains('/') {
        return places.get(full.as_str()).copied();
    }
    let package = user.split('/').next().unwrap_or_default();
    let own = places.get(format!("{package}/{full}").as_str()).copied();
    own.or_else(|| (full == "Header").then(|| places.get("std_msgs/Header").copied()).flatten())
}
