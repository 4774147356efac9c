//! The lines of a `.msg` text, in the spelling of either ROS version.

use super::SchemaError;

/// A field as written: `float64[9] k`.
#[derive(Debug)]
pub(super) struct Written<'a> {
    /// Type without array and bound: `float64`.
    pub(super) base: &'a str,
    /// What stands between the brackets, if there are any: `9`, `<=9`, or nothing.
    pub(super) array: Option<&'a str>,
    pub(super) name: &'a str,
}

/// The sections of a full definition: name (empty for the first) and text. They are divided by lines of `=`, and each
/// but the first begins with `MSG: package/Name`.
pub(super) fn sections(text: &str) -> Vec<(&str, Vec<&str>)> {
    let mut sections: Vec<(&str, Vec<&str>)> = vec![("", Vec::new())];
    let mut after_rule = false;
    for line in text.lines() {
        let bare = line.trim();
        if bare.len() >= 3 && bare.bytes().all(|byte| byte == b'=') {
            after_rule = true;
            continue;
        }
        match bare.strip_prefix("MSG:") {
            Some(name) if after_rule => sections.push((name.trim(), Vec::new())),
            _ => sections.last_mut().into_iter().for_each(|(_, lines)| lines.push(line)),
        }
        after_rule = after_rule && bare.is_empty();
    }
    sections
}

/// The field in a line; `None` for comments, constants and empty lines.
pub(super) fn field(line: &str) -> Result<Option<Written<'_>>, SchemaError> {
    let code = line.split('#').next().unwrap_or_default().trim();
    if code.is_empty() {
        return Ok(None);
    }
    let fault = || SchemaError::Line(shortened(code));
    let (kind, rest) = code.split_once(char::is_whitespace).ok_or_else(fault)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    if after.trim_start().starts_with('=') {
        return Ok(None);
    }
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if name.is_empty() || !name.chars().all(is_name) {
        return Err(fault());
    }
    let (base, array) = match kind.split_once('[') {
        Some((base, array)) => (base, Some(array.strip_suffix(']').ok_or_else(fault)?)),
        None => (kind, None),
    };
    // A bound of a text (string<=20) changes nothing on the wire.
    let base = base.split_once("<=").map_or(base, |(base, _)| base);
    Ok(Some(Written { base, array, name }))
}

/// A line as an error shows it.
fn shortened(code: &str) -> String {
    code.chars().take(60).collect()
}
