//! The text of a message type, and what ROS 1 derives from it.

use std::{fmt::Write, sync::OnceLock};

use md5::{Digest, Md5};

use crate::{dynamic::Schema, line::Line};

/// The wire formats in which a message type exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wires {
    /// The same fields in both ROS versions.
    Both,
    /// Only ROS 1 has it, or has it with these fields.
    Ros1,
    /// Only ROS 2 has it, or has it with these fields.
    Ros2,
}

/// Text and dependencies of one message type. Each type has one static of it.
#[derive(Debug)]
pub struct Definition {
    /// ROS package, such as `geometry_msgs`.
    pub package: &'static str,
    /// Type name within the package, such as `Point`.
    pub name: &'static str,
    /// The `.msg` text, in ROS 1 spelling (`time`, `duration`); of other packages without comments.
    pub text: &'static str,
    /// The wire formats in which the type exists.
    pub wires: Wires,
    /// The types of its fields, each once.
    pub nested: &'static [fn() -> &'static Definition],
    md5: OnceLock<String>,
    ros1_text: OnceLock<String>,
    ros2_text: OnceLock<String>,
    schemas: [OnceLock<Option<Schema>>; 2],
}

impl Definition {
    /// A definition; `nested` names the types that `text` uses.
    pub const fn new(
        package: &'static str,
        name: &'static str,
        text: &'static str,
        wires: Wires,
        nested: &'static [fn() -> &'static Definition],
    ) -> Self {
        Self {
            package,
            name,
            text,
            wires,
            nested,
            md5: OnceLock::new(),
            ros1_text: OnceLock::new(),
            ros2_text: OnceLock::new(),
            schemas: [OnceLock::new(), OnceLock::new()],
        }
    }

    /// `package/Name`, as ROS 1 writes it.
    pub fn type_name(&self) -> String {
        format!("{}/{}", self.package, self.name)
    }

    /// `package/msg/Name`, as ROS 2 writes it.
    pub fn ros2_type_name(&self) -> String {
        format!("{}/msg/{}", self.package, self.name)
    }

    /// Whether the type itself begins with a header. Its `seq` counts the messages of a ROS 1 publisher.
    pub fn is_numbered(&self) -> bool {
        let lines = self.text.lines().map(|line| line.split('#').next().unwrap_or_default());
        let first = lines.filter_map(|line| line.split_whitespace().next()).next();
        matches!(first, Some("Header" | "std_msgs/Header"))
    }

    /// The md5 by which ROS 1 checks that both ends mean the same type: of its text without comments.
    pub fn ros1_md5(&self) -> &str {
        self.md5.get_or_init(|| hex(&Md5::digest(self.ros1_md5_text())))
    }

    /// The text without comments, with the constants first, and with each nested type replaced by its own md5.
    pub(crate) fn ros1_md5_text(&self) -> String {
        let lines: Vec<_> = self.text.lines().filter_map(Line::parse).collect();
        let mut canonical: Vec<String> = Vec::with_capacity(lines.len());
        for line in &lines {
            if let Line::Constant { kind, name, value } = line {
                canonical.push(format!("{kind} {name}={value}"));
            }
        }
        for line in &lines {
            if let Line::Field { kind, name } = line {
                canonical.push(match self.nested_type(kind) {
                    Some(nested) => format!("{} {name}", nested.ros1_md5()),
                    None => format!("{kind} {name}"),
                });
            }
        }
        canonical.join("\n")
    }

    /// The text, followed by those of all types that it uses, as in connection headers and bags.
    pub fn ros1_definition(&self) -> &str {
        self.ros1_text
            .get_or_init(|| self.with_nested(Self::type_name, |definition| definition.text.to_owned()))
    }

    /// The same in ROS 2 spelling (`ros2msg`): no `seq` in the header, `builtin_interfaces` times, legal field
    /// names.
    pub fn ros2_definition(&self) -> &str {
        self.ros2_text.get_or_init(|| {
            let mut text = self.with_nested(Self::type_name, |definition| definition.ros2_own_text());
            for name in ["Time", "Duration"] {
                if text.contains(&format!("builtin_interfaces/{name} ")) {
                    let rule = "=".repeat(80);
                    let _ =
                        write!(text, "\n{rule}\nMSG: builtin_interfaces/{name}\nint32 sec\nuint32 nanosec\n");
                }
            }
            text
        })
    }

    /// Its fields in ROS 1.
    pub fn ros1_schema(&self) -> Option<&Schema> {
        let parse = || Schema::parse(&self.type_name(), self.ros1_definition()).ok();
        self.schemas[0].get_or_init(parse).as_ref()
    }

    /// Its fields in ROS 2.
    pub fn ros2_schema(&self) -> Option<&Schema> {
        let parse = || Schema::parse(&self.type_name(), self.ros2_definition()).ok();
        self.schemas[1].get_or_init(parse).as_ref()
    }

    /// This type and all types that it uses, each once: first itself, then the others in order of first use.
    pub fn all(&'static self) -> Vec<&'static Definition> {
        let mut found = vec![self];
        self.append_nested(&mut found);
        found
    }

    fn with_nested(&self, title: impl Fn(&Self) -> String, text: impl Fn(&Self) -> String) -> String {
        let mut nested = Vec::new();
        self.append_nested(&mut nested);
        let mut whole = text(self);
        for definition in nested {
            let _ = write!(whole, "\n{}\nMSG: {}\n{}", "=".repeat(80), title(definition), text(definition));
        }
        whole
    }

    fn append_nested(&self, found: &mut Vec<&'static Definition>) {
        for nested in self.nested {
            let nested = nested();
            if !found.iter().any(|known| std::ptr::eq(*known, nested)) {
                found.push(nested);
                nested.append_nested(found);
            }
        }
    }

    /// The definition of a field's type; `None` for built-in types. An array is not part of the name.
    fn nested_type(&self, kind: &str) -> Option<&'static Definition> {
        let base = kind.split('[').next().unwrap_or(kind);
        self.nested.iter().map(|nested| nested()).find(|nested| match base.split_once('/') {
            Some((package, name)) => (package, name) == (nested.package, nested.name),
            None if base == "Header" => (nested.package, nested.name) == ("std_msgs", "Header"),
            None => (nested.package, nested.name) == (self.package, base),
        })
    }

    fn ros2_own_text(&self) -> String {
        let mut text = String::new();
        for line in self.text.lines().filter_map(Line::parse) {
            let _ = match line {
                // A ROS 1 string constant is the rest of the line, including quotes.
                Line::Constant { kind: "string", name, value } if !value.starts_with('"') => {
                    writeln!(text, "string {name}=\"{value}\"")
                }
                Line::Constant { kind, name, value } => writeln!(text, "{kind} {name}={value}"),
                Line::Field { name: "seq", .. } if self.package == "std_msgs" && self.name == "Header" => {
                    Ok(())
                }
                Line::Field { kind, name } => {
                    let (base, array) = kind.split_at(kind.find('[').unwrap_or(kind.len()));
                    let base = match base {
                        "time" => "builtin_interfaces/Time",
                        "duration" => "builtin_interfaces/Duration",
                        "Header" => "std_msgs/Header",
                        base => base,
                    };
                    writeln!(text, "{base}{array} {}", name.to_ascii_lowercase())
                }
            };
        }
        text
    }
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut hex, byte| {
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::{Message, std_msgs::Header, types};

    #[test]
    fn only_a_type_that_begins_with_a_header_is_numbered() {
        let numbered = |name: &str| {
            let found = types().into_iter().find(|definition| definition.type_name() == name);
            found.map(|definition| definition.is_numbered())
        };
        assert_eq!(numbered("nav_msgs/Odometry"), Some(true));
        // the header of its first transform is not its own
        assert_eq!(numbered("tf2_msgs/TFMessage"), Some(false));
        assert_eq!(numbered("std_msgs/Header"), Some(false));
    }

    /// From ROS 1's `rosmsg md5`, or from the generated code of packages that ROS 1 does not contain.
    const KNOWN: &[(&str, &str)] = &[
        ("actionlib_msgs/GoalID", "302881f31927c1df708a2dbab0e80ee8"),
        ("diagnostic_msgs/DiagnosticArray", "60810da900de1dd6ddd437c3503511da"),
        ("diagnostic_msgs/DiagnosticStatus", "d0ce08bc6e5ba34c7754f563a9cabaf1"),
        ("diagnostic_msgs/KeyValue", "cf57fdc6617a881a88c16e768132149c"),
        ("dynamic_reconfigure/BoolParameter", "23f05028c1a699fb83e22401228c3a9e"),
        ("dynamic_reconfigure/Config", "958f16a05573709014982821e6822580"),
        ("dynamic_reconfigure/DoubleParameter", "d8512f27253c0f65f928a67c329cd658"),
        ("dynamic_reconfigure/GroupState", "a2d87f51dc22930325041a2f8b1571f8"),
        ("dynamic_reconfigure/IntParameter", "65fedc7a0cbfb8db035e46194a350bf1"),
        ("dynamic_reconfigure/StrParameter", "bc6ccc4a57f61779c8eaae61e9f422e0"),
        ("geometry_msgs/Point", "4a842b65f413084dc2b10fb484ea7f17"),
        ("geometry_msgs/Point32", "cc153912f1453b708d221682bc23d9ac"),
        ("geometry_msgs/Pose", "e45d45a5a1ce597b249e23fb30fc871f"),
        ("geometry_msgs/Pose2D", "938fa65709584ad8e77d238529be13b8"),
        ("geometry_msgs/PoseArray", "916c28c5764443f268b296bb671b9d97"),
        ("geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
        ("geometry_msgs/PoseWithCovariance", "c23e848cf1b7533a8d7c259073a97e6f"),
        ("geometry_msgs/PoseWithCovarianceStamped", "953b798c0f514ff060a53a3498ce6246"),
        ("geometry_msgs/Quaternion", "a779879fadf0160734f906b8c19c7004"),
        ("geometry_msgs/Transform", "ac9eff44abf714214112b05d54a3cf9b"),
        ("geometry_msgs/TransformStamped", "b5764a33bfeb3588febc2682852579b0"),
        ("geometry_msgs/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
        ("geometry_msgs/TwistStamped", "98d34b0043a2093cf9d9345ab6eef12e"),
        ("geometry_msgs/TwistWithCovariance", "1fe8a28e6890a4cc3ae4c3ca5c7d82e6"),
        ("geometry_msgs/Vector3", "4a842b65f413084dc2b10fb484ea7f17"),
        ("move_base_msgs/MoveBaseActionGoal", "660d6895a1b9a16dce51fbdd9a64a56b"),
        ("move_base_msgs/MoveBaseGoal", "257d089627d7eb7136c24d3593d05a16"),
        ("nav2_msgs/CostmapFilterInfo", "01d3e515341ee21f22986694eb45f09c"),
        ("nav2_msgs/SpeedLimit", "46b4d9efff8f0aa5f264a52bb6e78077"),
        ("nav_msgs/MapMetaData", "10cfc8a2818024d3248802c00c95f11b"),
        ("nav_msgs/OccupancyGrid", "3381f2d731d4076ec5c71b0759edbe4e"),
        ("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
        ("nav_msgs/Path", "6227e2b7e9cce15051f669a5e197bbf7"),
        ("pedsim_msgs/AgentStates", "aa81ea94344df8d81e135b65d4d499b1"),
        ("pedsim_msgs/LineObstacle", "ad6f4eea34a193d38008f1d4053cce66"),
        ("pedsim_msgs/LineObstacles", "4de3122fdaa1292012d39892365813ee"),
        ("pedsim_msgs/TrackedPersons", "21c0b1a57c4933e68f39aa3802861828"),
        ("pedsim_msgs/Waypoint", "7fe6c11b241f6ddddc1c756dacf4a21f"),
        ("people_msgs/People", "18722f4b8db20cc2369740732357847b"),
        ("roscausal_msgs/CausalModel", "dffe9a6aaf2835bf56c67571594f45fb"),
        ("roscausal_msgs/HumanState", "90716816acd7c89906d6a039b49fe272"),
        ("roscausal_msgs/Humans", "6a4845f7410a9b3ab633d5f388b36b39"),
        ("roscausal_msgs/ModelChange", "c911df3fa06ecfb389e8212fc3935958"),
        ("roscausal_msgs/ModelChanges", "1e477164258feefd437fb7073a60a138"),
        ("roscausal_msgs/RobotState", "85ccda3e8061a45d573a2a8550778871"),
        ("rosgraph_msgs/Clock", "a9c97c1d230cfc112e270351a944ee47"),
        ("rosgraph_msgs/Log", "acffd30cd6b6de30f120938c17c593fb"),
        ("sensor_msgs/CompressedImage", "8f7a12909da2c9d3332d540a0977563f"),
        ("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"),
        ("spencer_tracking_msgs/TrackedPersons", "21c0b1a57c4933e68f39aa3802861828"),
        ("std_msgs/Bool", "8b94c1b53db61fb6aed406028ad6332a"),
        ("std_msgs/ColorRGBA", "a29a96539573343b1310c73607334b00"),
        ("roscausal_msgs/Action", "c1a701b1cafc32c0d9486d172ad03419"),
        ("roscausal_msgs/Contribution", "1b38a1b22d5577a53753a61ab5fc291f"),
        ("roscausal_msgs/CostTerm", "c8522a858f4eed7eb6d414535cfcb52c"),
        ("roscausal_msgs/Features", "be6c25a8120d5cdd59f2eb17f769d980"),
        ("roscausal_msgs/Forecast", "47e86b32b8ecec61821a15ba35201ede"),
        ("roscausal_msgs/Intervention", "8a30da5ec0090260fb1eb4f9aaa97645"),
        ("roscausal_msgs/Limit", "6e7201adc9c3a47340d4f06a232da5d6"),
        ("roscausal_msgs/Outlook", "29b084e7d7fe33f7595506bef2e42d06"),
        ("roscausal_msgs/Prediction", "b18ade42d92e7fb75a68bde92b27f764"),
        ("std_msgs/Float32MultiArray", "6a40e0ffa6a17a503ac3f8616991b1f6"),
        ("std_msgs/Float64", "fdb28210bfa9d7c91146260178d9a584"),
        ("std_msgs/Header", "2176decaecbce78abc3b96ef049fabed"),
        ("std_msgs/Int32MultiArray", "1d99f79f8b325b44fee908053e9c945b"),
        ("std_msgs/MultiArrayDimension", "4cd0c83a8683deae40ecdac60e53bfa8"),
        ("std_msgs/MultiArrayLayout", "0fed2a11c13e11c5571b4e2a995a91a3"),
        ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1"),
        ("tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec"),
        ("visualization_msgs/Marker", "4048c9de2a16f4ae8e0538085ebf1b97"),
        ("visualization_msgs/MarkerArray", "d155b9ce5188fbaf89745847fd5882d7"),
    ];

    #[test]
    fn md5_are_those_of_ros1() {
        let types = types();
        for (name, md5) in KNOWN {
            let definition = types.iter().find(|definition| definition.type_name() == *name);
            assert_eq!(definition.map(|definition| definition.ros1_md5()), Some(*md5), "{name}");
        }
    }

    #[test]
    fn md5_puts_constants_first_and_ignores_comments_and_spaces() {
        static MESSY: Definition = Definition::new(
            "p",
            "T",
            "# comment\n\n  Header   header  # why\nstring  NOTE =  a # b  \nint32[4]   ids\nbyte LEVEL=1 # low\n",
            Wires::Both,
            &[<Header as Message>::definition],
        );
        let canonical =
            "string NOTE=a # b\nbyte LEVEL=1\n2176decaecbce78abc3b96ef049fabed header\nint32[4] ids";
        assert_eq!(MESSY.ros1_md5(), hex(&Md5::digest(canonical)));
    }

    #[test]
    fn every_field_type_is_built_in_or_declared() {
        const BUILT_IN: &str = " bool byte int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64 string time duration ";
        for definition in types() {
            for line in definition.text.lines().filter_map(Line::parse) {
                if let Line::Field { kind, name } = line {
                    let base = kind.split('[').next().unwrap_or(kind);
                    let known =
                        BUILT_IN.contains(&format!(" {base} ")) || definition.nested_type(kind).is_some();
                    assert!(known, "{}: {kind} {name}", definition.type_name());
                }
            }
            assert!(definition.text.ends_with('\n'), "{}", definition.type_name());
        }
    }

    #[test]
    fn a_name_has_one_definition_per_wire_but_for_pedsims_agents() {
        let mut seen = BTreeSet::new();
        for definition in types() {
            let ours = definition.package != "pedsim_msgs" || definition.wires == Wires::Both;
            if ours && definition.wires != Wires::Ros2 {
                assert!(seen.insert(definition.type_name()), "{}", definition.type_name());
            }
        }
    }

    #[test]
    fn a_visitor_finds_the_type_behind_each_definition() {
        struct Name;
        impl crate::TypeVisitor for Name {
            type Output = (&'static str, &'static str);
            fn visit<M: Message>(self) -> Self::Output {
                (M::ros1_md5(), M::NAME)
            }
        }
        for definition in types() {
            assert_eq!(crate::visit(definition, Name), Some((definition.ros1_md5(), definition.name)));
        }
        static STRANGER: Definition = Definition::new("p", "T", "bool x\n", Wires::Both, &[]);
        assert_eq!(crate::visit(&STRANGER, Name), None);
    }

    #[test]
    fn definitions_append_each_nested_type_once() {
        let text = crate::Humans::ros1_definition();
        for name in
            ["std_msgs/Header", "roscausal_msgs/HumanState", "geometry_msgs/Pose2D", "geometry_msgs/Point"]
        {
            assert_eq!(text.matches(&format!("MSG: {name}\n")).count(), 1, "{name}");
        }
    }

    #[test]
    fn the_ros2_text_has_legal_names_and_its_own_times() {
        let text = crate::HumanState::definition().ros2_definition();
        assert!(text.contains("geometry_msgs/Pose2D pose2d\n"), "{text}");
        assert!(
            text.contains("MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"),
            "{text}"
        );
        assert!(!text.contains("seq"), "{text}");
        assert!(text.ends_with("MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"), "{text}");
    }
}
