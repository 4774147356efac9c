//! What a question is asked of: a model, data, and a moment in them.

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use roscausal_core::{
    Error, Result,
    batch::{Table, table::common_step},
    bounded, threads,
};
use roscausal_discovery::{DataFrame, methods::acts_on_of, names};
use roscausal_reasoning::{
    ActsOn, Facts, Settings, StructuralModel, default_intervention_targets,
    model::{SCHEMA, graph_of_json},
    question::Situation,
};

use crate::{folders::model_in, output, results::check_whole};

/// The arguments that all questions share.
#[derive(Default, ClapArgs)]
pub(super) struct SourceArgs {
    /// A model of `roscausal discover` or the folder of its results, a graph written by hand ({"links": [{"cause": "r_v", "effect": "d", "lag": 1}]}), or a
    /// structural model (--save).
    #[arg(value_name = "MODEL")]
    pub(super) model: PathBuf,
    /// CSV files with a header that the equations are fitted on, separated by commas; the question is about the last. A structural
    /// model brings its own rows.
    #[arg(long, value_delimiter = ',', value_name = "FILE")]
    pub(super) data: Vec<PathBuf>,
    /// Equations: auto (a Gaussian process where it predicts better than a line), linear, gp.
    #[arg(long, default_value = "auto", value_parser = ["auto", "linear", "gp"])]
    pub(super) equations: String,
    /// Columns of interventions and the variable that each sets, separated by commas; default: do_robot_speed=r_v,
    /// do_robot_off=r_v, do_human_v=h_v, do_human_stop=h_v.
    #[arg(long, value_delimiter = ',', value_name = "COLUMN=VARIABLE")]
    pub(super) acts_on: Option<Vec<String>>,
    /// Units of variables for sentences and axes, separated by commas; those that the files of batches name need not be given.
    #[arg(long, value_delimiter = ',', value_name = "VARIABLE=UNIT")]
    pub(super) units: Vec<String>,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 42)]
    pub(super) seed: u64,
    /// Threads; default: all cores. They do not change the answer.
    #[arg(long)]
    pub(super) threads: Option<usize>,
    /// File for the structural model: with it as MODEL the next question is answered without a new fit.
    #[arg(long, value_name = "FILE")]
    pub(super) save: Option<PathBuf>,
    /// Overwrite what others made: the file of --save, and files in --out.
    #[arg(long)]
    pub(super) force: bool,
    /// What to print on stdout.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub(super) format: Format,
}

/// What to print.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Sentences and a table.
    #[default]
    Text,
    /// One JSON object.
    Json,
}

/// A model that is ready for questions, and the rows that these are about.
pub(super) struct Ready {
    pub(super) model: StructuralModel,
    /// Times of each recording, where it has them.
    times: Vec<Option<Vec<f64>>>,
}

impl SourceArgs {
    /// Reads and fits, then answers, in as many threads as asked for.
    pub(super) fn with<T: Send>(&self, answer: impl FnOnce(&Ready) -> Result<T> + Send) -> Result<T> {
        if let Some(path) = &self.save {
            output::claim_file(path, SCHEMA, self.force)?;
        }
        threads::in_pool(self.threads.unwrap_or(0), || {
            let ready = self.ready()?;
            if let Some(path) = &self.save {
                output::write_at(path, ready.model.to_json().as_bytes())?;
            }
            answer(&ready)
        })
    }

    fn ready(&self) -> Result<Ready> {
        std::iter::once(&self.model).chain(&self.data).try_for_each(|path| check_whole(path))?;
        let text = bounded::read_text(&model_in(&self.model)?, bounded::MODEL)?;
        let of_file = |error: roscausal_discovery::Error| match error {
            roscausal_discovery::Error::Param { name, reason } => {
                Error::file(&self.model, format!("{name}: {reason}"))
            }
            other => Error::file(&self.model, other),
        };
        // Of whatever version: one that cannot be read says so.
        if text.contains(SCHEMA.trim_end_matches(|c: char| c.is_ascii_digit())) {
            let model = StructuralModel::from_json(&text).map_err(of_file)?;
            let reason =
                "a structural model has its rows with it; leave --data out, or give the graph as MODEL";
            Error::ensure(self.data.is_empty(), "data", || reason)?;
            let times = vec![None; model.samples().recordings().len()];
            let facts = self.with_units(model.facts.clone(), model.graph().names())?;
            return Ok(Ready { model: model.with_facts(facts), times });
        }
        let reason = "a graph alone answers nothing; give the CSV files that it was found in";
        Error::ensure(!self.data.is_empty(), "data", || reason)?;
        let acts_on = self.acts_on()?;
        let context: Vec<String> = acts_on.iter().map(|(column, _)| column.clone()).collect();
        let (graph, mut facts) = graph_of_json(&text, &context).map_err(of_file)?;
        let tables: Vec<Table> =
            self.data.iter().map(|path| Table::read(path, None)).collect::<Result<_>>()?;
        let dt = common_step(self.data.iter().map(PathBuf::as_path).zip(&tables))?;
        facts.dt = dt.or(facts.dt);
        let facts = self.with_units(facts, graph.names())?;
        let times = tables.iter().map(|table| table.time.clone()).collect();
        let data = self.frame(tables, graph.names(), &context)?;
        let settings =
            Settings { equations: self.equations.parse()?, seed: self.seed, ..Settings::default() };
        let model = StructuralModel::fit(&data, &graph, &settings, &acts_on)?.with_facts(facts);
        Ok(Ready { model, times })
    }

    /// Units of `--units`, else those that the graph has, else those of a batch's `.json`.
    fn with_units(&self, mut facts: Facts, variables: &[String]) -> Result<Facts> {
        for given in &self.units {
            let (name, unit) = given.split_once('=').unwrap_or((given, ""));
            if names::position(variables, name).is_none() || unit.trim().is_empty() {
                let all = variables.join(", ");
                let reason =
                    format!("'{given}' gives no variable a unit; write it like d=m; variables: {all}");
                return Err(Error::param("units", reason));
            }
            facts.units.retain(|(known, _)| known != name);
            facts.units.push((name.to_owned(), unit.trim().to_owned()));
        }
        for path in &self.data {
            for (name, unit) in output::units_beside(path) {
                if names::position(variables, &name).is_some()
                    && facts.units.iter().all(|(known, _)| *known != name)
                {
                    facts.units.push((name, unit));
                }
            }
        }
        Ok(facts)
    }

    fn acts_on(&self) -> Result<ActsOn> {
        let Some(given) = &self.acts_on else { return Ok(default_intervention_targets()) };
        Ok(acts_on_of(given)?)
    }

    /// The graph's variables and the columns of interventions, which a file may lack.
    fn frame(&self, tables: Vec<Table>, variables: &[String], context: &[String]) -> Result<DataFrame> {
        let there = |name: &&String| tables.iter().any(|table| names::position(&table.names, name).is_some());
        let wanted: Vec<String> = variables.iter().chain(context.iter().filter(there)).cloned().collect();
        let mut recordings = Vec::new();
        for (table, path) in tables.iter().zip(&self.data) {
            let mut values = ndarray::Array2::zeros((table.values.nrows(), wanted.len()));
            for (k, name) in wanted.iter().enumerate() {
                match names::position(&table.names, name) {
                    Some(column) => values.column_mut(k).assign(&table.values.column(column)),
                    None if k >= variables.len() => {}
                    None => {
                        let all = table.names.join(", ");
                        let reason =
                            format!("it has no column '{name}', which the model names; columns: {all}");
                        return Err(Error::file(path, reason));
                    }
                }
            }
            recordings.push(values);
        }
        Ok(DataFrame::new(recordings, wanted)?)
    }
}

impl Ready {
    /// The moment of a time, and its recording: the last one that has it; without a time the end of the last.
    pub(super) fn situation(&self, at: Option<f64>) -> Result<(Situation<'_>, usize)> {
        let recordings = self.model.samples().recordings();
        let last = recordings.len() - 1;
        let Some(time) = at else {
            return Ok((Situation::newest(recordings[last].view()), last));
        };
        let has = |k: &usize| self.row(*k, time).is_some();
        let recording = (0..recordings.len()).rev().find(has).unwrap_or(last);
        let now = self.row_in(recording, time)?;
        Ok((Situation { rows: recordings[recording].view(), now }, recording))
    }

    /// The last row of a recording that is not after a time.
    pub(super) fn row_in(&self, recording: usize, time: f64) -> Result<usize> {
        self.row(recording, time).ok_or_else(|| {
            let (first, last) = self.span(recording);
            let what = if self.times[recording].is_some() { "s" } else { "as row numbers" };
            Error::Data(format!("the data have no row at {time}; they go from {first} to {last} {what}"))
        })
    }

    /// Time of the first row of a recording, 0 if it has no times.
    pub(super) fn start(&self, recording: usize) -> f64 {
        self.span(recording).0
    }

    fn span(&self, recording: usize) -> (f64, f64) {
        let rows = self.model.samples().recordings()[recording].nrows();
        match &self.times[recording] {
            Some(times) => (times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0)),
            None => (0.0, rows.saturating_sub(1) as f64),
        }
    }

    fn row(&self, recording: usize, time: f64) -> Option<usize> {
        let (first, last) = self.span(recording);
        // Times are rounded in files.
        let slack = 1e-6 + self.model.facts.dt.unwrap_or(0.0) * 0.01;
        if !(time >= first - slack && time <= last + self.model.facts.dt.unwrap_or(1.0)) {
            return None;
        }
        Some(match &self.times[recording] {
            Some(times) => times.partition_point(|&t| t <= time + slack).saturating_sub(1),
            None => time.max(0.0) as usize,
        })
    }
}
