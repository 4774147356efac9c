//! What the sections of the page share.

/// A section with its heading; nothing without content.
pub(super) fn section(id: &str, title: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    format!("<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{title}</h2>\n{content}</section>\n")
}

/// A table, which is scrolled where it is wide. The rows are HTML.
pub(super) fn table(label: &str, columns: &[&str], rows: &str) -> String {
    let head: String = columns.iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    format!(
        "<div class=\"figure\" tabindex=\"0\" role=\"region\" aria-label=\"{label}\">\n<table>\n<thead><tr>{head}</tr></thead>\n\
         <tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

/// An anchor of a link's evidence.
pub(super) fn anchor(place: usize) -> String {
    format!("link-{}", place + 1)
}
