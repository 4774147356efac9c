//! The links as a LaTeX table, and the graph as a TikZ picture.

use std::fmt::Write;

use roscausal_discovery::{LinkMark, Model, names::plain, visible};

use crate::report;

/// What every file begins with, by which a later one knows that it may take its place.
pub(super) const MARK: &str = "% made by roscausal report\n";

/// A table of the links: `tabular`, without packages.
pub(super) fn table(model: &Model) -> String {
    let mut out = String::from(MARK)
        + "\\begin{tabular}{llrrl}\n\\hline\ncause & effect & lag & strength & $p$ \\\\\n\\hline\n";
    for link in &model.links {
        let p = report::p_cell(model, link.p_value);
        let p = match (link.p_value, p.strip_prefix('<')) {
            (None, _) => p,
            (_, Some(smallest)) => format!("$<{smallest}$"),
            (_, None) => format!("${p}$"),
        };
        let strength = link.value.map_or(String::from("--"), |value| format!("${value:.3}$"));
        let (cause, effect) = (text(&plain(&link.cause)), text(&plain(&link.effect)));
        let _ = writeln!(out, "{cause} & {effect} & {} & {strength} & {p} \\\\", link.lag);
    }
    out + "\\hline\n\\end{tabular}\n"
}

/// The graph: variables on a ring, one arrow per link, labelled with its lag. It needs the package `tikz`.
pub(super) fn tikz(model: &Model) -> String {
    let n = model.features.len().max(1);
    let radius = 1.2 + 0.45 * n as f64;
    let mut out = String::from(MARK)
        + "\\begin{tikzpicture}[variable/.style={circle, draw, minimum size=1.1cm, font=\\small}, every edge/.style={draw, \
         ->, >=stealth}]\n";
    for (i, name) in model.features.iter().enumerate() {
        let (angle, name) = (90.0 - 360.0 * i as f64 / n as f64, text(&plain(name)));
        let _ = writeln!(out, "  \\node[variable] (v{i}) at ({angle:.1}:{radius:.2}cm) {{{name}}};");
    }
    let place = |name: &str| model.features.iter().position(|feature| feature == name);
    for link in &model.links {
        let (Some(i), Some(j)) = (place(&link.cause), place(&link.effect)) else { continue };
        let mut style = format!("line width={:.2}pt", 0.4 + 1.6 * link.drawn_strength().abs().min(1.0));
        if link.drawn_strength() < 0.0 {
            style += ", dashed";
        }
        if link.mark != LinkMark::Forward {
            style += ", -";
        }
        let way =
            if i == j { "loop above".to_owned() } else { format!("bend left={}", 14 + 6 * link.lag.min(5)) };
        let label = format!("node[fill=white, inner sep=1pt, font=\\tiny] {{{}}}", link.lag);
        let _ = writeln!(out, "  \\path (v{i}) edge[{way}, {style}] {label} (v{j});");
    }
    out + "\\end{tikzpicture}\n"
}

/// A text for LaTeX: what has a meaning there is spelled out.
fn text(name: &str) -> String {
    let letter = |c: char| match c {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{c}"),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '\\' => "\\textbackslash{}".to_owned(),
        '<' => "\\textless{}".to_owned(),
        '>' => "\\textgreater{}".to_owned(),
        '|' => "\\textbar{}".to_owned(),
        '"' => "''".to_owned(),
        // After the end of a row these would belong to it.
        '[' | '*' => format!("{{{c}}}"),
        c => c.to_string(),
    };
    visible::line(name).chars().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_be_a_command() {
        assert_eq!(text("h_v"), "h\\_v");
        assert_eq!(text("\\input{x}"), "\\textbackslash{}input\\{x\\}");
        assert_eq!(text("a%b\nc"), "a\\%b\\textless{}U+000A\\textgreater{}c");
        assert_eq!(text("[3cm]*"), "{[}3cm]{*}");
    }
}
