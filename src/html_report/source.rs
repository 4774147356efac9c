//! What a report is made of, from a folder, a model or data.

use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

use roscausal_core::{Error, Result, batch::pool::with_ending, nodes::EVIDENCE_FOLDER};
use roscausal_discovery::{
    Evidence, Model,
    methods::Reads,
    settings::{Kind, setting},
};

use super::Args;
use crate::{
    discover::{self, AnalysisArgs},
    folders::{EVIDENCE, model_in, read_evidence, read_model},
    interrupt::Interrupt,
    results::check_whole,
};

/// Most variables and lags of a model that a report shows.
const LARGEST: usize = 1000;

/// What a report is made of.
pub(crate) struct Material {
    pub(crate) model: Model,
    /// What stands behind the model, if it was kept.
    pub(crate) evidence: Option<Evidence>,
    /// Where the model comes from.
    pub(crate) name: String,
    /// The command that makes the same model again.
    pub(crate) command: String,
    /// The models of single batches, oldest first: name and model.
    pub(crate) batches: Vec<(String, Model)>,
}

/// Reads what the arguments name.
pub(super) fn read(args: &Args, interrupt: &Interrupt) -> Result<Material> {
    let input = &args.input;
    check_whole(input)?;
    let is_model = input.extension().is_some_and(|extension| extension == "json");
    if is_model || (input.is_dir() && !holds_recording(input)?) {
        return stored(input);
    }
    let (inputs, method, means) = (args.inputs.clone(), args.method.clone(), args.means.clone());
    let how = AnalysisArgs { inputs, method, means, ..AnalysisArgs::default() };
    let analysis = discover::Args::of(std::slice::from_ref(input), &how, args.seed)?;
    let discover::Answer { model, evidence, .. } = discover::found(&analysis, interrupt, false)?;
    let name = input.display().to_string();
    let command = command(&model, &name);
    Ok(Material { model, evidence: Some(evidence), name, command, batches: Vec::new() })
}

/// What a model or a folder of results holds.
pub(super) fn stored(path: &Path) -> Result<Material> {
    if path.is_dir() { of_folder(path) } else { of_model(path, path.display().to_string()) }
}

/// Whether a folder is a recording, not results.
fn holds_recording(dir: &Path) -> Result<bool> {
    let has = |ending: &str| with_ending(dir, ending).map(|files| !files.is_empty());
    Ok(!dir.join("model.json").exists() && (has(".bag")? || has(".mcap")? || has(".db3")?))
}

/// `model.json` in a folder; else the newest of its models in `cm_pool`, or in the folder itself.
fn of_folder(dir: &Path) -> Result<Material> {
    let pool = dir.join("cm_pool");
    let only_models = pool.is_dir();
    let pool = if only_models { pool } else { dir.to_owned() };
    let mut models: Vec<(PathBuf, Model)> = Vec::new();
    for path in with_ending(&pool, ".json")? {
        match read_model(&path) {
            Ok(model) => models.push((path, model)),
            Err(error) if only_models => tell!("note: left out: {error}"),
            // Other JSON files may lie there, too.
            Err(_) => {}
        }
    }
    let newest = model_in(dir)?;
    models.retain(|(path, model)| *path != dir.join("model.json") && check(model, path).is_ok());
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut material = of_model(&newest, dir.display().to_string())?;
    if models.len() > 1 {
        material.batches = models.into_iter().map(|(path, model)| (stem(&path), model)).collect();
    }
    Ok(material)
}

fn of_model(path: &Path, name: String) -> Result<Material> {
    let model = read_model(path)?;
    check(&model, path)?;
    let dir = path.parent().unwrap_or(Path::new("."));
    let own_name = path.file_name().unwrap_or_default();
    let beside = match own_name.to_str() {
        Some("model.json") => dir.join(EVIDENCE),
        _ => dir.join(EVIDENCE_FOLDER).join(own_name),
    };
    let evidence = read_evidence(&beside)?.filter(|evidence| {
        let is_of = evidence.is_of(&model);
        if !is_of {
            tell!("note: left out: {}: it is the evidence of another model", beside.display());
        }
        is_of
    });
    let command = command(&model, "DATA.csv");
    Ok(Material { model, evidence, name, command, batches: Vec::new() })
}

/// Refuses models that would be drawn for ever.
fn check(model: &Model, path: &Path) -> Result<()> {
    if model.tau_max <= LARGEST && model.features.len() <= LARGEST {
        return Ok(());
    }
    let (n, lags) = (model.features.len(), model.tau_max);
    let reason = format!(
        "a report shows up to {LARGEST} variables and lags; the model has {n}, with lags up to {lags}"
    );
    Err(Error::file(path, reason))
}

/// The command that makes the model again from `file`.
fn command(model: &Model, file: &str) -> String {
    format!("roscausal discover {} {} --seed {}", quoted(file), flags(model), model.seed)
}

/// A word for a shell.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/+".contains(c);
    if word.chars().all(plain) { word.to_owned() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// The flags of the analysis that made the model.
pub(crate) fn flags(model: &Model) -> String {
    let mut line = format!("--method {}", model.method);
    // Writing to a String cannot fail.
    if model.cond_ind_test != "none" {
        let _ = write!(line, " --test {}", model.cond_ind_test);
    }
    // A method of others has a name that is not known here.
    let method = model.method.method();
    if method.is_none_or(|method| !method.info().one_level && method.info().p_values) {
        let _ = write!(line, " --alpha {}", model.alpha);
    }
    let _ = write!(line, " --tau-min {} --tau-max {}", model.tau_min, model.tau_max);
    if method.is_none_or(|method| method.reads(Reads::PcAlpha)) {
        let level = model.pc_alpha.map_or("auto".to_owned(), |level| level.to_string());
        let _ = write!(line, " --pc-alpha {level}");
    }
    if let Some(level) = model.f_alpha {
        let _ = write!(line, " --f-alpha {level}");
    }
    if model.fdr != "none" {
        let _ = write!(line, " --fdr {}", model.fdr);
    }
    for (id, value) in &model.settings {
        let _ = match setting(id) {
            Some(setting) if setting.kind == Kind::Flag => write!(line, " --{}", setting.flag),
            Some(setting) => write!(line, " --{} {}", setting.flag, quoted(&setting.written(value))),
            None => continue,
        };
    }
    if let Some(of) = model.confidence.as_ref().map(|confidence| &confidence.resampling) {
        let share = of.share.map_or(String::new(), |share| format!(" --share {share}"));
        let (n, scheme, block) = (of.asked, quoted(&of.scheme), quoted(&of.block));
        let _ = write!(line, " --resamples {n} --resampling {scheme} --block {block}{share}");
    }
    line
}
