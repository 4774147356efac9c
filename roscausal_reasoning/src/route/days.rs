//! Days of recordings of a house, and what they tell.
//!
//! A day is a table with a row for each place and moment: how many people are there, the variables that the model has besides, and the
//! hour. Rows at the robot's own place also say how fast it drove, what its battery lost in a second, and whether it was loaded.

use ndarray::Array2;
use roscausal_discovery::{DataFrame, Error, Result};

use super::{
    levels::{Levels, Made, Way},
    map::Map,
    pace::{Drain, Pace},
    plan::House,
};
use crate::graph::Graph;

/// Name of the column with the hour of the day.
pub const HOUR: &str = "hour";

/// Recordings of several days.
#[derive(Clone, Debug, Default)]
pub struct Days {
    /// One for each place and day; columns as in [`Days::names`].
    pub recordings: Vec<Array2<f64>>,
    /// Where and when each was made.
    pub made: Vec<Made>,
    /// Names of the columns.
    pub names: Vec<String>,
    /// People at the robot's place a row before, and its speed in m/s, for rows in which it drove.
    pub drives: Vec<(f64, f64)>,
    /// Speed in m/s and loss of the battery in a second, for rows without a load and for those with one.
    pub drains: [Vec<(f64, f64)>; 2],
    /// Seconds of a row.
    pub row: f64,
}

/// What days tell of a house.
#[derive(Clone, Debug)]
pub struct Known {
    /// What is expected at each place and hour.
    pub levels: Levels,
    /// How fast the robot drives among people.
    pub pace: Pace,
    /// What its battery loses, without and with a load.
    pub drains: [Drain; 2],
    days: usize,
    row: f64,
}

impl Days {
    /// How many days there are.
    pub fn days(&self) -> usize {
        self.made.iter().map(|one| one.day + 1).max().unwrap_or(0)
    }

    /// What these days tell, with the variable `target` from the days `counted` (mostly the same). The graph has its parents.
    ///
    /// # Errors
    /// No variable `target` or `hour`, no rows, or a robot that hardly drove.
    pub fn known(&self, counted: &Self, graph: &Graph, target: &str, way: Way) -> Result<Known> {
        let data = DataFrame::new(counted.recordings.clone(), counted.names.clone())?;
        let names: Vec<&str> = graph.names().iter().map(String::as_str).collect();
        let find = |name: &str| {
            names.iter().position(|one| *one == name).ok_or_else(|| Error::unknown("count", name, &names))
        };
        Ok(Known {
            levels: Levels::fit(&data, &counted.made, graph, find(target)?, find(HOUR)?, way)?,
            pace: Pace::fit(&self.drives)?,
            drains: [Drain::fit(&self.drains[0]), Drain::fit(&self.drains[1])],
            days: counted.days(),
            row: self.row,
        })
    }
}

impl Known {
    /// The house on a map, for a robot without or with a load.
    pub fn house<'a>(&'a self, map: &'a Map, loaded: bool) -> House<'a> {
        House {
            map,
            levels: &self.levels,
            pace: self.pace,
            drain: self.drains[usize::from(loaded)],
            row: self.row,
        }
    }

    /// What the numbers rest on, a sentence each: the days, what began anew in them, and what they do not tell.
    pub fn notes(&self, map: &Map, loaded: bool) -> Vec<String> {
        let days = if self.days == 1 { "1 day".to_owned() } else { format!("{} days", self.days) };
        let Pace { free, each } = self.pace;
        let mut notes = vec![format!(
            "It rests on {days}; a metre takes {free:.2} s where nobody is, and {each:.2} s more for each person at a place."
        )];
        if self.drains[usize::from(loaded)] == Drain::default() {
            let load = if loaded { "with a load" } else { "without a load" };
            notes.push(format!("No row tells what the battery loses {load}; it counts as nothing."));
        }
        for day in 0..self.days {
            let of_day = || self.levels.anew.iter().filter(move |anew| anew.day == day);
            let hours = of_day().filter_map(|anew| {
                anew.hour.map(|hour| format!("at {} (all places)", self.levels.hour(hour)))
            });
            let places = of_day().filter_map(|anew| {
                anew.place.map(|place| format!("at {} (all hours)", map.places[place].name))
            });
            let what: Vec<String> = hours.chain(places).collect();
            if !what.is_empty() {
                let (day, what) = (day + 1, what.join(", "));
                notes.push(format!(
                    "Day {day} differs from the days before {what}: only it and later ones count there."
                ));
            }
        }
        notes
    }
}
