//! What stands behind each link: one card per link, and the batches in which it was found.

use std::fmt::Write;

use roscausal_discovery::{Link, LinkEvidence, Model, draw, draw::escaped, names::plain};

use super::{
    Material,
    parts::{anchor, section, table},
};
use crate::report;

/// Most batches that are named.
const NAMED: usize = 12;

/// One card per link.
pub(super) fn cards(material: &Material) -> String {
    let model = &material.model;
    let Some(evidence) = &material.evidence else {
        if model.links.is_empty() {
            return String::new();
        }
        let anchors = (0..model.links.len()).map(|place| format!("<span id=\"{}\"></span>", anchor(place)));
        let (why, anchors) = ("<p>No evidence was kept beside this model.</p>", anchors.collect::<String>());
        return section("evidence", "Evidence", &format!("{why}\n{anchors}\n"));
    };
    let card =
        |(place, link): (usize, &Link)| evidence.of(link).map(|seen| card(material, place, link, seen));
    let cards: String = model.links.iter().enumerate().filter_map(card).collect();
    section("evidence", "Evidence", &cards)
}

fn card(material: &Material, place: usize, link: &Link, seen: &LinkEvidence) -> String {
    let model = &material.model;
    let mut facts: Vec<(&str, String)> = vec![
        ("strength", link.strength_in_words(4)),
        ("p-value", report::p_cell(model, link.p_value)),
        ("samples", seen.n_samples.to_string()),
    ];
    if let Some((low, high)) = seen.interval {
        facts.push(("interval", format!("{low:.4} to {high:.4}")));
    }
    if let Some(confidence) = link.confidence {
        let word = link.word().map_or(String::new(), |word| word + ": ");
        let share = format!("{word}{:.0} % of the resamples have it", 100.0 * confidence);
        facts.push(("confidence", share));
    }
    if let (Some(low), Some(high)) = (link.value_low, link.value_high) {
        facts.push(("strength in the resamples, 90 %", format!("{low:.4} to {high:.4}")));
    }
    if link.n_lost > 0 {
        facts.push(("left out, a value was missing", link.n_lost.to_string()));
    }
    facts.push(("given", conditions(seen)));
    if !material.batches.is_empty() {
        facts.push(("found in", found_in(material, link)));
    }
    let mut out = format!(
        "<article class=\"card\" id=\"{id}\" tabindex=\"-1\" aria-labelledby=\"{id}-title\">\n<h3 id=\"{id}-title\">{}</h3>\n<dl>\n",
        escaped(&report::sentence(model, link)),
        id = anchor(place)
    );
    for (name, value) in facts {
        let _ = writeln!(out, "<div><dt>{name}</dt><dd>{}</dd></div>", escaped(&value));
    }
    out += "</dl>\n<div class=\"plots\">\n";
    let level = model.link_level().unwrap_or(model.alpha);
    let plots = [
        (Some(draw::lag_function(seen, level, model.has_sign())), "Strength at each lag"),
        ((!seen.scatter.is_empty()).then(|| draw::scatter(seen)), "Samples of cause and effect"),
        (draw::residual_scatter(seen), "Samples after the conditions"),
    ];
    for (svg, name) in plots {
        let Some(svg) = svg else { continue };
        out += &svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{name}\" "), 1);
    }
    out + "</div>\n<p><a href=\"#graph\">Back to the graph</a></p>\n</article>\n"
}

fn conditions(seen: &LinkEvidence) -> String {
    let names = seen.conditions.iter().map(|condition| match condition.lag {
        0 => format!("{}(t)", plain(&condition.name)),
        lag => format!("{}(t-{lag})", plain(&condition.name)),
    });
    let names: Vec<String> = names.collect();
    let names = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    if seen.note.is_empty() { names } else { format!("{names}; {}", seen.note) }
}

fn has(model: &Model, link: &Link) -> bool {
    let is_it = |o: &Link| o.cause == link.cause && o.effect == link.effect && o.lag == link.lag;
    model.links.iter().any(is_it)
}

fn found_in(material: &Material, link: &Link) -> String {
    let having = material.batches.iter().filter(|(_, model)| has(model, link));
    let found: Vec<&str> = having.map(|(name, _)| name.as_str()).collect();
    let named = found.iter().take(NAMED).copied().collect::<Vec<_>>().join(", ");
    let more = if found.len() > NAMED { ", ..." } else { "" };
    match found.len() {
        0 => format!("none of {} batches", material.batches.len()),
        n => format!("{n} of {} batches: {named}{more}", material.batches.len()),
    }
}

/// The models of single batches: how many links each has.
pub(super) fn batches(material: &Material) -> String {
    if material.batches.is_empty() {
        return String::new();
    }
    let row = |(name, model): &(String, Model)| {
        let shared = model.links.iter().filter(|link| has(&material.model, link)).count();
        let (name, samples, links) = (escaped(name), model.n_samples, model.links.len());
        format!("<tr><td>{name}</td><td>{samples}</td><td>{links}</td><td>{shared}</td></tr>\n")
    };
    let rows: String = material.batches.iter().map(row).collect();
    let columns = ["batch", "samples", "links", "of these in this report"];
    section("batches", "Batches", &table("Table of the batches", &columns, &rows))
}
