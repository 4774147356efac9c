//! A message type's text, and what ROS 1 derives from it.

use std::{fmt::Write, sync::OnceLock};

use md5::{Digest, Md5};

/// The wires a message type exists on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wires {
    /// The same fields in both ROS versions.
    Both,
    /// Only ROS 1 has it, or has it with these fields.
    Ros1,
    /// Only ROS 2 has it, or has it with these fields.
    Ros2,
}

/// Text and dependencies of one message type; one static of it per type.
#[derive(Debug)]
pub struct Definition {
    /// ROS package, such as `geometry_msgs`.
    pub package: &'static str,
    /// Type name within the package, such as `Point`.
    pub name: &'static str,
    /// The `.msg` text, in ROS 1 spelling (`time`, `duration`).
    pub text: &'static str,
    /// Where the type exists.
    pub wires: Wires,
    /// The types of its fields, each once.
    pub nested: &'static [fn() -> &'static Definition],
    md5: OnceLock<String>,
    ros1_text: OnceLock<String>,
    ros2_text: OnceLock<String>,
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

    /// The md5 by which ROS 1 checks that both ends mean the same type: of the text with its constants first,
    /// without comments, each nested type replaced by its own md5.
    pub fn ros1_md5(&self) -> &str {
        self.md5.get_or_init(|| {
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
            Md5::digest(canonical.join("\n")).iter().fold(String::with_capacity(32), |mut hex, byte| {
                let _ = write!(hex, "{byte:02x}");
                hex
            })
        })
    }

    /// The text with those of all types it uses appended, as connection headers and bags carry it.
    pub fn ros1_definition(&self) -> &str {
        self.ros1_text
            .get_or_init(|| self.with_nested(Self::type_name, |definition| definition.text.to_owned()))
    }

    /// The same in the spelling of ROS 2 (`ros2msg`): no `seq` in the header, `builtin_interfaces` times,
    /// legal field names. `builtin_interfaces` is known to every reader and not appended.
    pub fn ros2_definition(&self) -> &str {
        self.ros2_text
            .get_or_init(|| self.with_nested(Self::type_name, |definition| definition.ros2_own_text()))
    }

    /// This type and all that it uses, each once, itself first, then in the order of first use.
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

    /// The definition behind a field's type, `None` for the built-in types. An array is not part of the name.
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
                // A ROS 1 string constant is the rest of the line, quotes and all.
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

/// One line of a `.msg` text that means something.
enum Line<'a> {
    Constant { kind: &'a str, name: &'a str, value: &'a str },
    Field { kind: &'a str, name: &'a str },
}

impl<'a> Line<'a> {
    fn parse(line: &'a str) -> Option<Self> {
        let code = line.split('#').next().unwrap_or("").trim();
        let (kind, rest) = code.split_once(char::is_whitespace)?;
        let rest = rest.trim();
        // A string constant may hold a '#': its value is the whole rest of the line.
        let rest = match kind {
            "string" if rest.contains('=') => line.trim_start().strip_prefix(kind)?.trim(),
            _ => rest,
        };
        Some(match rest.split_once('=') {
            Some((name, value)) => Self::Constant { kind, name: name.trim(), value: value.trim() },
            None => Self::Field { kind, name: rest },
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::types;

    /// From `rosmsg md5` of ROS 1 and from the packages' own generated code.
    const KNOWN: &[(&str, &str)] = &[
        ("roscausal_msgs/RobotState", "85ccda3e8061a45d573a2a8550778871"),
        ("roscausal_msgs/HumanState", "90716816acd7c89906d6a039b49fe272"),
        ("roscausal_msgs/Humans", "6a4845f7410a9b3ab633d5f388b36b39"),
        ("roscausal_msgs/CausalModel", "dffe9a6aaf2835bf56c67571594f45fb"),
        ("std_msgs/Header", "2176decaecbce78abc3b96ef049fabed"),
        ("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
        ("geometry_msgs/PoseWithCovarianceStamped", "953b798c0f514ff060a53a3498ce6246"),
        ("move_base_msgs/MoveBaseActionGoal", "660d6895a1b9a16dce51fbdd9a64a56b"),
        ("tf2_msgs/TFMessage", "94810edda583a504dfda3829e70d7eec"),
        ("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"),
        ("diagnostic_msgs/DiagnosticArray", "60810da900de1dd6ddd437c3503511da"),
        ("rosgraph_msgs/Clock", "a9c97c1d230cfc112e270351a944ee47"),
        ("rosgraph_msgs/Log", "acffd30cd6b6de30f120938c17c593fb"),
    ];

    #[test]
    fn md5_are_those_of_ros1() {
        let types = types();
        for (name, md5) in KNOWN {
            let definition = types.iter().find(|definition| definition.type_name() == *name);
            assert_eq!(definition.map(|definition| definition.ros1_md5()), Some(*md5), "{name}");
        }
    }
}
