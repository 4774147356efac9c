//! A signal bound to the definition of its topic's messages, and its value in a message.

use roscausal_msgs::{
    Fault, Time,
    dynamic::{Array, Found, Kind, Path, Query, QueryError, Schema, Step, Wire},
};

use super::parse::{Node, Of, Signal};
use crate::grammar::{FUNCTIONS, Operator, wrap};
use crate::{ensure, params::nearest};

/// What an expression is computed from: a message, and when it was stamped and arrived.
pub(super) struct Scope<'a> {
    pub(super) schema: &'a Schema,
    pub(super) wire: Wire,
    pub(super) bytes: &'a [u8],
    /// The stamp of its header, if it has one.
    pub(super) header: Option<Time>,
    pub(super) stamp: Time,
    pub(super) arrived: Time,
}

/// A signal that is ready to be read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bound {
    root: Part,
    /// Which messages count: those where this is not 0.
    only: Option<Part>,
    /// Stamp and value of the message before, for each place that remembers one.
    memories: Vec<Option<(Time, f64)>>,
}

#[derive(Clone, Debug, PartialEq)]
enum Part {
    Number(f64),
    Text(String),
    One(Query),
    Of(Of, Query),
    /// Length of the vector of these numbers.
    Norm(Vec<Query>),
    /// Length of the way through these points: their x, y and, if they have it, z.
    Length(Vec<Query>),
    /// Of a quaternion: x, y, z, w.
    Angle(Of, [Query; 4]),
    Hertz(usize),
    Delay,
    Rate {
        memory: usize,
        is_angle: bool,
        of: Box<Part>,
    },
    Negative(Box<Part>),
    Binary(Operator, Box<Part>, Box<Part>),
    Call(usize, Box<Part>),
    Pair(bool, Box<Part>, Box<Part>),
}

impl Signal {
    /// The signal for messages of `schema`.
    ///
    /// # Errors
    /// A field that the messages do not have, with the nearest that exists, or one that is not a number.
    pub(super) fn bind(&self, schema: &Schema) -> Result<Bound, String> {
        let binder = Binder { schema, signal: self };
        let root = binder.part(&self.root)?;
        let only = self.only.as_ref().map(|only| binder.number(only)).transpose()?;
        ensure(!is_text(&root), || format!("{} is a text; compare it: == \"...\"", self.text))?;
        Ok(Bound { root, only, memories: vec![None; self.memories] })
    }
}

fn is_text(part: &Part) -> bool {
    match part {
        Part::Text(_) => true,
        Part::One(query) => query.is_text(),
        _ => false,
    }
}

struct Binder<'a> {
    schema: &'a Schema,
    signal: &'a Signal,
}

impl Binder<'_> {
    fn part(&self, node: &Node) -> Result<Part, String> {
        let boxed = |node: &Node| self.number(node).map(Box::new);
        Ok(match node {
            Node::Number(value) => Part::Number(*value),
            Node::Text(text) => Part::Text(text.clone()),
            Node::Path(path) => self.path(path)?,
            Node::Of(of, path) => self.of(*of, path)?,
            Node::Hertz(memory) => Part::Hertz(*memory),
            Node::Delay => {
                let header = self.schema.root().fields.first();
                if header.is_none_or(|field| field.name != "header") {
                    let name = &self.schema.root().name;
                    return Err(format!("{name} has no header, so nothing tells when it was stamped"));
                }
                Part::Delay
            }
            Node::Rate(memory, inner) => {
                let of = boxed(inner)?;
                Part::Rate { memory: *memory, is_angle: matches!(*of, Part::Angle(..)), of }
            }
            Node::Negative(inner) => Part::Negative(boxed(inner)?),
            Node::Call(function, inner) => Part::Call(*function, boxed(inner)?),
            Node::Pair(smaller, a, b) => Part::Pair(*smaller, boxed(a)?, boxed(b)?),
            Node::Binary(operator, a, b) => {
                let (a, b) = (self.part(a)?, self.part(b)?);
                let compared = matches!(operator, Operator::Equal | Operator::Unequal);
                let fits = is_text(&a) == is_text(&b) && (compared || !is_text(&a));
                ensure(fits, || "a text goes with == and != and another text only")?;
                Part::Binary(*operator, Box::new(a), Box::new(b))
            }
        })
    }

    fn number(&self, node: &Node) -> Result<Part, String> {
        let part = self.part(node)?;
        if is_text(&part) { Err("a text is not a number; compare it: == \"...\"".into()) } else { Ok(part) }
    }

    /// A field that is one number or text, or an angle of an orientation.
    fn path(&self, path: &Path) -> Result<Part, String> {
        let whole = format!("{}{}{path}", self.signal.topic, if path.0.is_empty() { "" } else { "." });
        let query = match self.schema.query(path) {
            Ok(query) => query,
            Err(QueryError::NoField { .. }) if let Some((of, orientation)) = angle(path) => {
                return self.of(of, &orientation).map_err(|_| self.fault(path));
            }
            Err(QueryError::Whole { type_name, .. }) => {
                return Err(format!("{whole} is a whole {type_name}; fields: {}", self.below(path)));
            }
            Err(error) => return Err(self.reported(path, &error)),
        };
        ensure(!query.is_list(), || {
            format!(
                "{whole} has several numbers; take one ([0]), or mean(), min(), max(), sum(), norm() or count() of them"
            )
        })?;
        Ok(Part::One(query))
    }

    fn of(&self, of: Of, path: &Path) -> Result<Part, String> {
        if of == Of::Count {
            let count = self.schema.count(path).map_err(|error| self.reported(path, &error));
            return count.map(|query| Part::Of(of, query));
        }
        let (kind, array) = self.schema.at(path).map_err(|error| self.reported(path, &error))?;
        let field = |name: &&str| self.schema.query(&path.field(name)).ok().filter(|query| !query.is_list());
        let fields = |names: &[&str]| names.iter().map(field).collect::<Option<Vec<Query>>>();
        let is_one = matches!((kind, array), (Kind::Struct(_), Array::One));
        match of {
            Of::Length => self.way(path, array),
            Of::Roll | Of::Pitch | Of::Yaw => {
                let found = fields(&["x", "y", "z", "w"]).filter(|_| is_one);
                let found = found.and_then(|found| <[Query; 4]>::try_from(found).ok());
                found.map(|found| Part::Angle(of, found)).ok_or_else(|| {
                    format!("{}.{path} is not an orientation: it has no x, y, z and w", self.signal.topic)
                })
            }
            Of::Norm if is_one => fields(&["x", "y", "z"])
                .or_else(|| fields(&["x", "y"]))
                .map(Part::Norm)
                .ok_or_else(|| format!("{}.{path} is not a vector: it has no x and y", self.signal.topic)),
            _ => {
                let query = self.schema.query(path).map_err(|error| self.reported(path, &error))?;
                ensure(!query.is_text(), || format!("{}.{path} is a text", self.signal.topic))?;
                Ok(Part::Of(of, query))
            }
        }
    }

    /// The points of an array of points or poses, with or without headers.
    fn way(&self, path: &Path, array: Array) -> Result<Part, String> {
        const POINTS: [&[&str]; 4] =
            [&["pose", "position"], &["position"], &["pose", "pose", "position"], &[]];
        let forms =
            POINTS.into_iter().flat_map(|point| [(point, &["x", "y", "z"][..]), (point, &["x", "y"])]);
        let found = forms.filter(|_| array != Array::One).find_map(|(point, names)| {
            let point = point.iter().fold(path.all(), |path, name| path.field(name));
            let part = |name: &&str| self.schema.query(&point.field(name)).ok();
            names.iter().map(part).collect::<Option<Vec<Query>>>()
        });
        found
            .map(Part::Length)
            .ok_or_else(|| format!("{}.{path} is not an array of points or poses", self.signal.topic))
    }

    fn reported(&self, path: &Path, error: &QueryError) -> String {
        match error {
            QueryError::NoField { .. } => self.fault(path),
            other => other.to_string(),
        }
    }

    /// What is wrong with a path that is not there: the nearest that is, angles of orientations among them.
    fn fault(&self, path: &Path) -> String {
        let mut leaves: Vec<String> = self.schema.leaves().iter().map(Path::to_string).collect();
        let orientations: Vec<String> =
            leaves.iter().filter_map(|leaf| leaf.strip_suffix("orientation.w").map(str::to_owned)).collect();
        for angle in ["roll", "pitch", "yaw"] {
            leaves.extend(orientations.iter().map(|before| format!("{before}orientation.{angle}")));
        }
        let type_name = &self.schema.root().name;
        let near = nearest(&leaves, &path.to_string());
        let hint = near.map_or_else(
            || format!("it has: {}", self.below(&Path::default())),
            |near| format!("did you mean {}.{near}?", self.signal.topic),
        );
        format!("{type_name} has no field '{path}'; {hint}")
    }

    /// The first numbers below a path.
    fn below(&self, path: &Path) -> String {
        let (prefix, leaves) = (path.to_string(), self.schema.leaves());
        let below: Vec<String> =
            leaves.iter().map(Path::to_string).filter(|leaf| leaf.starts_with(&prefix)).take(12).collect();
        if below.is_empty() { "none that is a number".to_owned() } else { below.join(", ") }
    }
}

/// The orientation in a path that ends with `roll`, `pitch` or `yaw`.
fn angle(path: &Path) -> Option<(Of, Path)> {
    let (Step::Field(last), orientation) = path.0.split_last()? else { return None };
    let angles = [("roll", Of::Roll), ("pitch", Of::Pitch), ("yaw", Of::Yaw)];
    let (_, of) = angles.into_iter().find(|(name, _)| name == last)?;
    Some((of, Path(orientation.to_vec())))
}

impl Bound {
    /// The value in a message; NaN where it has none. `None`: the message does not count.
    ///
    /// # Errors
    /// Bytes that are no such message.
    pub(super) fn value(&mut self, scope: &Scope<'_>) -> Result<Option<f64>, Fault> {
        if let Some(only) = &self.only {
            let holds = only.value(scope, &mut self.memories)?;
            if holds.is_nan() || holds == 0.0 {
                return Ok(None);
            }
        }
        let value = self.root.value(scope, &mut self.memories)?;
        Ok(Some(if value.is_finite() { value } else { f64::NAN }))
    }
}

type Memories = [Option<(Time, f64)>];

impl Part {
    fn value(&self, scope: &Scope<'_>, memories: &mut Memories) -> Result<f64, Fault> {
        let one = |query: &Query| -> Result<f64, Fault> {
            Ok(numbers(query, scope)?.first().copied().unwrap_or(f64::NAN))
        };
        Ok(match self {
            Self::Number(value) => *value,
            Self::Text(_) => f64::NAN,
            Self::One(query) => one(query)?,
            Self::Of(of, query) => together(*of, &numbers(query, scope)?),
            Self::Norm(queries) => {
                let squares = queries.iter().map(|query| one(query).map(|x| x * x));
                squares.sum::<Result<f64, Fault>>()?.sqrt()
            }
            Self::Length(queries) => {
                let parts = queries.iter().map(|query| numbers(query, scope));
                way(&parts.collect::<Result<Vec<_>, Fault>>()?)
            }
            Self::Angle(of, [x, y, z, w]) => euler(*of, [one(x)?, one(y)?, one(z)?, one(w)?]),
            Self::Hertz(memory) => {
                step(memories, *memory, scope.arrived, 0.0).map_or(f64::NAN, |(seconds, _)| 1.0 / seconds)
            }
            Self::Delay => scope.header.map_or(f64::NAN, |stamp| scope.arrived.secs_since(stamp)),
            Self::Rate { memory, is_angle, of } => {
                let value = of.value(scope, memories)?;
                match step(memories, *memory, scope.stamp, value) {
                    Some((seconds, before)) if *is_angle => wrap(value - before) / seconds,
                    Some((seconds, before)) => (value - before) / seconds,
                    None => f64::NAN,
                }
            }
            Self::Negative(inner) => -inner.value(scope, memories)?,
            Self::Call(function, inner) => (FUNCTIONS[*function].1)(inner.value(scope, memories)?),
            Self::Pair(smaller, a, b) => {
                let (a, b) = (a.value(scope, memories)?, b.value(scope, memories)?);
                match a.is_nan() || b.is_nan() {
                    true => f64::NAN,
                    false if *smaller => a.min(b),
                    false => a.max(b),
                }
            }
            Self::Binary(operator, a, b) if is_text(a) => {
                let same = a.text(scope)? == b.text(scope)?;
                f64::from(same == (*operator == Operator::Equal))
            }
            Self::Binary(operator, a, b) => operator.of(a.value(scope, memories)?, b.value(scope, memories)?),
        })
    }

    fn text(&self, scope: &Scope<'_>) -> Result<Option<String>, Fault> {
        Ok(match self {
            Self::Text(text) => Some(text.clone()),
            Self::One(query) => match query.read(scope.schema, scope.wire, scope.bytes)? {
                Found::Text(text) => Some(text),
                Found::Numbers(_) => None,
            },
            _ => None,
        })
    }
}

fn numbers(query: &Query, scope: &Scope<'_>) -> Result<Vec<f64>, Fault> {
    Ok(match query.read(scope.schema, scope.wire, scope.bytes)? {
        Found::Numbers(numbers) => numbers,
        Found::Text(_) => Vec::new(),
    })
}

/// Seconds since the message that this memory holds, and its value; the memory then holds this one. A message that is not
/// later, or has no value, has no step.
fn step(memories: &mut Memories, memory: usize, stamp: Time, value: f64) -> Option<(f64, f64)> {
    if value.is_nan() {
        return None;
    }
    let before = memories.get_mut(memory)?.replace((stamp, value))?;
    let seconds = stamp.secs_since(before.0);
    (seconds > 0.0).then_some((seconds, before.1))
}

/// One number from those of an array. What is not finite, such as the range of a beam that met nothing, does not count.
fn together(of: Of, all: &[f64]) -> f64 {
    if of == Of::Count {
        return all.iter().sum();
    }
    let known: Vec<f64> = all.iter().copied().filter(|value| value.is_finite()).collect();
    if known.is_empty() {
        return f64::NAN;
    }
    let sum: f64 = known.iter().sum();
    match of {
        Of::Mean => sum / known.len() as f64,
        Of::Min => known.iter().copied().fold(f64::INFINITY, f64::min),
        Of::Max => known.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        Of::Norm => known.iter().map(|x| x * x).sum::<f64>().sqrt(),
        _ => sum,
    }
}

/// The length of the way through points whose coordinates are in these lists; NaN if there are none.
fn way(parts: &[Vec<f64>]) -> f64 {
    let count = parts.iter().map(Vec::len).min().unwrap_or(0);
    if count == 0 {
        return f64::NAN;
    }
    let step = |i: usize| parts.iter().map(|part| (part[i] - part[i - 1]).powi(2)).sum::<f64>().sqrt();
    (1..count).map(step).sum()
}

/// Roll, pitch and yaw (fixed axes x, y, z, as REP-103 has them) of a quaternion of any length but 0.
fn euler(of: Of, [x, y, z, w]: [f64; 4]) -> f64 {
    let norm = x * x + y * y + z * z + w * w;
    if norm < 1e-12 {
        return f64::NAN;
    }
    match of {
        Of::Roll => libm::atan2(2.0 * (w * x + y * z), norm - 2.0 * (x * x + y * y)),
        Of::Pitch => libm::asin((2.0 * (w * y - z * x) / norm).clamp(-1.0, 1.0)),
        _ => libm::atan2(2.0 * (w * z + x * y), norm - 2.0 * (y * y + z * z)),
    }
}
