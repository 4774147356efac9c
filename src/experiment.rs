//! `roscausal experiment`: the whole chain over many seeds; how often each link is found.

use std::{collections::BTreeMap, path::PathBuf};

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, discovery::Model, discovery::analysis::Settings};

use crate::{chart, demo::Run, discover::MethodArgs, expected::PAPER, interrupt::Interrupt, output};

/// Arguments of `roscausal experiment`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Seeds of the simulation, both ends included.
    #[arg(long, default_value = "1..20", value_name = "A..B")]
    seeds: String,
    /// Seconds to record per seed, as two batches.
    #[arg(long, default_value_t = 300.0)]
    duration: f64,
    /// Scenario: a built-in name or a TOML file.
    #[arg(long, default_value = "thor")]
    scenario: String,
    #[command(flatten)]
    method: MethodArgs,
    /// Threads of each analysis; default: all cores.
    #[arg(long)]
    threads: Option<usize>,
    /// Folder for recall.csv and, per seed, the model; a seed whose model is there is not run again.
    #[arg(long, value_name = "DIR", default_value = "roscausal_experiment")]
    out: PathBuf,
}

/// Runs `roscausal experiment`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let seeds = seeds(&args.seeds)?;
    let settings = args.method.settings(Settings::default().seed)?;
    let bar = chart::bar("seeds", seeds.len() as u64, false);
    let mut models = Vec::new();
    for &seed in &seeds {
        models.push(model_of(args, &settings, seed, interrupt)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let found = counts(&models);
    let file = output::write_file(&args.out, "recall.csv", recall_csv(args, &found, seeds.len()).as_bytes())?;
    println!("{}\n\n{}", table(&found, seeds.len()), file.display());
    Ok(())
}

fn seeds(text: &str) -> Result<Vec<u64>> {
    let fault = || Error::param("seeds", format!("'{text}' is no range of seeds; write it as 1..20"));
    let (first, last) = text.split_once("..").ok_or_else(fault)?;
    let number = |text: &str| text.trim_start_matches('=').trim().parse::<u64>().map_err(|_| fault());
    let (first, last) = (number(first)?, number(last)?);
    if last < first || last - first >= 1_000_000 {
        return Err(fault());
    }
    Ok((first..=last).collect())
}

/// The model of one seed, from its file when that was made with the same settings.
fn model_of(args: &Args, settings: &Settings, seed: u64, interrupt: &Interrupt) -> Result<Model> {
    let key = format!(
        "{}_{}s_{}_{}_{}",
        args.scenario.replace(['/', '\\', '.'], "-"),
        args.duration,
        settings.method,
        settings.cond_ind_test,
        settings.alpha
    );
    let name = format!("seed_{seed}.json");
    let folder = args.out.join(key);
    if let Ok(text) = std::fs::read(folder.join(&name))
        && let Ok(model) = serde_json::from_slice(&text)
    {
        return Ok(model);
    }
    let run = Run {
        scenario: args.scenario.clone(),
        seed,
        duration: args.duration,
        settings: settings.clone(),
        threads: args.threads,
        out: folder.join("work"),
        quiet: true,
    };
    let (_, model) = run.whole_chain(interrupt)?;
    output::write_file(&folder, &name, model.to_file_json().as_bytes())?;
    Ok(model)
}

type Link = (String, String);

/// How often each cross link was found, the paper's first.
fn counts(models: &[Model]) -> Vec<(Link, usize)> {
    let mut found: BTreeMap<Link, usize> = BTreeMap::new();
    for model in models {
        let mut links: Vec<Link> = model.links.iter().map(|l| (l.cause.clone(), l.effect.clone())).collect();
        links.sort();
        links.dedup();
        for link in links.into_iter().filter(|(cause, effect)| cause != effect) {
            *found.entry(link).or_default() += 1;
        }
    }
    let paper = PAPER.map(|(cause, effect)| (cause.to_owned(), effect.to_owned()));
    let mut rows: Vec<(Link, usize)> =
        paper.into_iter().map(|link| (link.clone(), found.remove(&link).unwrap_or(0))).collect();
    rows.extend(found);
    rows
}

fn table(found: &[(Link, usize)], runs: usize) -> String {
    let mut lines =
        vec!["| link | found | of | in the paper's model |".to_owned(), "|---|---|---|---|".to_owned()];
    for ((cause, effect), count) in found {
        let expected = if is_papers(cause, effect) { "yes" } else { "no" };
        lines.push(format!("| {cause} -> {effect} | {count} | {runs} | {expected} |"));
    }
    lines.join("\n")
}

fn is_papers(cause: &str, effect: &str) -> bool {
    PAPER.contains(&(cause, effect))
}

fn recall_csv(args: &Args, found: &[(Link, usize)], runs: usize) -> String {
    let mut csv = "scenario,duration,cause,effect,expected,found,runs\n".to_owned();
    for ((cause, effect), count) in found {
        let expected = is_papers(cause, effect);
        csv += &format!("{},{},{cause},{effect},{expected},{count},{runs}\n", args.scenario, args.duration);
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_a_range_with_both_ends() {
        assert_eq!(seeds("1..3").expect("a range"), [1, 2, 3]);
        assert!(seeds("3..1").is_err() && seeds("five").is_err());
    }
}
