//! Writes the Rust types of all messages and services from their texts: a file for each package, and the list of the types.
//!
//! The folder of a text says what it is. `msg/` and `srv/` are our own. In `foreign/PACKAGE/`, `msg/` and `srv/` have what both ROS
//! versions have, `ros1/` and `ros2/` what only one has so, and `hrisim/` what ROS-Causal_HRISim changed in pedsim_msgs.
//!
//! Comments become documentation. The comment at the top, before an empty line, is the type's; one behind a field or a
//! constant is its own; one above holds for all up to the next empty line. The texts of `foreign/` travel without comments.

#[path = "src/line.rs"]
mod line;

use std::{collections::BTreeSet, env, error::Error, fs, path::Path};

use line::{Line, code};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const OWN: &str = "roscausal_msgs";

#[derive(Clone)]
struct Message {
    package: String,
    /// The folder of its text.
    folder: String,
    name: String,
    /// Its name in Rust.
    rust: String,
    text: String,
}

/// What a text says.
struct Text<'a> {
    /// The type's own comment.
    about: Vec<&'a str>,
    constants: Vec<Entry<'a>>,
    fields: Vec<Entry<'a>>,
}

/// A field or a constant, and the comment that holds for it.
struct Entry<'a> {
    kind: &'a str,
    name: &'a str,
    /// Of a constant.
    value: Option<&'a str>,
    comment: Vec<&'a str>,
}

impl Entry<'_> {
    /// Of a fixed length.
    fn is_array(&self) -> bool {
        self.kind.ends_with(']') && !self.kind.ends_with("[]")
    }
}

impl Message {
    fn new(package: &str, folder: &str, name: String, text: &str) -> Self {
        let in_ros1 = || Path::new(&format!("foreign/{package}/ros1/{name}.msg")).exists();
        let rust = match folder {
            "hrisim" => format!("{name}WithGoal"),
            "ros2" if in_ros1() => format!("Ros2{name}"),
            _ => name.clone(),
        };
        Self { package: package.into(), folder: folder.into(), name, rust, text: text.into() }
    }

    fn path(&self) -> String {
        let module = if self.package == OWN { String::new() } else { format!("{}::", self.package) };
        format!("crate::{module}{}", self.rust)
    }

    /// The text as connections and recordings have it.
    fn travelling(&self) -> String {
        if self.package == OWN {
            return self.text.clone();
        }
        let lines = self.text.lines().map(code).filter(|code| !code.is_empty());
        lines.map(|code| format!("{code}\n")).collect()
    }

    fn parse(&self) -> Text<'_> {
        let (mut about, mut entries) = (Vec::new(), Vec::new());
        // The comment above, and whether its next line may follow.
        let (mut above, mut open) = (Vec::new(), true);
        for line in self.text.lines() {
            let own = line.trim()[code(line).len()..].trim_start().strip_prefix('#').map(str::trim);
            let (kind, name, value) = match Line::parse(line) {
                Some(Line::Field { kind, name }) => (kind, name, None),
                Some(Line::Constant { kind, name, value }) => (kind, name, Some(value)),
                None => {
                    if own.is_none() && about.is_empty() && entries.is_empty() {
                        about = above.clone();
                    }
                    if own.is_none() || !open {
                        above.clear();
                    }
                    above.extend(own);
                    open = true;
                    continue;
                }
            };
            let comment = own.map_or_else(|| above.clone(), |own| vec![own]);
            entries.push(Entry { kind, name, value, comment });
            open = false;
        }
        let (constants, fields) = entries.into_iter().partition(|entry| entry.value.is_some());
        Text { about, constants, fields }
    }
}

/// All messages: our own, then the others by package.
struct Messages(Vec<Message>);

impl Messages {
    fn read() -> Result<Self> {
        let mut all = [read(OWN, "msg", "msg")?, read(OWN, "srv", "srv")?].concat();
        for package in names("foreign")? {
            for folder in names(&format!("foreign/{package}"))? {
                all.extend(read(&package, &folder, &format!("foreign/{package}/{folder}"))?);
            }
        }
        all.sort_by_key(|message| (message.package != OWN, message.package.clone(), message.rust.clone()));
        Ok(Self(all))
    }

    /// The message that a field of another one contains: of the same folder if there are several.
    fn nested(&self, of: &Message, kind: &str) -> Option<&Message> {
        let kind = kind.split('[').next().unwrap_or(kind);
        let (package, name) = kind.split_once('/').unwrap_or((&of.package, kind));
        let mut named = self.0.iter().filter(|message| message.package == package && message.name == name);
        named.clone().find(|message| message.folder == of.folder).or_else(|| named.next())
    }

    /// Whether a field of the message, or of one in it, is of such a type.
    fn any(&self, message: &Message, is: fn(&str) -> bool) -> bool {
        let Text { fields, .. } = message.parse();
        fields.iter().any(|field| {
            is(field.kind) || self.nested(message, field.kind).is_some_and(|nested| self.any(nested, is))
        })
    }

    /// The Rust type of a field or a constant.
    fn rust_type(&self, message: &Message, kind: &str) -> Result<String> {
        let (base, array) = kind.split_at(kind.find('[').unwrap_or(kind.len()));
        let base = match base {
            "bool" => base.into(),
            "byte" => "u8".into(),
            "string" => "::std::string::String".into(),
            "time" => "crate::Time".into(),
            "duration" => "crate::Duration".into(),
            "int8" | "int16" | "int32" | "int64" => base.replace("int", "i"),
            "uint8" | "uint16" | "uint32" | "uint64" => base.replace("uint", "u"),
            "float32" | "float64" => base.replace("float", "f"),
            _ => {
                let Message { package, name, .. } = message;
                let unknown =
                    || format!("{package}/{name} has a field of type {base}, of which there is no text");
                self.nested(message, base).ok_or_else(unknown)?.path()
            }
        };
        Ok(match array {
            "" => base,
            "[]" => format!("Vec<{base}>"),
            _ => format!("[{base}; {}]", array.trim_matches(['[', ']'])),
        })
    }

    fn derives(&self, message: &Message, fields: &[Entry<'_>]) -> String {
        let mut derives = "Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize".to_owned();
        // Arrays may be too long for it, and no rotation is not zero.
        if message.rust != "Quaternion" && !fields.iter().any(Entry::is_array) {
            derives += ", Default";
        }
        if !self.any(message, |kind| kind == "string" || kind.ends_with(']')) {
            derives += ", Copy";
        }
        if !self.any(message, |kind| kind.starts_with("float")) {
            derives += ", Eq";
        }
        format!("#[derive({derives})]\n")
    }

    fn field(&self, message: &Message, field: &Entry<'_>) -> Result<String> {
        let name = field.name.to_ascii_lowercase();
        let (attribute, name) = match (field.kind, name.as_str()) {
            ("uint8[]" | "byte[]", name) => ("#[serde(with = \"serde_bytes\")]\n", name),
            (_, name) if field.is_array() => ("#[serde(with = \"serde_big_array::BigArray\")]\n", name),
            (_, "type") if message.rust == "Intervention" => ("#[serde(rename = \"type\")]\n", "kind"),
            (_, "type") => ("", "r#type"),
            (_, name) => ("", name),
        };
        let kind = self.rust_type(message, field.kind)?;
        Ok(format!("{}{attribute}pub {name}: {kind},\n", doc(&field.comment)))
    }

    fn constant(&self, message: &Message, constant: &Entry<'_>) -> Result<String> {
        let value = constant.value.unwrap_or_default();
        let (kind, value) = match (constant.kind, message.rust.as_str()) {
            ("string", _) => ("&str".into(), format!("{:?}", value.trim_matches('"'))),
            // ROS 1 says uint8, but the fields are int32.
            (_, "Marker") => ("i32".into(), value.into()),
            (kind, _) => (self.rust_type(message, kind)?, value.into()),
        };
        Ok(format!("{}pub const {}: {kind} = {value};\n", doc(&constant.comment), constant.name))
    }

    /// The Rust type of a message, and what the crate knows of it.
    fn rust(&self, message: &Message) -> Result<String> {
        let Message { package, folder, name, rust, .. } = message;
        let Text { about, constants, mut fields } = message.parse();
        // Only the bytes of ROS 1 have it; the codec adds it.
        fields.retain(|field| (rust.as_str(), field.name) != ("Header", "seq"));
        let (wires, versions) = match folder.as_str() {
            "ros1" | "hrisim" => ("Ros1", " of ROS 1"),
            "ros2" => ("Ros2", " of ROS 2"),
            _ => ("Both", ""),
        };
        let mut nested: Vec<_> = fields.iter().filter_map(|field| self.nested(message, field.kind)).collect();
        let mut seen = BTreeSet::new();
        nested.retain(|nested| seen.insert(nested.path()));
        let nested: String = nested.iter().map(|nested| nested.path() + ", ").collect();

        let mut out = doc(&about);
        if !out.is_empty() {
            out += "///\n";
        }
        out += &format!("/// `{package}/{name}`{versions}.\n{}", self.derives(message, &fields));
        out += &format!("pub struct {rust} {{\n");
        for field in &fields {
            out += &self.field(message, field)?;
        }
        out += "}\n";
        if !constants.is_empty() {
            out += &format!("impl {rust} {{\n");
            for constant in &constants {
                out += &self.constant(message, constant)?;
            }
            out += "}\n";
        }
        let text = message.travelling();
        out += &format!("message!({rust}, {package:?}, {name:?}, {text:?}, {wires}, [{nested}]);\n");
        Ok(out)
    }
}

/// The messages of a folder. A service has two.
fn read(package: &str, folder: &str, path: &str) -> Result<Vec<Message>> {
    let mut found = Vec::new();
    for file in names(path)? {
        let text = fs::read_to_string(format!("{path}/{file}"))?;
        let name = file.split('.').next().unwrap_or_default();
        let mut add = |name: String, text: &str| found.push(Message::new(package, folder, name, text));
        match text.split_once("\n---\n") {
            Some((question, answer)) => {
                add(format!("{name}Request"), &format!("{question}\n"));
                add(format!("{name}Response"), answer);
            }
            None if folder == "srv" => return Err(format!("{path}/{file} has no line '---'").into()),
            None => add(name.into(), &text),
        }
    }
    Ok(found)
}

/// What a folder contains.
fn names(folder: &str) -> Result<Vec<String>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned())).collect()
}

/// A comment as documentation, without links, tags and dashes where it has brackets and arrows. The compiler warns of those that
/// are missing.
fn doc(comment: &[&str]) -> String {
    let escaped = |line: &str| line.replace('[', "\\[").replace('<', "\\<").replace("--", "\\--");
    comment.iter().map(|line| format!("/// {}\n", escaped(line))).collect()
}

fn main() -> Result<()> {
    for folder in ["msg", "srv", "foreign"] {
        println!("cargo::rerun-if-changed={folder}");
    }
    let out = env::var("OUT_DIR")?;
    let messages = Messages::read()?;
    let mut list = String::from("registry![\n");
    for package in messages.0.chunk_by(|a, b| a.package == b.package) {
        let mut types = String::new();
        for message in package {
            types += &messages.rust(message)?;
            match message.name.strip_suffix("Response").filter(|_| message.folder == "srv") {
                Some(service) => {
                    types += &format!(
                        "service!({:?}, {service}, {service}Request, {service}Response);\n",
                        message.package
                    )
                }
                None if message.folder != "srv" => list += &format!("{},\n", message.path()),
                None => {}
            }
        }
        fs::write(format!("{out}/{}.rs", package[0].package), types)?;
    }
    fs::write(format!("{out}/registry.rs"), list + "];\n")?;
    Ok(())
}
