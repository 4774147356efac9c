//! The text of an expression as a tree.

use roscausal_discovery::{Named, names::position};

use super::{DEEPEST, FUNCTIONS, Field, Function, LONGEST_LAG, Node, UNITS, Who};

/// What names stand for.
pub(super) enum Names<'a> {
    /// A person and a robot: `h`, `r.v`.
    Bodies,
    /// Columns of a table.
    Columns(&'a [String]),
    /// Columns that are not known yet; they are gathered.
    Any(&'a mut Vec<String>),
}

/// Reads an expression from left to right, one function for each strength of binding.
pub(super) struct Parser<'a, 'n> {
    text: &'a str,
    names: &'a mut Names<'n>,
    at: usize,
    depth: usize,
}

impl<'a, 'n> Parser<'a, 'n> {
    pub(super) fn new(text: &'a str, names: &'a mut Names<'n>) -> Self {
        Self { text, names, at: 0, depth: 0 }
    }

    /// The whole text as one expression.
    pub(super) fn whole(mut self) -> Result<Node, String> {
        let root = self.sum()?;
        self.blanks();
        if self.at < self.text.len() {
            return Err(self.fault("an operator or the end is missing"));
        }
        Ok(root)
    }

    fn sum(&mut self) -> Result<Node, String> {
        let mut left = self.product()?;
        while let Some(operator) = self.one_of(['+', '-']) {
            left = Node::Binary(operator, Box::new(left), Box::new(self.product()?));
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Node, String> {
        let mut left = self.sign()?;
        while let Some(operator) = self.one_of(['*', '/']) {
            left = Node::Binary(operator, Box::new(left), Box::new(self.sign()?));
        }
        Ok(left)
    }

    /// `-a ^ b` is `-(a ^ b)`, `a ^ -b` is allowed.
    fn sign(&mut self) -> Result<Node, String> {
        self.deeper(|parser| match parser.one_of(['-', '-']) {
            Some(_) => Ok(Node::Negative(Box::new(parser.sign()?))),
            None => parser.power(),
        })
    }

    fn power(&mut self) -> Result<Node, String> {
        let base = self.atom()?;
        match self.one_of(['^', '^']) {
            Some(operator) => Ok(Node::Binary(operator, Box::new(base), Box::new(self.sign()?))),
            None => Ok(base),
        }
    }

    fn atom(&mut self) -> Result<Node, String> {
        self.blanks();
        match self.rest().chars().next() {
            Some('(') => {
                self.at += 1;
                let inner = self.sum()?;
                if self.one_of([',', ',']).is_some() {
                    let second = self.sum()?;
                    self.expect(')')?;
                    return Ok(Node::Pair(Box::new(inner), Box::new(second)));
                }
                self.expect(')')?;
                Ok(inner)
            }
            Some(quote @ ('"' | '`')) if !matches!(self.names, Names::Bodies) => self.quoted(quote),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() => self.named(),
            Some(c) if !matches!(self.names, Names::Bodies) && (c.is_alphabetic() || c == '_') => {
                self.named()
            }
            _ => Err(self.fault("a number, a name or '(' is missing")),
        }
    }

    fn number(&mut self) -> Result<Node, String> {
        let rest = self.rest();
        let mut end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let exponent = rest[end..].strip_prefix(['e', 'E']).map(|tail| {
            let digits = tail.strip_prefix(['+', '-']).unwrap_or(tail);
            let n_digits = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            (n_digits, 1 + tail.len() - digits.len() + n_digits)
        });
        if let Some((1.., length)) = exponent {
            end += length;
        }
        let number: f64 = rest[..end].parse().map_err(|_| self.fault("this is not a number"))?;
        self.at += end;
        Ok(Node::Number(number * self.unit()?))
    }

    /// The unit behind a number; 1 without one.
    fn unit(&mut self) -> Result<f64, String> {
        let before = self.at;
        self.blanks();
        let rest = self.rest();
        let name = &rest[..rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len())];
        if !name.starts_with(char::is_alphabetic) {
            self.at = before;
            return Ok(1.0);
        }
        let Some((name, unit)) = UNITS.iter().find(|(known, _)| *known == name) else {
            let known: Vec<&str> = UNITS.iter().map(|(name, _)| *name).collect();
            return Err(self.fault(&format!("'{name}' is not a unit; units: {}", known.join(", "))));
        };
        self.at += name.len();
        Ok(*unit)
    }

    /// A name in quotes.
    fn quoted(&mut self, quote: char) -> Result<Node, String> {
        let start = self.at;
        let inner = &self.text[start + 1..];
        let Some(length) = inner.find(quote) else { return Err(self.fault("the second quote is missing")) };
        self.at += length + 2;
        self.column(&inner[..length], start)
    }

    fn column(&mut self, name: &str, start: usize) -> Result<Node, String> {
        let found = match self.names {
            Names::Columns(columns) => position(columns, name),
            Names::Any(gathered) => {
                gathered.push(name.to_owned());
                Some(0)
            }
            Names::Bodies => None,
        };
        found.map(Node::Column).ok_or_else(|| {
            self.at = start;
            let columns =
                if let Names::Columns(columns) = self.names { columns.join(", ") } else { String::new() };
            self.fault(&format!("'{name}' is unknown; columns: {columns}"))
        })
    }

    fn named(&mut self) -> Result<Node, String> {
        let start = self.at;
        let word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.');
        let rest = self.rest();
        let name = rest[..rest.find(|c| !word(c)).unwrap_or(rest.len())].to_owned();
        self.at += name.len();
        if self.one_of(['(', '(']).is_some() {
            return self.call(&name, start);
        }
        let known =
            if let Names::Columns(columns) = self.names { position(columns, &name).is_some() } else { false };
        if !matches!(self.names, Names::Bodies) && (known || !matches!(name.as_str(), "t" | "time" | "pi")) {
            return self.column(&name, start);
        }
        let (who, part) = match name.split_once(['.', '_']) {
            _ if name == "t" || (name == "time" && !matches!(self.names, Names::Bodies)) => {
                return Ok(Node::Time);
            }
            _ if name == "pi" => return Ok(Node::Number(std::f64::consts::PI)),
            None => (name.as_str(), None),
            Some((who, part)) => (who, Some(part)),
        };
        let who = match who {
            "h" => Some(Who::Human),
            "r" => Some(Who::Robot),
            _ => None,
        };
        let field = |part: &str| Field::ALL.into_iter().find(|field| field.name() == part);
        let node = who.and_then(|who| match part {
            None => Some(Node::Place(who)),
            Some("goal") => Some(Node::Goal(who)),
            Some("vel") => Some(Node::Velocity(who)),
            Some(part) => Some(Node::Field(who, field(part)?)),
        });
        node.ok_or_else(|| {
            self.at = start;
            let known = "h, r, h.goal, h.vel, h.x, h.y, h.theta, h.v, h.omega (r. likewise), t, pi";
            self.fault(&format!("'{name}' is unknown; known: {known}"))
        })
    }

    fn call(&mut self, name: &str, start: usize) -> Result<Node, String> {
        let Some(function) = FUNCTIONS.iter().position(|(known, ..)| *known == name) else {
            self.at = start;
            let known: Vec<&str> = FUNCTIONS.iter().map(|(name, ..)| *name).collect();
            return Err(self.fault(&format!("there is no function '{name}'; known: {}", known.join(", "))));
        };
        // A row that was recorded just now is computed from it and the row before it alone.
        let looks_back =
            matches!(FUNCTIONS[function].2, Function::Lag | Function::Difference | Function::Rate);
        if looks_back && matches!(self.names, Names::Bodies) {
            self.at = start;
            return Err(self.fault(&format!("{name}() is for the columns of a table ({})", Named("feature"))));
        }
        let mut arguments = vec![self.sum()?];
        while self.one_of([',', ',']).is_some() {
            arguments.push(self.sum()?);
        }
        self.expect(')')?;
        if matches!(FUNCTIONS[function].2, Function::Norm | Function::Angle) && arguments.len() == 2 {
            let second = arguments.pop().map(Box::new);
            let first = arguments.pop().map(Box::new);
            arguments.extend(first.zip(second).map(|(x, y)| Node::Pair(x, y)));
        }
        if matches!(FUNCTIONS[function].2, Function::Lag) {
            return match (arguments.pop(), arguments.pop(), arguments.is_empty()) {
                (Some(Node::Number(rows)), Some(inner), true)
                    if rows.fract() == 0.0 && (1.0..=LONGEST_LAG as f64).contains(&rows) =>
                {
                    Ok(Node::Lagged(Box::new(inner), rows as usize))
                }
                _ => {
                    self.at = start;
                    Err(self.fault("lag() takes an expression and a whole number of rows, such as lag(x, 2)"))
                }
            };
        }
        let wanted = FUNCTIONS[function].1;
        if arguments.len() != wanted {
            self.at = start;
            return Err(self.fault(&format!("{name}() takes {wanted} arguments, not {}", arguments.len())));
        }
        Ok(Node::Call(function, arguments))
    }

    fn deeper(&mut self, inner: impl FnOnce(&mut Self) -> Result<Node, String>) -> Result<Node, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.fault("too many brackets within brackets"));
        }
        let node = inner(self);
        self.depth -= 1;
        node
    }

    fn one_of(&mut self, wanted: [char; 2]) -> Option<char> {
        self.blanks();
        let found = self.rest().chars().next().filter(|c| wanted.contains(c))?;
        self.at += found.len_utf8();
        Some(found)
    }

    fn expect(&mut self, wanted: char) -> Result<(), String> {
        match self.one_of([wanted, wanted]) {
            Some(_) => Ok(()),
            None => Err(self.fault(&format!("'{wanted}' is missing"))),
        }
    }

    fn blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    fn rest(&self) -> &str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn fault(&self, reason: &str) -> String {
        format!("'{}', character {}: {reason}", self.text, self.at + 1)
    }
}
