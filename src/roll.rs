//! `roscausal roll`: a model per window of time, or per batch, and when a mechanism changes.

use std::path::{Path, PathBuf};

use clap::{Args as ClapArgs, ValueEnum};
use roscausal_core::{Error, Result};
use roscausal_discovery::{
    Control, DataFrame, LinkMark, Model, Settings,
    changes::{self, ChangeEvent, Detector, Form, Levels},
    confidence::set_step,
    methods::Status,
    names::plain,
    rolling::{
        LinkCount, ROLLING_SCHEMA, WindowModel, Windows, link_counts, roll, roll_resampled, strips_of,
    },
};
use serde_json::{Value, json};

use crate::{
    discover::{self, AnalysisArgs, ResampleArgs},
    export, flags,
    interrupt::Interrupt,
    output,
    results::Results,
};

/// Rows of a part that the detector reads at a time, unless the number of variables asks for more.
const CHANGE_ROWS: usize = 150;

/// Arguments of `roscausal roll`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// CSV files, recordings, or the folder of a demo or a node, as for `discover`. No window spans two of them.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Rows of a window.
    #[arg(long, value_name = "ROWS", required_unless_present = "batch", conflicts_with = "batch")]
    window: Option<usize>,
    /// Rows from one window's start to the next. Default: half a window.
    #[arg(long, value_name = "ROWS", requires = "window")]
    step: Option<usize>,
    /// Also take the window that ends exactly with the data.
    #[arg(long, requires = "window")]
    last: bool,
    /// Rows of a batch: windows that follow one another.
    #[arg(long, value_name = "ROWS")]
    batch: Option<usize>,
    /// Tell when a mechanism changes (docs/confidence.md).
    #[arg(long)]
    changes: bool,
    /// With --changes: rows that are compared with those before at a time. Default: 150, more for many variables.
    #[arg(long, value_name = "ROWS", requires = "changes")]
    change_rows: Option<usize>,
    #[command(flatten)]
    how: AnalysisArgs,
    #[command(flatten)]
    resample: ResampleArgs,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 42, help_heading = "Method")]
    seed: u64,
    /// Folder for rolling.json and a picture of the links over time.
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write into --out although there are files of others.
    #[arg(long, requires = "out", help_heading = "Output")]
    force: bool,
    /// What to print while it runs.
    #[arg(long, value_enum, default_value_t = Format::Text, help_heading = "Output")]
    format: Format,
}

/// What to print of models over time.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A line for each window and event, and a summary.
    Text,
    /// A JSON object on each line: a window or an event; the last one has the status.
    Jsonl,
    /// A table with a row for each link of each window.
    Csv,
}

/// Runs `roscausal roll`.
pub(crate) fn run(args: &Args, interrupt: &Interrupt) -> Result<()> {
    interrupt.nothing_at_stake("what was printed is all there is");
    let results = Results::wanted(args.out.as_deref(), args.force, &args.files)?;
    results.iter().for_each(|results| interrupt.remove_at_end(results.temporary()));
    let resampling = args.resample.asked()?;
    let windows = args.windows();
    let (data, settings, dt) = discover::read(&args.files, &args.how, args.seed, interrupt)?;
    args.check_batch(&data, settings.tau_max)?;
    let control = args.how.means.within_budget(Control::default().cancel_on(interrupt.flag()))?;
    let rolling = args.how.means.in_pool(|| {
        let mut rolling = Rolling::new(args.format, dt);
        if args.changes {
            rolling.status = args.events(&data, &settings, &control, &mut rolling)?;
        }
        rolling.begin();
        if rolling.status == Status::Complete {
            let take = |window| {
                rolling.take(window);
                Ok(())
            };
            rolling.status = match &resampling {
                Some(resampling) => roll_resampled(&data, &settings, &windows, resampling, &control, take)?,
                None => roll(&data, &settings, &windows, &control, take)?,
            };
        }
        rolling.end();
        Ok(rolling)
    })?;
    let Some(results) = results else { return Ok(()) };
    interrupt.writing();
    results.write(|dir| rolling.write(dir))
}

impl Args {
    fn windows(&self) -> Windows {
        match (self.batch, self.window) {
            (Some(rows), _) => Windows { length: rows, step: rows, last: true },
            (None, window) => {
                let length = window.unwrap_or_default();
                Windows { length, step: self.step.unwrap_or((length / 2).max(1)), last: self.last }
            }
        }
    }

    /// A batch is a window to the library; users hear of what they gave.
    fn check_batch(&self, data: &DataFrame, tau_max: usize) -> Result<()> {
        let past = tau_max.saturating_mul(2);
        let longest = data.recordings().iter().map(|rows| rows.nrows()).max().unwrap_or(0);
        let reason = match self.batch {
            Some(0) => "a batch has rows; give 1 or more".to_owned(),
            Some(rows) if rows > longest => {
                format!("{rows} rows leave no batch in {longest} rows; give shorter batches or record longer")
            }
            Some(rows) if rows <= past => format!(
                "the first batch of {rows} rows has no sample, since {past} rows only serve as the past of others; give more than {past}, \
                 or a lower --tau-max"
            ),
            _ => return Ok(()),
        };
        Err(Error::param("batch", reason))
    }

    /// Adds what the detector tells of the whole data, recording after recording.
    fn events(
        &self,
        data: &DataFrame,
        settings: &Settings,
        control: &Control,
        rolling: &mut Rolling,
    ) -> Result<Status> {
        let names = data.var_names().to_vec();
        let detector = Detector::new(names, settings.tau_max, &settings.exogenous, Levels::default())?;
        let mut detector = detector.of_form(Form::of_test(&settings.cond_ind_test));
        let rows = self.change_rows.unwrap_or(CHANGE_ROWS.max(detector.fewest_rows()));
        for (place, recording) in data.recordings().iter().enumerate() {
            let masked = data.masked_effects(place);
            let read = detector.read_each(recording.view(), &masked, rows, control, &mut rolling.events);
            (rolling.looked_at, rolling.misfit) =
                (Some(detector.rows()), detector.misfit().map(|note| flags::spelled(&note)));
            match read {
                Err(error) if control.is_timeout(&error) => {
                    let rows = detector.rows();
                    let how_far = format!(
                        "the time budget ended after {rows} rows of changes, before the first window"
                    );
                    return Ok(Status::Partial(how_far));
                }
                read => read?,
            }
        }
        Ok(Status::Complete)
    }
}

/// What was found so far.
struct Rolling {
    format: Format,
    dt: Option<f64>,
    windows: Vec<WindowModel>,
    events: Vec<ChangeEvent>,
    /// Rows in which changes were looked for.
    looked_at: Option<usize>,
    /// What slopes do not follow.
    misfit: Option<String>,
    status: Status,
}

impl Rolling {
    fn new(format: Format, dt: Option<f64>) -> Self {
        let (windows, events, status) = (Vec::new(), Vec::new(), Status::Complete);
        Self { format, dt, windows, events, looked_at: None, misfit: None, status }
    }

    fn begin(&self) {
        match self.format {
            Format::Csv => say!(
                "recording,start,end,cause,effect,lag,value,p_value,mark,confidence,value_low,value_high"
            ),
            Format::Jsonl => {
                let head = json!({ "schema": ROLLING_SCHEMA, "dt": self.dt, "events": self.events.len(), "note": self.misfit });
                crate::terminal::print_json(&head.to_string());
                for event in &self.events {
                    crate::terminal::print_json(&json!({ "event": event }).to_string());
                }
            }
            Format::Text => {
                self.events.iter().for_each(|event| say!("{}", event.sentence()));
                if let Some(rows) = self.looked_at {
                    let confirmed =
                        self.events.iter().filter(|event| event.status == changes::Status::Confirmed).count();
                    let reported = match confirmed {
                        0 => "no change confirmed".to_owned(),
                        1 => "1 change confirmed".to_owned(),
                        n => format!("{n} changes confirmed"),
                    };
                    say!("{reported} in {rows} rows");
                    self.misfit.iter().for_each(|misfit| tell!("note: {misfit}"));
                }
            }
        }
    }

    /// Prints a window as soon as it is there.
    fn take(&mut self, mut window: WindowModel) {
        set_step(&mut window.model, self.dt);
        match self.format {
            Format::Jsonl => {
                crate::terminal::print_json(&json!({ "window": self.object(&window) }).to_string())
            }
            Format::Csv => window.model.links.iter().for_each(|link| {
                let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
                let WindowModel { recording, start, end, .. } = window;
                let (cause, effect) = (quoted(&link.cause), quoted(&link.effect));
                let (lag, value, p, mark) = (link.lag, number(link.value), number(link.p_value), link.mark);
                let [share, low, high] = [link.confidence, link.value_low, link.value_high].map(number);
                say!(
                    "{recording},{start},{end},{cause},{effect},{lag},{value},{p},{mark},{share},{low},{high}"
                );
            }),
            Format::Text => {
                let link = |link: &roscausal_discovery::Link| {
                    let arrow = if link.mark == LinkMark::Forward { "->" } else { link.mark.symbol() };
                    let (cause, effect, lag) = (plain(&link.cause), plain(&link.effect), link.lag);
                    format!("{cause} {arrow} {effect} ({lag}) {}", link.strength_in_words(2))
                };
                let links: Vec<String> = window.model.links.iter().map(link).collect();
                let links = if links.is_empty() { "no link".to_owned() } else { links.join(", ") };
                say!("rows {} to {}: {links}", window.start, window.end);
            }
        }
        self.windows.push(window);
    }

    fn end(&self) {
        if self.status != Status::Complete {
            tell!("{}", self.status);
        }
        if self.format == Format::Jsonl {
            crate::terminal::print_json(&json!({ "status": self.status.to_string() }).to_string());
        }
        if self.format != Format::Text || self.windows.is_empty() {
            return;
        }
        count_lines(&self.counts(), "windows").iter().for_each(|line| say!("{line}"));
    }

    fn counts(&self) -> Vec<LinkCount> {
        let models: Vec<&Model> = self.windows.iter().map(|window| &window.model).collect();
        link_counts(&models)
    }

    /// A window as it stands in files: without the run time, with the seconds of its start.
    fn object(&self, window: &WindowModel) -> Value {
        let mut object = json!(window);
        object["run_time_s"] = Value::Null;
        object["time"] = json!(self.dt.map(|dt| dt * window.start as f64));
        object
    }

    fn write(&self, dir: &Path) -> Result<()> {
        let windows: Vec<Value> = self.windows.iter().map(|window| self.object(window)).collect();
        let whole = json!({
            "schema": ROLLING_SCHEMA,
            "status": self.status.to_string(),
            "dt": self.dt,
            "windows": windows,
            "events": self.events,
            "note": self.misfit,
            "links": self.counts(),
        });
        let text = serde_json::to_string_pretty(&whole);
        let text = text.map_err(|e| Error::Data(format!("the models cannot be written: {e}")))? + "\n";
        output::write_file(dir, "rolling.json", text.as_bytes())?;
        let middle = |window: &WindowModel| 0.5 * (window.start + window.end) as f64;
        let of_first = self.windows.iter().filter(|window| window.recording == 0);
        let models: Vec<(f64, &Model)> = of_first.map(|window| (middle(window), &window.model)).collect();
        let when = |event: &ChangeEvent| {
            event.changed_between.map_or(event.time as f64, |[from, to]| 0.5 * (from + to) as f64)
        };
        let events: Vec<(f64, &ChangeEvent)> = self.events.iter().map(|event| (when(event), event)).collect();
        let picture = strips_of(&models, "rows of the first recording, middle of each window", &events);
        output::write_picture(dir, "strip", &picture)
    }
}

fn quoted(name: &str) -> String {
    let name = export::cell(name);
    if name.contains([',', '"']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name }
}

/// `h_v -> h_dg at lag 1: found in 3 of 4 windows, mean strength 0.45`, a line per link.
pub(crate) fn count_lines(counts: &[LinkCount], what: &str) -> Vec<String> {
    if counts.is_empty() {
        return vec![format!("No link in any of the {what}.")];
    }
    let line = |count: &LinkCount| {
        let LinkCount { cause, effect, lag, found, of, mean_value } = count;
        let (cause, effect) = (plain(cause), plain(effect));
        format!(
            "{cause} -> {effect} at lag {lag}: found in {found} of {of} {what}, mean strength {mean_value:.2}"
        )
    };
    std::iter::once(String::new()).chain(counts.iter().map(line)).collect()
}
