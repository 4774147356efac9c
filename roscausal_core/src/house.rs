//! A house as files: its map, tables of days, and the causal model of what is counted in it.
//!
//! ```text
//! places = [{ name = "hall", at = [0.0, 0.0] }, { name = "lab", at = [6.0, 0.0] }]      map.toml
//! arcs = [["hall", "lab"]]
//!
//! time,place,people,robot,hour,speed,loss,load                                          monday.csv: a file for each day
//! 0,0,2,0,8.0,,,
//! 0,1,0,1,8.0,0.61,0.0069,0
//! ```
//!
//! `place` is the place's name, or its position in the map's list, from 0. `speed` (m/s), `loss` (percent of the battery in a second)
//! and `load` (0 or 1) stand in rows of the robot's own place, if anywhere; `speed` only while it drives.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
    time::SystemTime,
};

use ndarray::Axis;
use roscausal_msgs::{
    geometry_msgs::{Point, Pose, Quaternion},
    nav_msgs::{MapMetaData, OccupancyGrid},
    std_msgs::Header,
};
use roscausal_reasoning::{
    graph::Graph,
    model::graph_of_json,
    route::{
        days::{Days, HOUR, Known},
        levels::{Made, Way},
        map::{Map, Place},
    },
};
use serde::Deserialize;

use crate::{
    Error, Result,
    batch::{
        Table,
        table::{Note, Reading},
    },
    bounded, ensure,
    gate::lock,
};

/// The largest count.
const MOST: f64 = 86_400.0;
/// Columns that say how the robot fared.
const FARED: [&str; 3] = ["speed", "loss", "load"];
/// The column with the place.
const PLACE: &str = "place";

/// What a map's file has; a scenario of a working day has it as `[day]`.
#[derive(Default, Deserialize)]
#[serde(default)]
struct MapFile {
    places: Vec<Place>,
    arcs: Vec<[String; 2]>,
    day: Option<Box<MapFile>>,
}

/// Reads a map.
///
/// # Errors
/// A file that cannot be read or has no places, and whatever [`Map::new`] refuses.
pub fn map(path: &Path) -> Result<Map> {
    let text = bounded::read_settings(path)?;
    let mut file: MapFile = toml::from_str(&text).map_err(|error| Error::file(path, error.message()))?;
    if let Some(day) = file.day.take() {
        file = *day;
    }
    Map::new(file.places, &file.arcs).map_err(|error| Error::file(path, error))
}

/// The value of a map's cell at which nobody should pass: so many people at a place count as that.
const FULL: f64 = 5.0;
/// Metres around places and arcs that have the cost of the people there, and metres around the whole map.
const REACH: f64 = 2.0;
const MARGIN: f64 = 5.0;
/// Most cells along an axis; those of a larger map are wider.
const MOST_CELLS: f64 = 500.0;

/// The ends of an arc, metres, and what is expected there.
type Ends = ([[f64; 2]; 2], [Option<f64>; 2]);

/// What is expected at an hour as a grid for a costmap filter: 0 where nobody is expected to 100 where five people or more are; -1
/// away from all places and arcs, and where nothing was recorded.
pub fn costs(map: &Map, known: &Known, hour: f64, resolution: f64) -> OccupancyGrid {
    let extent = |axis: usize| {
        let at = map.places.iter().map(|place| place.at[axis]);
        let (low, high) = at.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        (low - MARGIN, high - low + 2.0 * MARGIN)
    };
    let ((x, wide), (y, high)) = (extent(0), extent(1));
    let resolution = resolution.max(wide.max(high) / MOST_CELLS);
    let [width, height] = [wide, high].map(|size| (size / resolution).ceil() as u32);
    let level = |place: usize| known.levels.level(place, hour).map(|level| level.mean.max(0.0));
    let arcs = map.graph.raw_edges().iter().map(|edge| [edge.source().index(), edge.target().index()]);
    let arcs: Vec<Ends> =
        arcs.map(|ends| (ends.map(|place| map.places[place].at), ends.map(level))).collect();
    let cell = |column: u32, row: u32| {
        let at = [x + (f64::from(column) + 0.5) * resolution, y + (f64::from(row) + 0.5) * resolution];
        let near = arcs.iter().map(|(ends, levels)| (along(ends, at), levels));
        let ((share, _), levels) =
            near.filter(|((_, far), _)| *far <= REACH).min_by(|a, b| a.0.1.total_cmp(&b.0.1))?;
        Some(levels[0]? * (1.0 - share) + levels[1]? * share)
    };
    let value = |(column, row)| {
        cell(column, row).map_or(-1, |people| (100.0 * people / FULL).min(100.0).round() as i8)
    };
    let cells = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let origin = Pose { position: Point { x, y, z: 0.0 }, orientation: Quaternion::default() };
    OccupancyGrid {
        header: Header::default(),
        info: MapMetaData { resolution: resolution as f32, width, height, origin, ..MapMetaData::default() },
        data: cells.map(value).collect(),
    }
}

/// Where on the way between two places a position lies, from 0 to 1, and how far it is from it.
fn along([a, b]: &[[f64; 2]; 2], p: [f64; 2]) -> (f64, f64) {
    let (way, offset) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = way[0] * way[0] + way[1] * way[1];
    let share =
        if square > 0.0 { ((offset[0] * way[0] + offset[1] * way[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (share, libm::hypot(offset[0] - share * way[0], offset[1] - share * way[1]))
}

/// A house whose days are added while somebody asks: a map, a model, and a folder with a table for each day, in order of their names.
#[derive(Debug, Default)]
pub struct House {
    /// The map's file.
    pub map: PathBuf,
    /// The model's file.
    pub model: PathBuf,
    /// The folder of the tables.
    pub days: PathBuf,
    /// The variable that is counted.
    pub count: String,
    read: Mutex<Option<Read>>,
}

/// Files with the time of their last change, and what they told.
type Read = (Vec<(PathBuf, SystemTime)>, Arc<(Map, Known)>);

impl House {
    /// A house in these files.
    pub fn new(map: PathBuf, model: PathBuf, days: PathBuf, count: String) -> Self {
        Self { map, model, days, count, read: Mutex::default() }
    }

    /// What the files tell now; they are read again when one of them has changed or a day has come.
    ///
    /// # Errors
    /// As [`map`] and [`known`], and a folder without tables.
    pub fn newest(&self) -> Result<Arc<(Map, Known)>> {
        let listed = std::fs::read_dir(&self.days).map_err(|error| Error::file(&self.days, error))?;
        let mut tables: Vec<PathBuf> = listed.flatten().map(|entry| entry.path()).collect();
        tables.retain(|path| path.extension().is_some_and(|end| end == "csv"));
        // Day 10 comes after day 9.
        tables.sort_by_key(|path| padded(&path.to_string_lossy()));
        ensure(!tables.is_empty(), || Error::file(&self.days, "it has no table of a day (*.csv)"))?;
        let changed = |path: &PathBuf| {
            path.metadata().and_then(|data| data.modified()).unwrap_or(SystemTime::UNIX_EPOCH)
        };
        let files = [&self.map, &self.model].into_iter().chain(&tables);
        let files: Vec<(PathBuf, SystemTime)> = files.map(|path| (path.clone(), changed(path))).collect();
        let mut read = lock(&self.read);
        if let Some((_, told)) = read.as_ref().filter(|(of, _)| *of == files) {
            return Ok(told.clone());
        }
        let map = map(&self.map)?;
        let known = known(&map, &self.model, &tables, &self.count)?;
        let told = Arc::new((map, known));
        *read = Some((files, told.clone()));
        Ok(told)
    }
}

/// A text whose numbers sort as numbers.
fn padded(text: &str) -> String {
    let mut digits = String::new();
    let mut made = String::new();
    for c in text.chars().chain(['\0']) {
        if c.is_ascii_digit() {
            digits.push(c);
            continue;
        }
        if !digits.is_empty() {
            let _ = write!(made, "{:0>20}", std::mem::take(&mut digits));
        }
        made.push(c);
    }
    made
}

/// Reads the tables of days and the model, and fits what they tell of `target`.
///
/// # Errors
/// A file that cannot be read, a column that is missing, a place that the map does not have, steps that differ, and what
/// [`Days::known`] refuses.
pub fn known(map: &Map, model: &Path, tables: &[PathBuf], target: &str) -> Result<Known> {
    let text = bounded::read_text(model, bounded::MODEL)?;
    let (graph, _) = graph_of_json(&text, &[]).map_err(|error| Error::file(model, error))?;
    let days = days(map, &graph, tables, target)?;
    Ok(days.known(&days, &graph, target, Way::Causal)?)
}

fn days(map: &Map, graph: &Graph, tables: &[PathBuf], target: &str) -> Result<Days> {
    let mut names = graph.names().to_vec();
    for name in [HOUR, target] {
        let counted = target != HOUR && names.iter().any(|one| one == name);
        Error::ensure_data(counted, || {
            format!("the model has no variable '{name}' that is counted at an {HOUR}: {}", names.join(", "))
        })?;
    }
    let wide = names.len();
    names.extend(FARED.into_iter().chain([PLACE]).map(str::to_owned));
    let mut days = Days { names: graph.names().to_vec(), ..Days::default() };
    let counts = names.iter().position(|name| name == target).unwrap_or(0);
    for (day, path) in tables.iter().enumerate() {
        let reading =
            Reading { columns: Some(names.clone()), recording: Some(PLACE.into()), ..Reading::default() };
        let mut table = Table::read_as(path, &reading)?;
        let words = table.notes.iter().find_map(|note| match note {
            Note::Coded { words, .. } => Some(words),
            _ => None,
        });
        if let Some(words) = words {
            let place = |word: &String| map.place(word).map_err(|error| Error::file(path, error));
            let named = words.iter().map(place).collect::<Result<Vec<usize>>>()?;
            let number = |code: f64| if code.is_nan() { code } else { named[code as usize] as f64 };
            table.values.column_mut(wide + FARED.len()).mapv_inplace(number);
        }
        for (name, part) in table.by_recording(PLACE, false).map_err(|reason| Error::file(path, reason))? {
            let place = name.rsplit(' ').next().and_then(|text| text.parse().ok());
            let Some(place) = place.filter(|place| *place < map.places.len()) else {
                let reason = format!("{name} is none of the map's; they are 0 to {}", map.places.len() - 1);
                return Err(Error::file(path, reason));
            };
            let step = part.dt().filter(|step| days.row == 0.0 || (step - days.row).abs() < 0.01 * days.row);
            days.row = step.ok_or_else(|| {
                Error::file(path, format!("{name} has no times, or another step than the rest"))
            })?;
            let times = part.time.as_deref().unwrap_or_default();
            if let Some(pair) =
                times.windows(2).find(|pair| (pair[1] - pair[0] - days.row).abs() > 0.5 * days.row)
            {
                let reason = format!(
                    "{name} has a step from {} s to {} s; its rows need even steps of {} s",
                    pair[0], pair[1], days.row
                );
                return Err(Error::file(path, reason));
            }
            for row in 0..part.values.nrows() {
                let [speed, loss, load] = [0, 1, 2].map(|k| part.values[[row, wide + k]]);
                let limits = [
                    ("speed", speed, 100.0),
                    ("loss", loss, 100.0),
                    (target, part.values[[row, counts]], MOST),
                ];
                if let Some((of, value, most)) =
                    limits.iter().find(|(_, value, most)| *value < 0.0 || value > most)
                {
                    let reason =
                        format!("row {} of {name}: {of} is {value}; it lies from 0 to {most}", row + 1);
                    return Err(Error::file(path, reason));
                }
                if row > 0 && speed.is_finite() {
                    days.drives.push((part.values[[row - 1, counts]], speed));
                }
                if loss.is_finite() {
                    let speed = if speed.is_finite() { speed } else { 0.0 };
                    days.drains[usize::from(load > 0.5)].push((speed, loss));
                }
            }
            days.made.push(Made { place, day });
            let kept: Vec<usize> = (0..wide).collect();
            days.recordings.push(part.values.select(Axis(1), &kept));
        }
    }
    Ok(days)
}
