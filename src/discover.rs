//! `roscausal discover`: from CSV files or recordings to a causal model.

mod aside;
mod changes;
mod condition;
mod estimate;
#[cfg(test)]
mod hostile_tests;
mod method;
mod reading;
mod resampling;
mod trajectories;

use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
};

use clap::{Args as ClapArgs, ValueEnum};
use ndarray::Array2;
use roscausal_core::{
    Error, Result,
    batch::{
        Table,
        joint::{Facts, Joint},
        pool::with_ending,
        table::{Note, common_step},
    },
};
use roscausal_discovery::{
    DataFrame, DataProfile, Evidence, Fault, Levelled, Model, Named, Recommendation, Settings,
    confidence::{ResampleGraph, Resampled, set_step},
};

use crate::{
    export, flags, folders,
    interrupt::Interrupt,
    output,
    recording::{self, InputArgs, Source},
    report::{self, Detail},
    results::{Results, check_whole},
    terminal,
};
use changes::ChangeArgs;
pub(crate) use method::{Analysis, MeansArgs, MethodArgs};
use reading::{PartArgs, ReadArgs};
pub(crate) use resampling::ResampleArgs;
use resampling::{Advised, ResultArgs};
use trajectories::TrajectoryArgs;

/// Arguments of `roscausal discover`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// CSV files with a header (`-`: the standard input), recordings (.bag, .mcap, .db3, folders of them), or the folder of a demo or a node. Several
    /// files are recordings of one system: no lagged sample spans two files.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    how: AnalysisArgs,
    #[command(flatten)]
    resample: ResampleArgs,
    #[command(flatten)]
    result: ResultArgs,
    #[command(flatten)]
    trajectories: TrajectoryArgs,
    #[command(flatten)]
    changes: ChangeArgs,
    /// Batches with several people: pooled (each person is a recording of one system) or joint (everybody's
    /// variables).
    #[arg(long, default_value = "pooled", value_parser = ["pooled", "joint"], help_heading = "People")]
    several_people: String,
    #[command(flatten)]
    pictures: output::PictureArgs,
    /// With --method auto: also do what is advised.
    #[arg(long, help_heading = "Method")]
    take_it: bool,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 42, help_heading = "Method")]
    seed: u64,
    /// Folder for the model, its pictures and tables.
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write into --out although there are files of others, and over the file of --resample-out.
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// What to print on stdout; and `trajectories`: the files are tables with a row for each agent and time (ETH, UCY, ATC, THÖR), which
    /// become the variables of the nodes. Both: `--format trajectories,json`. Default: text.
    #[arg(long, value_enum, value_delimiter = ',', ignore_case = true, help_heading = "Output")]
    format: Vec<FormatWord>,
}

/// A word of `discover --format`: what to print, or what is read.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatWord {
    /// Sentences and a table.
    Text,
    /// One JSON object (docs/model-schema.md).
    Json,
    /// A graph for Graphviz.
    Dot,
    /// A graph for networkx, Gephi, yEd, igraph.
    Graphml,
    /// A table of the links.
    Csv,
    /// The files have a row for each agent and time.
    Trajectories,
}

impl FormatWord {
    /// What to print has the same word; what is read has none.
    fn printed(self) -> Option<Format> {
        Format::from_str(self.to_possible_value()?.get_name(), false).ok()
    }
}

/// What to print of a model.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// Sentences and a table.
    Text,
    /// One JSON object (docs/model-schema.md).
    Json,
    /// A graph for Graphviz.
    Dot,
    /// A graph for networkx, Gephi, yEd, igraph.
    Graphml,
    /// A table of the links.
    Csv,
}

impl Format {
    /// Prints a model; `advice`: whether the text says what to do next.
    pub(crate) fn print(self, model: &Model, detail: Detail, advice: bool) -> Result<()> {
        match self {
            Self::Text => terminal::print_report(&report::text_with(model, detail, advice)),
            Self::Json => terminal::print_json(&model.to_json()),
            Self::Dot => terminal::print_text(&export::dot(model)),
            Self::Graphml => terminal::print_text(&export::graphml(model)),
            Self::Csv => terminal::print_text(&String::from_utf8_lossy(&export::links_csv(model)?)),
        }
        Ok(())
    }
}

/// Runs `roscausal discover`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    interrupt.nothing_at_stake("there is no result yet, and nothing is written");
    let format = args.printed()?;
    Error::ensure(!args.take_it || args.how.method.is_auto(), "take-it", || "it is for --method auto")?;
    if args.how.method.is_auto() && !args.take_it {
        return explain(args, interrupt);
    }
    let results = Results::wanted(args.out.as_deref(), args.force, &args.files)?;
    results.iter().for_each(|results| interrupt.remove_at_end(results.temporary()));
    if let Some(file) = &args.result.resample_out {
        output::claim_file(file, RESAMPLE_MARK, args.force)?;
    }
    let keep = results.as_ref().map(|results| results.folder().join("batches"));
    let Answer { model, evidence, data, graphs } =
        found_and_kept(args, interrupt, format != Format::Text, keep.as_deref())?;
    args.pictures.check(&model)?;
    // From here on there is a result.
    interrupt.writing();
    format.print(&model, args.result.detail, args.result.advice == Advised::On)?;
    // Last: what cannot be written is at least printed.
    if let Some(file) = &args.result.resample_out {
        output::write_at(file, json_lines(&graphs)?.as_bytes())?;
    }
    let Some(results) = results else { return Ok(()) };
    results.write(|dir| {
        output::write_model_as(dir, &model, &args.pictures)?;
        output::write_file(dir, folders::EVIDENCE, evidence.to_json().as_bytes())?;
        let kept = keep.iter().flat_map(|folder| with_ending(folder, ".csv")).flatten();
        let files = args.files.iter().cloned().chain(kept);
        let units: Vec<_> = files.flat_map(|file| output::units_beside(&file)).collect();
        for (i, recording) in data.recordings().iter().enumerate().take(MOST_PICTURES) {
            let name = format!("series_{}", i + 1);
            output::write_series(dir, &name, data.var_names(), &units, recording.view(), model.dt)?;
        }
        Ok(())
    })
}

/// Says which method and test these data ask for, and why. Nothing is analysed.
fn explain(args: &Args, interrupt: &Interrupt) -> Result<()> {
    let mut request = args.how.method.request_for_reading(args.seed)?;
    let Data { data, origins, .. } = Data::read(args, &mut request.settings, interrupt, true, None)?;
    look_at(&data, &origins, args, &request.settings)?;
    let recommended = Recommendation::of(&data, &request.settings);
    let chosen = args.how.method.chosen(&recommended, &request)?;
    let (method, test) = (chosen.method, &chosen.cond_ind_test);
    say!("For these data I would take {method} with {test}:");
    recommended.why.iter().for_each(|reason| say!("* {reason}"));
    say!("* {}: {}", method.name(), method.info().assumes);
    say!(
        "Nothing was analysed. The same command with --method {method} --test {test} does it, or with --take-it. `roscausal methods` \
         has all methods."
    );
    Ok(())
}

/// Recordings of which pictures are drawn.
const MOST_PICTURES: usize = 12;

/// What a file of [`json_lines`] begins with.
const RESAMPLE_MARK: &str = "{\"resample\":";

fn json_lines(graphs: &[ResampleGraph]) -> Result<String> {
    let line = |graph: &ResampleGraph| {
        let text = serde_json::to_string(graph);
        text.map(|text| text + "\n").map_err(|e| Error::Data(format!("a resample cannot be written: {e}")))
    };
    graphs.iter().map(line).collect()
}

/// What the analysis of files gives.
pub(crate) struct Answer {
    pub(crate) model: Model,
    /// What stands behind the model.
    pub(crate) evidence: Evidence,
    data: DataFrame,
    /// The graphs of the resamples.
    graphs: Vec<ResampleGraph>,
}

/// Analyses the files.
pub(crate) fn found(args: &Args, interrupt: &Interrupt, quiet: bool) -> Result<Answer> {
    found_and_kept(args, interrupt, quiet, None)
}

/// As [`found`]; the batches that are made of recordings are also put into the folder `keep`.
fn found_and_kept(args: &Args, interrupt: &Interrupt, quiet: bool, keep: Option<&Path>) -> Result<Answer> {
    let mut request = args.how.method.request_for_reading(args.seed)?;
    let resampling = args.resample.asked()?;
    request.settings.test.max_memory = args.how.means.max_bytes();
    let Data { data, dt, mut warnings, origins, runs, .. } =
        Data::read(args, &mut request.settings, interrupt, quiet, keep)?;
    let data = data.with_named_vectors(&request.vectors)?;
    if args.how.method.finds_lag() {
        let (lag, test) = (request.settings.tau_max, request.settings.asked_test());
        let later = DataProfile::of(&data, lag).0.with_later(&data, lag, Some(test), dt).later;
        let lag = later.first().map_or(lag, |later| later.tau_max);
        request.settings.tau_max = lag;
        warnings.push(format!("the largest lag is {lag}, as far as dependence is seen"));
    }
    if args.how.method.is_auto() {
        request.settings = args.how.method.chosen(&Recommendation::of(&data, &request.settings), &request)?;
    }
    let settings = args.how.method.for_variables(&request, data.var_names())?;
    let profile = look_at(&data, &origins, args, &settings)?;
    let Levelled { data, settings, note } = Levelled::of(data, &runs, settings);
    warnings.extend(note);
    let profile = settings.look_later(profile, &data, dt);
    if let Some(reported) = estimate::check(&data, &settings, resampling.as_ref(), &args.how.means)? {
        tell!("{reported}");
    }
    let Resampled { mut model, evidence, graphs } =
        args.how.means.analyse(&data, &settings, resampling.as_ref(), interrupt, quiet)?;
    set_step(&mut model, dt);
    model.about_data = Some(profile);
    model.warnings.splice(0..0, warnings);
    Ok(Answer { model: model.spelled(flags::spelled_one), evidence, data, graphs })
}

/// How files are read, and how they will be analysed.
#[derive(ClapArgs, Clone, Debug, Default)]
pub(crate) struct AnalysisArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    #[command(flatten)]
    pub(crate) method: MethodArgs,
    #[command(flatten)]
    pub(crate) means: MeansArgs,
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    #[command(flatten)]
    pub(crate) part: PartArgs,
}

/// The data of files, the settings for them, and their step in seconds, if known; refused are those that [`found`] refuses.
pub(crate) fn read(
    files: &[PathBuf],
    how: &AnalysisArgs,
    seed: u64,
    interrupt: &Interrupt,
) -> Result<(DataFrame, Settings, Option<f64>)> {
    let args = Args::of(files, how, seed)?;
    let mut request = args.how.method.request(seed)?;
    request.settings.test.max_memory = args.how.means.max_bytes();
    let Data { data, dt, origins, runs, .. } =
        Data::read(&args, &mut request.settings, interrupt, true, None)?;
    let data = data.with_named_vectors(&request.vectors)?;
    let settings = args.how.method.for_variables(&request, data.var_names())?;
    look_at(&data, &origins, &args, &settings)?;
    let Levelled { data, settings, .. } = Levelled::of(data, &runs, settings);
    Ok((data, settings, dt))
}

impl Args {
    /// What to print.
    fn printed(&self) -> Result<Format> {
        let mut printed = self.format.iter().filter_map(|word| word.printed());
        match (printed.next(), printed.next()) {
            (first, None) => Ok(first.unwrap_or(Format::Text)),
            _ => Err(Error::param("format", "several are named; one is printed, --out writes all")),
        }
    }

    /// Whether the files have a row for each agent and time.
    fn has_trajectories(&self) -> bool {
        self.format.contains(&FormatWord::Trajectories)
    }

    /// An analysis that prints the usual.
    pub(crate) fn of(files: &[PathBuf], how: &AnalysisArgs, seed: u64) -> Result<Self> {
        let usual = flags::parsed(["discover", "-"]).map_err(|error| Error::Data(error.to_string()))?;
        Ok(Self { files: files.to_vec(), how: how.clone(), seed, ..usual })
    }
}

/// What `roscausal discover` would analyse.
pub struct Recordings {
    /// Names of the variables.
    pub names: Vec<String>,
    /// The recordings, each `T x N`.
    pub values: Vec<Array2<f64>>,
    /// Step between samples in seconds, if known.
    pub dt: Option<f64>,
    /// Variables that may be causes only (interventions).
    pub exogenous: Vec<String>,
    /// What a reader of the model should know, one sentence each.
    pub warnings: Vec<String>,
    /// For each recording the rows that `--where` or `--mask` makes no effects; empty if there are none.
    pub masked: Vec<Vec<bool>>,
}

/// Reads the tables and recordings in `files` as `roscausal discover` does, with its options, such as `--person=7`.
///
/// # Errors
/// An unknown option, a file that cannot be read, files that do not fit together, or cancellation by `cancel`.
pub fn read_recordings(files: &[PathBuf], options: &[String], cancel: Arc<AtomicBool>) -> Result<Recordings> {
    let words = std::iter::once(OsString::from("discover"))
        .chain(options.iter().map(OsString::from))
        .chain([OsString::from("--")])
        .chain(files.iter().map(|file| file.clone().into_os_string()));
    let args: Args = flags::parsed(words).map_err(|error| {
        let text = error.to_string();
        let reason = text.lines().next().unwrap_or_default().trim_start_matches("error: ");
        Error::param("options", reason)
    })?;
    let mut settings = Settings::default();
    let Data { data, dt, warnings, .. } =
        Data::read(&args, &mut settings, &Interrupt::on(cancel), true, None)?;
    let of_each = |place| data.masked_effects(place);
    let masked: Vec<Vec<bool>> = (0..data.recordings().len()).map(of_each).collect();
    let is_masked = masked.iter().any(|rows| rows.contains(&true));
    Ok(Recordings {
        masked: if is_masked { masked } else { Vec::new() },
        names: data.var_names().to_vec(),
        values: data.recordings().to_vec(),
        dt,
        exogenous: settings.exogenous,
        warnings: warnings.iter().map(|note| flags::spelled(note)).collect(),
    })
}

/// A table to analyse, and the user's file that it comes from.
#[derive(Clone)]
struct Input {
    table: PathBuf,
    user: PathBuf,
    /// Which of the user's files or folders, and which recording in it: batches of one run follow one another.
    run: [usize; 2],
}

impl Input {
    /// A table of the user's, or those in a folder.
    fn of_table(path: &Path, run: usize) -> Result<Vec<Self>> {
        let path = if path == Path::new("-") { Path::new("/dev/stdin") } else { path };
        check_whole(path)?;
        let tables = if path.is_dir() { folders::batches_in(path)? } else { vec![path.to_path_buf()] };
        Ok(tables.into_iter().map(|table| Self { user: table.clone(), table, run: [run, 0] }).collect())
    }

    /// Whether it was made of a recording.
    fn is_recorded(&self) -> bool {
        self.table != self.user
    }

    /// A recording within a table, as `walks.csv (id 3)`.
    fn part(&self, which: &str, number: usize) -> Self {
        let name = self.user.file_name().unwrap_or_default().to_string_lossy();
        let user = self.user.with_file_name(format!("{name} ({which})"));
        Self { table: user.clone(), user, run: [self.run[0], number] }
    }
}

/// What is analysed.
struct Data {
    data: DataFrame,
    dt: Option<f64>,
    warnings: Vec<String>,
    /// Whether it comes from recordings, so that a node chose the columns.
    recorded: bool,
    /// For each recording, the file that it comes from, if the recordings are the files.
    origins: Vec<PathBuf>,
    /// For each recording, which run it is of; empty: all are of one.
    runs: Vec<[usize; 2]>,
}

impl Data {
    /// The data of the files. Interventions that they mention become exogenous in `settings`.
    fn read(
        args: &Args,
        settings: &mut Settings,
        interrupt: &Interrupt,
        quiet: bool,
        keep: Option<&Path>,
    ) -> Result<Self> {
        if args.has_trajectories() {
            if let Some(flag) = args.how.inputs.given_besides_params() {
                let agent = Named("agent");
                let reason = format!("it is for recordings; of trajectories, {agent} says who is analysed");
                return Err(Error::param(flag, reason));
            }
            return args.how.part.part(args.trajectories.read(args)?, &args.changes, None, &args.how.read);
        }
        if let Some(flag) = args.trajectories.given() {
            let reason = format!("it is for tables of trajectories ({} trajectories)", Named("format"));
            return Err(Error::param(flag, reason));
        }
        let (files, _made, notes) = tables_of(args, interrupt, quiet, keep)?;
        let besides = args.how.part.columns();
        let read = match with_facts(args, &files, settings)? {
            Some(data) => data,
            None => {
                let (dt, max_memory) = (args.how.inputs.dt, args.how.means.max_bytes());
                Self::of(args.how.read.read(&files, dt, &besides, max_memory)?)?
            }
        };
        let variables = if besides.is_empty() { None } else { args.how.read.variables(read.recorded)? };
        let mut data = args.how.part.part(read, &args.changes, variables.as_deref(), &args.how.read)?;
        // They were printed before.
        data.warnings.extend(notes);
        Ok(data)
    }

    /// Tables with the same columns, each as a recording.
    fn of(tables: Vec<(Input, Table)>) -> Result<Self> {
        let names = tables.first().map(|(_, table)| table.names.clone()).unwrap_or_default();
        let dt = common_step(tables.iter().map(|(file, table)| (file.user.as_path(), table)))?;
        let warnings = notes_on(&tables);
        let recorded = tables.iter().any(|(file, _)| file.is_recorded());
        let origins = tables.iter().map(|(file, _)| file.user.clone()).collect();
        let runs = runs_of(&tables, dt);
        let values = tables.into_iter().map(|(_, table)| table.values).collect();
        Ok(Self { data: DataFrame::new(values, names)?, dt, warnings, recorded, origins, runs })
    }
}

/// Which run each table is of: a file or folder is one, and so are files of which each begins where the one before ends.
fn runs_of(tables: &[(Input, Table)], dt: Option<f64>) -> Vec<[usize; 2]> {
    let ends = |table: &Table| table.time.as_ref().and_then(|time| Some([*time.first()?, *time.last()?]));
    let follows = |before: &Table, table: &Table| match (ends(before), ends(table), dt) {
        (Some([_, end]), Some([start, _]), Some(dt)) => start > end && start - end < 5.0 * dt,
        _ => false,
    };
    let mut runs: Vec<[usize; 2]> = Vec::with_capacity(tables.len());
    for (k, (file, table)) in tables.iter().enumerate() {
        let before = k.checked_sub(1).filter(|&before| follows(&tables[before].1, table));
        runs.push(before.map_or(file.run, |before| runs[before]));
    }
    runs
}

/// Looks at the data, and refuses what no analysis should take as it is, with the way out.
fn look_at(data: &DataFrame, origins: &[PathBuf], args: &Args, settings: &Settings) -> Result<DataProfile> {
    let (profile, faults) = DataProfile::of(data, settings.tau_max);
    let origin = |place: &usize| match origins.get(*place) {
        Some(file) => file.display().to_string(),
        None => format!("recording {}", place + 1),
    };
    for fault in faults {
        let reason = match fault {
            Fault::MissingFlag { .. } if !args.how.read.missing_value.is_empty() => continue,
            Fault::MissingFlag { name, value, count } => format!(
                "{name} is {value} in {count} rows, far from all its other values: it seems to stand for a missing value; \
                 {flag}={value} takes it as one, {flag}=none keeps it",
                flag = Named("missing_value")
            ),
            Fault::Twins(a, b) => format!(
                "{a} and {b} say the same (correlation 1): no test can tell which of them drives anything; leave one out, such as \
                 with {} '!{b}'",
                Named("columns")
            ),
            Fault::SameRecording(a, b) if origins.get(a) == origins.get(b) => format!(
                "{} holds the same rows twice, as a loop that was recorded on does; cut it to one lap",
                origin(&a)
            ),
            Fault::SameRecording(a, b) => format!(
                "{} and {} hold the same rows: counted twice, they would make any link significant; leave one out",
                origin(&a),
                origin(&b)
            ),
        };
        return Err(Error::Data(reason));
    }
    Ok(profile)
}

/// What is said of the tables, each matter once. What is constant in one table and not in another is no matter.
fn notes_on(tables: &[(Input, Table)]) -> Vec<String> {
    let varies = |column: &String, value: f64| {
        let of = |table: &Table| {
            let var = table.names.iter().position(|name| name == column);
            var.is_some_and(|var| table.values.column(var).iter().any(|v| !v.is_nan() && *v != value))
        };
        tables.iter().any(|(_, table)| of(table))
    };
    let matters = |note: &Note| !matches!(note, Note::Constant { column, value } if varies(column, *value));
    let notes =
        tables.iter().enumerate().flat_map(|(k, (_, table))| table.notes.iter().map(move |note| (k, note)));
    let name = |table: usize| {
        let file = &tables[table].0;
        // Several batches of one recording say their own names.
        match file.table.file_name().filter(|_| file.is_recorded()) {
            Some(batch) => format!("{} ({})", file.user.display(), batch.display()),
            None => file.user.display().to_string(),
        }
    };
    let mut lines: Vec<(Vec<usize>, Vec<Note>)> = Vec::new();
    for (of, note) in Note::gathered(notes.filter(|(_, note)| matters(note))) {
        let kind = |note: &Note| note.column().map(|_| std::mem::discriminant(note));
        let is_of_kind = |known: &Note| kind(known).is_some() && kind(known) == kind(&note);
        match lines.iter_mut().find(|(files, known)| *files == of && is_of_kind(&known[0])) {
            Some((_, known)) => known.push(note),
            None => lines.push((of, vec![note])),
        }
    }
    let line = |(of, notes): (Vec<usize>, Vec<Note>)| match (&of[..], Note::together(&notes)) {
        ([first, .., last], note) => {
            format!("{} to {} ({} of {} tables): {note}", name(*first), name(*last), of.len(), tables.len())
        }
        (_, note) => format!("{}: {note}", name(of[0])),
    };
    lines.into_iter().map(line).collect()
}

/// The files with their metadata, if that mentions interventions or several people and all columns are analysed.
/// Interventions become exogenous.
fn with_facts(args: &Args, files: &[Input], settings: &mut Settings) -> Result<Option<Data>> {
    let tables: Vec<&Path> = files.iter().map(|file| file.table.as_path()).collect();
    let says_more = |file: &&Path| {
        let facts = Facts::read(file);
        facts.ids.len() > 1 || !facts.context.is_empty()
    };
    let (read, recorded) = (&args.how.read, files.iter().any(Input::is_recorded));
    let own = read.columns.is_some()
        || read.join
        || (!recorded && (args.how.inputs.ignore_settings || !read.features.is_empty()));
    if own || !tables.iter().any(says_more) {
        return Ok(None);
    }
    let mut joint = Joint::read_within(&tables, args.how.means.max_bytes())?;
    let people = args.several_people.parse()?;
    // The pooled model is the last one.
    let Some(part) = joint.parts(people)?.pop() else { return Ok(None) };
    let new = part.exogenous.into_iter().filter(|name| !settings.exogenous.contains(name));
    let new: Vec<String> = new.collect();
    settings.exogenous.extend(new);
    let (origins, runs) = (Vec::new(), Vec::new());
    Ok(Some(Data { data: part.data, dt: joint.dt, warnings: joint.warnings, recorded, origins, runs }))
}

/// The files to analyse: the user's own, and the batches made from the user's recordings. Those are in a folder that is removed
/// with the returned handle, and also in `keep`. What was said of the recordings' clocks.
fn tables_of(
    args: &Args,
    interrupt: &Interrupt,
    quiet: bool,
    keep: Option<&Path>,
) -> Result<(Vec<Input>, Option<tempfile::TempDir>, Vec<String>)> {
    if !args.files.iter().any(|file| recording::is_recording(file)) {
        if let Some(flag) = args.how.inputs.given() {
            return Err(Error::param(flag, "it is for recordings; these files are tables"));
        }
        let inputs = args.files.iter().enumerate().map(|(run, file)| Input::of_table(file, run));
        return Ok((inputs.collect::<Result<Vec<_>>>()?.concat(), None, Vec::new()));
    }
    let temporary = tempfile::tempdir().map_err(|e| Error::file(std::env::temp_dir(), e))?;
    interrupt.remove_at_end(temporary.path().to_path_buf());
    let (mut files, mut notes) = (Vec::new(), Vec::new());
    for (number, file) in args.files.iter().enumerate() {
        if recording::is_recording(file) {
            let inputs = args.how.inputs.with_param(args.how.read.as_parameter());
            let source = Source::open(file, &inputs, args.how.means.max_bytes())?;
            notes.extend(source.inputs.clocks.notes.iter().cloned());
            let folder = temporary.path().join(format!("{}", number + 1));
            for batch in source.batches(&folder, interrupt, quiet)? {
                if let Some(folder) = keep {
                    output::copy_batch(&batch, folder)?;
                }
                files.push(Input { table: batch, user: file.clone(), run: [number, 0] });
            }
        } else {
            files.extend(Input::of_table(file, number)?);
        }
    }
    Ok((files, Some(temporary), notes))
}
