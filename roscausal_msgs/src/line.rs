//! A line of a `.msg` text. The build script reads the texts by it, too.

/// The line without its comment. A string constant may contain a '#': its value is the whole rest of the line.
pub(crate) fn code(line: &str) -> &str {
    let code = line.split('#').next().unwrap_or_default().trim();
    let is_text = code.split_whitespace().next() == Some("string") && code.contains('=');
    if is_text { line.trim() } else { code }
}

/// What stands in a line that is not empty and not a comment.
pub(crate) enum Line<'a> {
    Constant { kind: &'a str, name: &'a str, value: &'a str },
    Field { kind: &'a str, name: &'a str },
}

impl<'a> Line<'a> {
    pub(crate) fn parse(line: &'a str) -> Option<Self> {
        let (kind, rest) = code(line).split_once(char::is_whitespace)?;
        Some(match rest.split_once('=') {
            Some((name, value)) => Self::Constant { kind, name: name.trim(), value: value.trim() },
            None => Self::Field { kind, name: rest.trim() },
        })
    }
}
