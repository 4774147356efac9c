//! The page: sections of HTML. Every text from outside goes through `escaped`; there is no script, and the page's own
//! policy forbids any.

use std::fmt::Write;

use roscausal_discovery::{Model, SummaryLink, draw, draw::escaped, names::plain, settings::setting};

use super::{
    Material, evidence,
    parts::{anchor, section, table},
};
use crate::{flags, report};

/// Only the styles of the page itself; nothing is loaded, nothing runs.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// What every report has near its beginning, by which a later one knows that it may take its place.
pub(super) const MARK: &str = "<meta name=\"generator\" content=\"roscausal\">";

/// Most tests in the table of all.
const MOST_TESTS: usize = 3000;

/// Widest picture that shrinks with the page, in pixels.
const FITS: f64 = 900.0;

/// The whole report.
pub(super) fn html(material: &Material) -> String {
    let model = &material.model;
    let title = escaped(&format!("Causal model of {}", material.name));
    let sections = [
        summary(material),
        graph(model),
        links(model),
        evidence::cards(material),
        evidence::batches(material),
        data(material),
        settings(model),
        caveats(model),
        reproduce(material),
        appendix(model),
    ];
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n{MARK}\n<title>{title}</title>\n<style>\n{}</style>\n</head>\n<body>\n\
         <a class=\"skip\" href=\"#main\">Skip to the content</a>\n<main id=\"main\">\n<h1>{title}</h1>\n{}</main>\n</body>\n</html>\n",
        include_str!("style.css"),
        sections.concat()
    )
}

/// What may be said, before anything else.
fn summary(material: &Material) -> String {
    let model = &material.model;
    let of = model.summary().spelled(flags::spelled_one);
    let list = |items: &mut dyn Iterator<Item = &String>| -> String {
        items.map(|item| format!("<li>{}</li>\n", escaped(item))).collect()
    };
    let time = model.run_time_s.map_or(String::new(), |s| format!(", found in {s:.2} s"));
    let mut content = format!("<p class=\"lead\">{}{time}.</p>\n", escaped(&of.headline));
    let _ = write!(content, "<ul class=\"conclusion\">\n{}</ul>\n", list(&mut of.conclusion.iter()));
    if !of.advice.is_empty() {
        let advice = list(&mut of.advice.iter().map(|one| &one.text));
        let _ = write!(content, "<h3>Next</h3>\n<ol>\n{advice}</ol>\n");
    }
    section("summary", "Summary", &content)
}

fn graph(model: &Model) -> String {
    let wide = |svg: &str, name: &str| {
        let width = svg.split('"').skip_while(|part| !part.ends_with(" width=")).nth(1);
        // A small picture shrinks with the page; a large one is scrolled, so that its names can be read.
        let fits = width.and_then(|width| width.parse().ok()).is_some_and(|width: f64| width <= FITS);
        let class = if fits { "figure fits" } else { "figure" };
        format!(
            "<div class=\"{class}\" tabindex=\"0\" role=\"region\" aria-label=\"{name}\">\n{}</div>\n",
            asked(model, svg)
        )
    };
    let mut content = String::from("<p>An arrow leads to its evidence. Hover shows all its lags.</p>\n");
    content += &wide(&draw::dag(model), "Summary graph");
    content += "<details><summary>In time: which step drives which</summary>\n";
    content += &wide(&draw::tsdag(model), "Time series graph");
    content += "</details>\n";
    section("graph", "Graph", &content)
}

/// The picture with each arrow as an anchor to the evidence of its first link.
fn asked(model: &Model, svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    let mut open = false;
    let mut named = std::collections::BTreeSet::new();
    for line in svg.lines() {
        let place = model.links.iter().position(|link| {
            let (cause, effect) = (escaped(&link.cause), escaped(&link.effect));
            line.starts_with(&format!("<g class=\"link\" data-cause=\"{cause}\" data-effect=\"{effect}\">"))
        });
        match place {
            Some(place) => {
                let title = line.split_once('>').map_or("", |(_, rest)| rest);
                let name = escaped(&report::sentence(model, &model.links[place]));
                // The label leads there, too, but it is no second stop for the keyboard and not read twice.
                let stated = match named.insert(place) {
                    true => format!("aria-label=\"{name}\""),
                    false => "tabindex=\"-1\" aria-hidden=\"true\"".to_owned(),
                };
                let _ = writeln!(out, "<a href=\"#{}\" {stated}>{title}", anchor(place));
                open = true;
            }
            None if open && line == "</g>" => {
                out.push_str("</a>\n");
                open = false;
            }
            None => out.extend([line, "\n"]),
        }
    }
    out
}

fn links(model: &Model) -> String {
    if model.links.is_empty() {
        return String::new();
    }
    let (mut rows, summary) = (String::new(), model.summary());
    for (place, link) in model.links.iter().enumerate() {
        let (cause, effect, lag) = (plain(&link.cause), plain(&link.effect), link.lag);
        let is_it = |of: &&SummaryLink| (&of.cause, &of.effect, of.lag) == (&cause, &effect, lag);
        let sure = summary.links.iter().find(is_it).map_or("own past", |of| of.sure);
        let (cause, effect) = (escaped(&cause), escaped(&effect));
        let (strength, p) = (link.strength_in_words(3), escaped(&report::p_cell(model, link.p_value)));
        let (anchor, words) = (anchor(place), escaped(&report::sentence(model, link)));
        let _ = writeln!(
            rows,
            "<tr><td>{cause}</td><td>{effect}</td><td>{lag}</td><td>{strength}</td><td>{p}</td><td>{sure}</td><td><a href=\"#{anchor}\">{words}</a></td></tr>"
        );
    }
    let columns = ["cause", "effect", "lag", "strength", "p", "how sure", "in words"];
    section("links", "Links", &table("Table of links", &columns, &rows))
}

fn data(material: &Material) -> String {
    let Some(evidence) = &material.evidence else { return String::new() };
    let number = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.4}"));
    let lengths: Vec<String> = evidence.rows.iter().map(ToString::to_string).collect();
    let mut rows = String::new();
    for facts in &evidence.variables {
        let remark = match facts {
            facts if facts.present == 0 => "empty",
            facts if facts.sd.is_some_and(|sd| sd == 0.0) => "constant: it can have no link",
            facts if facts.missing * 5 > facts.present => "more than a sixth is missing",
            facts if facts.autocorrelation.is_some_and(|a| a > 0.98) => {
                "neighbouring samples are nearly equal; a longer step may tell more"
            }
            _ => "",
        };
        let (present, missing) = (facts.present, facts.missing);
        let numbers = [facts.min, facts.max, facts.mean, facts.sd, facts.autocorrelation].map(number);
        let (name, numbers) = (escaped(&plain(&facts.name)), numbers.join("</td><td>"));
        let _ = writeln!(
            rows,
            "<tr><td>{name}</td><td>{present}</td><td>{missing}</td><td>{numbers}</td><td>{remark}</td></tr>"
        );
    }
    let columns =
        ["variable", "values", "missing", "smallest", "largest", "mean", "sd", "autocorrelation", "remark"];
    let table = table("Table of the variables", &columns, &rows);
    section("data", "Data check", &format!("<p>Rows of each recording: {}.</p>\n{table}", lengths.join(", ")))
}

fn settings(model: &Model) -> String {
    let level = |level: Option<f64>, none: &str| level.map_or(none.to_owned(), |level| level.to_string());
    let step = model.step_in_words().unwrap_or_else(|| "unknown".to_owned());
    let (level_name, level_text) = model.link_level_in_words();
    let rows = [
        ("method", escaped(model.method.name())),
        ("independence test", escaped(&model.cond_ind_test)),
        ("level of a link", format!("{level_text} ({level_name})")),
        ("level of the condition selection", level(model.pc_alpha, "chosen by a score")),
        ("level of the filter", level(model.f_alpha, "no filter")),
        ("correction for many tests", escaped(&model.fdr)),
        ("lags", format!("{} to {} steps", model.tau_min, model.tau_max)),
        ("step", step),
        ("samples of a test", model.n_samples.to_string()),
        ("recordings", model.n_recordings.to_string()),
        ("seed", model.seed.to_string()),
    ];
    let others = model.settings.iter().filter_map(|(id, value)| setting(id).zip(Some(value)));
    let others = others.map(|(setting, value)| (setting.flag, escaped(&setting.written(value))));
    let row = |(name, value)| format!("<div><dt>{name}</dt><dd>{value}</dd></div>\n");
    let rows: String = rows.into_iter().chain(others).map(row).collect();
    section("settings", "Settings", &format!("<dl>\n{rows}</dl>\n"))
}

fn caveats(model: &Model) -> String {
    let summary = model.summary().spelled(flags::spelled_one);
    let about = summary.about_data.iter().map(|about| format!("About the data: {about}"));
    let mut items: Vec<String> = about.chain(summary.notes.iter().cloned()).collect();
    items.push("A link means: no other variable that was recorded explains it. A cause of both that was not recorded can.".into());
    items.push("The system is taken to be the same from the first sample to the last.".into());
    items.push("An effect faster than one step appears at lag 0, or not at all.".into());
    let items = items.iter().map(|item| format!("<li>{}</li>\n", escaped(item))).collect::<String>();
    section("caveats", "Caveats", &format!("<ul>\n{items}</ul>\n"))
}

fn reproduce(material: &Material) -> String {
    let (version, command) = (env!("CARGO_PKG_VERSION"), escaped(&material.command));
    let content = format!(
        "<p>The same data, settings and seed give the same model, byte for byte, on any number of threads. \
         Made with roscausal {version}.</p>\n<pre tabindex=\"0\">{command}</pre>\n\
         <p>To cite: roscausal {version} (its CITATION.cff names the papers of the methods), and Castri et al. 2024, arXiv:2402.16068.</p>\n"
    );
    section("reproduce", "How to reproduce and to cite", &content)
}

/// All tests of the run, folded: for readers who check.
fn appendix(model: &Model) -> String {
    let names: Vec<String> = model.features.iter().map(|name| escaped(&plain(name))).collect();
    let (mut rows, mut tests) = (String::new(), 0);
    for (i, cause) in names.iter().enumerate() {
        for (j, effect) in names.iter().enumerate() {
            for lag in model.tau_min..=model.tau_max {
                let Some(value) = model.val_matrix[i][j][lag].filter(|_| lag > 0 || i < j) else { continue };
                tests += 1;
                if tests > MOST_TESTS {
                    continue;
                }
                let p = escaped(&report::p_cell(model, model.p_matrix[i][j][lag]));
                let samples = model.n_matrix[i][j][lag].map_or("–".to_owned(), |n| n.to_string());
                let mark = model.graph[i][j][lag];
                let mark = if mark.is_link() { escaped(&mark.to_string()) } else { String::new() };
                let _ = writeln!(
                    rows,
                    "<tr><td>{cause}</td><td>{effect}</td><td>{lag}</td><td>{value:.4}</td><td>{p}</td><td>{samples}</td><td>{mark}</td></tr>"
                );
            }
        }
    }
    if tests == 0 {
        return String::new();
    }
    let columns = ["cause", "effect", "lag", "value", "p", "samples", "link"];
    let table = table("Table of all tests", &columns, &rows);
    let shown = if tests > MOST_TESTS {
        format!(" (the first {MOST_TESTS}; model.json has all)")
    } else {
        String::new()
    };
    let content = format!("<details><summary>All {tests} tests{shown}</summary>\n{table}</details>\n");
    section("appendix", "Appendix for experts", &content)
}
