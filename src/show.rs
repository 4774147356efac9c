//! `roscausal show`: a stored model, printed and drawn again.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::Result;

use crate::{discover::Format, folders::read_model, output, results::Results};

/// Arguments of `roscausal show`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// A model: `model.json` of a result folder, or a file of the discovery node.
    model: PathBuf,
    /// Folder for its pictures and tables.
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write into --out although there are files of others.
    #[arg(long, requires = "out")]
    force: bool,
    /// What to print on stdout.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Runs `roscausal show`.
pub(crate) fn run(args: &Args) -> Result<()> {
    let model = read_model(&args.model)?;
    let results = Results::wanted(args.out.as_deref(), args.force, std::slice::from_ref(&args.model))?;
    args.format.print(&model)?;
    results.map_or(Ok(()), |results| results.write(|dir| output::write_model(dir, &model).map(drop)))
}
