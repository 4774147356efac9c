//! A model in the formats of other programs: DOT (Graphviz), GraphML (networkx, Gephi, yEd, igraph), and CSV of
//! links.

use std::fmt::Write;

use roscausal_core::{Error, Result};
use roscausal_discovery::{Link, LinkMark, Model, draw::escaped, names::plain, visible};

use crate::report;

/// The model as a directed graph for Graphviz: one edge per link, labelled with lag and strength.
pub fn dot(model: &Model) -> String {
    let mut out = String::from("digraph causal_model {\n  rankdir=LR;\n  node [shape=circle];\n");
    for name in &model.features {
        let _ = writeln!(out, "  {};", quoted(&plain(name)));
    }
    for link in &model.links {
        let ends = ends(link.mark);
        let strength = link.drawn_strength();
        let colour = match strength < 0.0 {
            _ if !model.has_sign() => "#475569",
            true => "#1d4ed8",
            false => "#c2410c",
        };
        let style = if link.confidence.is_some_and(|share| share < 0.5) { ", style=dashed" } else { "" };
        let found = link.confidence.map_or(String::new(), |share| format!(" · {share:.2} found"));
        let (cause, effect) = (quoted(&plain(&link.cause)), quoted(&plain(&link.effect)));
        let label = format!("{} · {}{found}", link.lag, link.strength_in_words(2));
        let width = 1.0 + 4.0 * strength.abs().min(1.0);
        let _ = writeln!(
            out,
            "  {cause} -> {effect} [label=\"{label}\", penwidth={width:.2}, color=\"{colour}\"{style}{ends}];"
        );
    }
    out.push_str("}\n");
    out
}

/// The ends of an edge: heads, circles, crosses. A direction alone is Graphviz's usual edge.
fn ends(mark: LinkMark) -> String {
    let shape = |end| match end {
        'o' => "odot",
        'x' => "tee",
        '<' | '>' => "normal",
        _ => "none",
    };
    match (mark.symbol().chars().next(), mark.symbol().chars().next_back()) {
        (Some('-'), Some('>')) => String::new(),
        (Some(tail), Some(head)) if mark != LinkMark::Unoriented && mark != LinkMark::Conflict => {
            format!(", dir=both, arrowtail={}, arrowhead={}", shape(tail), shape(head))
        }
        _ => ", dir=none".to_owned(),
    }
}

fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('\\', "\\\\").replace('"', "\\\""))
}

/// The model as GraphML. Edges have `lag`, `mark` and `tested`, and `value` and `p_value` if they were.
pub fn graphml(model: &Model) -> String {
    let mut out = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n",
    );
    for (id, kind) in [
        ("lag", "int"),
        ("value", "double"),
        ("p_value", "double"),
        ("mark", "string"),
        ("tested", "boolean"),
        ("confidence", "double"),
    ] {
        let _ = writeln!(out, "  <key id=\"{id}\" for=\"edge\" attr.name=\"{id}\" attr.type=\"{kind}\"/>");
    }
    let number_of = |key: &str, value: Option<f64>| {
        value.map_or(String::new(), |value| format!("<data key=\"{key}\">{value}</data>"))
    };
    out.push_str("  <graph id=\"causal_model\" edgedefault=\"directed\">\n");
    for name in &model.features {
        let _ = writeln!(out, "    <node id=\"{}\"/>", escaped(&plain(name)));
    }
    for (number, link) in model.links.iter().enumerate() {
        let Link { cause, effect, lag, mark, .. } = link;
        let (cause, effect) = (escaped(&plain(cause)), escaped(&plain(effect)));
        let found = link.confidence.map_or(String::new(), |c| format!("<data key=\"confidence\">{c}</data>"));
        let (value, p_value) = (number_of("value", link.value), number_of("p_value", link.p_value));
        let (mark, tested) = (escaped(mark.symbol()), link.value.is_some());
        let _ = writeln!(
            out,
            "    <edge id=\"e{number}\" source=\"{cause}\" target=\"{effect}\"><data key=\"lag\">{lag}</data>{value}{p_value}\
             <data key=\"mark\">{mark}</data><data key=\"tested\">{tested}</data>{found}</edge>"
        );
    }
    out.push_str("  </graph>\n</graphml>\n");
    out
}

/// A text as a cell of a table that a spreadsheet may open: what it would take for a formula begins with an apostrophe, behind
/// what separates cells elsewhere (`;`), too. Numbers and marks of links (`-->`) stay.
pub(crate) fn cell(text: &str) -> String {
    let plain = |part: &str| {
        let formula = part.starts_with(['=', '+', '-', '@', '\u{ff1d}', '\u{ff0b}', '\u{ff0d}', '\u{ff20}'])
            && part.contains(char::is_alphanumeric)
            && part.parse::<f64>().is_err();
        format!("{}{}", if formula { "'" } else { "" }, visible::line(part))
    };
    text.split_inclusive([';', '|']).map(plain).collect()
}

/// The columns of the table of links. Their values are empty for a link that was required: it was not tested. `p` is the p-value in
/// words: `<0.002` where the test cannot tell smaller ones apart and `p_value` may be 0. `confidence` is the share of the resamples with
/// the link, and the last two are the strengths in nine of ten of them; empty without resamples.
const COLUMNS: [&str; 12] = [
    "cause", "effect", "lag", "value", "p_value", "mark", "n_lost", "n_used", "p", "confidence", "value_low",
    "value_high",
];

/// The links as a table, one row per link.
pub fn links_csv(model: &Model) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let fault = |e: &dyn std::fmt::Display| Error::Data(format!("the list of links cannot be written: {e}"));
    writer.write_record(COLUMNS).map_err(|e| fault(&e))?;
    for link in &model.links {
        let Link { lag, value, p_value, mark, n_lost, n_used, confidence, value_low, value_high, .. } = link;
        let (cause, effect) = (cell(&link.cause), cell(&link.effect));
        let p = if link.required { "required".to_owned() } else { report::p_cell(model, *p_value) };
        let tested = (lag, value, p_value, mark, n_lost, n_used);
        let row = (cause, effect, tested, p, confidence, value_low, value_high);
        writer.serialize(row).map_err(|e| fault(&e))?;
    }
    writer.into_inner().map_err(|e| fault(&e))
}
