//! The small expressions that define features: `dist(h, h.goal)`, `abs(h_v - r_v) / 2`.
//!
//! Values are numbers or points (`x, y`). `h` and `r` are the positions of person and robot. `h.goal` and `h.vel`
//! are points; `h.x`, `h.y`, `h.theta`, `h.v`, `h.omega`, `h.gx` and `h.gy` are numbers, also written as `h_v` and
//! so on; likewise for `r`. `t` is the time in seconds, `pi` the number. Operators are `+ - * / ^` and brackets; comparisons
//! `< <= > >= == !=` are 1 or 0. A result that is not finite, such as a division by zero, becomes NaN, a missing value.
//!
//! In a table (`--feature`), names are columns instead of bodies; odd ones stand in quotes: `"Time [s]"`. `(a, b)` is a point,
//! `lag(x, 2)` is x two rows earlier, `diff(x)` its change since the row before, `rate(x)` that change per second. A number may
//! carry a unit, and is then in SI units: `30 deg`, `5 kmh`, `250 ms`; so `heading * 1 deg` is in radians.
//!
//! Why not a library: `exmex` 0.21 and `fasteval` 0.2 compute with numbers of one kind, so the points, the names such as
//! `h.goal`, and the messages that name the character and what is known there would be ours all the same; `evalexpr` 13
//! has a licence (AGPL) that a robot's maker could not use.

mod parser;
mod unit;

use super::tracks::{Field, Values};
use crate::ensure;
use crate::grammar::{self, Language, Operator, Scanner};
use parser::Names;

/// Functions of other things than one number, the number of their arguments, and their results.
const FUNCTIONS: [(&str, usize, Function); 13] = [
    ("dist", 2, Function::Distance),
    ("speed", 1, Function::Speed),
    ("norm", 1, Function::Norm),
    ("angle", 1, Function::Angle),
    ("dot", 2, Function::Dot),
    ("cross", 2, Function::Cross),
    ("risk", 2, Function::Risk),
    ("lag", 2, Function::Lag),
    ("diff", 1, Function::Difference),
    ("rate", 1, Function::Rate),
    ("min", 2, Function::Pair(|a, b| known(a, b, f64::min))),
    ("max", 2, Function::Pair(|a, b| known(a, b, f64::max))),
    ("atan2", 2, Function::Pair(libm::atan2)),
];

/// A function by its number: first [`FUNCTIONS`], then those of one number.
fn function(number: usize) -> (&'static str, usize, Function) {
    let of_number = || {
        let (name, of) = grammar::FUNCTIONS[number - FUNCTIONS.len()];
        (name, 1, Function::Number(of))
    };
    FUNCTIONS.get(number).copied().unwrap_or_else(of_number)
}

/// `of` the two, if both are known: `f64::min` and `f64::max` leave out what is not.
fn known(a: f64, b: f64, of: fn(f64, f64) -> f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { of(a, b) }
}

/// Most rows that a value may lie back.
const LONGEST_LAG: usize = 1_000_000;

/// Deepest nesting of `diff` and `rate`: each one doubles the work of a row.
const DEEPEST_CHANGE: usize = 8;
/// A point that is not known.
const NOWHERE: (f64, f64) = (f64::NAN, f64::NAN);
/// Longest expression in bytes: each `+` adds a level to the recursive evaluation.
const LONGEST: usize = 2000;

/// A checked expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    root: Node,
}

/// What an expression is evaluated on: one row of a batch or a table. What it does not say is not known.
pub trait Moment: Sized {
    /// Seconds.
    fn time(&self) -> f64 {
        f64::NAN
    }
    /// What is known of a body.
    fn body(&self, _who: Who) -> &Values {
        &Values::UNKNOWN
    }
    /// The risk that the first body collides with the second.
    fn risk(&self, _a: Who, _b: Who) -> f64 {
        f64::NAN
    }
    /// The value of a column of a table.
    fn cell(&self, _column: usize) -> f64 {
        f64::NAN
    }
    /// The row that lies this many rows earlier, if there is one.
    fn earlier(&self, _rows: usize) -> Option<Self> {
        None
    }
}

#[derive(Clone, Copy, Debug)]
enum Function {
    Lag,
    Difference,
    Rate,
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
    /// A column of a table.
    Column(usize),
    Pair(Box<Node>, Box<Node>),
    /// The same, this many rows earlier.
    Lagged(Box<Node>, usize),
    Negative(Box<Node>),
    Binary(Operator, Box<Node>, Box<Node>),
    /// A function by its number.
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
        Self::with_names(text, &mut Names::Bodies)
    }

    /// Parses and checks an expression about the columns of a table.
    ///
    /// # Errors
    /// As [`Expression::parse`].
    pub fn of_columns(text: &str, columns: &[String]) -> Result<Self, String> {
        Self::with_names(text, &mut Names::Columns(columns))
    }

    /// The names of columns in an expression about a table.
    ///
    /// # Errors
    /// As [`Expression::parse`], apart from unknown names.
    pub fn names_in(text: &str) -> Result<Vec<String>, String> {
        let mut found = Vec::new();
        Self::with_names(text, &mut Names::Any(&mut found))?;
        Ok(found)
    }

    fn with_names(text: &str, names: &mut Names<'_>) -> Result<Self, String> {
        let length = text.len();
        ensure(length <= LONGEST, || {
            format!("an expression of {length} characters is too long; allowed: {LONGEST}")
        })?;
        let mut scanner = Scanner::new(text);
        let parsed = names.expression(&mut scanner).and_then(|root| {
            scanner.end("an operator or the end is missing")?;
            Ok(root)
        });
        let root = parsed.map_err(|fault| format!("'{text}', {fault}"))?;
        ensure(root.changes() <= DEEPEST_CHANGE, || {
            format!("'{text}' has more than {DEEPEST_CHANGE} diff() and rate() within each other")
        })?;
        ensure(root.kind()? != Kind::Point, || {
            format!("'{text}' is a point, not a number; try dist(...), norm(...) or speed(h)")
        })?;
        Ok(Self { root })
    }

    /// Whether it needs to know what time it is.
    pub fn mentions_time(&self) -> bool {
        self.root.any(&|node| match node {
            Node::Time => true,
            Node::Call(number, _) => matches!(function(*number).2, Function::Rate),
            _ => false,
        })
    }

    /// Whether it uses anything of a person.
    pub fn mentions_human(&self) -> bool {
        self.root.any(&|node| match node {
            Node::Field(who, _) | Node::Place(who) | Node::Goal(who) | Node::Velocity(who) => {
                *who == Who::Human
            }
            _ => false,
        })
    }

    /// The value; NaN if it is not finite.
    pub fn value(&self, row: &impl Moment) -> f64 {
        let value = self.root.number(row);
        if value.is_finite() { value } else { f64::NAN }
    }
}

impl Node {
    fn kind(&self) -> Result<Kind, String> {
        match self {
            Self::Number(_) | Self::Time | Self::Field(..) | Self::Column(_) => Ok(Kind::Number),
            Self::Place(_) | Self::Goal(_) | Self::Velocity(_) => Ok(Kind::Point),
            Self::Negative(inner) | Self::Lagged(inner, _) => inner.kind(),
            Self::Pair(a, b) => match (a.kind()?, b.kind()?) {
                (Kind::Number, Kind::Number) => Ok(Kind::Point),
                _ => Err("a point is made of two numbers, such as (x, y)".into()),
            },
            Self::Binary(operator, a, b) => match (operator, a.kind()?, b.kind()?) {
                (_, Kind::Number, Kind::Number) => Ok(Kind::Number),
                (Operator::Plus | Operator::Minus, Kind::Point, Kind::Point)
                | (Operator::Times | Operator::Over, Kind::Point, Kind::Number)
                | (Operator::Times, Kind::Number, Kind::Point) => Ok(Kind::Point),
                (operator, ..) => Err(format!("'{}' does not go with a point here", operator.sign())),
            },
            Self::Call(number, arguments) => {
                let (name, _, function) = function(*number);
                let (kind, wanted) = match function {
                    Function::Difference => return arguments.first().map_or(Ok(Kind::Number), Self::kind),
                    Function::Number(_) | Function::Pair(_) | Function::Rate => (Kind::Number, "numbers"),
                    Function::Speed | Function::Risk => {
                        let bodies = arguments.iter().all(|node| matches!(node, Self::Place(_)));
                        return if bodies { Ok(Kind::Number) } else { Err(format!("{name}() takes h or r")) };
                    }
                    _ => (Kind::Point, "points"),
                };
                for argument in arguments {
                    ensure(argument.kind()? == kind, || format!("{name}() takes {wanted}"))?;
                }
                Ok(Kind::Number)
            }
        }
    }

    /// The nodes right below this one.
    fn below(&self) -> Vec<&Self> {
        match self {
            Self::Negative(inner) | Self::Lagged(inner, _) => vec![inner.as_ref()],
            Self::Binary(_, a, b) | Self::Pair(a, b) => vec![a.as_ref(), b.as_ref()],
            Self::Call(_, arguments) => arguments.iter().collect(),
            _ => Vec::new(),
        }
    }

    /// Whether this node or any within it is such.
    fn any(&self, such: &dyn Fn(&Self) -> bool) -> bool {
        such(self) || self.below().into_iter().any(|node| node.any(such))
    }

    /// How deep `diff` and `rate` are nested.
    fn changes(&self) -> usize {
        let is_change = |number: usize| matches!(function(number).2, Function::Difference | Function::Rate);
        let own = matches!(self, Self::Call(number, _) if is_change(*number));
        usize::from(own) + self.below().into_iter().map(Self::changes).max().unwrap_or(0)
    }

    fn number(&self, row: &impl Moment) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Time => row.time(),
            Self::Field(who, field) => row.body(*who).get(*field),
            Self::Column(column) => row.cell(*column),
            Self::Lagged(inner, rows) => row.earlier(*rows).map_or(f64::NAN, |row| inner.number(&row)),
            Self::Negative(inner) => -inner.number(row),
            Self::Binary(operator, a, b) => arithmetic(*operator, a.number(row), b.number(row)),
            Self::Call(number, arguments) => call(function(*number).2, arguments, row),
            Self::Place(_) | Self::Goal(_) | Self::Velocity(_) | Self::Pair(..) => f64::NAN,
        }
    }

    fn point(&self, row: &impl Moment) -> (f64, f64) {
        match self {
            Self::Place(who) => (row.body(*who).x, row.body(*who).y),
            Self::Goal(who) => (row.body(*who).gx, row.body(*who).gy),
            Self::Velocity(who) => {
                let body = row.body(*who).body();
                (body.vx, body.vy)
            }
            Self::Pair(x, y) => (x.number(row), y.number(row)),
            Self::Lagged(inner, rows) => row.earlier(*rows).map_or(NOWHERE, |row| inner.point(&row)),
            Self::Call(number, arguments) => match (function(*number).2, arguments.as_slice()) {
                (Function::Difference, [inner]) => {
                    let (x, y) = inner.point(row);
                    let before = row.earlier(1).map_or(NOWHERE, |earlier| inner.point(&earlier));
                    (x - before.0, y - before.1)
                }
                _ => NOWHERE,
            },
            Self::Negative(inner) => {
                let (x, y) = inner.point(row);
                (-x, -y)
            }
            Self::Binary(operator @ (Operator::Plus | Operator::Minus), a, b) => {
                let (a, b) = (a.point(row), b.point(row));
                (arithmetic(*operator, a.0, b.0), arithmetic(*operator, a.1, b.1))
            }
            Self::Binary(operator, a, b) => {
                let ((x, y), factor) = match a.kind() {
                    Ok(Kind::Point) => (a.point(row), b.number(row)),
                    _ => (b.point(row), a.number(row)),
                };
                (arithmetic(*operator, x, factor), arithmetic(*operator, y, factor))
            }
            _ => NOWHERE,
        }
    }
}

fn call<M: Moment>(function: Function, arguments: &[Node], row: &M) -> f64 {
    let number = |i: usize| arguments.get(i).map_or(f64::NAN, |node| node.number(row));
    let point = |i: usize| arguments.get(i).map_or(NOWHERE, |node| node.point(row));
    match function {
        Function::Number(f) => f(number(0)),
        Function::Pair(f) => f(number(0), number(1)),
        Function::Difference | Function::Rate => {
            let before = row.earlier(1);
            let of = |part: &dyn Fn(&Node) -> f64| arguments.first().map_or(f64::NAN, part);
            let change = of(&|node| node.number(row))
                - of(&|node| before.as_ref().map_or(f64::NAN, |before| node.number(before)));
            let elapsed = || row.time() - before.as_ref().map_or(f64::NAN, Moment::time);
            if matches!(function, Function::Rate) { change / elapsed() } else { change }
        }
        // The parser makes a node of its own of it.
        Function::Lag => f64::NAN,
        Function::Speed => match arguments {
            [Node::Place(who)] => row.body(*who).body().speed(),
            _ => f64::NAN,
        },
        Function::Risk => match arguments {
            [Node::Place(who), Node::Place(other)] => row.risk(*who, *other),
            _ => f64::NAN,
        },
        Function::Norm => libm::hypot(point(0).0, point(0).1),
        Function::Angle => libm::atan2(point(0).1, point(0).0),
        Function::Distance => libm::hypot(point(0).0 - point(1).0, point(0).1 - point(1).1),
        Function::Dot => point(0).0 * point(1).0 + point(0).1 * point(1).1,
        Function::Cross => point(0).0 * point(1).1 - point(0).1 * point(1).0,
    }
}

fn arithmetic(operator: Operator, a: f64, b: f64) -> f64 {
    if operator == Operator::Over && b == 0.0 { f64::NAN } else { operator.of(a, b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: Values = Values::from_array([0.0, 0.0, 4.0, 3.0, 0.0, 0.5, 0.0]);
    const HUMAN: Values = Values::from_array([1.0, 1.0, 0.0, 0.0, std::f64::consts::FRAC_PI_2, 2.0, 0.1]);

    /// A row of a batch, or of a table with the columns x (0, 1, 4, 9, ...) and y (3).
    struct Now(usize);

    impl Moment for Now {
        fn time(&self) -> f64 {
            self.0 as f64
        }

        fn body(&self, who: Who) -> &Values {
            if who == Who::Human { &HUMAN } else { &ROBOT }
        }

        fn risk(&self, a: Who, b: Who) -> f64 {
            self.body(a).body().speed() + 10.0 * self.body(b).body().speed()
        }

        fn cell(&self, column: usize) -> f64 {
            if column == 0 { (self.0 * self.0) as f64 } else { 3.0 }
        }

        fn earlier(&self, rows: usize) -> Option<Self> {
            self.0.checked_sub(rows).map(Self)
        }
    }

    #[test]
    fn a_table_has_columns_lags_differences_points_and_units() {
        let columns = ["x", "Goal [m]"].map(str::to_owned);
        for (text, expected) in [
            ("x + \"Goal [m]\"", 52.0),
            ("lag(x, 2)", 25.0),
            ("diff(x)", 13.0),
            ("diff(diff(x))", 2.0),
            ("rate(x) / 2", 6.5),
            ("norm(4, `Goal [m]`)", 5.0),
            ("norm((x, 0) - (40, 0))", 9.0),
            ("angle(0, 2) / 1 deg", 90.0),
            ("dist((0, 0), (3, 4 m))", 5.0),
            ("norm(diff((x, t)))", 170_f64.sqrt()),
            ("36 kmh + 500 ms + 2 km", 2010.5),
            ("wrap(2 * 180 deg) + sign(0 - x) + lag(t, 1)", 5.0),
        ] {
            let value =
                Expression::of_columns(text, &columns).unwrap_or_else(|e| panic!("{e}")).value(&Now(7));
            assert!((value - expected).abs() < 1e-12, "{text} is {value}");
        }
        let first = Expression::of_columns("x + lag(x, 8)", &columns).expect("parses").value(&Now(7));
        assert!(first.is_nan());
        for (text, part) in [
            ("x + goal", "'goal' is unknown; columns: x, Goal [m]"),
            ("lag(x, 1.5)", "whole number of rows"),
            ("5 parsecs", "'parsecs' is not a unit; units: deg"),
            ("speed(x)", "takes h or r"),
            ("(x, 1)", "is a point"),
            ("\"x", "quote is missing"),
        ] {
            let fault = Expression::of_columns(text, &columns).expect_err(text);
            assert!(fault.contains(part), "{text}: {fault}");
        }
        assert_eq!(Expression::names_in("x * lag(\"a b\", 1) + pi * t"), Ok(vec!["x".into(), "a b".into()]));
    }

    fn value(text: &str) -> f64 {
        Expression::parse(text).unwrap_or_else(|e| panic!("{e}")).value(&Now(7))
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
            ("lag(h.v, 1)", "lag() is for the columns of a table"),
            ("1 2", "an operator or the end is missing"),
            ("", "a number, a name or '(' is missing"),
            ("1 + é", "is missing"),
            ("1..2", "this is not a number"),
        ] {
            let fault = Expression::parse(text).expect_err(text);
            assert!(fault.contains(part), "{text}: {fault}");
        }
        assert!(Expression::parse(&"(".repeat(100_000)).is_err());
        let deep = format!("{}x{}", "diff(".repeat(20), ")".repeat(20));
        assert!(Expression::names_in(&deep).expect_err("deep").contains("within each other"));
        assert!(Expression::parse(&"-".repeat(100_000)).is_err());
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_the_parser_panic(text in "[hr.vxgoal_ ()+*/^,0-9e-]{0,40}") {
            let _ = (Expression::parse(&text), Expression::names_in(&text));
        }
    }
}
