//! `roscausal route`: where and when should a robot go? From a map, tables of days, and the model of what is counted there.

use std::path::PathBuf;

use clap::Args as ClapArgs;
use roscausal_core::{Error, Result, house};
use roscausal_reasoning::{
    answer::Status,
    route::plan::{Choice, Cost, Trip},
};

use crate::folders::model_in;

/// Arguments of `roscausal route`.
#[derive(ClapArgs)]
pub(crate) struct Args {
    /// The model of the tables, as `roscausal discover` writes it: which variables drive the count.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// The map: a TOML file with places and arcs (docs/route.md).
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// A table for each day, oldest first, separated by commas (docs/route.md).
    #[arg(long, value_delimiter = ',', required = true, value_name = "FILE")]
    data: Vec<PathBuf>,
    /// The variable that is counted at each place.
    #[arg(long, default_value = "people", value_name = "VARIABLE")]
    count: String,
    /// Name of the place where the robot is.
    #[arg(long, value_name = "PLACE")]
    from: String,
    /// Name of the place where it has to go.
    #[arg(long, value_name = "PLACE")]
    to: String,
    /// Time of day, such as 11:40.
    #[arg(long, value_name = "HH:MM", value_parser = time_of_day)]
    at: f64,
    /// Minutes for which it may wait.
    #[arg(long, default_value_t = 60.0)]
    wait: f64,
    /// Seconds that the way may take; default: as long as it takes.
    #[arg(long, value_name = "SECONDS")]
    allowed: Option<f64>,
    /// It carries a load.
    #[arg(long)]
    loaded: bool,
    /// What is counted now at each place of the map, separated by commas; default: not known.
    #[arg(long, value_delimiter = ',', value_name = "COUNTS")]
    now: Option<Vec<f64>>,
    /// What costs as much as a second on the way: a second of waiting, a person met, a percent of the battery, and being late.
    #[arg(long, value_delimiter = ',', default_values_t = [0.02, 0.0, 1.0, 300.0], value_name = "SECONDS")]
    cost: Vec<f64>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn time_of_day(text: &str) -> std::result::Result<f64, String> {
    let (hours, minutes) = text.split_once(':').unwrap_or((text, "0"));
    match (hours.parse::<u32>(), minutes.parse::<u32>()) {
        (Ok(hours), Ok(minutes)) if hours < 48 && minutes < 60 => {
            Ok(f64::from(hours) + f64::from(minutes) / 60.0)
        }
        _ => Err(format!("'{text}' is no time of day; write it like 11:40")),
    }
}

/// Runs `roscausal route`.
pub(crate) fn run(args: &Args) -> Result<Status> {
    let map = house::map(&args.map)?;
    let (from, to) = (map.place(&args.from)?, map.place(&args.to)?);
    let known = house::known(&map, &model_in(&args.model)?, &args.data, &args.count)?;
    let [waiting, person, percent, late] = args.cost[..] else {
        return Err(Error::param("cost", "give four numbers, such as 0.02,0,1,300"));
    };
    let trip = Trip {
        from,
        to,
        hour: args.at,
        horizon: args.wait * 60.0,
        allowed: args.allowed,
        now: args.now.as_deref(),
        cost: Cost { waiting, person, percent, late },
    };
    let found = known.house(&map, args.loaded).best(&trip);
    let notes = known.notes(&map, args.loaded);
    let (best, at_once) = match found {
        Ok(both) => both,
        Err(roscausal_discovery::Error::Data(reason)) => {
            match args.json {
                true => say!("{}", serde_json::json!({ "refused": reason, "notes": notes })),
                false => say!("{reason}"),
            }
            return Ok(Status::NotSupported);
        }
        Err(error) => return Err(error.into()),
    };
    if args.json {
        let object = |choice: &Choice| {
            let names = choice.places.iter().map(|place| map.places[*place].name.as_str());
            serde_json::json!({
                "wait_s": choice.wait, "places": names.collect::<Vec<_>>(), "seconds": choice.seconds.mean,
                "seconds_interval": choice.seconds_interval(), "people": choice.people,
                "battery_percent": choice.battery, "late": choice.late, "cost_s": choice.cost,
            })
        };
        let at_once = at_once.as_ref().map(object);
        say!("{}", serde_json::json!({ "best": object(&best), "at_once": at_once, "notes": notes }));
        return Ok(Status::Ok);
    }
    say!("{}", best.sentence(&map, at_once.as_ref()));
    notes.iter().for_each(|note| say!("{note}"));
    Ok(Status::Ok)
}
