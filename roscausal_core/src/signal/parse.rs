//! The text of a signal: name, expression, and what rows hold.

use roscausal_msgs::dynamic::Path;
use serde::{Deserialize, Serialize};

use crate::{Error, Result, middleware::is_token, params::nearest};

/// Longest text of a signal, bytes.
const LONGEST: usize = 1000;
/// Deepest nesting of brackets.
const DEEPEST: usize = 30;
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

/// A comparison or an arithmetic operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Unequal,
}

/// A function by its name.
type Named = (&'static str, fn(f64) -> f64);

/// Functions of one number.
pub(super) const FUNCTIONS: [Named; 7] = [
    ("abs", f64::abs),
    ("sqrt", f64::sqrt),
    ("exp", f64::exp),
    ("log", f64::ln),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("wrap", wrap),
];

/// Functions that go around the whole.
const WHOLE: [&str; 4] = ["hold", "linear", "average", "only"];

/// The angle between -pi and pi.
pub(super) fn wrap(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

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
    /// Index into [`FUNCTIONS`].
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
        if text.len() > LONGEST {
            return Err(fault(format!(
                "a signal of {} characters is too long; allowed: {LONGEST}",
                text.len()
            )));
        }
        let Some((name, expression)) = text.split_once('=') else {
            return Err(fault(format!("'{text}' has no '='; write name = expression, such as '{EXAMPLE}'")));
        };
        let name = name.trim();
        if !is_token(name) || ["time", "t", "timestamp"].contains(&name) || name.starts_with("do_") {
            return Err(fault(format!(
                "'{name}' is not a valid signal name; use letters, digits and '_', such as '{EXAMPLE}'"
            )));
        }
        let expression = expression.trim();
        let mut parser = Parser { text: expression, at: 0, depth: 0, topic: None, memories: 0, only: None };
        let parsed = parser.whole(max_age);
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
        let mut texts: Vec<String> = Vec::new();
        for item in items.iter().flat_map(|item| item.split(';')).filter(|item| !item.trim().is_empty()) {
            let begins = item.split_once('=').is_some_and(|(name, _)| is_token(name.trim()));
            match texts.last_mut() {
                Some(open) if !begins => {
                    open.push(',');
                    open.push_str(item);
                }
                _ => texts.push(item.to_owned()),
            }
        }
        let signals: Vec<Self> =
            texts.iter().map(|text| Self::parse(text, max_age, param)).collect::<Result<_>>()?;
        for (place, signal) in signals.iter().enumerate() {
            if signals[..place].iter().any(|other| other.name == signal.name) {
                return Err(Error::param(param, format!("'{}' is defined twice", signal.name)));
            }
        }
        Ok(signals)
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    topic: Option<String>,
    memories: usize,
    only: Option<Node>,
}

type Parsed<T> = std::result::Result<T, String>;

impl Parser<'_> {
    /// The expression to its end, and what rows hold of it.
    fn whole(&mut self, max_age: f64) -> Parsed<(Node, How)> {
        let parsed = if self.word("hold(") {
            let inner = self.counted()?;
            self.expect(',')?;
            let seconds = self.number()?;
            if !(seconds > 0.0 && seconds <= LONGEST_HOLD_S) {
                return Err("hold(..., seconds) takes more than 0 and at most 1e9 seconds".into());
            }
            self.expect(')')?;
            (inner, How::Hold(seconds))
        } else if self.word("linear(") {
            (self.closed_counted()?, How::Linear)
        } else if self.word("average(") {
            (self.closed_counted()?, How::Average(max_age))
        } else {
            (self.counted()?, How::Hold(max_age))
        };
        self.blanks();
        if self.at < self.text.len() {
            return Err(self.fault(
                "an operator or the end is missing; hold, linear, average and only go around the whole",
            ));
        }
        Ok(parsed)
    }

    /// An expression, and with `only(e, condition)` which messages count.
    fn counted(&mut self) -> Parsed<Node> {
        if !self.word("only(") {
            return self.comparison();
        }
        let inner = self.comparison()?;
        self.expect(',')?;
        self.only = Some(self.closed()?);
        Ok(inner)
    }

    fn closed_counted(&mut self) -> Parsed<Node> {
        let inner = self.counted()?;
        self.expect(')')?;
        Ok(inner)
    }

    fn closed(&mut self) -> Parsed<Node> {
        let inner = self.comparison()?;
        self.expect(')')?;
        Ok(inner)
    }

    fn comparison(&mut self) -> Parsed<Node> {
        let left = self.sum()?;
        let operators = [
            ("<=", Operator::AtMost),
            (">=", Operator::AtLeast),
            ("==", Operator::Equal),
            ("!=", Operator::Unequal),
            ("<", Operator::Less),
            (">", Operator::More),
        ];
        for (sign, operator) in operators {
            if self.word(sign) {
                return Ok(Node::Binary(operator, Box::new(left), Box::new(self.sum()?)));
            }
        }
        Ok(left)
    }

    fn sum(&mut self) -> Parsed<Node> {
        let mut left = self.product()?;
        loop {
            let operator = match () {
                () if self.word("+") => Operator::Plus,
                () if self.word("-") => Operator::Minus,
                () => return Ok(left),
            };
            left = Node::Binary(operator, Box::new(left), Box::new(self.product()?));
        }
    }

    fn product(&mut self) -> Parsed<Node> {
        let mut left = self.sign()?;
        loop {
            let operator = match () {
                () if self.word("*") => Operator::Times,
                () if self.word("/") => Operator::Over,
                () => return Ok(left),
            };
            left = Node::Binary(operator, Box::new(left), Box::new(self.sign()?));
        }
    }

    fn sign(&mut self) -> Parsed<Node> {
        if self.depth >= DEEPEST {
            return Err(self.fault("the brackets are nested too deeply"));
        }
        self.depth += 1;
        let node = if self.word("-") { Node::Negative(Box::new(self.sign()?)) } else { self.atom()? };
        self.depth -= 1;
        Ok(node)
    }

    fn atom(&mut self) -> Parsed<Node> {
        self.blanks();
        match self.rest().chars().next() {
            Some('(') => {
                self.at += 1;
                self.closed()
            }
            Some('/') => self.path().map(Node::Path),
            Some('"' | '\'') => self.quoted().map(Node::Text),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number().map(Node::Number),
            Some(c) if c.is_ascii_alphabetic() => self.named(),
            _ => Err(self.fault("a number, a function or a topic (which begins with '/') is missing")),
        }
    }

    fn named(&mut self) -> Parsed<Node> {
        let begin = self.at;
        let name = self.while_is(|c| c.is_ascii_alphanumeric() || c == '_').to_owned();
        if name == "pi" {
            return Ok(Node::Number(std::f64::consts::PI));
        }
        if !self.word("(") {
            self.at = begin;
            return Err(self
                .fault("a topic begins with '/', such as /cmd_vel.linear.x; a function is followed by '('"));
        }
        let node = match name.as_str() {
            "true" | "false" => return Err(self.fault("write 1 or 0")),
            "hz" | "delay" => {
                let path = self.path()?;
                if !path.0.is_empty() {
                    return Err(format!("{name}() takes a topic without a field"));
                }
                if name == "hz" { Node::Hertz(self.memory()) } else { Node::Delay }
            }
            "rate" => {
                let inner = self.comparison()?;
                Node::Rate(self.memory(), Box::new(inner))
            }
            _ => self.function(&name, begin)?,
        };
        self.expect(')')?;
        Ok(node)
    }

    /// What stands in the brackets of a function.
    fn function(&mut self, name: &str, begin: usize) -> Parsed<Node> {
        if let Some(function) = FUNCTIONS.iter().position(|(known, _)| *known == name) {
            return Ok(Node::Call(function, Box::new(self.comparison()?)));
        }
        let Some((_, of)) = Of::ALL.iter().find(|(known, _)| *known == name) else {
            self.at = begin;
            let known = Of::ALL.iter().map(|(name, _)| *name).chain(FUNCTIONS.map(|(name, _)| name));
            let known: Vec<&str> = known.chain(["rate", "hz", "delay"]).collect();
            let all: Vec<&str> = known.iter().copied().chain(WHOLE).collect();
            let hint = nearest(&all, name).map_or(String::new(), |near| format!("did you mean {near}? "));
            return Err(self.fault(&format!(
                "'{name}' is not a function; {hint}known: {}; around the whole: {}",
                known.join(", "),
                WHOLE.join(", ")
            )));
        };
        let inner = self.comparison()?;
        if matches!(of, Of::Min | Of::Max) && self.word(",") {
            let other = self.comparison()?;
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
    fn path(&mut self) -> Parsed<Path> {
        self.blanks();
        let begin = self.at;
        if !self.rest().starts_with('/') {
            return Err(self.fault("a topic is missing; it begins with '/'"));
        }
        let topic = self.while_is(|c| c.is_ascii_alphanumeric() || "/_".contains(c)).to_owned();
        if !topic.split('/').skip(1).all(is_token) {
            self.at = begin;
            return Err(self.fault(&format!("'{topic}' is not a valid topic name")));
        }
        match &self.topic {
            Some(other) if *other != topic => {
                return Err(format!(
                    "it reads {other} and {topic}; a signal reads one topic, so make each a signal of its own"
                ));
            }
            _ => self.topic = Some(topic),
        }
        if !self.rest().starts_with('.') {
            return Ok(Path::default());
        }
        self.at += 1;
        let rest = self.rest();
        let mut in_brackets = false;
        // A `*` outside of brackets is a product.
        let ends = |c: char| {
            in_brackets = c == '[' || (in_brackets && c != ']');
            !(c.is_ascii_alphanumeric() || "_.[]".contains(c) || (in_brackets && "* ".contains(c)))
        };
        let text = &rest[..rest.find(ends).unwrap_or(rest.len())];
        let path: Path = text.parse()?;
        self.at += text.len();
        Ok(path)
    }

    fn quoted(&mut self) -> Parsed<String> {
        let Some(quote) = self.rest().chars().next() else { return Err(self.fault("a text is missing")) };
        let inner = &self.rest()[1..];
        let end = inner.find(quote).ok_or_else(|| self.fault("the text has no end"))?;
        let text = inner[..end].to_owned();
        self.at += end + 2;
        Ok(text)
    }

    fn number(&mut self) -> Parsed<f64> {
        self.blanks();
        let rest = self.rest();
        let mut end = 0;
        let bytes = rest.as_bytes();
        while end < bytes.len()
            && (bytes[end].is_ascii_alphanumeric()
                || bytes[end] == b'.'
                || (matches!(bytes[end], b'+' | b'-') && end > 0 && matches!(bytes[end - 1], b'e' | b'E')))
        {
            end += 1;
        }
        let value: f64 = rest[..end].parse().map_err(|_| self.fault("a number is missing"))?;
        self.at += end;
        Ok(value)
    }

    fn while_is(&mut self, fits: impl Fn(char) -> bool) -> &str {
        let rest = &self.text[self.at..];
        let word = &rest[..rest.find(|c| !fits(c)).unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    /// Passes `word` if it comes next.
    fn word(&mut self, word: &str) -> bool {
        self.blanks();
        let is_next = self.rest().starts_with(word);
        if is_next {
            self.at += word.len();
        }
        is_next
    }

    fn expect(&mut self, sign: char) -> Parsed<()> {
        if self.word(sign.encode_utf8(&mut [0; 4])) {
            Ok(())
        } else {
            Err(self.fault(&format!("'{sign}' is missing")))
        }
    }

    fn blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn fault(&self, what: &str) -> String {
        format!("{what} (at character {})", self.text[..self.at].chars().count() + 1)
    }
}
