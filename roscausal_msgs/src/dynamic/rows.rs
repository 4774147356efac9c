//! The elements of an array in a message, each with the values that belong to it: a table with a row for each person of a
//! list of people.
//!
//! A [`Query`] with `[*]` gives all numbers of all elements in one list, which does not tell whose they are where an element
//! lacks one. Here each element is read by itself.

use super::{
    Found, Path, Query, QueryError, Wire,
    cursor::Cursor,
    query::Hop,
    schema::{Array, Kind, Schema},
};
use crate::wire::Fault;

/// Most rows that are read of one message.
const MOST_ROWS: usize = 10_000;

/// An array, and what is read of each of its elements. It is read from messages of its schema only.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rows {
    /// The way to the array: fields only.
    way: Vec<usize>,
    element: Kind,
    columns: Vec<Query>,
}

impl Schema {
    /// The rows of the array at a path, with these columns: paths within an element, an empty one for the element itself.
    /// Without an array, the message is the only row.
    ///
    /// # Errors
    /// A path that the schema does not have, or an array that is none.
    pub fn rows(&self, array: Option<&Path>, columns: &[Path]) -> Result<Rows, QueryError> {
        let (mut way, mut element) = (Vec::new(), Kind::Struct(0));
        if let Some(path) = array {
            let end = self.follow(path)?;
            let field = |hop: &Hop| match hop {
                Hop::Field(index) => Some(*index),
                Hop::Index(_) | Hop::All => None,
            };
            let fields: Option<Vec<usize>> = end.hops.iter().map(field).collect();
            let no_array = || QueryError::NoArray(path.to_string());
            (way, element) = (fields.filter(|_| end.array != Array::One).ok_or_else(no_array)?, end.kind);
        }
        let columns = columns.iter().map(|path| self.query_in(element, path)).collect::<Result<_, _>>()?;
        Ok(Rows { way, element, columns })
    }
}

impl Rows {
    /// The rows of a message, at most 10,000. A cell without a number (an array that is too short) is an empty list.
    ///
    /// # Errors
    /// Bytes that are no message of this schema, as far as they were read.
    pub fn read(&self, schema: &Schema, wire: Wire, bytes: &[u8]) -> Result<Vec<Vec<Found>>, Fault> {
        let mut cursor = Cursor::new(schema, wire, bytes)?;
        let (mut kind, mut array) = (Kind::Struct(0), Array::One);
        for index in &self.way {
            let Kind::Struct(place) = kind else { return Err(Fault::Unsupported("a field of a number")) };
            let fields = &schema.types[place].fields;
            cursor.enter(kind)?;
            cursor.pass_all(&fields[..*index])?;
            (kind, array) = (fields[*index].kind, fields[*index].array);
        }
        let count = cursor.count(kind, array)? as usize;
        // Elements without bytes have no values, however many there are.
        if cursor.least(kind) == 0 {
            return Ok(Vec::new());
        }
        let mut rows = Vec::new();
        for _ in 0..count.min(MOST_ROWS) {
            let cell = |query: &Query| query.read_at(schema, self.element, cursor.clone());
            rows.push(self.columns.iter().map(cell).collect::<Result<_, _>>()?);
            cursor.pass(self.element, Array::One)?;
        }
        Ok(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Message, cdr,
        people_msgs::{People, Person},
        ros1,
    };

    fn path(text: &str) -> Path {
        if text.is_empty() { Path::default() } else { text.parse().expect("a path") }
    }

    #[test]
    fn each_element_of_an_array_has_its_own_values_also_where_one_lacks_something() {
        let person = |name: &str, x: f64, tags: &[&str]| {
            let mut person = Person { name: name.into(), reliability: x / 10.0, ..Person::default() };
            person.position.x = x;
            person.tags = tags.iter().map(|tag| (*tag).to_owned()).collect();
            person
        };
        let people = People {
            people: vec![person("anna", 1.0, &[]), person("b", 2.0, &["seen", "far"]), person("", 3.0, &[])],
            ..People::default()
        };
        let schema =
            Schema::parse("people_msgs/People", People::definition().ros1_definition()).expect("parses");
        let columns = ["name", "position.x", "reliability", "tags[0]"].map(path);
        let rows = schema.rows(Some(&path("people")), &columns).expect("is there");
        let (number, text) = (|x| Found::Numbers(vec![x]), |t: &str| Found::Text(t.to_owned()));
        let expected = vec![
            vec![text("anna"), number(1.0), number(0.1), Found::Numbers(Vec::new())],
            vec![text("b"), number(2.0), number(0.2), text("seen")],
            vec![text(""), number(3.0), number(0.3), Found::Numbers(Vec::new())],
        ];
        let ros1 = ros1::to_bytes(&people, 0).expect("encodes");
        assert_eq!(rows.read(&schema, Wire::Ros1, &ros1), Ok(expected.clone()));
        let cdr = cdr::to_bytes(&people).expect("encodes");
        let schema =
            Schema::parse("people_msgs/People", People::definition().ros2_definition()).expect("parses");
        let rows = schema.rows(Some(&path("people")), &columns).expect("is there");
        assert_eq!(rows.read(&schema, Wire::Cdr, &cdr), Ok(expected));
        for cut in 0..cdr.len() - 4 {
            let _ = rows.read(&schema, Wire::Cdr, &cdr[..cut]);
        }
    }

    #[test]
    fn a_list_of_texts_has_a_row_for_each_and_a_message_without_a_list_is_one_row() {
        let schema = Schema::parse("hri_msgs/IdsList", "string[] ids").expect("parses");
        let rows = schema.rows(Some(&path("ids")), &[path("")]).expect("is there");
        let bytes = [2, 0, 0, 0, 1, 0, 0, 0, b'a', 2, 0, 0, 0, b'b', b'c'];
        let read = rows.read(&schema, Wire::Ros1, &bytes).expect("reads");
        assert_eq!(read, [[Found::Text("a".into())], [Found::Text("bc".into())]]);
        let schema = Schema::parse("demo/One", "float32 x").expect("parses");
        let rows = schema.rows(None, &[path("x")]).expect("is there");
        assert_eq!(
            rows.read(&schema, Wire::Ros1, &[0, 0, 128, 63]),
            Ok(vec![vec![Found::Numbers(vec![1.0])]])
        );
        assert!(schema.rows(Some(&path("x")), &[]).is_err(), "it is not an array");
    }

    #[test]
    fn two_billion_elements_in_ten_bytes_are_refused_or_nothing() {
        let schema = Schema::parse("demo/Bomb", "Nothing[] all\n===\nMSG: demo/Nothing\n").expect("parses");
        let rows = schema.rows(Some(&path("all")), &[]).expect("is there");
        assert_eq!(rows.read(&schema, Wire::Ros1, &[255, 255, 255, 255]), Ok(Vec::new()));
        let schema = Schema::parse("demo/Long", "float64[] all").expect("parses");
        let rows = schema.rows(Some(&path("all")), &[path("")]).expect("is there");
        assert!(rows.read(&schema, Wire::Ros1, &[255, 255, 255, 255, 0, 0]).is_err());
    }
}
