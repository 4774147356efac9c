//! Which columns of a table say who, when and where.
//!
//! | layout | columns |
//! |---|---|
//! | named, long | `id`, `time` or `frame`, `x`, `y`, and perhaps velocity, heading, goal, kind of agent |
//! | named, wide | `time` or `frame`, and for each body `NAME x`, `NAME y` (motion capture: its centroid, or its markers) |
//! | without names, 8 columns, times since 1970 | ATC: time, person, x, y, z, speed, angle of motion, angle of the face |
//! | without names, 8 columns, otherwise | BIWI: frame, person, x, z, y, and the velocity in the same order |
//! | without names, 10 columns | the Stanford drones: person, box (from x, y to x, y), frame, lost, occluded, generated, label |
//! | without names, 4 to 7 columns | ETH and UCY: frame, person, x, y, perhaps the velocity; JuPedSim and others: person, frame, x, y |

use std::collections::BTreeMap;

use roscausal_discovery::Named;

use super::sample::PositionUnit;
use crate::batch::table::{binary::Column, columns::time_name, grid::Grid, median, time::Unit};

/// Names of the columns of each role, separated by commas, in lower case and without a unit.
const ROLES: [(&str, &str); 11] = [
    (
        "id",
        "id,agent_id,ag_id,agent,agentid,person_id,personid,person,ped_id,pedestrian_id,pedestrian,ped,pid,track_id,trackid,track,\
         object_id,obj_id,human_id,body_id,body,name",
    ),
    ("frame", "frame,frame_id,frameid,frame_number,frame_no,frames,framenumber,fr"),
    ("x", "x,pos_x,position_x,x_pos,position.x,pose.position.x,xcenter,x_center,px,x_coord,position x"),
    ("y", "y,pos_y,position_y,y_pos,position.y,pose.position.y,ycenter,y_center,py,y_coord,position y"),
    ("vx", "vx,v_x,vel_x,velocity_x,x_vel,xvelocity,velocity.x,x_velocity"),
    ("vy", "vy,v_y,vel_y,velocity_y,y_vel,yvelocity,velocity.y,y_velocity"),
    ("speed", "v,speed,velocity,vel"),
    ("heading", "heading,theta,yaw,angle,orientation,direction,motion_angle,angle of motion,psi"),
    ("gx", "gx,goal_x,x_goal,goal.x"),
    ("gy", "gy,goal_y,y_goal,goal.y"),
    ("kind", "agent_type,type,class,category,kind,role,agent_class"),
];

/// The roles that a user may name a column for.
pub(super) const NAMED_ROLES: &str = "id, time, frame, x, y, vx, vy, speed, heading, gx, gy, kind";

/// When a row is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Clock {
    Time(usize, Option<Unit>),
    Frame(usize),
}

/// The columns of one agent's places: averaged over its markers.
pub(super) type Places = Vec<(usize, usize)>;

/// What the columns are.
#[derive(Debug, PartialEq)]
pub(super) enum Layout {
    /// A row for each agent and time; columns by role.
    Long(Clock, BTreeMap<&'static str, usize>),
    /// A row for each time; agents by name.
    Wide(Clock, BTreeMap<String, Places>),
}

/// Whether these words are the names of such a table.
pub(super) fn is_header(words: &[String], given: &BTreeMap<String, String>) -> bool {
    let names: Vec<&str> = words.iter().map(String::as_str).collect();
    let are_numbers = names.iter().all(|name| name.parse::<f64>().is_ok());
    let is_layout = |given: &BTreeMap<String, String>| of_names(&names, given).is_ok();
    !are_numbers && (is_layout(given) || is_layout(&BTreeMap::new()))
}

/// The layout of a file.
pub(super) fn of(grid: &Grid, given: &BTreeMap<String, String>) -> Result<Layout, String> {
    // Columns without names have numbers, from 1.
    if !grid.nameless || !given.is_empty() {
        let names: Vec<&str> = grid.columns.iter().map(|(name, _)| name.as_str()).collect();
        return of_names(&names, given);
    }
    let width = grid.columns.len();
    let first = |column: usize| grid.columns.get(column).map_or(f64::NAN, |(_, column)| column.number(0));
    if !(4..=8).contains(&width)
        || grid.columns.iter().take(4).any(|(_, column)| matches!(column, Column::Words(_)))
    {
        return Err(format!(
            "no line has the names of the columns of trajectories; an agent's id, its time (or frame), x and y are needed, named \
             so or with {} id=NAME,time=NAME,x=NAME,y=NAME",
            Named("trajectory_columns")
        ));
    }
    let long = |clock, columns: &[_]| Ok(Layout::Long(clock, columns.iter().copied().collect()));
    if width == 8 && first(0) > 1e8 {
        let columns = [("id", 1), ("x", 2), ("y", 3), ("speed", 5), ("heading", 6)];
        return long(Clock::Time(0, Some(Unit::Seconds)), &columns);
    }
    if width == 8 {
        return long(Clock::Frame(0), &[("id", 1), ("x", 2), ("y", 4), ("vx", 5), ("vy", 7)]);
    }
    let ([frame, id], has_velocities) = frame_and_id(grid);
    let rows = grid.columns[0].1.len();
    let whole = |column: usize| (0..rows).all(|row| grid.columns[column].1.number(row).fract() == 0.0);
    let clock = if whole(frame) { Clock::Frame(frame) } else { Clock::Time(frame, None) };
    let columns = [("id", id), ("x", 2), ("y", 3), ("vx", 4), ("vy", 5)];
    long(clock, &columns[..if has_velocities { 5 } else { 3 }])
}

/// Makes places of the boxes of the Stanford drones, their middles, and names the columns. Who is lost has no place: returns in how many rows;
/// `None` if it is another table.
pub(super) fn without_boxes(grid: &mut Grid) -> Option<usize> {
    const NAMES: &str = "id,x,y,xmax,ymax,frame,lost,occluded,generated,kind";
    let number = |column: usize, row: usize| grid.columns[column].1.number(row);
    let has_flags = |row: usize| (6..9).all(|column| [0.0, 1.0].contains(&number(column, row)));
    let rows = grid.columns.first().map_or(0, |(_, column)| column.len());
    let is_like_it =
        matches!(grid.columns.as_slice(), [.., (_, Column::Words(_))] if grid.columns.len() == 10);
    if !(grid.nameless && is_like_it && (0..rows).all(has_flags)) {
        return None;
    }
    let middle = |low: usize, row: usize| f64::midpoint(number(low, row), number(low + 2, row));
    let place = |low: usize, row: usize| if number(6, row) > 0.0 { f64::NAN } else { middle(low, row) };
    let [x, y] = [1, 2].map(|low| Column::Numbers((0..rows).map(|row| place(low, row)).collect()));
    let lost = (0..rows).filter(|&row| number(6, row) > 0.0).count();
    (grid.columns[1].1, grid.columns[2].1, grid.nameless) = (x, y, false);
    grid.columns.iter_mut().zip(NAMES.split(',')).for_each(|((name, _), given)| *name = given.to_owned());
    Some(lost)
}

/// Which of the first two columns counts frames, and which names agents: the right way round, an agent is near its place before. And
/// whether the fifth and sixth are velocities: they then point where it goes.
fn frame_and_id(grid: &Grid) -> ([usize; 2], bool) {
    const ROWS: usize = 20_000;
    let rows = grid.columns[0].1.len().min(ROWS);
    let number = |column: usize, row: usize| grid.columns[column].1.number(row);
    let steps = |frame: usize, id: usize| -> Vec<[usize; 2]> {
        let mut order: Vec<usize> = (0..rows).collect();
        let key = |row: usize| (number(id, row), number(frame, row));
        order.sort_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
        let pairs = order.windows(2).map(|pair| [pair[0], pair[1]]);
        pairs.filter(|[a, b]| number(id, *a) == number(id, *b)).collect()
    };
    let way = |[a, b]: [usize; 2]| [2, 3].map(|column| number(column, b) - number(column, a));
    let length = |[x, y]: [f64; 2]| libm::hypot(x, y);
    let usual =
        |steps: &[[usize; 2]]| median(steps.iter().map(|&step| length(way(step)))).unwrap_or(f64::INFINITY);
    let [frame_first, id_first] = [steps(0, 1), steps(1, 0)];
    let (columns, steps) =
        if usual(&id_first) < 0.5 * usual(&frame_first) { ([1, 0], id_first) } else { ([0, 1], frame_first) };
    let (mut along, mut most) = (0.0, 0.0);
    for step in steps.into_iter().filter(|_| grid.columns.len() > 5) {
        let (way, velocity) = (way(step), [4, 5].map(|column| number(column, step[0])));
        along += way[0] * velocity[0] + way[1] * velocity[1];
        most += length(way) * length(velocity);
    }
    (columns, along > 0.9 * most)
}

fn of_names(names: &[&str], given: &BTreeMap<String, String>) -> Result<Layout, String> {
    let exactly = |name: &String| {
        let found = names.iter().position(|other| other.trim() == name);
        found.ok_or_else(|| format!("there is no column '{name}'; columns: {}", names.join(", ")))
    };
    let plain: Vec<String> = names.iter().map(|name| bare(name)).collect();
    let mut roles: BTreeMap<&'static str, usize> = BTreeMap::new();
    for (role, usual) in ROLES {
        let found = match given.get(role) {
            Some(name) => Some(exactly(name)?),
            None => usual.split(',').find_map(|usual| plain.iter().position(|name| name == usual)),
        };
        if let Some(column) = found {
            roles.insert(role, column);
        }
    }
    let time = match given.get("time") {
        Some(name) => Some((exactly(name)?, None)),
        None => names.iter().enumerate().find_map(|(column, name)| Some((column, time_name(name)?))),
    };
    let frame = roles.get("frame").copied();
    let clock = match (time, frame) {
        (_, Some(frame)) if given.contains_key("frame") => Clock::Frame(frame),
        (Some((time, unit)), _) => Clock::Time(time, unit),
        (None, Some(frame)) => Clock::Frame(frame),
        (None, None) => return Err(lacking("time (or frame)", names)),
    };
    let bodies = bodies(names);
    match ["id", "x", "y"].iter().find(|role| !roles.contains_key(*role)) {
        Some(_) if !bodies.is_empty() => Ok(Layout::Wide(clock, bodies)),
        Some(role) => Err(lacking(role, names)),
        None => Ok(Layout::Long(clock, roles)),
    }
}

pub(super) fn lacking(role: &str, names: &[&str]) -> String {
    let short = role.split(' ').next().unwrap_or(role);
    let (setting, names) = (Named("trajectory_columns"), names.join(", "));
    format!(
        "no column is called {role}; {setting} {short}=NAME names it (roles: {NAMED_ROLES}); columns: {names}"
    )
}

/// A name without its unit, in lower case: `x` for `X [mm]`, `x/m`, `x_cm`.
fn bare(name: &str) -> String {
    let name = name.trim().to_lowercase();
    let name = name.split(['[', '(', '/']).next().unwrap_or_default().trim();
    ["_mm", "_cm", "_ft", "_m"].iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name).to_owned()
}

/// The unit of positions that the name of a column of them tells: `x/cm`, `x [mm]`, `pos_x (m)`, `x_mm`.
pub(super) fn unit_of(layout: &Layout, grid: &Grid) -> Option<PositionUnit> {
    let column = match layout {
        Layout::Long(_, roles) => *roles.get("x")?,
        Layout::Wide(_, bodies) => bodies.values().flatten().next()?.0,
    };
    let name = grid.columns.get(column)?.0.trim().to_lowercase();
    let unit = name.trim_end_matches([']', ')']);
    unit.rsplit_once(['/', '[', '(', '_']).and_then(|(_, unit)| unit.trim().parse().ok())
}

/// The bodies whose places stand in columns of their own, such as `Helmet_1 Centroid_X`, `Helmet_1 - 2 X` (a marker) or `ped1_x`.
/// A body's centroid counts for more than its markers.
fn bodies(names: &[&str]) -> BTreeMap<String, Places> {
    let mut centroids: BTreeMap<String, Places> = BTreeMap::new();
    let mut markers: BTreeMap<String, Places> = BTreeMap::new();
    // Of columns with the same name the first counts.
    let y = names.iter().enumerate().rev().filter_map(|(y, name)| Some((stem(name, 'y')?, y)));
    let of_y: BTreeMap<&str, usize> = y.collect();
    for (x, name) in names.iter().enumerate() {
        let Some(stem) = stem(name, 'x') else { continue };
        let Some(&y) = of_y.get(stem) else { continue };
        match stem.strip_suffix("Centroid").or(stem.strip_suffix("centroid")) {
            Some(body) => centroids.entry(clean(body)).or_default().push((x, y)),
            None => markers.entry(clean(without_marker(stem))).or_default().push((x, y)),
        }
    }
    for (body, places) in markers {
        centroids.entry(body).or_insert(places);
    }
    centroids
}

/// What stands before the letter of an axis; `None` if the name does not end so.
fn stem(name: &str, axis: char) -> Option<&str> {
    let name = name.trim();
    let name = name.strip_suffix("[m]").or(name.strip_suffix("[mm]")).unwrap_or(name).trim_end();
    let rest = name.strip_suffix(axis).or_else(|| name.strip_suffix(axis.to_ascii_uppercase()))?;
    let stem = rest.strip_suffix(['_', ' ', '.', '-', ':'])?;
    (!stem.trim().is_empty()).then_some(stem)
}

/// `Helmet_1` for `Helmet_1 - 3`.
fn without_marker(stem: &str) -> &str {
    match stem.rsplit_once(" - ") {
        Some((body, marker)) if marker.trim().chars().all(|letter| letter.is_ascii_digit()) => body,
        _ => stem,
    }
}

fn clean(name: &str) -> String {
    name.trim().trim_end_matches(['_', '-', '.', ':']).trim().to_owned()
}
