//! What stands between the operators of an expression.

use roscausal_discovery::{Named, names::position};

use super::{FUNCTIONS, Field, Function, LONGEST_LAG, Node, Who, function};
use crate::grammar::{self, Language, Operator, Parsed, Scanner};

/// What names stand for.
pub(super) enum Names<'a> {
    /// A person and a robot: `h`, `r.v`.
    Bodies,
    /// Columns of a table.
    Columns(&'a [String]),
    /// Columns that are not known yet; they are gathered.
    Any(&'a mut Vec<String>),
}

impl Language for Names<'_> {
    type Node = Node;

    fn atom(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        let of_table = !matches!(self, Self::Bodies);
        match text.next() {
            Some('(') => {
                text.expect("(")?;
                let mut inner = self.expression(text)?;
                if text.word(",") {
                    inner = Node::Pair(Box::new(inner), Box::new(self.expression(text)?));
                }
                text.expect(")")?;
                Ok(inner)
            }
            Some('"' | '`') if of_table => {
                let start = text.at;
                let name = text.quoted()?;
                self.column(name, text, start)
            }
            Some(c) if c.is_ascii_digit() || c == '.' => text.number().map(Node::Number),
            Some(c) if c.is_ascii_alphabetic() || of_table && (c.is_alphabetic() || c == '_') => {
                self.named(text)
            }
            _ => Err(text.fault("a number, a name or '(' is missing")),
        }
    }

    fn negative(inner: Node) -> Node {
        Node::Negative(Box::new(inner))
    }

    fn binary(operator: Operator, left: Node, right: Node) -> Node {
        Node::Binary(operator, Box::new(left), Box::new(right))
    }
}

impl Names<'_> {
    fn column(&mut self, name: &str, text: &Scanner<'_>, start: usize) -> Parsed<Node> {
        let (found, columns) = match self {
            Self::Columns(columns) => (position(columns, name), columns.join(", ")),
            Self::Any(gathered) => {
                gathered.push(name.to_owned());
                (Some(0), String::new())
            }
            Self::Bodies => (None, String::new()),
        };
        let unknown = || text.fault_at(start, &format!("'{name}' is unknown; columns: {columns}"));
        found.map(Node::Column).ok_or_else(unknown)
    }

    fn named(&mut self, text: &mut Scanner<'_>) -> Parsed<Node> {
        let start = text.at;
        let name = text.while_is(|c| c.is_alphanumeric() || matches!(c, '_' | '.'));
        if text.word("(") {
            return self.call(name, text, start);
        }
        let of_table = !matches!(self, Self::Bodies);
        let known = matches!(self, Self::Columns(columns) if position(columns, name).is_some());
        if of_table && (known || !matches!(name, "t" | "time" | "pi")) {
            return self.column(name, text, start);
        }
        let (who, part) = match name.split_once(['.', '_']) {
            _ if name == "t" || (name == "time" && of_table) => return Ok(Node::Time),
            _ if name == "pi" => return Ok(Node::Number(std::f64::consts::PI)),
            None => (name, None),
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
            let known = "h, r, h.goal, h.vel, h.x, h.y, h.theta, h.v, h.omega (r. likewise), t, pi";
            text.fault_at(start, &format!("'{name}' is unknown; known: {known}"))
        })
    }

    fn call(&mut self, name: &str, text: &mut Scanner<'_>, start: usize) -> Parsed<Node> {
        let numbers = 0..FUNCTIONS.len() + grammar::FUNCTIONS.len();
        let Some(number) = numbers.clone().find(|number| function(*number).0 == name) else {
            let known: Vec<&str> = numbers.map(|number| function(number).0).collect();
            let reason = format!("there is no function '{name}'; known: {}", known.join(", "));
            return Err(text.fault_at(start, &reason));
        };
        let (_, wanted, function) = function(number);
        // A row that was recorded just now is computed from it and the row before it alone.
        let looks_back = matches!(function, Function::Lag | Function::Difference | Function::Rate);
        if looks_back && matches!(self, Self::Bodies) {
            let reason = format!("{name}() is for the columns of a table ({})", Named("feature"));
            return Err(text.fault_at(start, &reason));
        }
        let mut arguments = vec![self.expression(text)?];
        while text.word(",") {
            arguments.push(self.expression(text)?);
        }
        text.expect(")")?;
        if matches!(function, Function::Norm | Function::Angle) && arguments.len() == 2 {
            let second = arguments.pop().map(Box::new);
            let first = arguments.pop().map(Box::new);
            arguments.extend(first.zip(second).map(|(x, y)| Node::Pair(x, y)));
        }
        if matches!(function, Function::Lag) {
            return match (arguments.pop(), arguments.pop(), arguments.is_empty()) {
                (Some(Node::Number(rows)), Some(inner), true)
                    if rows.fract() == 0.0 && (1.0..=LONGEST_LAG as f64).contains(&rows) =>
                {
                    Ok(Node::Lagged(Box::new(inner), rows as usize))
                }
                _ => {
                    let reason = "lag() takes an expression and a whole number of rows, such as lag(x, 2)";
                    Err(text.fault_at(start, reason))
                }
            };
        }
        if arguments.len() != wanted {
            let reason = format!("{name}() takes {wanted} arguments, not {}", arguments.len());
            return Err(text.fault_at(start, &reason));
        }
        Ok(Node::Call(number, arguments))
    }
}
