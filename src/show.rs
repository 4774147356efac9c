//! `roscausal show`: a stored model, printed and drawn again, or as a report.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::Result;

use crate::{
    discover::Format,
    folders::read_model,
    html_report::{self, LatexArgs},
    output,
    report::Detail,
    results::Results,
};

/// Arguments of `roscausal show`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// A model: a folder of results, its `model.json`, or a file of the discovery node.
    model: PathBuf,
    /// Folder for its pictures and tables.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write a report: the model and what stands behind it as one HTML file, to read, print and pass on.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    latex: LatexArgs,
    /// Write although there are files of others.
    #[arg(long)]
    force: bool,
    /// What to print on stdout.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    pictures: output::PictureArgs,
    #[command(flatten)]
    detail: Detail,
}

/// Runs `roscausal show`.
pub(crate) fn run(args: &Args) -> Result<()> {
    let model = read_model(&args.model)?;
    args.pictures.check(&model)?;
    let results = Results::wanted(args.out.as_deref(), args.force, std::slice::from_ref(&args.model))?;
    args.format.print(&model, args.detail, true)?;
    html_report::of_stored(&args.model, args.report.as_deref(), &args.latex, args.force)?;
    results.map_or(Ok(()), |results| results.write(|dir| output::write_model_as(dir, &model, &args.pictures)))
}
