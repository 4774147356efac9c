//! Messages read by definition: the same numbers as by type, in both wire formats, and no harm from hostile texts.

#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use roscausal_fuzz::{Allocator, Target};
use roscausal_msgs::{
    Definition, Message, Time, cdr,
    dynamic::{Found, Path, QueryError, Schema, SchemaError, Wire},
    geometry_msgs::{Quaternion, Vector3},
    nav_msgs::Odometry,
    people_msgs::{People, Person},
    ros1, types,
};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

fn path(text: &str) -> Path {
    text.parse().expect(text)
}

fn numbers(schema: &Schema, wire: Wire, bytes: &[u8], at: &str) -> Vec<f64> {
    let query = schema.query(&path(at)).expect(at);
    match query.read(schema, wire, bytes).expect(at) {
        Found::Numbers(numbers) => numbers,
        Found::Text(text) => panic!("{at} is the text '{text}'"),
    }
}

/// Schema and bytes of a message in both wire formats.
fn both<M: Message>(message: &M) -> [(Schema, Wire, Vec<u8>); 2] {
    let definition = M::definition();
    let schema = |text: &str| Schema::parse(&definition.type_name(), text).expect("a definition");
    [
        (schema(definition.ros1_definition()), Wire::Ros1, ros1::to_bytes(message, 7).expect("bytes")),
        (schema(definition.ros2_definition()), Wire::Cdr, cdr::to_bytes(message).expect("bytes")),
    ]
}

#[test]
fn every_known_type_has_a_schema_in_both_spellings() {
    for definition in types() {
        for text in [definition.ros1_definition(), definition.ros2_definition()] {
            let schema = Schema::parse(&definition.type_name(), text);
            assert!(schema.is_ok(), "{}: {schema:?}\n{text}", definition.type_name());
        }
    }
}

#[test]
fn numbers_read_by_definition_are_those_read_by_type() {
    let mut odometry = Odometry::default();
    odometry.header.stamp = Time::from_secs_f64(12.5);
    odometry.header.frame_id = "odom".into();
    odometry.child_frame_id = "base".into();
    odometry.pose.pose.orientation = Quaternion { x: 0.1, y: 0.2, z: 0.3, w: 0.4 };
    odometry.twist.twist.linear = Vector3 { x: -1.5, y: 0.25, z: 9.0 };
    odometry.pose.covariance[35] = 4.0;
    for (schema, wire, bytes) in both(&odometry) {
        let at = |path: &str| numbers(&schema, wire, &bytes, path);
        assert_eq!(at("header.stamp"), [12.5]);
        assert_eq!(at("pose.pose.orientation.w"), [0.4]);
        assert_eq!(at("twist.twist.linear.x"), [-1.5]);
        assert_eq!(at("pose.covariance[35]"), [4.0]);
        assert_eq!(at("pose.covariance").len(), 36);
        assert_eq!(at("twist.covariance[35]"), [0.0]);
        assert_eq!(schema.stamp(wire, &bytes), Ok(Some(odometry.header.stamp)));
        let child = schema.query(&path("child_frame_id")).expect("a text");
        assert_eq!(child.read(&schema, wire, &bytes), Ok(Found::Text("base".into())));
    }
}

#[test]
fn arrays_of_messages_are_counted_indexed_and_read_whole() {
    let person = |name: &str, x: f64| {
        let mut person = Person { name: name.into(), reliability: x, ..Person::default() };
        person.position.x = x;
        person.tags = vec!["uncommon".into(), "tag".into()];
        person
    };
    let people = People { people: vec![person("a", 1.0), person("bob", 2.0)], ..People::default() };
    for (schema, wire, bytes) in both(&people) {
        assert_eq!(numbers(&schema, wire, &bytes, "people[*].position.x"), [1.0, 2.0]);
        assert_eq!(numbers(&schema, wire, &bytes, "people[1].reliability"), [2.0]);
        assert_eq!(numbers(&schema, wire, &bytes, "people[2].reliability"), [0.0; 0], "there is no third");
        let count = |at: &str| schema.count(&path(at)).expect(at).read(&schema, wire, &bytes).expect(at);
        assert_eq!(count("people"), Found::Numbers(vec![2.0]));
        assert_eq!(count("people[*].tags"), Found::Numbers(vec![2.0, 2.0]));
        let name = schema.query(&path("people[1].name")).expect("a text");
        assert_eq!(name.read(&schema, wire, &bytes), Ok(Found::Text("bob".into())));
    }
}

#[test]
fn numbers_of_every_size_and_sign_are_read_in_either_byte_order() {
    let text = "bool b\nint8 i1\nuint8 u1\nint16 i2\nuint16 u2\nint32 i4\nuint32 u4\nint64 i8\nuint64 u8\nfloat32 f4\nfloat64 f8\nbyte[3] last";
    let schema = Schema::parse("p/T", text).expect("a definition");
    let mut little: Vec<u8> = vec![1, 0xFF, 0xFF];
    little.extend((-2i16).to_le_bytes());
    little.extend(65_535u16.to_le_bytes());
    little.extend((-3i32).to_le_bytes());
    little.extend(4_000_000_000u32.to_le_bytes());
    little.extend((-5i64).to_le_bytes());
    little.extend(6u64.to_le_bytes());
    little.extend(1.5f32.to_le_bytes());
    little.extend((-2.5f64).to_le_bytes());
    little.extend([1, 2, 254]);
    let mut big: Vec<u8> = vec![0, 0, 0, 0, 1, 0xFF, 0xFF, 0];
    big.extend((-2i16).to_be_bytes());
    big.extend(65_535u16.to_be_bytes());
    big.extend((-3i32).to_be_bytes());
    big.extend([0; 0]);
    big.extend(4_000_000_000u32.to_be_bytes());
    big.extend((-5i64).to_be_bytes());
    big.extend(6u64.to_be_bytes());
    big.extend(1.5f32.to_be_bytes());
    big.extend([0; 4]);
    big.extend((-2.5f64).to_be_bytes());
    big.extend([1, 2, 254]);
    for (wire, bytes) in [(Wire::Ros1, little), (Wire::Cdr, big)] {
        let all: Vec<f64> = schema
            .leaves()
            .iter()
            .flat_map(|leaf| numbers(&schema, wire, &bytes, &leaf.to_string()))
            .collect();
        assert_eq!(
            all,
            [1.0, -1.0, 255.0, -2.0, 65_535.0, -3.0, 4e9, -5.0, 6.0, 1.5, -2.5, 1.0, 2.0, -2.0],
            "{wire:?}"
        );
    }
}

#[test]
fn ros2s_bounds_defaults_and_empty_types_are_understood() {
    let text = "int32 A=1\nstring<=20 name \"no # comment\"\nint32[<=3] few\nEmpty[] none\nfloat64 x 1.5 # why\nuint8[] data\nfloat64 y\n\
                ====\nMSG: p/Empty\n# nothing\n";
    let schema = Schema::parse("p/T", text).expect("a definition");
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend([3, 0, 0, 0, b'h', b'i', 0, 0]); // name, with its NUL and padding
    bytes.extend([1, 0, 0, 0, 9, 0, 0, 0]); // few
    bytes.extend([2, 0, 0, 0, 7, 7, 0, 0]); // none: each a byte
    bytes.extend(2.5f64.to_le_bytes());
    bytes.extend([3, 0, 0, 0, 1, 2, 3, 0]); // data
    bytes.extend(4.5f64.to_le_bytes());
    for (at, value) in [("few[0]", 9.0), ("x", 2.5), ("data[2]", 3.0), ("y", 4.5)] {
        assert_eq!(numbers(&schema, Wire::Cdr, &bytes, at), [value], "{at}");
    }
}

#[test]
fn a_path_that_is_not_there_says_what_is_wrong() {
    let schema = Schema::parse("nav_msgs/Odometry", Odometry::ros1_definition()).expect("a definition");
    let fault = |at: &str| schema.query(&path(at)).expect_err(at);
    assert_eq!(fault("pose.pose.positon.x").to_string(), "geometry_msgs/Pose has no field 'positon'");
    assert!(matches!(fault("pose.pose"), QueryError::Whole { .. }));
    assert!(matches!(fault("pose.covariance[36]"), QueryError::Beyond { length: 36, .. }));
    assert!(matches!(fault("pose.pose.position.x[0]"), QueryError::NoArray(_)));
    assert!(matches!(fault("pose.pose.position.x.y"), QueryError::NoField { .. }));
    assert!(
        "a..b".parse::<Path>().is_err() && "a[x]".parse::<Path>().is_err() && "".parse::<Path>().is_err()
    );
}

#[test]
fn hostile_definitions_are_refused() {
    let refused = |text: &str| Schema::parse("p/T", text).expect_err(&text[..text.len().min(60)]);
    assert!(matches!(refused("T t\n"), SchemaError::Cycle(_)));
    assert!(matches!(refused("A a\n===\nMSG: p/A\nB[] b\n===\nMSG: p/B\nA a\n"), SchemaError::Cycle(_)));
    assert!(matches!(refused("Nowhere x\n"), SchemaError::Missing(..)));
    assert!(matches!(refused("int32 a\nint32 a\n"), SchemaError::Twice(..)));
    assert!(matches!(refused("int32 a.b\n"), SchemaError::Line(_)));
    assert!(matches!(refused("int32[99999999999] a\n"), SchemaError::Line(_)));
    assert!(matches!(refused("IDL: p/msg/T\nmodule p {};"), SchemaError::Idl));
    let deep: String = (0..200)
        .map(|level| format!("L{} next\n===\nMSG: p/L{}\n", level + 1, level + 1))
        .chain(["int32 x\n".to_owned()])
        .collect();
    assert!(matches!(refused(&deep), SchemaError::Size(_)));
    assert!(matches!(refused(&"int32 x\n".repeat(200_000)), SchemaError::Size(_) | SchemaError::Twice(..)));
}

#[test]
fn lengths_that_the_bytes_do_not_pay_for_are_refused_at_once() {
    let claims = |text: &str, bytes: &[u8]| {
        let schema = Schema::parse("p/T", text).expect("a definition");
        schema.query(&path("x")).expect("a number").read(&schema, Wire::Ros1, bytes)
    };
    let most = [0xFF; 12];
    assert!(claims("float64[] a\nfloat64 x", &most).is_err());
    assert!(claims("string[] a\nfloat64 x", &most).is_err());
    assert!(claims("float64[4294967295] a\nfloat64 x", &most).is_err());
    // A type that takes no bytes may be there 2^32 times.
    assert!(claims("E[] a\nfloat64 x\n===\nMSG: p/E\n", &most).is_ok());
    assert!(
        claims("E[4294967295] a\nfloat64 x\n===\nMSG: p/E\nF[4294967295] f\n===\nMSG: p/F\n", &most).is_ok()
    );
    // A small text that stands for 2^31 fields, none of which takes a byte.
    let wide: String = (0..31)
        .map(|level| format!("L{0} a\nL{0} b\n===\nMSG: p/L{0}\n", level + 1))
        .chain(["int8[0] none\n".to_owned()])
        .collect();
    let wide = format!("W w\nuint8 x\n===\nMSG: p/W\n{wide}");
    assert_eq!(claims(&wide, &[5]), Ok(Found::Numbers(vec![5.0])));
    let schema = Schema::parse("p/T", &wide).expect("a definition");
    let query = schema.query(&path("x")).expect("a number");
    assert_eq!(query.read(&schema, Wire::Cdr, &[0, 1, 0, 0, 5]), Ok(Found::Numbers(vec![5.0])));
    assert!(schema.leaves().len() <= 2000);
    let nested =
        "A[4294967295] a\nfloat64 x\n===\nMSG: p/A\nB[4294967295] b\n===\nMSG: p/B\nfloat64[4294967295] c\n";
    assert!(claims(nested, &most).is_err());
}

/// A definition, a zero byte, and a message of it, in either wire format.
#[test]
fn hostile_definitions_and_messages_neither_panic_nor_allocate_what_they_claim() {
    let seed = |definition: &'static Definition| {
        [
            [definition.ros1_definition().as_bytes(), &[0; 100]].concat(),
            [definition.ros2_definition().as_bytes(), &[0, 0, 1, 0, 0, 2, 0, 0, 0, 1]].concat(),
        ]
    };
    let target = Target {
        corpus: format!("{}/tests/corpus/dynamic", env!("CARGO_MANIFEST_DIR")).into(),
        seeds: types().into_iter().filter(|t| t.text.len() < 500).step_by(5).flat_map(seed).collect(),
        tokens: &[
            b"\xff\xff\xff\xff", b"[4294967295]", b"[]", b"\n====\nMSG: a/B\n", b"Header h\n", b"wstring w\n",
        ],
        // A field of nine bytes (`int8 a\\n`), its name, and a path to it; a number per byte of a message.
        bytes_per_byte: 512,
    };
    target.run(|input| {
        let end = input.iter().position(|byte| *byte == 0).unwrap_or(input.len());
        let (text, message) = input.split_at(end);
        let Ok(schema) = Schema::parse("a/A", &String::from_utf8_lossy(text)) else { return };
        let message = message.get(1..).unwrap_or_default();
        for wire in [Wire::Ros1, Wire::Cdr] {
            let _ = schema.stamp(wire, message);
            for leaf in schema.leaves().iter().take(20) {
                let _ = schema.query(leaf).unwrap().read(&schema, wire, message);
            }
        }
    });
}
