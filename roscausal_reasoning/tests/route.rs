//! Laws of routes: levels are what was put into the data, whatever the robot did; a changed day is seen, an unchanged one is not; the
//! best choice is the best of all.

#![allow(clippy::unwrap_used, reason = "a test may panic: that is how it fails")]

use ndarray::Array2;
use roscausal_discovery::DataFrame;
use roscausal_fuzz::unit;
use roscausal_reasoning::{
    graph::{Arrow, Graph},
    route::{
        levels::{Expected, Levels, Made, Way},
        map::{Map, Place},
        pace::{Drain, Pace},
        plan::{Cost, House, STEP, Trip},
    },
};

const HOURS: usize = 3;
const ROWS: usize = 360;

fn graph() -> Graph {
    let names = ["people", "robot", "hour"].map(str::to_owned).to_vec();
    let arrow = |cause, effect, lag| Arrow { cause, effect, lag };
    Graph::new(names, 1, &[arrow(0, 0, 1), arrow(1, 0, 1)], &[]).unwrap()
}

fn level(place: usize, hour: usize) -> f64 {
    1.0 + ((place * 7 + hour * 5) % 11) as f64
}

/// Days of four places: people come back to their level with 0.9, the robot drives two of them away, and is at places of even number
/// half of the time. `moved` shifts the hours of the levels from that day on.
fn days(days: usize, seed: u64, moved: Option<usize>) -> (DataFrame, Vec<Made>) {
    let mut state = seed;
    let mut normal = move || (0..12).map(|_| unit(&mut state)).sum::<f64>() - 6.0;
    let (mut recordings, mut made) = (Vec::new(), Vec::new());
    for day in 0..days {
        for place in 0..4 {
            let mut rows = Array2::zeros((HOURS * ROWS, 3));
            let shift = usize::from(moved.is_some_and(|first| day >= first));
            let of = |row: usize| level(place, (row / ROWS + shift) % HOURS);
            let (mut people, mut robot) = (of(0), 0.0);
            for row in 0..HOURS * ROWS {
                people = 0.1 * of(row) + 0.9 * people - 0.2 * robot + 0.4 * normal();
                robot = f64::from(place % 2 == 0 && (row / 30) % 2 == 0);
                rows[[row, 0]] = people;
                rows[[row, 1]] = robot;
                rows[[row, 2]] = 8.0 + row as f64 / ROWS as f64;
            }
            recordings.push(rows);
            made.push(Made { place, day });
        }
    }
    let names = graph().names().to_vec();
    (DataFrame::new(recordings, names).unwrap(), made)
}

#[test]
fn levels_are_those_without_the_robot_and_means_are_not() {
    let (data, made) = days(8, 1, None);
    let causal = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
    let mean = Levels::fit(&data, &made, &graph(), 0, 2, Way::Mean).unwrap();
    assert!((causal.kept - 0.9).abs() < 0.01 && (causal.slopes[1] + 0.2).abs() < 0.03, "{:?}", causal.slopes);
    for place in 0..4 {
        for hour in 0..HOURS {
            let at = 8.5 + hour as f64;
            let found = causal.level(place, at).unwrap();
            let (truth, sd) = (level(place, hour), found.variance.sqrt());
            assert!((found.mean - truth).abs() < 4.0 * sd + 0.1, "{place} {hour}: {found:?}, {truth}");
            // The robot takes one person away on average where it is half of the time.
            let plain = mean.level(place, at).unwrap().mean - truth;
            assert_eq!(plain < -0.5, place % 2 == 0, "{place} {hour}: {plain}");
        }
    }
}

#[test]
fn what_is_expected_goes_from_the_present_to_the_level() {
    let (data, made) = days(4, 2, None);
    let levels = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
    let at = |ahead: f64| levels.expected(1, 8.5, ahead, Some((20.0, 8.5))).unwrap();
    assert!((at(0.0).mean - 20.0).abs() < 1e-9 && at(0.0).variance < at(5.0).variance);
    assert!((at(500.0).mean - levels.level(1, 8.5).unwrap().mean).abs() < 1e-6);
}

#[test]
fn an_hour_or_a_place_that_nobody_recorded_is_refused() {
    let (data, made) = days(2, 3, None);
    let levels = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
    for (place, hour) in [(0, 7.9), (0, 11.1), (4, 9.0), (0, f64::NAN)] {
        assert_eq!(levels.expected(place, hour, 0.0, None), None, "{place} {hour}");
    }
}

#[test]
fn an_hour_past_midnight_is_found_whether_the_days_count_on_or_begin_anew() {
    let (data, made) = days(2, 3, None);
    for shift in [0.0, 15.0] {
        // From 8 to 11, and from 23 to 26.
        let mut recordings = data.recordings().to_vec();
        recordings.iter_mut().for_each(|rows| rows.column_mut(2).mapv_inplace(|hour| hour + shift));
        let data = DataFrame::new(recordings, data.var_names().to_vec()).unwrap();
        let levels = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
        let last = 10.5 + shift;
        assert!(levels.level(1, last).is_some());
        for again in [last - 24.0, last + 24.0] {
            assert_eq!(levels.level(1, again), levels.level(1, last), "{again}");
        }
        assert_eq!(levels.level(1, last + 1.0), None);
    }
}

#[test]
fn a_day_that_differs_begins_anew_and_others_do_not() {
    let mut false_ones = 0;
    for seed in 0..20 {
        let (data, made) = days(6, 100 + seed, None);
        false_ones += Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap().anew.len();
        let (data, made) = days(6, 200 + seed, Some(4));
        let levels = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
        assert!(levels.anew.iter().all(|anew| anew.day == 4), "{:?}", levels.anew);
        for (place, hour) in (0..4).flat_map(|place| (0..HOURS).map(move |hour| (place, hour))) {
            let found = levels.level(place, 8.5 + hour as f64).unwrap();
            let truth = level(place, (hour + 1) % HOURS);
            assert!((found.mean - truth).abs() < 4.0 * found.variance.sqrt() + 0.1, "{found:?}, {truth}");
        }
    }
    assert!(false_ones <= 1, "{false_ones} of 20 houses in which nothing changes begin anew");
}

#[test]
fn a_metre_takes_what_it_took() {
    let mut state = 5;
    let rows: Vec<(f64, f64)> = (0..4000)
        .map(|k| {
            let people = f64::from(k % 5);
            // It stands for part of the row, or drives at its top speed.
            (people, if unit(&mut state) < 1.0 / (1.0 + people) { 0.8 } else { 0.0 })
        })
        .collect();
    let pace = Pace::fit(&rows).unwrap();
    assert!((pace.free - 1.25).abs() < 0.08 && (pace.each - 1.25).abs() < 0.08, "{pace:?}");
    assert!(Pace::fit(&[(0.0, 1e308); 50]).is_err() && Pace::fit(&[(0.0, 1e-300); 50]).is_err());
    assert_eq!(Drain::fit(&[(0.0, -0.1), (1.0, -0.4), (0.5, -0.25)]), Drain::default());
    assert!(Pace::fit(&rows[..10]).is_err() && Pace::fit(&[(1.0, 0.0); 50]).is_err());
    let drain = Drain::fit(&[(0.0, 0.1), (1.0, 0.4), (0.5, 0.25)]);
    assert!((drain.second - 0.1).abs() < 1e-12 && (drain.metre - 0.3).abs() < 1e-12);
}

fn map() -> Map {
    let place = |name: &str, x: f64, y: f64| Place { name: name.into(), at: [x, y], kind: String::new() };
    let places =
        vec![place("a", 0.0, 0.0), place("b", 10.0, 0.0), place("c", 20.0, 0.0), place("d", 10.0, 8.0)];
    let arcs = [["a", "b"], ["b", "c"], ["a", "d"], ["d", "c"]].map(|pair| pair.map(str::to_owned));
    Map::new(places, &arcs).unwrap()
}

#[test]
fn the_best_choice_is_the_best_of_all_ways_and_moments() {
    let map = map();
    let (data, made) = days(4, 7, None);
    let levels = Levels::fit(&data, &made, &graph(), 0, 2, Way::Causal).unwrap();
    let house = House {
        map: &map,
        levels: &levels,
        pace: Pace { free: 1.25, each: 0.8 },
        drain: Drain { second: 0.01, metre: 0.02 },
        row: 10.0,
    };
    let ways = [[0, 1, 2], [0, 3, 2]];
    for (k, now) in [[0.0, 0.0, 0.0, 9.0], [0.0, 9.0, 0.0, 0.0], [3.0, 30.0, 3.0, 30.0]].iter().enumerate() {
        let cost = Cost { person: 2.0, ..Cost::default() };
        let trip =
            Trip { from: 0, to: 2, hour: 8.2, horizon: 1800.0, allowed: Some(150.0), now: Some(now), cost };
        let (best, at_once) = house.best(&trip).unwrap();
        let mut least = f64::MAX;
        for step in 0..=30 {
            for way in ways {
                least = least.min(by_hand(&house, &trip, &way, step));
            }
        }
        let at_once = at_once.unwrap();
        assert!((best.cost - least).abs() < 1e-9 && best.cost <= at_once.cost, "{k}: {best:?}, {least}");
        assert_eq!(at_once.wait, 0.0);
        // People on one way: the other one; on both: wait.
        match k {
            0 => assert_eq!((best.wait, &best.places), (0.0, &vec![0, 1, 2])),
            1 => assert_eq!((best.wait, &best.places), (0.0, &vec![0, 3, 2])),
            _ => assert!(best.wait > 0.0, "{best:?}"),
        }
    }
    assert!(levels.level(0, 8.1).is_some() && levels.level(0, 11.5).is_none());
    let late =
        Trip { from: 0, to: 2, hour: 12.0, horizon: 0.0, allowed: None, now: None, cost: Cost::default() };
    assert!(house.best(&late).unwrap_err().to_string().contains("do not reach"));
}

/// The cost of a way from the definition: the people at a place slow the robot on half of both arcs that meet there.
fn by_hand(house: &House<'_>, trip: &Trip<'_>, way: &[usize], step: usize) -> f64 {
    let wait = step as f64 * STEP;
    let mut cost = wait * (trip.cost.waiting + trip.cost.percent * house.drain.second);
    let (mut seconds, mut weights) = (0.0, [(0.0, 0.0); 3]);
    for (k, pair) in way.windows(2).enumerate() {
        let [a, b] = [pair[0], pair[1]].map(|place| house.map.places[place].at);
        let metres = (a[0] - b[0]).hypot(a[1] - b[1]);
        let moment = step + (house.map.distance[trip.from][pair[0]] * house.pace.free / STEP) as usize;
        let ahead = moment as f64 * STEP;
        let at = |place: usize| -> Expected {
            let now = (trip.now.unwrap()[place], trip.hour);
            house.levels.expected(place, trip.hour + ahead / 3600.0, ahead / house.row, Some(now)).unwrap()
        };
        let (a, b) = (at(pair[0]), at(pair[1]));
        let people = (a.mean + b.mean) / 2.0;
        let part = metres * (house.pace.free + house.pace.each * people);
        seconds += part;
        weights[k] = (weights[k].0 + metres * house.pace.each / 2.0, a.variance);
        weights[k + 1] = (metres * house.pace.each / 2.0, b.variance);
        let battery = house.drain.second * part + house.drain.metre * metres;
        cost += part + trip.cost.person * people + trip.cost.percent * battery;
    }
    let variance: f64 = weights.iter().map(|(weight, variance)| weight * weight * variance).sum();
    let z: f64 = (trip.allowed.unwrap() - seconds) / variance.sqrt();
    cost + trip.cost.late * libm::erfc(z / std::f64::consts::SQRT_2) / 2.0
}

#[test]
fn a_crowd_ahead_is_avoided_where_it_may_make_the_robot_late() {
    // Both ways take as long on average; at b nobody or twenty people stand, at d always the same.
    let map = map();
    let mut recordings = Vec::new();
    for place in 0..4 {
        recordings.push(Array2::from_shape_fn((360, 2), |(row, column)| match (column, place) {
            (1, _) => 8.0 + row as f64 / 361.0,
            (_, 1) => 6.0 * f64::from((row / 40) % 2 == 0),
            (_, 3) => 1.0 + 0.01 * f64::from(row % 2 == 0),
            _ => 0.0,
        }));
    }
    let names = ["people", "hour"].map(str::to_owned).to_vec();
    let graph = Graph::new(names.clone(), 1, &[Arrow { cause: 0, effect: 0, lag: 1 }], &[]).unwrap();
    let made: Vec<Made> = (0..4).map(|place| Made { place, day: 0 }).collect();
    let levels =
        Levels::fit(&DataFrame::new(recordings, names).unwrap(), &made, &graph, 0, 1, Way::Causal).unwrap();
    let drain = Drain { second: 0.0, metre: 0.0 };
    let house = House { map: &map, levels: &levels, pace: Pace { free: 1.0, each: 0.3 }, drain, row: 10.0 };
    let trip =
        Trip { from: 0, to: 2, hour: 8.2, horizon: 0.0, allowed: None, now: None, cost: Cost::default() };
    assert!(house.best(&Trip { hour: 20.0, ..trip }).is_err(), "days of one hour say nothing of another");
    let quick = house.best(&trip).unwrap().0;
    let sure = house.best(&Trip { allowed: Some(33.5), ..trip }).unwrap().0;
    assert!(quick.places == [0, 1, 2] || quick.seconds.mean < sure.seconds.mean + 1e-9, "{quick:?} {sure:?}");
    assert_eq!(sure.places, [0, 3, 2], "{sure:?}");
    assert!(sure.late.unwrap() < 0.01 && sure.seconds_interval().0 >= sure.least, "{sure:?}");
    let there = house.best(&Trip { to: 0, ..trip }).unwrap().0;
    assert_eq!(there.sentence(&map, None), "The robot is there.");
}

#[test]
fn a_map_that_is_none_is_refused_with_its_reason() {
    let place = |name: &str| Place { name: name.into(), at: [0.0, name.len() as f64], kind: String::new() };
    let arc = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
    let cases = [
        (vec![], vec![], "0 places"),
        ((0..501).map(|k| place(&format!("p{k}"))).collect(), vec![], "501 places"),
        (vec![place("a"), place("a")], vec![], "two places"),
        (vec![place("a b")], vec![], "letters"),
        (vec![Place { at: [f64::NAN, 0.0], ..place("a") }], vec![], "metres"),
        (vec![place("a"), place("bb")], vec![], "no way leads to 'bb'"),
        (vec![place("a"), place("bb")], vec![arc("a", "c")], "no place 'c'"),
    ];
    for (places, arcs, reason) in cases {
        let stated = Map::new(places, &arcs).unwrap_err().to_string();
        assert!(stated.contains(reason), "{stated}");
    }
    assert_eq!(map().way(0, 2), [0, 1, 2]);
    assert_eq!(map().way(3, 1).len(), 3);
}
