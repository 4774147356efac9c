//! The second version of CDR (OMG DDS-XTypes 1.3, 7.4.3), written here by hand.
#![allow(clippy::unwrap_used, reason = "a failed unwrap fails the test, in helpers too")]

use roscausal_msgs::{
    Message, Time, cdr,
    dynamic::{Found, Path, Schema, Wire},
    people_msgs::{People, Person},
    std_msgs::{Bool, Header},
};

/// Writes numbers aligned to at most four bytes.
struct Writer {
    bytes: Vec<u8>,
    big_endian: bool,
    /// Whether types, and arrays of other things than numbers, begin with their length.
    types: bool,
    arrays: bool,
}

impl Writer {
    fn new(representation: u8, types: bool, arrays: bool) -> Self {
        let bytes = vec![0, representation, 0, 0];
        Self { bytes, big_endian: representation.is_multiple_of(2), types, arrays }
    }

    fn number<const N: usize>(&mut self, mut little_endian: [u8; N]) {
        while !(self.bytes.len() - 4).is_multiple_of(N.min(4)) {
            self.bytes.push(0);
        }
        if self.big_endian {
            little_endian.reverse();
        }
        self.bytes.extend(little_endian);
    }

    fn length(&mut self, length: usize) {
        self.number(u32::try_from(length).unwrap().to_le_bytes());
    }

    /// Writes what `inner` writes, after its length if `has_length`.
    fn delimited(&mut self, has_length: bool, inner: impl FnOnce(&mut Self)) {
        if !has_length {
            return inner(self);
        }
        self.length(0);
        let start = self.bytes.len();
        inner(self);
        let length = u32::try_from(self.bytes.len() - start).unwrap();
        let bytes = if self.big_endian { length.to_be_bytes() } else { length.to_le_bytes() };
        self.bytes[start - 4..start].copy_from_slice(&bytes);
    }

    fn text(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
    }

    fn point(&mut self, xyz: [f64; 3]) {
        self.delimited(self.types, |this| xyz.iter().for_each(|v| this.number(v.to_le_bytes())));
    }

    fn person(&mut self, person: &Person) {
        let xyz = |p: &roscausal_msgs::geometry_msgs::Point| [p.x, p.y, p.z];
        self.delimited(self.types, |this| {
            this.text(&person.name);
            this.point(xyz(&person.position));
            this.point(xyz(&person.velocity));
            this.number(person.reliability.to_le_bytes());
            for list in [&person.tagnames, &person.tags] {
                this.delimited(this.arrays, |this| {
                    this.length(list.len());
                    list.iter().for_each(|text| this.text(text));
                });
            }
        });
    }

    fn people(mut self, people: &People) -> Vec<u8> {
        self.delimited(self.types, |this| {
            this.delimited(this.types, |this| {
                this.delimited(this.types, |this| {
                    this.number(people.header.stamp.sec.to_le_bytes());
                    this.number(people.header.stamp.nanosec.to_le_bytes());
                });
                this.text(&people.header.frame_id);
            });
            this.delimited(this.arrays, |this| {
                this.length(people.people.len());
                people.people.iter().for_each(|person| this.person(person));
            });
        });
        let padding = (self.bytes.len() - 4).wrapping_neg() % 4;
        self.bytes.resize(self.bytes.len() + padding, 0);
        self.bytes[3] = u8::try_from(padding).unwrap();
        self.bytes
    }
}

fn people(count: usize) -> People {
    let person = |number: usize| {
        let mut person = Person { name: "ä".repeat(number), reliability: 0.5, ..Person::default() };
        person.position.x = number as f64 + 0.25;
        person.velocity.z = -1.0;
        person.tags = vec!["seen".to_owned(); number % 3];
        person
    };
    let header = Header { stamp: Time::from_secs_f64(1.5), frame_id: "map".into() };
    People { header, people: (0..count).map(person).collect() }
}

/// Every form in which the message may come: as the standard says, and without the lengths before arrays.
fn forms(message: &People) -> Vec<Vec<u8>> {
    let mut forms = Vec::new();
    for (representation, types) in [(6, false), (7, false), (8, true), (9, true)] {
        for arrays in [true, false] {
            forms.push(Writer::new(representation, types, arrays).people(message));
        }
    }
    forms
}

#[test]
fn both_forms_of_the_second_version_are_read_in_either_byte_order() {
    for count in 0..5 {
        let message = people(count);
        for bytes in forms(&message) {
            assert_eq!(cdr::from_bytes::<People>(&bytes).unwrap(), message, "{bytes:?}");
            for cut in 0..bytes.len() - 4 {
                assert!(cdr::from_bytes::<People>(&bytes[..cut]).is_err(), "{bytes:?} cut at {cut}");
            }
        }
    }
}

#[test]
fn paths_and_stamps_are_read_of_the_second_version() {
    let text = People::definition().ros2_definition();
    let schema = Schema::parse("people_msgs/People", text).unwrap();
    let path = |text: &str| text.parse::<Path>().unwrap();
    let query = |text: &str| schema.query(&path(text)).unwrap();
    for bytes in forms(&people(4)) {
        let read = |text: &str| query(text).read(&schema, Wire::Cdr, &bytes).unwrap();
        assert_eq!(read("people[2].position.x"), Found::Numbers(vec![2.25]));
        assert_eq!(read("people[*].velocity.z"), Found::Numbers(vec![-1.0; 4]));
        assert_eq!(read("people[2].tags[1]"), Found::Text("seen".into()));
        assert_eq!(read("header.stamp"), Found::Numbers(vec![1.5]));
        assert_eq!(schema.stamp(Wire::Cdr, &bytes).unwrap(), Some(Time::from_secs_f64(1.5)));
        let rows = schema.rows(Some(&path("people")), &[path("position.x"), path("name")]).unwrap();
        let rows = rows.read(&schema, Wire::Cdr, &bytes).unwrap();
        let mut changed = bytes.clone();
        schema.restamp(Wire::Cdr, &mut changed, Time::from_secs_f64(-7.25)).unwrap();
        let (new, mut old) = (cdr::from_bytes::<People>(&changed).unwrap(), people(4));
        old.header.stamp = Time::from_secs_f64(-7.25);
        assert_eq!(new, old);
        assert_eq!(rows[3], [Found::Numbers(vec![3.25]), Found::Text("äää".into())]);
    }
}

#[test]
fn a_later_version_of_a_type_may_have_more_fields() {
    // A Bool with one number more, in its length.
    let bytes = [0, 9, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0];
    assert_eq!(cdr::from_bytes::<Bool>(&bytes).unwrap(), Bool { data: true });
}

#[test]
fn other_representations_are_refused_by_name() {
    for (representation, name) in [(2, "PL_CDR"), (3, "PL_CDR"), (10, "PL_CDR2"), (11, "PL_CDR2")] {
        let error = cdr::from_bytes::<Bool>(&[0, representation, 0, 0, 1]).unwrap_err().to_string();
        assert!(error.contains(&format!("({name})")), "{error}");
    }
}

#[test]
fn a_wide_text_is_passed_over_whoever_wrote_it() {
    let schema = Schema::parse("demo/Wide", "wstring name\nfloat64 x\nwstring[] more\nint32 y\n").unwrap();
    let units = |text: &str, length: usize, unit: usize, out: &mut Vec<u8>| {
        out.resize(out.len().next_multiple_of(4), 0);
        out.extend(u32::try_from(length).unwrap().to_le_bytes());
        for c in text.encode_utf16() {
            out.extend(&u32::from(c).to_le_bytes()[..unit]);
        }
    };
    // The length counts bytes in the second version, and two or four bytes each in the first.
    for (representation, unit, in_bytes, align) in [(1, 2, false, 8), (1, 4, false, 8), (7, 2, true, 4)] {
        let mut out = Vec::new();
        let length = |text: &str| text.len() * if in_bytes { unit } else { 1 };
        units("anna", length("anna"), unit, &mut out);
        out.resize(out.len().next_multiple_of(align), 0);
        out.extend(0.75_f64.to_le_bytes());
        let begin = out.len();
        if in_bytes {
            out.extend([0; 4]);
        }
        out.extend(2_u32.to_le_bytes());
        units("b", length("b"), unit, &mut out);
        units("", 0, unit, &mut out);
        if in_bytes {
            let length = u32::try_from(out.len() - begin - 4).unwrap();
            out[begin..begin + 4].copy_from_slice(&length.to_le_bytes());
        }
        out.resize(out.len().next_multiple_of(4), 0);
        out.extend((-3_i32).to_le_bytes());
        let bytes = [&[0, representation, 0, 0], &out[..]].concat();
        let read =
            |path: &str| schema.query(&path.parse().unwrap()).unwrap().read(&schema, Wire::Cdr, &bytes);
        assert_eq!(read("x"), Ok(Found::Numbers(vec![0.75])), "{unit}");
        assert_eq!(read("y"), Ok(Found::Numbers(vec![-3.0])), "{unit}");
    }
}
