//! Text from outside, such as a name in somebody's recording, on its way to a terminal, a message or a picture: what a reader could
//! not see, or a terminal would obey, is spelled out, and what is too long is cut.

use std::{borrow::Cow, fmt::Write};

/// Longest quotation in a message, in characters.
pub const QUOTATION: usize = 80;
/// Longest message, in characters.
const MESSAGE: usize = 2000;

/// Whether a character has no shape of its own: control characters (C0, C1), marks that turn the direction of writing, ends of
/// lines, and what Unicode calls ignorable by default (zero widths, fillers, variation selectors, tags) or no character, and the
/// empty pattern of Braille.
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}' | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180f}')
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{2800}' | '\u{3164}' | '\u{fe00}'..='\u{fe0f}')
        || matches!(c, '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}')
        || matches!(c, '\u{fdd0}'..='\u{fdef}' | '\u{e0000}'..='\u{e0fff}')
        || u32::from(c) & 0xfffe == 0xfffe
}

/// The text with what [`is_hidden`] said by `spell`.
fn spelled(text: &str, hidden: impl Fn(char) -> bool, spell: impl Fn(&mut String, char)) -> Cow<'_, str> {
    if !text.contains(&hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if hidden(c) { spell(&mut out, c) } else { out.push(c) }
    }
    Cow::Owned(out)
}

fn code(out: &mut String, c: char) {
    // Writing into a String cannot fail.
    let _ = write!(out, "<U+{:04X}>", u32::from(c));
}

/// A text of one line: each character without a shape becomes its number, ends of lines, too. It changes nothing more when it is
/// used again.
///
/// ```
/// assert_eq!(roscausal_discovery::visible::line("a\u{1b}[31m\nb"), "a<U+001B>[31m<U+000A>b");
/// ```
pub fn line(text: &str) -> Cow<'_, str> {
    spelled(text, is_hidden, code)
}

/// A text of several lines: as [`line()`], but ends of lines stay.
pub fn lines(text: &str) -> Cow<'_, str> {
    spelled(text, |c| c != '\n' && is_hidden(c), code)
}

/// JSON: the same characters are escaped as JSON does it, so that its readers get the same text.
///
/// ```
/// assert_eq!(roscausal_discovery::visible::json("{\"a\u{9b}\": 1}"), "{\"a\\u009b\": 1}");
/// ```
pub fn json(text: &str) -> Cow<'_, str> {
    let spell = |out: &mut String, c: char| {
        for unit in c.encode_utf16(&mut [0; 2]) {
            let _ = write!(out, "\\u{unit:04x}");
        }
    };
    spelled(text, |c| c != '\n' && is_hidden(c), spell)
}

/// A message: one line, with its quotations cut to [`QUOTATION`] characters, and itself to 2000.
pub fn message(text: &str) -> String {
    let (mut out, mut rest, mut before) = (String::new(), text, ' ');
    while let Some(at) = rest.find(['\'', '"', '`']) {
        let (head, quoted) = rest.split_at(at);
        let (mark, inside) = quoted.split_at(1);
        out += head;
        out += mark;
        before = head.chars().next_back().unwrap_or(before);
        // An apostrophe within a word opens nothing.
        match inside.find(mark).filter(|_| !before.is_alphanumeric()) {
            Some(end) => {
                out += &cut(&inside[..end], QUOTATION);
                out += mark;
                rest = &inside[end + 1..];
            }
            None => rest = inside,
        }
        before = '\'';
    }
    out += rest;
    // The end of a message is what to do.
    let length = out.chars().count();
    if length > MESSAGE {
        let begin: String = out.chars().take(MESSAGE / 2).collect();
        let end: String = out.chars().skip(length - MESSAGE / 4).collect();
        out = format!("{begin} ... {end}");
    }
    line(&out).into_owned()
}

/// The beginning of a text that is longer than `most` characters, and how long it is.
///
/// ```
/// use roscausal_discovery::visible::cut;
///
/// assert_eq!(cut("short", 10), "short");
/// assert_eq!(cut("long enough", 4), "long... (11 characters)");
/// ```
pub fn cut(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        Some((end, _)) => format!("{}... ({} characters)", &text[..end], text.chars().count()).into(),
        None => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn nothing_that_a_terminal_obeys_is_left(text in any::<String>(), hidden in prop::collection::vec(0_u32..0xfffff, 0..20)) {
            let text: String = text.chars().chain(hidden.into_iter().filter_map(char::from_u32)).collect();
            let all = line(&text);
            prop_assert!(!all.contains(is_hidden));
            prop_assert_eq!(line(&all), all.clone());
            prop_assert!(!lines(&text).contains(|c| c != '\n' && is_hidden(c)));
            prop_assert!(!message(&text).contains(is_hidden));
        }

        #[test]
        fn json_says_the_same_and_shows_it(text in "[a\"\\\\\u{1}-\u{1f}\u{7f}-\u{9f}\u{202e}\u{2066}\u{e0041}é]*") {
            let written = serde_json::to_string(&text).unwrap();
            let shown = json(&written);
            prop_assert!(!shown.contains(is_hidden));
            prop_assert_eq!(serde_json::from_str::<String>(&shown).unwrap(), text);
        }
    }

    #[test]
    fn words_of_any_language_stay() {
        for text in
            ["h_θ", "Geschwindigkeit überm Weg", "速度", "سرعة", "e\u{301}", "क्षि", "→ ½ 😀", "a\\b{c}"]
        {
            assert_eq!(line(text), text);
        }
        for c in [
            '\u{9b}', '\u{202e}', '\u{2069}', '\u{200f}', '\u{61c}', '\u{200b}', '\u{2800}', '\u{e0041}',
            '\u{feff}', '\u{ffff}', '\u{1fffe}',
        ] {
            assert_eq!(line(&format!("a{c}")), format!("a<U+{:04X}>", u32::from(c)));
        }
    }

    #[test]
    fn a_long_quotation_is_cut_and_the_advice_stays() {
        let cell = "x".repeat(10 << 20);
        for quote in ['\'', '"', '`'] {
            let reported = message(&format!(
                "row 3, the person's cell: {quote}{cell}{quote} is not a number; correct it"
            ));
            assert!(
                reported.len() < 200
                    && reported.ends_with(&format!("characters){quote} is not a number; correct it")),
                "{reported}"
            );
        }
        let reported = message(&format!("{cell}: {cell}'s; correct it"));
        assert!(reported.len() < 2100 && reported.ends_with("; correct it"));
        assert_eq!(
            message("'a' is no 'b': don't, the persons' \"c\""),
            "'a' is no 'b': don't, the persons' \"c\""
        );
    }
}
