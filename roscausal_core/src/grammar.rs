//! The grammar of expressions, those of features and those of signals: operators, brackets, numbers with units, and functions of
//! numbers. What a name stands for is each language's own.

/// Deepest nesting of brackets.
const DEEPEST: usize = 50;

/// What was read, or what is wrong with it in words.
pub(crate) type Parsed<T> = Result<T, String>;

/// An arithmetic operation or a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Operator {
    Plus,
    Minus,
    Times,
    Over,
    Power,
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Unequal,
}

/// The operators of each strength of binding, the weakest first; of two signs that begin alike the longer one first.
const SIGNS: [&[(&str, Operator)]; 4] = [
    &[
        ("<=", Operator::AtMost),
        (">=", Operator::AtLeast),
        ("==", Operator::Equal),
        ("!=", Operator::Unequal),
        ("<", Operator::Less),
        (">", Operator::More),
    ],
    &[("+", Operator::Plus), ("-", Operator::Minus)],
    &[("*", Operator::Times), ("/", Operator::Over)],
    &[("^", Operator::Power)],
];

impl Operator {
    /// How it is written.
    pub(crate) fn sign(self) -> &'static str {
        SIGNS.concat().into_iter().find(|(_, operator)| *operator == self).map_or("", |(sign, _)| sign)
    }

    /// Its result; a comparison is 1 or 0, and NaN where a side is missing.
    pub(crate) fn of(self, a: f64, b: f64) -> f64 {
        let truth = |is_so: bool| if a.is_nan() || b.is_nan() { f64::NAN } else { f64::from(is_so) };
        match self {
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Times => a * b,
            Self::Over => a / b,
            Self::Power => libm::pow(a, b),
            Self::Less => truth(a < b),
            Self::AtMost => truth(a <= b),
            Self::More => truth(a > b),
            Self::AtLeast => truth(a >= b),
            Self::Equal => truth(a == b),
            Self::Unequal => truth(a != b),
        }
    }
}

/// A function by its name.
type Named = (&'static str, fn(f64) -> f64);

/// Functions of one number.
pub(crate) const FUNCTIONS: [Named; 12] = [
    ("abs", f64::abs),
    ("sqrt", f64::sqrt),
    ("exp", libm::exp),
    ("log", libm::log),
    ("sign", |x| if x == 0.0 { x } else { x.signum() }),
    ("round", f64::round),
    ("tanh", libm::tanh),
    ("tan", libm::tan),
    ("log10", libm::log10),
    ("sin", libm::sin),
    ("cos", libm::cos),
    ("wrap", wrap),
];

/// The angle between -pi and pi.
pub(crate) fn wrap(angle: f64) -> f64 {
    libm::atan2(libm::sin(angle), libm::cos(angle))
}

/// The definitions in a list that may have been cut at commas: an item that does not begin one continues the one before. Those in one
/// item are separated by `;`.
pub(crate) fn rejoined(items: &[String], begins: impl Fn(&str) -> bool) -> Vec<String> {
    let mut texts: Vec<String> = Vec::new();
    for item in items.iter().flat_map(|item| item.split(';')).filter(|item| !item.trim().is_empty()) {
        match texts.last_mut() {
            Some(open) if !begins(item) => *open = format!("{open},{item}"),
            _ => texts.push(item.to_owned()),
        }
    }
    texts
}

/// Units of a number, in SI units.
const UNITS: [(&str, f64); 16] = [
    ("deg", std::f64::consts::PI / 180.0),
    ("rad", 1.0),
    ("km", 1e3),
    ("m", 1.0),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("h", 3600.0),
    ("min", 60.0),
    ("s", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("ns", 1e-9),
    ("kmh", 1.0 / 3.6),
    ("mph", 0.447_04),
    ("g", 9.806_65),
    ("percent", 0.01),
];

/// What expressions are about.
pub(crate) trait Language {
    /// A part of an expression.
    type Node;

    /// What no operator divides, apart from an expression in brackets of its own.
    fn atom(&mut self, text: &mut Scanner<'_>) -> Parsed<Self::Node>;

    fn negative(inner: Self::Node) -> Self::Node;

    fn binary(operator: Operator, left: Self::Node, right: Self::Node) -> Self::Node;

    /// The next expression.
    fn expression(&mut self, text: &mut Scanner<'_>) -> Parsed<Self::Node> {
        self.bound(text, 0)
    }

    /// Operands that bind as strongly as the operators of a `level`, or more.
    fn bound(&mut self, text: &mut Scanner<'_>, level: usize) -> Parsed<Self::Node> {
        if level == SIGNS.len() - 1 {
            return self.signed(text);
        }
        let mut left = self.bound(text, level + 1)?;
        while let Some((_, operator)) = SIGNS[level].iter().find(|(sign, _)| text.word(sign)) {
            left = Self::binary(*operator, left, self.bound(text, level + 1)?);
            // A comparison of a comparison is none.
            if level == 0 {
                break;
            }
        }
        Ok(left)
    }

    /// `-a ^ b` is `-(a ^ b)`, `a ^ -b` is allowed.
    fn signed(&mut self, text: &mut Scanner<'_>) -> Parsed<Self::Node> {
        text.depth += 1;
        crate::ensure(text.depth <= DEEPEST, || text.fault("too many brackets within brackets"))?;
        let node = if text.word("-") {
            Self::negative(self.signed(text)?)
        } else {
            let base = self.atom(text)?;
            if text.word("^") { Self::binary(Operator::Power, base, self.signed(text)?) } else { base }
        };
        text.depth -= 1;
        Ok(node)
    }
}

/// Reads a text from left to right.
pub(crate) struct Scanner<'a> {
    text: &'a str,
    /// How many bytes have been read.
    pub(crate) at: usize,
    depth: usize,
}

impl<'a> Scanner<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self { text, at: 0, depth: 0 }
    }

    /// What has not been read.
    pub(crate) fn ahead(&self) -> &'a str {
        self.text.get(self.at..).unwrap_or_default()
    }

    /// What has not been read, without the blanks before it.
    pub(crate) fn rest(&mut self) -> &'a str {
        self.at += self.ahead().len() - self.ahead().trim_start().len();
        self.ahead()
    }

    /// The next character.
    pub(crate) fn next(&mut self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Passes `word` if it comes next.
    pub(crate) fn word(&mut self, word: &str) -> bool {
        let is_next = self.rest().starts_with(word);
        self.at += if is_next { word.len() } else { 0 };
        is_next
    }

    pub(crate) fn expect(&mut self, sign: &str) -> Parsed<()> {
        if self.word(sign) { Ok(()) } else { Err(self.fault(&format!("'{sign}' is missing"))) }
    }

    /// The end, or else what is `missing`.
    pub(crate) fn end(&mut self, missing: &str) -> Parsed<()> {
        if self.rest().is_empty() { Ok(()) } else { Err(self.fault(missing)) }
    }

    /// The characters that fit.
    pub(crate) fn while_is(&mut self, fits: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let word = &rest[..rest.find(|c| !fits(c)).unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    /// What stands in the quotes that come next.
    pub(crate) fn quoted(&mut self) -> Parsed<&'a str> {
        let mut all = self.rest().chars();
        let (quote, inner) = (all.next().unwrap_or_default(), all.as_str());
        let end = inner.find(quote).ok_or_else(|| self.fault("the second quote is missing"))?;
        self.at += end + 2 * quote.len_utf8();
        Ok(&inner[..end])
    }

    /// A number, in SI units if it has a unit.
    pub(crate) fn number(&mut self) -> Parsed<f64> {
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
        let reason = if end == 0 { "a number is missing" } else { "this is not a number" };
        let number: f64 = rest[..end].parse().map_err(|_| self.fault(reason))?;
        self.at += end;
        Ok(number * self.unit()?)
    }

    /// The unit behind a number; 1 without one.
    fn unit(&mut self) -> Parsed<f64> {
        if !self.next().is_some_and(char::is_alphabetic) {
            return Ok(1.0);
        }
        let at = self.at;
        let name = self.while_is(char::is_alphanumeric);
        let known = || UNITS.map(|(name, _)| name).join(", ");
        let unit = UNITS.iter().find(|(known, _)| *known == name).map(|(_, unit)| *unit);
        unit.ok_or_else(|| self.fault_at(at, &format!("'{name}' is not a unit; units: {}", known())))
    }

    /// What is wrong at this place.
    pub(crate) fn fault(&self, reason: &str) -> String {
        self.fault_at(self.at, reason)
    }

    /// What is wrong at the place after so many bytes.
    pub(crate) fn fault_at(&self, at: usize, reason: &str) -> String {
        format!("character {}: {reason}", self.text[..at].chars().count() + 1)
    }
}
