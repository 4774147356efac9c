//! `roscausal report`: a model and what stands behind it as one HTML file that needs no network and runs no script.

mod evidence;
#[cfg(test)]
mod hostile;
mod latex;
mod page;
mod parts;
mod source;

use std::path::{Path, PathBuf};

use clap::Args as ClapArgs;
use roscausal_core::Result;

use crate::{
    discover::{MeansArgs, MethodArgs},
    interrupt::Interrupt,
    output,
    recording::InputArgs,
};

pub(crate) use source::{Material, flags, quoted};

/// Name of the report in a folder of results.
pub(crate) const REPORT: &str = "report.html";

/// Arguments of `roscausal report`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// A folder of results (of demo, replay or discover), a model (.json), or data to analyse first (a CSV file or a
    /// recording; the other options then say how).
    #[arg(value_name = "DIR|MODEL|CSV")]
    input: PathBuf,
    /// The report.
    #[arg(short, long, value_name = "FILE.html", default_value = REPORT)]
    output: PathBuf,
    /// Also write the links as a LaTeX table.
    #[arg(long, value_name = "FILE.tex")]
    latex: Option<PathBuf>,
    /// Also write the graph as a TikZ picture for LaTeX.
    #[arg(long, value_name = "FILE.tex")]
    tikz: Option<PathBuf>,
    /// Overwrite files of these names although no report of roscausal is in them.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    inputs: InputArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    means: MeansArgs,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 42)]
    seed: u64,
}

/// Runs `roscausal report`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    output::claim_file(&args.output, page::MARK, args.force)?;
    for path in args.latex.iter().chain(&args.tikz) {
        output::claim_file(path, latex::MARK, args.force)?;
    }
    let material = source::read(args, interrupt)?;
    output::write_at(&args.output, page::html(&material).as_bytes())?;
    if let Some(path) = &args.latex {
        output::write_at(path, latex::table(&material.model).as_bytes())?;
    }
    if let Some(path) = &args.tikz {
        output::write_at(path, latex::tikz(&material.model).as_bytes())?;
    }
    let links = material.model.links.len();
    let evidence = match &material.evidence {
        Some(_) => "",
        None => "; no evidence was kept beside this model",
    };
    crate::terminal::say!(
        "{}: {links} link{}{evidence}",
        args.output.display(),
        if links == 1 { "" } else { "s" }
    );
    Ok(())
}

/// Writes the report of a run into its folder.
pub(crate) fn write_into(dir: &Path, material: &Material) -> Result<()> {
    output::write_file(dir, REPORT, page::html(material).as_bytes()).map(drop)
}
