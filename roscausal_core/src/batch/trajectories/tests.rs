//! Tables of data sets in each layout, and the variables made of them.

use std::fs;

use super::*;
use crate::nodes;

/// Places of a person (7) who walks along x, and of a robot that stands at (4, 0), each 0.4 s.
fn places() -> Vec<(f64, f64, f64)> {
    let mut x = 0.0;
    (0..20)
        .map(|row| {
            x += 0.4 * if row % 3 == 0 { 1.2 } else { 0.8 };
            (f64::from(row) * 0.4, (x * 1e4_f64).round() / 1e4, 0.25)
        })
        .collect()
}

fn choice(who: &str) -> TrajectoryChoice {
    TrajectoryChoice { who: who.into(), obstacle: None, dt: None, max_gap: None, least_rows: 3 }
}

fn read(content: &str, reading: &TrajectoryReading, choice: &TrajectoryChoice) -> Result<Walks> {
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("walk.csv");
    fs::write(&file, content).expect("writes");
    walks(&file, reading, choice, &nodes::postprocess(&[]).expect("defaults"))
}

fn text(header: &str, line: impl Fn((f64, f64, f64)) -> String) -> String {
    let lines: String = places().into_iter().map(line).collect();
    if header.is_empty() { lines } else { format!("{header}\n{lines}") }
}

fn one(content: &str, reading: &TrajectoryReading) -> Table {
    let mut walks = read(content, reading, &choice("7")).unwrap_or_else(|error| panic!("{error}\n{content}"));
    assert_eq!(walks.tables.len(), 1);
    walks.tables.remove(0).1
}

#[test]
fn every_layout_of_the_data_sets_gives_the_same_variables() {
    let plain = TrajectoryReading { last_is_goal: true, ..TrajectoryReading::default() };
    let expected = one(&text("id,time,x,y", |(t, x, y)| format!("7,{t},{x},{y}\n8,{t},4,0\n")), &plain);
    assert_eq!(expected.names, ["h_v", "h_dg", "h_risk"]);
    let frame = |t: f64| (t * 25.0).round();
    let millimetres = |x: f64| (x * 1000.0).round();
    let jupedsim = |unit: &str, per_metre: f64| {
        let header = format!("#description: a walk\n#framerate: 25\n\n# id frame x/{unit} y/{unit} z/{unit}");
        text(&header, |(t, x, y)| {
            format!(
                "7 {0} {1} {2} 1.7\n8 {0} {3} 0 1.7\n",
                frame(t),
                x * per_metre,
                y * per_metre,
                4.0 * per_metre
            )
        })
    };
    let layouts = [
        // JuPedSim and PeTrack: comments, among them the rate; units in the names.
        jupedsim("m", 1.0),
        jupedsim("cm", 100.0),
        text("#framerate: 25.00 fps\n#ID\tFR\tX\tY\tZ", |(t, x, y)| {
            format!("7\t{0}\t{x}\t{y}\t1.7\n8\t{0}\t4\t0\t1.7\n", frame(t))
        }),
        // ETH and UCY, by tabs and by spaces.
        text("", |(t, x, y)| format!("{:.1}\t7.0\t{x}\t{y}\n{:.1}\t8.0\t4.0\t0.0\n", frame(t), frame(t))),
        text("", |(t, x, y)| format!(" {} 7  {x} {y}\n {} 8  4 0\n", frame(t), frame(t))),
        // ATC without a speed that differs: seconds since 1970, millimetres.
        text("time,person_id,pos_x,pos_y", |(t, x, y)| {
            format!("{:.1},7,{},{}\n{:.1},8,4000,0\n", 1.35e9 + t, millimetres(x), millimetres(y), 1.35e9 + t)
        }),
        // THOR-MAGNI, wide: facts before the header, millimetres, markers beside the centroid.
        format!(
            "FILE_ID,walk\nN_FRAMES,20\n{}",
            text(
                "Frame,Time,Helmet_7 - 1 X,Helmet_7 - 1 Y,Helmet_7 - 1 Z,Helmet_7 Centroid_X,Helmet_7 Centroid_Y,8 Centroid_X,8 \
                 Centroid_Y",
                |(t, x, y)| {
                    format!("{},{t},9999,9999,1,{},{},4000,0\n", frame(t), millimetres(x), millimetres(y))
                }
            )
        ),
        // Stamps and words.
        text("stamp;agent_id;agent_type;x [m];y [m]", |(t, x, y)| {
            format!("2026-11-24 08:00:{t:06.3};7;person;{x};{y}\n2026-11-24 08:00:{t:06.3};8;person;4;0\n")
        }),
    ];
    for (number, layout) in layouts.iter().enumerate() {
        let who = if layout.contains("Helmet") { "Helmet_7" } else { "7" };
        let reading = TrajectoryReading {
            unit: layout
                .contains("000")
                .then_some(PositionUnit::MILLIMETRES)
                .filter(|_| !layout.contains("stamp")),
            ..plain.clone()
        };
        let reading = if number < 5 { plain.clone() } else { reading };
        let walks = read(layout, &reading, &choice(who)).unwrap_or_else(|error| panic!("{number}: {error}"));
        let table = &walks.tables[0].1;
        assert_eq!(table.names, expected.names, "{number}");
        assert_eq!(table.values.dim(), expected.values.dim(), "{number}");
        for (found, expected) in table.values.iter().zip(&expected.values) {
            assert!(
                (found - expected).abs() < 1e-6 || (found.is_nan() && expected.is_nan()),
                "{number}: {found} {expected}"
            );
        }
    }
}

#[test]
fn the_variables_are_those_of_the_nodes() {
    let content = text("id,time,x,y", |(t, x, y)| format!("7,{t},{x},{y}\nrobot,{t},4,0\n"));
    let table = one(&content, &TrajectoryReading { last_is_goal: true, ..TrajectoryReading::default() });
    let places = places();
    assert!(table.values[[0, 0]].is_nan(), "one sample tells no speed");
    let (_, x, y) = places[5];
    let speed = (x - places[4].1) / 0.4;
    assert!((table.values[[5, 0]] - speed).abs() < 1e-9);
    assert!((table.values[[5, 1]] - (places[19].1 - x)).abs() < 1e-9);
    let body = |x, y, v| Values { x, y, theta: 0.0, v, omega: 0.0, ..Values::UNKNOWN }.body();
    let (a, b) = (body(x, y, speed), body(4.0, 0.0, 0.0));
    let (obs_size, safe_dist) = {
        let defaults = nodes::postprocess(&[]).expect("defaults");
        (defaults.obs_size, defaults.safe_dist)
    };
    let exponent =
        super::super::risk::risk_exponent(&a, &b, super::super::risk::RiskModel::V1_1, obs_size, safe_dist);
    assert!((table.values[[5, 2]] - exponent.exp()).abs() < 1e-9);
}

#[test]
fn agents_are_chosen_by_name_number_and_nearness() {
    let line = |(t, x, y): (f64, f64, f64)| format!("7,{t},{x},{y}\n9,{t},{x},40\nrobot,{t},4,0\n");
    let content = text("id,time,x,y", line);
    let names = |who: &str| -> Vec<String> {
        let walks = read(&content, &TrajectoryReading::default(), &choice(who)).expect("reads");
        walks.tables.into_iter().map(|(name, _)| name).collect()
    };
    assert_eq!(names("all"), ["7", "9"]);
    assert_eq!(names("nearest:1"), ["7"]);
    assert_eq!(names("9,7"), ["9", "7"]);
    assert_eq!(names("!7"), ["9"]);
    assert_eq!([names("7..9,!7"), names("!7,7..9")], [["9"], ["9"]], "in any order");
    let reported =
        read(&content, &TrajectoryReading::default(), &choice("12")).err().expect("nobody").to_string();
    assert!(reported.contains("'12' is nobody in this table; it has 7, 9, robot"), "{reported}");
    let walks = read(&content, &TrajectoryReading::default(), &choice("7")).expect("reads");
    assert!(walks.notes.iter().any(|note| note.contains("the obstacle is robot")), "{:?}", walks.notes);
    assert!(
        walks
            .notes
            .iter()
            .any(|note| note.contains("h_dg") && note.contains(&format!("{} last", Named("goal")))),
        "{:?}",
        walks.notes
    );
    assert_eq!(walks.tables[0].1.names, ["h_v", "h_risk"]);
}

#[test]
fn what_is_no_such_table_is_one_sentence_with_the_way_out() {
    let fault = |content: &str| {
        read(content, &TrajectoryReading::default(), &choice("all")).err().expect("refused").to_string()
    };
    assert!(fault("time,a,b\n0,1,2\n").contains("trajectory_columns"));
    assert!(fault("hello world\n").contains("trajectory_columns"));
    assert!(fault("").contains("walk.csv"));
    assert!(fault("id,time,x,y\n").contains("no rows"));
    assert!(fault("id,time,x,y\n1,,3,4\n").contains("nobody is in it"));
    // Many bodies, one below the other, are no column of one.
    let cars = |(t, x, y): (f64, f64, f64)| format!("{t},3,{x},{y}\n{t},4,{y},{x}\n{t},5,0,{x}\n");
    let reported = fault(&text("time,Vehicle,Local_X,Local_Y", cars));
    assert!(
        reported.contains("of several agents") && reported.contains("no column is called id"),
        "{reported}"
    );
    let content = text("ped,ts,px,py", |(t, x, y)| format!("7,{t},{x},{y}\n"));
    let columns = [("id", "ped"), ("time", "ts")].map(|(role, name)| (role.to_owned(), name.to_owned()));
    let reading = TrajectoryReading { columns: columns.into(), ..TrajectoryReading::default() };
    assert_eq!(one(&content, &reading).names, ["h_v"]);
}

/// Thirty invented people who come, walk some 1.3 m/s on a bend, and leave: `(second, id, [x, y], [vx, vy])`, each `step` seconds. The
/// first two stand.
fn crowd(step: f64) -> Vec<(f64, u32, [f64; 2], [f64; 2])> {
    let mut samples = Vec::new();
    for id in 1..=30_u32 {
        let (begin, speed) = (f64::from(id) * 1.5, 1.1 + 0.02 * f64::from(id % 20));
        let speed = if id <= 2 { 0.0 } else { speed };
        let (turns, first) = (0.3 * (f64::from(id * 7 % 11) / 5.0 - 1.0), f64::from(id));
        let mut place = [f64::from(id % 5), f64::from(id % 3)];
        for row in 0..(12.0 / step) as u32 {
            let heading = first + turns * f64::from(row) * step;
            let velocity = [speed * heading.cos(), speed * heading.sin()];
            let t = (begin / step).round() * step + f64::from(row) * step;
            samples.push((t, id, place, velocity));
            place = [0, 1].map(|axis| place[axis] + step * velocity[axis]);
        }
    }
    samples.sort_by(|a, b| a.0.total_cmp(&b.0));
    samples
}

#[test]
fn the_frame_rate_is_that_at_which_places_and_velocities_agree() {
    let units = [
        (PositionUnit::METRES, 1.0),
        (PositionUnit::CENTIMETRES, 100.0),
        (PositionUnit::MILLIMETRES, 1000.0),
    ];
    let rates = [2.5_f64, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0];
    let sets = rates.iter().flat_map(|rate| units.map(|unit| (*rate, unit)));
    for (rate, (_, per_metre)) in sets {
        // A sample each frame, and some 0.4 s apart as in BIWI's `obsmat.txt`: frame, id, x, z, y, and the velocity.
        for every in [1.0, f64::round(0.4 * rate)] {
            let line = |(t, id, [x, y], [vx, vy]): (f64, u32, [f64; 2], [f64; 2])| {
                let [x, y, vx, vy] = [x, y, vx, vy].map(|value| value * per_metre);
                format!("{:.0} {id} {x:.4} 0 {y:.4} {vx:.4} 0 {vy:.4}\n", t * rate)
            };
            let content: String = crowd(every / rate).into_iter().map(line).collect();
            let walks = read(&content, &TrajectoryReading::default(), &choice("all"))
                .unwrap_or_else(|error| panic!("{rate} {per_metre}: {error}"));
            let reported = walks.notes.join("\n");
            assert!(
                reported.contains(&format!("frames are taken as {rate} per second")),
                "{per_metre} {every}: {reported}"
            );
            let (_, table) = &walks.tables[0];
            let v = table.names.iter().position(|name| name == "h_v").expect("a speed");
            let mut speeds = table.values.column(v).to_vec();
            speeds.sort_by(f64::total_cmp);
            assert!((1.0..1.6).contains(&speeds[speeds.len() / 2]), "{rate} {per_metre}: {speeds:?}");
        }
    }
}

#[test]
fn a_velocity_behind_the_place_tells_the_rate_and_what_is_none_does_not() {
    type Seen = (f64, u32, [f64; 2], [f64; 2]);
    let notes = |line: fn(Seen) -> String| {
        let content: String = crowd(0.4).into_iter().map(line).collect();
        read(&content, &TrajectoryReading::default(), &choice("all")).expect("people").notes.join("\n")
    };
    let with = notes(|(t, id, [x, y], [vx, vy])| {
        format!("{:.0}\t{id}\t{x:.3}\t{y:.3}\t{vx:.3}\t{vy:.3}\n", t * 15.0)
    });
    assert!(with.contains("15 per second, at which places and velocities agree"), "{with}");
    let without =
        notes(|(t, id, [x, y], _)| format!("{:.0}\t{id}\t{x:.3}\t{y:.3}\t1.7\t{:.3}\n", t * 25.0, t.sin()));
    assert!(without.contains("25 per second, as those of ETH and UCY"), "{without}");
}

#[test]
fn scenes_as_of_eth_and_ucy_are_read_with_those_who_stand_left_out() {
    // Frames 25 a second of which each tenth is annotated, by tabs, by spaces, and with whole numbers.
    type Line = fn(f64, u32, f64, f64) -> String;
    let layouts: [Line; 3] = [
        |frame, id, x, y| format!("{frame:.1}\t{id}.0\t{x:.2}\t{y:.2}\n"),
        |frame, id, x, y| format!("{frame:.0} {id} {x:.3} {y:.3}\n"),
        |frame, id, x, y| format!("{id} {frame:.0} {x:.3} {y:.3}\n"),
    ];
    for (number, layout) in layouts.iter().enumerate() {
        let line = |(t, id, [x, y], _): (f64, u32, [f64; 2], [f64; 2])| layout((t * 25.0).round(), id, x, y);
        let content: String = crowd(0.4).into_iter().map(line).collect();
        let reading = TrajectoryReading { last_is_goal: true, ..TrajectoryReading::default() };
        let walks =
            read(&content, &reading, &choice("all")).unwrap_or_else(|error| panic!("{number}: {error}"));
        assert_eq!(walks.tables.len(), 28, "{number}: {:?}", walks.notes);
        let reported = walks.notes.join("\n");
        assert!(reported.contains("frames are taken as 25 per second"), "{number}: {reported}");
        assert!(walks.tables.iter().all(|(name, _)| name != "1" && name != "2"), "{number}");
        // Two stand, and 28 are too brief: those that are not listed are counted.
        let long = TrajectoryChoice { least_rows: 1000, ..choice("all") };
        let reported = read(&content, &reading, &long).err().expect("nobody is left").to_string();
        assert!(reported.contains(" and 8 more"), "{number}: {reported}");
    }
}

#[test]
fn the_boxes_of_the_stanford_drones_are_places_in_pixels_whose_length_must_be_told() {
    // Boxes of odd and even sizes about the places of 0.05 m pixels, 30 frames a second; the sixth row of 7 is lost.
    let line = |id: u32, t: f64, [x, y]: [f64; 2], lost: bool| {
        let [x, y, frame] = [20.0 * x + 100.0, 20.0 * y + 100.0, 30.0 * t].map(f64::round);
        let [left, top, right, bottom] = [x - 9.0, y - 12.0, x + 10.0, y + 12.0];
        format!("{id} {left} {top} {right} {bottom} {frame} {} 0 1 \"Pedestrian\"\n", u8::from(lost))
    };
    let boxes = |is_lost: fn(usize) -> bool| -> String {
        let row = |(row, (t, x, y)): (usize, (f64, f64, f64))| {
            line(7, t, [x, y], is_lost(row)) + &line(8, t, [4.0, 0.0], false)
        };
        places().into_iter().enumerate().map(row).collect()
    };
    let reading = |columns: &[(&str, &str)], unit: Option<&str>| TrajectoryReading {
        unit: unit.map(|unit| unit.parse().expect("a unit")),
        columns: columns.iter().map(|(role, name)| ((*role).to_owned(), (*name).to_owned())).collect(),
        last_is_goal: true,
        ..TrajectoryReading::default()
    };
    let plain = text("id,time,x,y", |(t, x, y)| {
        let [x, y] = [20.0 * x, 20.0 * y].map(|place| (place.round() + 100.5) * 0.05);
        let t = (30.0 * t).round() / 30.0;
        format!("7,{t},{x},{0}\n8,{t},{1},5.0\n", y - 0.025, 80.0 * 0.05 + 5.025)
    });
    let expected = one(&plain, &reading(&[], Some("m")));
    let walks = read(&boxes(|_| false), &reading(&[], Some("0.05m")), &choice("7")).expect("boxes");
    assert!(walks.notes.iter().any(|note| note.contains("30 frames a second")), "{:?}", walks.notes);
    let found = &walks.tables[0].1;
    assert_eq!((&found.names, found.values.dim()), (&expected.names, expected.values.dim()));
    for (found, expected) in found.values.iter().zip(&expected.values) {
        assert!(
            (found - expected).abs() < 1e-6 || (found.is_nan() && expected.is_nan()),
            "{found} {expected}"
        );
    }
    let lost = read(&boxes(|row| row > 14), &reading(&[], Some("0.05m")), &choice("7")).expect("boxes");
    assert!(lost.notes.iter().any(|note| note.contains("; 5 rows are left out")), "{:?}", lost.notes);
    assert!(lost.tables[0].1.values.nrows() < expected.values.nrows(), "a place of somebody lost");
    let refused = |unit, columns: &[(&str, &str)]| {
        read(&boxes(|_| false), &reading(columns, unit), &choice("7")).err().map(|error| error.to_string())
    };
    assert!(refused(None, &[]).is_some_and(|why| why.contains("how long one is")));
    let corner = [("id", "1"), ("frame", "6"), ("x", "2"), ("y", "3")];
    assert_eq!(refused(Some("0.05m"), &corner), None, "columns that are named are taken");
}

#[test]
fn a_unit_is_a_name_or_a_length() {
    let unit = |text: &str| text.parse::<PositionUnit>().ok();
    assert_eq!(unit("mm"), Some(PositionUnit::MILLIMETRES));
    assert!(unit("0.03m").is_some_and(|unit| (unit.per_metre() - 1.0 / 0.03).abs() < 1e-9));
    for text in ["px", "-1m", "0m", "nanm", "infm", "0.03"] {
        assert_eq!(unit(text), None, "{text}");
    }
}
