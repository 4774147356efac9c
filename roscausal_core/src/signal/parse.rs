//! The text of a signal: name, expression, and what rows hold.

use roscausal_msgs::dynamic::Path;
use serde::{Deserialize, Serialize};

use crate::{
    Error, Result, ensure,
    grammar::{FUNCTIONS, Language, Operator, Parsed, Scanner, rejoined},
    middleware::is_token,
    params::nearest,
};

/// Longest text of a signal, bytes.
const LONGEST: usize = 1000;
/// The longest that a value may be held, seconds: 30 years.
const LONGEST_HOLD_S: f64 = 1e9;
/// An example, for errors.
const EXAMPLE: &str = "v_cmd = /cmd_vel.linear.x";

/// What a row holds of a signal's values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum How {
    /// The last value, for at most this many seconds.
    Hold(f64),
    /// What lies between the value before and the value after, if they are at most `max_gap` apart.
    Linear,
    /// The mean of the values since the row before; without any, the last value for at most this many seconds.
    Average(f64),
}

/// A named signal of one topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Column name.
    pub name: String,
    /// The topic that it reads, such as `/cmd_vel`.
    pub topic: String,
    /// What rows hold.
    pub how: How,
    pub(super) root: Node,
    /// Only messages count in which this is not 0.
    pub(super) only: Option<Node>,
    /// Places where an evaluation remembers the message before.
    pub(super) memories: usize,
    /// The expression as written.
    pub(super) text: String,
}

/// What is computed from the numbers at a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    Count,
    Sum,
    Mean,
    Min,
    Max,
    Norm,
    Length,
    Roll,
    Pitch,
    Yaw,
}

impl Of {
    /// Their names.
    pub(super) const ALL: [(&'static str, Self); 10] = [
        ("count", Self::Count),
        ("sum", Self::Sum),
        ("mean", Self::Mean),
        ("min", Self::Min),
        ("max", Self::Max),
        ("norm", Self::Norm),
        ("length", Self::Length),
        ("roll", Self::Roll),
        ("pitch", Self::Pitch),
        ("yaw", Self::Yaw),
    ];
}

/// Functions that go around the whole.
const WHOLE: [&str; 4] = ["hold", "linear", "average", "only"];

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Number(f64),
    Text(String),
    Path(Path),
    Of(Of, Path),
    /// Messages per second; the number is that of its memory.
    Hertz(usize),
    Delay,
    Rate(usize, Box<Node>),
    Negative(Box<Node>),
    Binary(Operator, Box<Node>, Box<Node>),
    /// A function of a number, by its number.
    Call(usize, Box<Node>),
    /// The smaller of two; or the larger.
    Pair(bool, Box<Node>, Box<Node>),
}

impl Signal {
    /// A signal from `name = expression`. Values are held for `max_age` seconds unless it says otherwise.
    ///
    /// # Errors
    /// What is wrong and where, as an error of `param`.
    pub fn parse(text: &str, max_age: f64, param: &str) -> Result<Self> {
        let fault = |reason: String| Error::param(param, reason);
        let length = text.len();
        ensure(length <= LONGEST, || {
            fault(format!("a signal of {length} characters is too long; allowed: {LONGEST}"))
        })?;
        let Some((name, expression)) = text.split_once('=') else {
            return Err(fault(format!("'{text}' has no '='; write name = expression, such as '{EXAMPLE}'")));
        };
        let name = name.trim();
        ensure(
            is_token(name) && !["time", "t", "timestamp"].contains(&name) && !name.starts_with("do_"),
            || {
                fault(format!(
                    "'{name}' is not a valid signal name; use letters, digits and '_', such as '{EXAMPLE}'"
                ))
            },
        )?;
        let expression = expression.trim();
        let mut parser = Fields { topic: None, memories: 0, only: None };
        let parsed = parser.whole(&mut Scanner::new(expression), max_age);
        let (root, how) = parsed.map_err(|reason| fault(format!("{name} = {expression}: {reason}")))?;
        let topic = parser.topic.ok_or_else(|| {
            fault(format!("{name} = {expression}: it names no topic; write such as '{EXAMPLE}'"))
        })?;
        let (name, text) = (name.to_owned(), expression.to_owned());
        Ok(Self { name, topic, how, root, only: parser.only, memories: parser.memories, text })
    }

    /// Signals from a list that may have been cut at commas: an item without `name =` continues the one before.
    ///
    /// # Errors
    /// A bad signal, or a name that occurs twice.
    pub fn parse_all(items: &[String], max_age: f64, param: &str) -> Result<Vec<Self>> {
        let begins = |item: &str| item.split_once('=').is_some_and(|(name, _)| is_token(name.trim()));
        let texts = rejoined(items, begins);
        let signals: Vec<Self> =
            texts.iter().map(|text| Self::parse(text, max_age, param)).collect::<Result<_>>()?;
        for (place, signal) in signals.iter().enumerate() {
            ensure(signals[..place].iter().all(|other| other.name != signal.name), || {
                Error::param(param, format!("'{}' is defined twice", signal.name))
            })?;
        }
        Ok(signals)
    }
}

/// The fields of one topic, as an expression names them.
struct Fields {
    topic: Option<String>,
    memories: usize,
    only: Option<Node>,
}

impl Language for Fields {
    type Node = Node;

    fn atom(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        match text.next() {
            Some('(') => text.expect("(").and_then(|()| self.closed(text)),
            Some('/') => self.path(text).map(Node::Path),
            Some('"' | '\'') => Ok(Node::Text(text.quoted()?.to_owned())),
            Some(c) if c.is_ascii_digit() || c == '.' => text.number().map(Node::Number),
            Some(c) if c.is_ascii_alphabetic() => self.named(text),
            _ => Err(text.fault("a number, a function or a topic (which begins with '/') is missing")),
        }
    }

    fn negative(inner: Node) -> Node {
        Node::Negative(Box::new(inner))
    }

    fn binary(operator: Operator, left: Node, right: Node) -> Node {
        Node::Binary(operator, Box::new(left), Box::new(right))
    }
}

impl Fields {
    /// The expression to its end, and what rows hold of it.
    fn whole(&mut self, text: &mut Scanner<'_>, max_age: f64) -> Parsed<(Node, How)> {
        let parsed = if text.word("hold(") {
            let inner = self.counted(text)?;
            text.expect(",")?;
            let seconds = text.number()?;
            let reason = "hold(..., seconds) takes more than 0 and at most 1e9 seconds";
            ensure(seconds > 0.0 && seconds <= LONGEST_HOLD_S, || reason)?;
            text.expect(")")?;
            (inner, How::Hold(seconds))
        } else if text.word("linear(") {
            (self.closed_counted(text)?, How::Linear)
        } else if text.word("average(") {
            (self.closed_counted(text)?, How::Average(max_age))
        } else {
            (self.counted(text)?, How::Hold(max_age))
        };
        text.end("an operator or the end is missing; hold, linear, average and only go around the whole")?;
        Ok(parsed)
    }

    /// An expression, and with `only(e, condition)` which messages count.
    fn counted(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        if !text.word("only(") {
            return self.expression(text);
        }
        let inner = self.expression(text)?;
        text.expect(",")?;
        self.only = Some(self.closed(text)?);
        Ok(inner)
    }

    fn closed_counted(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        let inner = self.counted(text)?;
        text.expect(")")?;
        Ok(inner)
    }

    fn closed(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        let inner = self.expression(text)?;
        text.expect(")")?;
        Ok(inner)
    }

    fn named(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        let begin = text.at;
        let name = text.while_is(|c| c.is_ascii_alphanumeric() || c == '_');
        if name == "pi" {
            return Ok(Node::Number(std::f64::consts::PI));
        }
        let reason = "a topic begins with '/', such as /cmd_vel.linear.x; a function is followed by '('";
        ensure(text.word("("), || text.fault_at(begin, reason))?;
        let node = match name {
            "true" | "false" => return Err(text.fault("write 1 or 0")),
            "hz" | "delay" => {
                let path = self.path(text)?;
                ensure(path.0.is_empty(), || format!("{name}() takes a topic without a field"))?;
                if name == "hz" { Node::Hertz(self.memory()) } else { Node::Delay }
            }
            "rate" => {
                let inner = self.expression(text)?;
                Node::Rate(self.memory(), Box::new(inner))
            }
            _ => self.function(name, text, begin)?,
        };
        text.expect(")")?;
        Ok(node)
    }

    /// What stands in the brackets of a function.
    fn function(&mut self, name: &str, text: &mut Scanner<'_>, begin: usize) -> Parsed<Node> {
        if let Some(function) = FUNCTIONS.iter().position(|(known, _)| *known == name) {
            return Ok(Node::Call(function, Box::new(self.expression(text)?)));
        }
        let Some((_, of)) = Of::ALL.iter().find(|(known, _)| *known == name) else {
            let known = Of::ALL.iter().map(|(name, _)| *name).chain(FUNCTIONS.map(|(name, _)| name));
            let known: Vec<&str> = known.chain(["rate", "hz", "delay"]).collect();
            let all: Vec<&str> = known.iter().copied().chain(WHOLE).collect();
            let hint = nearest(&all, name).map_or(String::new(), |near| format!("did you mean {near}? "));
            let (known, whole) = (known.join(", "), WHOLE.join(", "));
            let reason =
                format!("'{name}' is not a function; {hint}known: {known}; around the whole: {whole}");
            return Err(text.fault_at(begin, &reason));
        };
        let inner = self.expression(text)?;
        if matches!(of, Of::Min | Of::Max) && text.word(",") {
            let other = self.expression(text)?;
            return Ok(Node::Pair(*of == Of::Min, Box::new(inner), Box::new(other)));
        }
        match inner {
            Node::Path(path) if !path.0.is_empty() => Ok(Node::Of(*of, path)),
            _ => Err(format!("{name}() takes a field, such as {name}(/topic.field)")),
        }
    }

    fn memory(&mut self) -> usize {
        self.memories += 1;
        self.memories - 1
    }

    /// `/topic.field.field`. The path is empty for a topic alone.
    fn path(&mut self, text: &mut Scanner<'_>) -> Parsed<Path> {
        ensure(text.next() == Some('/'), || text.fault("a topic is missing; it begins with '/'"))?;
        let begin = text.at;
        let topic = text.while_is(|c| c.is_ascii_alphanumeric() || "/_".contains(c)).to_owned();
        let legal = topic.split('/').skip(1).all(is_token);
        ensure(legal, || text.fault_at(begin, &format!("'{topic}' is not a valid topic name")))?;
        match &self.topic {
            Some(other) if *other != topic => {
                return Err(format!(
                    "it reads {other} and {topic}; a signal reads one topic, so make each a signal of its own"
                ));
            }
            _ => self.topic = Some(topic),
        }
        let Some(rest) = text.ahead().strip_prefix('.') else { return Ok(Path::default()) };
        let mut in_brackets = false;
        // A `*` outside of brackets is a product.
        let ends = |c: char| {
            in_brackets = c == '[' || (in_brackets && c != ']');
            !(c.is_ascii_alphanumeric() || "_.[]".contains(c) || (in_brackets && "* ".contains(c)))
        };
        let fields = &rest[..rest.find(ends).unwrap_or(rest.len())];
        let path: Path = fields.parse()?;
        text.at += 1 + fields.len();
        Ok(path)
    }
}
