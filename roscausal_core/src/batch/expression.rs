//! The small expressions that define features: `dist(h, h.goal)`, `abs(h_v - r_v) / 2`.
//!
//! Values are numbers or points (`x, y`). `h` and `r` are the positions of person and robot. `h.goal` and `h.vel`
//! are points; `h.x`, `h.y`, `h.theta`, `h.v`, `h.omega`, `h.gx` and `h.gy` are numbers, also written as `h_v` and
//! so on; likewise for `r`. `t` is the time in seconds, `pi` the number. Operators are `+ - * / ^` and brackets. A
//! result that is not finite, such as a division by zero, becomes NaN, a missing value.
//!
//! Why not a library: `exmex` 0.21 and `fasteval` 0.2 compute with numbers of one kind, so the points, the names such as
//! `h.goal`, and the messages that name the character and what is known there would be ours all the same; `evalexpr` 13
//! has a licence (AGPL) that a robot's maker could not use.

use super::tracks::{Field, Values};

/// Functions, the number of their arguments, and their results.
const FUNCTIONS: [(&str, usize, Function); 17] = [
    ("dist", 2, Function::Distance),
    ("speed", 1, Function::Speed),
    ("norm", 1, Function::Norm),
    ("angle", 1, Function::Angle),
    ("dot", 2, Function::Dot),
    ("cross", 2, Function::Cross),
    ("risk", 2, Function::Risk),
    ("abs", 1, Function::Number(f64::abs)),
    ("sqrt", 1, Function::Number(f64::sqrt)),
    ("exp", 1, Function::Number(f64::exp)),
    ("log", 1, Function::Number(f64::ln)),
    ("sin", 1, Function::Number(f64::sin)),
    ("cos", 1, Function::Number(f64::cos)),
    ("wrap", 1, Function::Number(wrap)),
    ("min", 2, Function::Pair(|a, b| known(a, b, f64::min))),
    ("max", 2, Function::Pair(|a, b| known(a, b, f64::max))),
    ("atan2", 2, Function::Pair(f64::atan2)),
];
/// `of` the two, if both are known: `f64::min` and `f64::max` leave out what is not.
fn known(a: f64, b: f64, of: fn(f64, f64) -> f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { of(a, b) }
}

/// Deepest nesting of brackets.
const DEEPEST: usize = 50;
/// Longest expression in bytes: each `+` adds a level to the recursive evaluation.
const LONGEST: usize = 2000;

/// A checked expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    root: Node,
}

/// The inputs of an expression: one row of one person.
#[derive(Clone, Copy)]
pub struct Scope<'a> {
    /// Seconds.
    pub time: f64,
    /// The robot.
    pub robot: &'a Values,
    /// The person.
    pub human: &'a Values,
    /// The risk that the first body collides with the second, in this row or in an earlier one.
    pub risk: &'a dyn Fn(Who, Who) -> f64,
}

#[derive(Clone, Copy, Debug)]
enum Function {
    Distance,
    Speed,
    Norm,
    Angle,
    Dot,
    Cross,
    Risk,
    Number(fn(f64) -> f64),
    Pair(fn(f64, f64) -> f64),
}

#[derive(Clone, Debug, PartialEq)]
enum Node {
    Number(f64),
    Time,
    Field(Who, Field),
    Place(Who),
    Goal(Who),
    Velocity(Who),
    Negative(Box<Node>),
    Binary(char, Box<Node>, Box<Node>),
    /// Index into [`FUNCTIONS`].
    Call(usize, Vec<Node>),
}

/// Whom a name is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    /// The person.
    Human,
    /// The robot.
    Robot,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Number,
    Point,
}

impl Expression {
    /// Parses and checks an expression whose value is a number.
    ///
    /// # Errors
    /// What is wrong and where (counted from 1), and which names are known.
    pub fn parse(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST {
            return Err(format!(
                "an expression of {} characters is too long; allowed: {LONGEST}",
                text.len()
            ));
        }
        let mut parser = Parser { text, at: 0, depth: 0 };
        let root = parser.sum()?;
        parser.blanks();
        if parser.at < text.len() {
            return Err(parser.fault("an operator or the end is missing"));
        }
        match root.kind()? {
            Kind::Number => Ok(Self { root }),
            Kind::Point => {
                Err(format!("'{text}' is a point, not a number; try dist(...), norm(...) or speed(h)"))
            }
        }
    }

    /// Whether it uses anything of a person.
    pub fn mentions_human(&self) -> bool {
        self.root.mentions_human()
    }

    /// The value; NaN if it is not finite.
    pub fn value(&self, scope: &Scope<'_>) -> f64 {
        let value = self.root.number(scope);
        if value.is_finite() { value } else { f64::NAN }
    }
}

impl Node {
    fn kind(&self) -> Result<Kind, String> {
        match self {
            Self::Number(_) | Self::Time | Self::Field(..) => Ok(Kind::Number),
            Self::Place(_) | Self::Goal(_) | Self::Velocity(_) => Ok(Kind::Point),
            Self::Negative(inner) => inner.kind(),
            Self::Binary(operator, a, b) => match (operator, a.kind()?, b.kind()?) {
                (_, Kind::Number, Kind::Number) => Ok(Kind::Number),
                ('+' | '-', Kind::Point, Kind::Point)
                | ('*' | '/', Kind::Point, Kind::Number)
                | ('*', Kind::Number, Kind::Point) => Ok(Kind::Point),
                (operator, ..) => Err(format!("'{operator}' does not go with a point here")),
            },
            Self::Call(function, arguments) => {
                let (name, _, function) = FUNCTIONS[*function];
                let (kind, wanted) = match function {
                    Function::Number(_) | Function::Pair(_) => (Kind::Number, "numbers"),
                    Function::Speed | Function::Risk => {
                        let bodies = arguments.iter().all(|node| matches!(node, Self::Place(_)));
                        return if bodies { Ok(Kind::Number) } else { Err(format!("{name}() takes h or r")) };
                    }
                    _ => (Kind::Point, "points"),
                };
                for argument in arguments {
                    if argument.kind()? != kind {
                        return Err(format!("{name}() takes {wanted}"));
                    }
                }
                Ok(Kind::Number)
            }
        }
    }

    fn mentions_human(&self) -> bool {
        match self {
            Self::Number(_) | Self::Time => false,
            Self::Field(who, _) | Self::Place(who) | Self::Goal(who) | Self::Velocity(who) => {
                *who == Who::Human
            }
            Self::Negative(inner) => inner.mentions_human(),
            Self::Binary(_, a, b) => a.mentions_human() || b.mentions_human(),
            Self::Call(_, arguments) => arguments.iter().any(Self::mentions_human),
        }
    }

    fn number(&self, scope: &Scope<'_>) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Time => scope.time,
            Self::Field(who, field) => scope.values(*who).get(*field),
            Self::Negative(inner) => -inner.number(scope),
            Self::Binary(operator, a, b) => arithmetic(*operator, a.number(scope), b.number(scope)),
            Self::Call(function, arguments) => call(FUNCTIONS[*function].2, arguments, scope),
            Self::Place(_) | Self::Goal(_) | Self::Velocity(_) => f64::NAN,
        }
    }

    fn point(&self, scope: &Scope<'_>) -> (f64, f64) {
        match self {
            Self::Place(who) => (scope.values(*who).x, scope.values(*who).y),
            Self::Goal(who) => (scope.values(*who).gx, scope.values(*who).gy),
            Self::Velocity(who) => {
                let body = scope.values(*who).body();
                (body.vx, body.vy)
            }
            Self::Negative(inner) => {
                let (x, y) = inner.point(scope);
                (-x, -y)
            }
            Self::Binary(operator @ ('+' | '-'), a, b) => {
                let (a, b) = (a.point(scope), b.point(scope));
                (arithmetic(*operator, a.0, b.0), arithmetic(*operator, a.1, b.1))
            }
            Self::Binary(operator, a, b) => {
                let ((x, y), factor) = match a.kind() {
                    Ok(Kind::Point) => (a.point(scope), b.number(scope)),
                    _ => (b.point(scope), a.number(scope)),
                };
                (arithmetic(*operator, x, factor), arithmetic(*operator, y, factor))
            }
            _ => (f64::NAN, f64::NAN),
        }
    }
}

impl Scope<'_> {
    fn values(&self, who: Who) -> &Values {
        match who {
            Who::Human => self.human,
            Who::Robot => self.robot,
        }
    }
}

fn call(function: Function, arguments: &[Node], scope: &Scope<'_>) -> f64 {
    let number = |i: usize| arguments.get(i).map_or(f64::NAN, |node| node.number(scope));
    let point = |i: usize| arguments.get(i).map_or((f64::NAN, f64::NAN), |node| node.point(scope));
    match function {
        Function::Number(f) => f(number(0)),
        Function::Pair(f) => f(number(0), number(1)),
        Function::Speed => match arguments {
            [Node::Place(who)] => scope.values(*who).body().speed(),
            _ => f64::NAN,
        },
        Function::Risk => match arguments {
            [Node::Place(who), Node::Place(other)] => (scope.risk)(*who, *other),
            _ => f64::NAN,
        },
        Function::Norm => point(0).0.hypot(point(0).1),
        Function::Angle => point(0).1.atan2(point(0).0),
        Function::Distance => (point(0).0 - point(1).0).hypot(point(0).1 - point(1).1),
        Function::Dot => point(0).0 * point(1).0 + point(0).1 * point(1).1,
        Function::Cross => point(0).0 * point(1).1 - point(0).1 * point(1).0,
    }
}

fn arithmetic(operator: char, a: f64, b: f64) -> f64 {
    match operator {
        '+' => a + b,
        '-' => a - b,
        '*' => a * b,
        '/' if b == 0.0 => f64::NAN,
        '/' => a / b,
        _ => a.powf(b),
    }
}

/// The angle between -pi and pi.
fn wrap(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
}

impl Parser<'_> {
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
                self.expect(')')?;
                Ok(inner)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() => self.named(),
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
        let number = rest[..end].parse().map_err(|_| self.fault("this is no number"))?;
        self.at += end;
        Ok(Node::Number(number))
    }

    fn named(&mut self) -> Result<Node, String> {
        let start = self.at;
        let word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.');
        let rest = self.rest();
        let name = rest[..rest.find(|c| !word(c)).unwrap_or(rest.len())].to_owned();
        self.at += name.len();
        if self.one_of(['(', '(']).is_some() {
            return self.call(&name, start);
        }
        let (who, part) = match name.split_once(['.', '_']) {
            _ if name == "t" => return Ok(Node::Time),
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
        let mut arguments = vec![self.sum()?];
        while self.one_of([',', ',']).is_some() {
            arguments.push(self.sum()?);
        }
        self.expect(')')?;
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

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: Values = Values::from_array([0.0, 0.0, 4.0, 3.0, 0.0, 0.5, 0.0]);
    const HUMAN: Values = Values::from_array([1.0, 1.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 2.0, 0.1]);

    fn value(text: &str) -> f64 {
        let speed = |who| if who == Who::Human { HUMAN.body().speed() } else { ROBOT.body().speed() };
        let risk = |a, b| speed(a) + 10.0 * speed(b);
        let scope = Scope { time: 7.0, robot: &ROBOT, human: &HUMAN, risk: &risk };
        Expression::parse(text).unwrap_or_else(|e| panic!("{e}")).value(&scope)
    }

    #[test]
    fn expressions_have_the_values_of_arithmetic() {
        for (text, expected) in [
            ("1 + 2 * 3 - 4 / 2", 5.0),
            ("-2 ^ 2", -4.0),
            ("2 ^ -1 ^ 2", 0.5),
            ("(1 + 2) * 3", 9.0),
            ("1e-2 + 1.5E+1", 15.01),
            ("2 - 3 - 4", -5.0),
            ("dist(h, r)", 5.0),
            ("dist(h, h.goal)", 2f64.sqrt()),
            ("norm(h.vel - r.vel)", 4.25f64.sqrt()),
            ("speed(h)", 2.0),
            ("h_v + r.v * t", 5.5),
            ("abs(r_x - h_x) / 2", 2.0),
            ("dot(h.vel, r - h) / dist(h, r)", 1.2),
            ("norm(2 * r / 5)", 2.0),
            ("risk(h, r)", 7.0),
            ("max(1, min(5, 3))", 3.0),
            ("wrap(2 * pi + h.theta)", std::f64::consts::FRAC_PI_2),
        ] {
            assert!((value(text) - expected).abs() < 1e-12, "{text} is {}", value(text));
        }
    }

    #[test]
    fn what_is_not_finite_is_missing() {
        for text in ["1 / 0", "1 / (h.x - h_x)", "log(0)", "sqrt(0 - 1)", "exp(1000)", "2 ^ 100000"] {
            assert!(value(text).is_nan(), "{text}");
        }
    }

    #[test]
    fn a_fault_names_the_place_and_what_is_known() {
        for (text, part) in [
            ("h.v + velocity", "character 7: 'velocity' is unknown; known: h, r"),
            ("distance(h, r)", "no function 'distance'; known: dist"),
            ("dist(h)", "takes 2 arguments, not 1"),
            ("dist(h, 3)", "dist() takes points"),
            ("abs(h)", "abs() takes numbers"),
            ("h + 1", "'+' does not go with a point"),
            ("h - r", "is a point, not a number"),
            ("(1 + 2", "')' is missing"),
            ("1 2", "an operator or the end is missing"),
            ("", "a number, a name or '(' is missing"),
            ("1 + é", "is missing"),
            ("1..2", "this is no number"),
        ] {
            let fault = Expression::parse(text).expect_err(text);
            assert!(fault.contains(part), "{text}: {fault}");
        }
        assert!(Expression::parse(&"(".repeat(100_000)).is_err());
        assert!(Expression::parse(&"-".repeat(100_000)).is_err());
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "[hr.vxgoal_ ()+*/^,0-9e-]{0,40}") {
            let _ = Expression::parse(&text);
        }
    }
}
