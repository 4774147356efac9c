//! The unit of an expression, where it follows from what it is made of: `h.v` is in m/s, `dist(h, r)` in m.

use super::{Expression, Function, Node, Operator, function};

impl Expression {
    /// The unit of its values; empty where none is known. Bodies are in metres, seconds and radians.
    pub fn unit(&self) -> &'static str {
        unit(&self.root).unwrap_or_default()
    }
}

/// `None`: not known; an empty text is a number without a unit.
fn unit(node: &Node) -> Option<&'static str> {
    let same = |a: &Node, b: &Node| unit(a).filter(|one| unit(b) == Some(*one));
    match node {
        Node::Field(_, field) => Some(field.unit()),
        Node::Place(_) | Node::Goal(_) => Some("m"),
        Node::Velocity(_) => Some("m/s"),
        Node::Time => Some("s"),
        Node::Lagged(of, _) | Node::Negative(of) => unit(of),
        Node::Binary(Operator::Plus | Operator::Minus, a, b) | Node::Pair(a, b) => same(a, b),
        Node::Call(number, of) => match (function(*number), of.as_slice()) {
            ((_, _, Function::Distance), _) => Some("m"),
            ((_, _, Function::Speed), _) => Some("m/s"),
            ((_, _, Function::Norm | Function::Difference), [of]) => unit(of),
            (("abs" | "round" | "wrap", ..), [of]) => unit(of),
            (("min" | "max", ..), [a, b]) => same(a, b),
            _ => None,
        },
        Node::Binary(..) | Node::Number(_) | Node::Column(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_follows_from_what_an_expression_is_made_of() {
        for (text, wanted) in [
            ("h_v", "m/s"),
            ("dist(h, h.goal)", "m"),
            ("-abs(h_v - r_v)", "m/s"),
            ("max(h_theta, r_theta)", "rad"),
            ("norm(h.vel)", "m/s"),
            ("speed(h)", "m/s"),
            // Not known, or none.
            ("risk(h, r)", ""),
            ("h_v * 2", ""),
            ("h_v + h_x", ""),
            ("3", ""),
        ] {
            assert_eq!(Expression::parse(text).map(|expression| expression.unit()), Ok(wanted), "{text}");
        }
    }
}
