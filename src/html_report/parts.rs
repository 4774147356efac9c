//! What the sections of the page share.

/// A section with its heading; nothing without content.
pub(super) fn section(id: &str, title: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{title}</h2>\n{content}</section>\n")
}

/// An anchor of a link's evidence.
pub(super) fn anchor(place: usize) -> String {
    format!("link-{}", place + 1)
}
