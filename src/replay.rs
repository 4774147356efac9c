//! `roscausal replay`: plays a recording to all four nodes, which make a model for each batch.

use std::{
    path::{Path, PathBuf},
    sync::mpsc::Receiver,
    time::{Duration, Instant},
};

use clap::Args as ClapArgs;
use roscausal_core::{
    Error, Result, Time,
    batch::{Table, pool::with_ending},
    ensure,
    loopback::Loopback,
    nodes::{RecordedChange, recorded_changes},
    params::Value,
};
use roscausal_discovery::{
    Model, Progress,
    changes::ChangeEvent,
    rolling::{ROLLING_SCHEMA, link_counts, strips_of},
};

use crate::{
    chart,
    discover::{Analysis, MeansArgs, MethodArgs, ResampleArgs},
    folders::{Folders, read_model},
    interrupt::Interrupt,
    nodes::{self, Nodes},
    output,
    recording::{InputArgs, Play, Seen, Source},
    report, roll,
    sink::{Sink, SinkArgs},
    web::{Web, WebArgs},
};

/// Time between two checks of the results.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// Length of a batch, in seconds, unless the recording or a flag says otherwise.
const TS_LENGTH_S: f64 = 150.0;

/// Arguments of `roscausal replay`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// Recording: .bag, .mcap, .db3, or a folder of them.
    recording: PathBuf,
    #[command(flatten)]
    inputs: InputArgs,
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    resample: ResampleArgs,
    /// Tell when a mechanism changes, as the discovery node does (docs/confidence.md).
    #[arg(long, help_heading = "Nodes and page")]
    changes: bool,
    /// With --changes: rows that are compared with those before at a time, more for many variables. Default: 0, each batch as a
    /// whole.
    #[arg(long, value_name = "ROWS", requires = "changes", value_parser = clap::value_parser!(u32).range(..=1_000_000), help_heading = "Nodes and page")]
    change_rows: Option<u32>,
    /// Most batches of a model: the newest ones since the last change. Default: 1, each batch alone.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), help_heading = "Nodes and page")]
    window_batches: u32,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 42, help_heading = "Method")]
    seed: u64,
    /// How many times faster than real time; `max`: as fast as the machine allows.
    #[arg(long, default_value = "max", help_heading = "Nodes and page")]
    speed: Speed,
    #[command(flatten)]
    means: MeansArgs,
    /// Folder for batches and models.
    #[arg(short, long, value_name = "DIR", default_value = "roscausal_replay", help_heading = "Output")]
    out: PathBuf,
    #[command(flatten)]
    sink: SinkArgs,
    #[command(flatten)]
    web: WebArgs,
}

/// The speed of recorded or simulated time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Speed {
    /// This many times real time.
    Times(f64),
    /// As fast as possible.
    Max,
}

impl std::str::FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.parse::<f64>() {
            _ if text == "max" => Ok(Self::Max),
            Ok(times) if (0.01..=1000.0).contains(&times) => Ok(Self::Times(times)),
            _ => Err("give a number from 0.01 to 1000, or max".into()),
        }
    }
}

/// Holds simulated time back to the chosen speed.
pub(crate) struct Pace {
    speed: Speed,
    begin: Option<(Instant, Time)>,
}

impl Pace {
    pub(crate) fn new(speed: Speed) -> Self {
        Self { speed, begin: None }
    }

    /// Waits until `now` is due, or `go_on` returns false.
    pub(crate) fn wait(&mut self, now: Time, go_on: impl Fn() -> bool) {
        let Speed::Times(times) = self.speed else { return };
        let (begin, first) = *self.begin.get_or_insert_with(|| (Instant::now(), now));
        let due = Duration::from_secs_f64((now.secs_since(first) / times).max(0.0));
        while let Some(left) = due.checked_sub(begin.elapsed()).filter(|left| !left.is_zero()) {
            if !go_on() {
                return;
            }
            std::thread::sleep(left.min(LOOK_AGAIN));
        }
    }
}

impl Args {
    /// Tells the discovery node how models roll on.
    fn set_rolling(&self, bus: &Loopback) {
        let set = |name: &str, value: Value| bus.set_node_param("discovery", name, value);
        set("window_batches", Value::Int(i64::from(self.window_batches)));
        set("detect_changes", Value::Str(if self.changes { "always" } else { "never" }.to_owned()));
        if let Some(rows) = self.change_rows {
            set("change_rows", Value::Int(i64::from(rows)));
        }
    }

    /// Plays the recording to the nodes, until all is analysed. The inner error, although the nodes ended well: it was the user.
    fn play(
        &self,
        bus: &Loopback,
        source: &mut Source,
        folders: &Folders,
        record: Option<&Path>,
        interrupt: &Interrupt,
    ) -> Result<Result<String>> {
        let mut sink = Sink::open(bus, record)?;
        let play = Play::new(bus, &mut source.recording, &source.inputs)?;
        let seen = Seen::on(bus)?;
        let (nodes, progress) = Nodes::start(bus, source.inputs.nodes).with_discovery();
        let mut nodes = nodes.with_reasoning(self.web.web);
        sink.watch()?;
        let web = Web::start(bus, &self.web, "")?;

        let bar = chart::bar("playing", 1000, false);
        let mut pace = Pace::new(self.speed);
        let played = play.run(&mut Vec::new(), |progress, now| {
            bar.set_position((progress * 1000.0) as u64);
            pace.wait(now, || !interrupt.is_set());
            !interrupt.is_set() && !nodes.one_has_ended()
        });
        bar.finish_and_clear();
        let analysed =
            nodes.end_recording().and_then(|()| await_analyses(bus, folders, &nodes, &progress, interrupt));
        // With a live page, Ctrl-C after the last batch is the way to leave.
        let ended_early = interrupt.is_set();
        if let Some(web) = web {
            web.stay(bus, interrupt);
            web.end()?;
        }
        if ended_early {
            // The analysis may be within a long test: what is recorded comes first.
            nodes.end_early(|| sink.close(), interrupt)?;
            let out = self.out.display();
            return Ok(Err(Error::Cancelled(format!("by the user; {out} keeps batches and models so far"))));
        }
        nodes.end()?;
        bus.settle();
        sink.close()?;
        let played = played?;
        played.tell(&self.recording);
        // Without a model the error says it.
        let is_used = source.inputs.is_raw() || !folders.model_files()?.is_empty();
        if let Some(remark) = seen.remark().filter(|_| is_used) {
            tell!("note: {}: {remark}", self.recording.display());
        }
        analysed?;
        Ok(Ok(played.troubles(seen.to_string())))
    }
}

/// Runs `roscausal replay`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    nodes::check_seed(args.seed)?;
    let analysis = Analysis::of(&args.method, &args.means, &args.resample, args.seed)?;
    let record = args.sink.claim_beside(&args.recording)?;
    interrupt.nothing_at_stake("nothing is recorded yet");
    let mut source = Source::open(&args.recording, &args.inputs, args.means.max_bytes())?;
    interrupt.recording();
    let folders = Folders::begin(&args.out, std::slice::from_ref(&args.recording), interrupt)?;
    let bus = Loopback::lockstep();
    nodes::set_pools(&bus, &folders.raw, &folders.processed);
    bus.set_node_param("data", "ts_length", Value::Double(TS_LENGTH_S));
    nodes::set_discovery(&bus, &folders, &analysis, 1)?;
    args.set_rolling(&bus);
    source.set_params(&bus);
    let ended = args.play(&bus, &mut source, &folders, record, interrupt);
    let troubles = match ended.map_err(|error| folders.named(error))? {
        Err(error @ Error::Cancelled(_)) => return folders.keep().and(Err(error)),
        other => other?,
    };
    show(args, &folders, &troubles, source.inputs.is_raw())
}

/// Waits until no batch is left to analyse.
fn await_analyses(
    bus: &Loopback,
    folders: &Folders,
    nodes: &Nodes,
    progress: &Receiver<Progress>,
    interrupt: &Interrupt,
) -> Result<()> {
    let bar = chart::bar("discovery", 0, false);
    while folders.waiting()? > 0 && !nodes.one_has_ended() && !interrupt.is_set() {
        if let Some(progress) = progress.try_iter().last() {
            chart::show(&bar, progress);
        }
        bus.settle();
        std::thread::sleep(LOOK_AGAIN);
    }
    bar.finish_and_clear();
    Ok(())
}

/// In how many of the batches each link was found, and what changed: in words, as `summary.json`, and as a picture.
fn summarise(args: &Args, folders: &Folders, files: &[PathBuf]) -> Result<Vec<String>> {
    let models = files.iter().map(|path| read_model(path)).collect::<Result<Vec<_>>>()?;
    let changes = recorded_changes(&folders.models)?;
    let sentence = |change: &RecordedChange| format!("{}: {}", change.batch, change.event.sentence());
    let mut lines: Vec<String> = changes.iter().map(sentence).collect();
    let counts = link_counts(&models.iter().collect::<Vec<_>>());
    lines.extend(roll::count_lines(&counts, "batches"));
    let name = |path: &PathBuf| path.file_stem().map(|name| name.to_string_lossy().into_owned());
    let batches: Vec<Option<String>> = files.iter().map(name).collect();
    let mut summary = serde_json::json!({ "schema": ROLLING_SCHEMA, "batches": batches, "links": counts });
    if args.changes {
        summary["changes"] = serde_json::json!(changes);
    }
    output::write_file(&folders.dir, "summary.json", format!("{summary:#}\n").as_bytes())?;
    // In minutes of the recording if every batch has its times, else by the number of the batch.
    let spans: Option<Vec<[f64; 2]>> = files.iter().map(|path| span(folders, path)).collect();
    let begin = spans.as_ref().and_then(|spans| spans.first()).map_or(0.0, |first| first[0]);
    let minutes = |stamp: f64| (stamp - begin) / 60.0;
    let at: Vec<(f64, &Model)> = match &spans {
        Some(spans) => spans.iter().map(|[a, b]| minutes(0.5 * (a + b))).zip(&models).collect(),
        None => (1..).map(f64::from).zip(&models).collect(),
    };
    let place = |batch: &str| batches.iter().position(|name| name.as_deref() == Some(batch));
    let when = |change: &RecordedChange| match (&spans, change.changed_from_to) {
        (Some(_), Some([from, to])) => minutes(0.5 * (from + to)),
        (Some(_), None) => minutes(change.told),
        (None, _) => place(&change.batch).map_or(0.0, |place| place as f64 + 0.5),
    };
    let events: Vec<(f64, &ChangeEvent)> =
        changes.iter().map(|change| (when(change), &change.event)).collect();
    let unit = if spans.is_some() { "minutes, middle of each batch" } else { "batches" };
    output::write_picture(&folders.dir, "strip", &strips_of(&at, unit, &events))?;
    lines.push(format!("{}: summary.json, strip.svg, strip.png", args.out.display()));
    Ok(lines)
}

/// Stamps of the first and the last row of a model's batch.
fn span(folders: &Folders, model: &Path) -> Option<[f64; 2]> {
    let name = Path::new(model.file_name()?).with_extension("csv");
    let time = Table::read(&folders.processed.join("analysed").join(name), None).ok()?.time?;
    Some([*time.first()?, *time.last()?])
}

fn show(args: &Args, folders: &Folders, troubles: &str, is_raw: bool) -> Result<()> {
    let models = folders.model_files()?;
    let summary = if models.len() > 1 || (args.changes && !models.is_empty()) {
        summarise(args, folders, &models).map_err(|error| folders.named(error))?
    } else {
        Vec::new()
    };
    let reasons = folders.rejections()?;
    let has_raw = is_raw && !with_ending(&folders.raw, ".csv")?.is_empty();
    let is_short = folders.processed.join("incomplete").is_dir();
    if is_short && !models.is_empty() {
        tell!("note: a batch that is shorter than --ts-length is set aside");
    }
    let folders = folders.keep().map_err(|error| folders.named(error))?;
    for name in models.iter().filter_map(|path| path.file_name()) {
        let path = folders.models.join(name);
        say!("{}", path.display());
        crate::terminal::print_text(&format!("{}\n\n", report::text(&read_model(&path)?)));
    }
    summary.iter().for_each(|line| say!("{line}"));
    reasons.iter().for_each(|reason| tell!("note: {reason}"));
    if models.is_empty() && has_raw {
        let raw = args.out.join("data_pool");
        say!(
            "{0}: raw batches, which data.postprocess=none leaves without a model; 'roscausal discover {0} --drop-empty' makes one",
            raw.display()
        );
        return Ok(());
    }
    let short = "its batches are shorter than --ts-length; 0 makes one of the whole recording";
    let reason = if is_short { short } else { troubles };
    ensure(!models.is_empty(), || Error::file(&args.recording, format!("no model came of it: {reason}")))?;
    say!("{}: {} models, batches", args.out.display(), models.len());
    Ok(())
}
