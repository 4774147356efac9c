//! `roscausal topics --signals`: every number in the messages of a recording.

use std::path::Path as File;

use roscausal_core::{Result, signal::Definitions};
use roscausal_msgs::dynamic::{Array, Found, Kind, Path, Query, Schema, Step, Wire};
use roscausal_recording::{Recording, Topic};

use super::Count;
use crate::{interrupt::Interrupt, report::WIDEST};

/// Most numbers of one topic that are listed.
const MOST: usize = 200;

/// The numbers of one topic.
struct Listed {
    schema: Schema,
    wire: Wire,
    signals: Vec<Signal>,
    /// Messages that could not be read.
    unreadable: u64,
}

/// One number, or one array of numbers.
struct Signal {
    path: Path,
    /// Type of the field: `float64`, `float32[]`.
    kind: String,
    query: Query,
    count: Count,
    /// Smallest and largest value.
    range: Option<(f64, f64)>,
}

impl Listed {
    /// The numbers of a topic.
    fn of(topic: &Topic, definitions: &Definitions) -> std::result::Result<Self, String> {
        let kind = topic.raw_type().ok_or("its messages are in an encoding that is not ROS's")?;
        let schema = definitions.schema(&kind)?;
        let signal = |path: Path| {
            let query = schema.query(&path).ok()?;
            let kind = kind_of(&schema, &path);
            Some(Signal { path, kind, query, count: Count::default(), range: None })
        };
        let signals = schema.leaves().into_iter().take(MOST).filter_map(signal).collect();
        Ok(Self { schema, wire: kind.wire, signals, unreadable: 0 })
    }

    fn add(&mut self, record: &roscausal_recording::Record) {
        for signal in &mut self.signals {
            match signal.query.read(&self.schema, self.wire, &record.bytes) {
                Ok(Found::Numbers(numbers)) => signal.add(record, &numbers),
                Ok(Found::Text(_)) => {}
                Err(_) => {
                    self.unreadable += 1;
                    return;
                }
            }
        }
    }
}

impl Signal {
    fn add(&mut self, record: &roscausal_recording::Record, numbers: &[f64]) {
        for number in numbers.iter().copied().filter(|number| number.is_finite()) {
            let (least, most) = self.range.unwrap_or((number, number));
            self.range = Some((least.min(number), most.max(number)));
        }
        if !numbers.is_empty() {
            self.count.add(record);
        }
    }

    fn line(&self, topic: &str, names: usize, kinds: usize) -> String {
        let [rate, gap] = self.count.texts();
        let [least, most] =
            self.range.map_or_else(|| ["-"; 2].map(str::to_owned), |(least, most)| [least, most].map(shown));
        let (name, kind) = (format!("{topic}.{}", self.path), &self.kind);
        format!("{name:names$}  {kind:kinds$}  {rate:>8}  {gap:>9}  {least:>12}  {most:>12}")
    }
}

/// The type of the field at a path, as `.msg` files write it.
fn kind_of(schema: &Schema, path: &Path) -> String {
    let field = match path.0.split_last() {
        Some((Step::All, array)) => Path(array.to_vec()),
        _ => path.clone(),
    };
    let Ok((kind, array)) = schema.at(&field) else { return String::new() };
    let bits = |bytes: u8| u32::from(bytes) * 8;
    let kind = match kind {
        Kind::Bool => "bool".to_owned(),
        Kind::Unsigned(bytes) => format!("uint{}", bits(bytes)),
        Kind::Signed(bytes) => format!("int{}", bits(bytes)),
        Kind::Float(bytes) => format!("float{}", bits(bytes)),
        Kind::Time => "time".to_owned(),
        Kind::Duration => "duration".to_owned(),
        Kind::Text => "string".to_owned(),
        Kind::WideText => "wstring".to_owned(),
        Kind::Struct(_) => schema.nested(kind).map_or_else(String::new, |nested| nested.name.clone()),
    };
    match array {
        Array::One => kind,
        Array::Fixed(length) => format!("{kind}[{length}]"),
        Array::Any => format!("{kind}[]"),
    }
}

/// A number in at most twelve characters.
fn shown(number: f64) -> String {
    let plain = format!("{number}");
    if plain.len() <= 12 { plain } else { format!("{number:.5e}") }
}

/// Prints the table.
pub(super) fn run(path: &File, interrupt: &Interrupt) -> Result<()> {
    let mut recording = Recording::open(path)?;
    let topics = recording.topics().to_vec();
    let definitions = Definitions::of("");
    let mut listed: Vec<_> = topics.iter().map(|topic| Listed::of(topic, &definitions)).collect();
    for record in recording.by_ref() {
        interrupt.check()?;
        if let Ok(topic) = &mut listed[record.topic] {
            topic.add(&record);
        }
    }
    let mut lines: Vec<_> = topics.iter().zip(&listed).collect();
    lines.sort_by_key(|(topic, _)| (&topic.name, &topic.type_name));
    let width = |(topic, listed): &(&Topic, &std::result::Result<Listed, String>)| {
        let paths = listed.iter().flat_map(|listed| &listed.signals);
        paths.map(|signal| topic.name.len() + 1 + signal.path.to_string().len()).max()
    };
    let names = lines.iter().filter_map(width).max().unwrap_or(0).clamp(6, WIDEST);
    let signals = lines.iter().flat_map(|(_, listed)| listed.iter()).flat_map(|listed| &listed.signals);
    let kinds = signals.map(|signal| signal.kind.len()).max().unwrap_or(0).clamp(4, WIDEST);
    let columns = "rate, Hz     gap, s         least          most";
    say!("{:names$}  {:kinds$}  {columns}", "signal", "type");
    for (topic, listed) in lines {
        match listed {
            Ok(listed) => {
                listed.signals.iter().for_each(|signal| say!("{}", signal.line(&topic.name, names, kinds)));
                if listed.unreadable > 0 {
                    tell!("note: {}: {} messages cannot be read", topic.name, listed.unreadable);
                }
            }
            Err(reason) => tell!("note: {}: {reason}", topic.name),
        }
    }
    recording.losses().iter().for_each(|loss| tell!("note: {loss}"));
    Ok(())
}
