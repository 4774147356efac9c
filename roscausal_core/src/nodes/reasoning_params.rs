//! The parameters of the reasoning node.

use std::{path::PathBuf, sync::Arc};

use roscausal_discovery::methods::acts_on_of;
use roscausal_reasoning::{
    ActsOn, Facts, Settings,
    graph::Graph,
    model::{Equations, graph_of_json},
};

use super::path;
use crate::{
    Error, Result, bounded,
    house::House,
    param_specs,
    params::{Allowed, ParamSpec, Params, Value},
};

/// Names, defaults, allowed values and descriptions.
pub(super) fn specs() -> Vec<ParamSpec> {
    use Allowed::{Any, OneOf, Range};
    use Value::{Bool, Double, Int, List, Str};
    let text = |text: &str| Str(text.to_owned());
    let acts_on =
        ["do_robot_speed=r_v", "do_robot_off=r_v", "do_human_v=h_v", "do_human_stop=h_v"].map(text).to_vec();
    param_specs! {
        "equations" = text("auto"), OneOf(Equations::NAMES),
            "equations of the model; auto: a Gaussian process where it predicts better than a line";
        "horizon" = Int(10), Range(1.0, 1000.0), "steps ahead, where a question does not say";
        "paths" = Int(400), Range(20.0, 100_000.0), "simulated paths of an answer";
        "prediction_paths" = Int(100), Range(20.0, 100_000.0),
            "simulated paths of a prediction on /roscausal/prediction";
        "max_samples" = Int(3000), Range(50.0, 1e6), "newest rows that are kept";
        "min_samples" = Int(200), Range(50.0, 1e6), "rows that a model needs";
        "refit_every" = Double(60.0), Range(1.0, 1e6),
            "seconds between two fits of the equations; a new model is fitted at once";
        "interval" = Double(0.9), Range(0.5, 0.999), "probability of an interval";
        "seed" = Int(42), Range(0.0, 9e15), "seed of all random numbers";
        "acts_on" = List(acts_on), Any,
            "columns of interventions and the variable that each sets, such as do_robot_speed=r_v";
        "graph" = text(""), Any,
            "file with a model, or a graph written by hand, instead of the topic; empty: the topic";
        "data" = List(Vec::new()), Any,
            "batches (CSV files) whose rows are there from the start, such as after a restart";
        "person" = text(""), Any,
            "id of the person whose variables (h_7_v) the model's (h_v) are, if there are several; empty: the only one";
        "allow_extrapolation" = Bool(false), Any, "also answer where the data do not reach, and say so";
        "route_map" = text(""), Any, "file with the places of a house, for /roscausal/route; empty: no routes";
        "route_model" = text(""), Any, "file with the causal model of what is counted at the places";
        "route_days" = text(""), Any, "folder with a table for each day, in order of their names; new ones are read when asked";
        "route_hour" = Double(0.0), Range(-24.0, 24.0), "hours from the clock's UTC to the hours of the tables, for the grid of costs";
        "route_resolution" = Double(0.5), Range(0.05, 10.0), "width of a cell of the grid of costs, metres";
        "route_count" = text("people"), Any, "the variable that is counted at the places";
        "threads" = Int(0), Range(0.0, 1024.0), "threads for answers and fits; 0: all cores";
    }
}

/// The parameters, checked.
#[derive(Clone, Debug)]
pub(super) struct ReasoningParams {
    pub(super) settings: Settings,
    pub(super) horizon: usize,
    pub(super) paths: usize,
    pub(super) prediction_paths: usize,
    pub(super) max_samples: usize,
    pub(super) min_samples: usize,
    pub(super) refit_every_s: f64,
    pub(super) acts_on: ActsOn,
    pub(super) graph: Option<(Graph, Facts)>,
    pub(super) data: Vec<PathBuf>,
    pub(super) person: String,
    pub(super) allow_extrapolation: bool,
    pub(super) threads: usize,
    /// The house of `/roscausal/route`.
    pub(super) house: Option<Arc<House>>,
    /// Hours from UTC to its tables, and the width of a cell, metres.
    pub(super) house_hour: f64,
    pub(super) house_cell: f64,
}

impl ReasoningParams {
    /// Checks the parameters and reads the graph, if one is given.
    pub(super) fn new(params: &Params) -> Result<Self> {
        let settings = Settings {
            equations: params.text("equations").parse()?,
            seed: params.int("seed").unsigned_abs(),
            interval: params.double("interval"),
            ..Settings::default()
        };
        let acts_on = acts_on_of(&params.list("acts_on")).map_err(|error| match Error::from(error) {
            Error::Param { reason, .. } => Error::param("acts_on", reason),
            other => other,
        })?;
        let (max_samples, min_samples) = (params.count("max_samples"), params.count("min_samples"));
        Error::ensure(min_samples <= max_samples, "min_samples", || {
            format!("{min_samples} is more than max_samples ({max_samples}); give less")
        })?;
        let graph = match params.text_if_set("graph") {
            None => None,
            Some(file) => {
                let file = path(&file);
                let text = bounded::read_text(&file, bounded::MODEL)?;
                let context: Vec<String> = acts_on.iter().map(|(column, _)| column.clone()).collect();
                Some(graph_of_json(&text, &context).map_err(|e| Error::file(&file, e))?)
            }
        };
        Ok(Self {
            settings,
            horizon: params.count("horizon"),
            paths: params.count("paths"),
            prediction_paths: params.count("prediction_paths"),
            max_samples,
            min_samples,
            refit_every_s: params.double("refit_every"),
            acts_on,
            graph,
            data: params.list("data").iter().map(|file| path(file)).collect(),
            person: params.text("person"),
            allow_extrapolation: params.flag("allow_extrapolation"),
            threads: params.count("threads"),
            house_hour: params.double("route_hour"),
            house_cell: params.double("route_resolution"),
            house: params.text_if_set("route_map").map(|map| {
                let [model, days] = ["route_model", "route_days"].map(|name| path(&params.text(name)));
                Arc::new(House::new(path(&map), model, days, params.text("route_count")))
            }),
        })
    }
}
