//! `roscausal show --report`: a model and what stands behind it as one HTML file that needs no network and runs no script.

mod evidence;
#[cfg(test)]
mod hostile_tests;
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
    #[command(flatten)]
    latex: LatexArgs,
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
    #[arg(long, default_value_t = 42, help_heading = "Method")]
    seed: u64,
}

/// Files for LaTeX.
#[derive(ClapArgs)]
pub(crate) struct LatexArgs {
    /// Write the links as a LaTeX table.
    #[arg(long, value_name = "FILE.tex")]
    latex: Option<PathBuf>,
    /// Write the graph as a TikZ picture for LaTeX.
    #[arg(long, value_name = "FILE.tex")]
    tikz: Option<PathBuf>,
}

/// Runs `roscausal report`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    written(Some(&args.output), &args.latex, args.force, || source::read(args, interrupt))
}

/// Writes what was asked for of a stored model.
pub(crate) fn of_stored(model: &Path, html: Option<&Path>, latex: &LatexArgs, force: bool) -> Result<()> {
    written(html, latex, force, || source::stored(model))
}

/// Files of others are refused before anything is computed.
fn written(
    html: Option<&Path>,
    LatexArgs { latex, tikz }: &LatexArgs,
    force: bool,
    material: impl FnOnce() -> Result<Material>,
) -> Result<()> {
    html.map_or(Ok(()), |path| output::claim_file(path, page::MARK, force))?;
    latex.iter().chain(tikz).try_for_each(|path| output::claim_file(path, latex::MARK, force))?;
    if html.is_none() && latex.is_none() && tikz.is_none() {
        return Ok(());
    }
    let material = material()?;
    let write = |path: Option<&Path>, text: &dyn Fn() -> String| {
        path.map_or(Ok(()), |path| output::write_at(path, text().as_bytes()))
    };
    write(html, &|| page::html(&material))?;
    write(latex.as_deref(), &|| latex::table(&material.model))?;
    write(tikz.as_deref(), &|| latex::tikz(&material.model))?;
    let Some(html) = html else { return Ok(()) };
    let links = material.model.links.len();
    let evidence = if material.evidence.is_some() { "" } else { "; no evidence was kept beside this model" };
    let s = if links == 1 { "" } else { "s" };
    tell!("{}: {links} link{s}{evidence}", html.display());
    Ok(())
}

/// Writes the report of a run into its folder.
pub(crate) fn write_into(dir: &Path, material: &Material) -> Result<()> {
    output::write_file(dir, REPORT, page::html(material).as_bytes())
}
