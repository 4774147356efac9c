//! `roscausal compare`: what differs between two stored models.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::Result;
use roscausal_discovery::{
    Link, LinkMark, Model, draw,
    names::plain,
    settings::{SETTINGS, Setting},
};

use crate::{folders::read_model, output, report, results::Results};

/// Arguments of `roscausal compare`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// The first model.
    a: PathBuf,
    /// The second model.
    b: PathBuf,
    /// Folder for pictures of the links that both have, and that only one has.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into --out although there are files of others.
    #[arg(long, requires = "out")]
    force: bool,
}

/// The links of two models.
struct Difference<'a> {
    both: Vec<(&'a Link, &'a Link)>,
    only_a: Vec<&'a Link>,
    only_b: Vec<&'a Link>,
}

/// Runs `roscausal compare`.
pub(crate) fn run(args: &Args) -> Result<()> {
    let (a, b) = (read_model(&args.a)?, read_model(&args.b)?);
    let results = Results::wanted(args.out.as_deref(), args.force, &[args.a.clone(), args.b.clone()])?;
    let difference = Difference::of(&a, &b);
    let (first, second) = (args.a.display().to_string(), args.b.display().to_string());
    settings(&a, &b).iter().for_each(|line| say!("{line}"));
    let names = |model: &Model| -> Vec<String> {
        model.features.iter().chain(&model.dropped).map(|name| plain(name)).collect()
    };
    for (name, here, there) in [(&first, names(&a), names(&b)), (&second, names(&b), names(&a))] {
        let only: Vec<String> = here.into_iter().filter(|variable| !there.contains(variable)).collect();
        if !only.is_empty() {
            say!("variables only in {name}: {}", only.join(", "));
        }
    }
    say!("{} links in both", difference.both.len());
    for (in_a, in_b) in &difference.both {
        let turned = match (in_a.value, in_b.value) {
            (Some(one), Some(other)) if one * other < 0.0 => ", of opposite sign",
            _ => "",
        };
        let (cause, effect, lag) = (plain(&in_a.cause), plain(&in_a.effect), in_a.lag);
        let (one, other) = (in_a.strength_in_words(2), in_b.strength_in_words(2));
        say!("  {cause} -> {effect} at lag {lag}: {one}, {other}{turned}");
    }
    for (name, model, links) in [(&first, &a, &difference.only_a), (&second, &b, &difference.only_b)] {
        say!("{} only in {name}", links.len());
        links.iter().for_each(|link| say!("  {}", report::sentence(model, link)));
    }
    if !(difference.only_a.is_empty() && difference.only_b.is_empty()) {
        say!("A link that only one model has is no proof of a change: it may be missing in the");
        say!("other by chance. `roscausal roll --changes` tests what changed.");
    }
    let Some(results) = results else { return Ok(()) };
    let both: Vec<&Link> = difference.both.iter().map(|(in_a, _)| *in_a).collect();
    let Difference { only_a, only_b, .. } = &difference;
    let pictures = [("both.svg", &a, &both), ("only_a.svg", &a, only_a), ("only_b.svg", &b, only_b)];
    results.write(|dir| {
        pictures.into_iter().try_for_each(|(name, model, links)| {
            output::write_file(dir, name, draw::dag(&with_links(model, links)).as_bytes())
        })
    })
}

impl<'a> Difference<'a> {
    fn of(a: &'a Model, b: &'a Model) -> Self {
        let twin = |link: &Link, of: &'a Model| of.links.iter().find(|other| same(link, other));
        let both = a.links.iter().filter_map(|link| Some((link, twin(link, b)?))).collect();
        let only_a = a.links.iter().filter(|link| twin(link, b).is_none()).collect();
        Self { both, only_a, only_b: b.links.iter().filter(|link| twin(link, a).is_none()).collect() }
    }
}

/// Whether two links join the same variables at the same lag with the same mark.
fn same(a: &Link, b: &Link) -> bool {
    let key = |link: &Link| (plain(&link.cause), plain(&link.effect), link.lag, link.mark);
    key(a) == key(b)
}

/// The settings and facts in which two models differ, one line each.
fn settings(a: &Model, b: &Model) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or("none".to_owned(), |value| value.to_string());
    let facts = |model: &Model| {
        [
            ("method", model.method.to_string()),
            ("test", model.cond_ind_test.clone()),
            ("alpha", model.alpha.to_string()),
            ("pc-alpha", number(model.pc_alpha)),
            ("f-alpha", number(model.f_alpha)),
            ("fdr", model.fdr.clone()),
            ("lags", format!("{}..{}", model.tau_min, model.tau_max)),
            ("step", number(model.dt)),
            ("samples", model.n_samples.to_string()),
            ("recordings", model.n_recordings.to_string()),
            ("seed", model.seed.to_string()),
            ("status", model.status.to_string()),
        ]
    };
    let pairs = facts(a).into_iter().zip(facts(b));
    let facts = pairs.filter(|(a, b)| a.1 != b.1).map(|(a, b)| format!("{}: {}, {}", a.0, a.1, b.1));
    let value = |model: &Model, setting: &Setting| {
        model.settings.get(setting.id).map_or("default".to_owned(), |value| setting.written(value))
    };
    let others = SETTINGS.iter().map(|setting| (setting.flag, value(a, setting), value(b, setting)));
    let others = others.filter(|(_, a, b)| a != b).map(|(flag, a, b)| format!("{flag}: {a}, {b}"));
    facts.chain(others).collect()
}

/// The model with these of its links only, for a picture.
fn with_links(model: &Model, links: &[&Link]) -> Model {
    let mut part = model.clone();
    part.links.retain(|link| links.iter().any(|kept| same(kept, link)));
    let kept = part.links.clone();
    for (i, cause) in model.features.iter().enumerate() {
        for (j, effect) in model.features.iter().enumerate() {
            for lag in 0..part.graph[i][j].len() {
                let joins = |from, to| {
                    kept.iter().any(|link| (&link.cause, &link.effect, link.lag) == (from, to, lag))
                };
                if !joins(cause, effect) && (lag > 0 || !joins(effect, cause)) {
                    part.graph[i][j][lag] = LinkMark::Absent;
                }
            }
        }
    }
    part
}
