//! A working day: what is counted, the battery's law, deadlines, and that people shun the robot.

#![allow(clippy::unwrap_used, reason = "a test may panic: that is how it fails")]

use roscausal_hrisim::{
    Scenario, Simulation,
    day::{Day, DaySpec},
    scenario::RobotSpec,
};

fn simulation(spec: DaySpec, seed: u64) -> Simulation {
    Simulation::new(&Scenario::of_day("warehouse", spec), seed).unwrap()
}

fn day(simulation: &Simulation) -> &Day {
    simulation.day.as_ref().unwrap()
}

fn run(simulation: &mut Simulation, hours: f64, mut seen: impl FnMut(&Simulation)) {
    let end = simulation.time() + hours * 3600.0;
    while simulation.time() < end {
        simulation.step();
        seen(simulation);
    }
}

#[test]
fn the_same_seed_is_the_same_day_and_a_house_is_the_same_on_all_days() {
    let spec = DaySpec::warehouse(4, 7);
    let counts = |spec: &DaySpec, seed: u64| {
        let mut simulation = simulation(spec.clone(), seed);
        let mut sums = vec![0.0; spec.places.len()];
        run(&mut simulation, 4.0, |simulation| {
            if simulation.time() > 3.0 * 3600.0 && simulation.steps() % 250 == 0 {
                let counts = day(simulation).counts(&simulation.crowd);
                sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += f64::from(count));
            }
        });
        sums
    };
    let (first, again, other) = (counts(&spec, 1), counts(&spec, 1), counts(&spec, 2));
    assert_eq!(first, again);
    assert_ne!(first, other);
    let correlation = |a: &[f64], b: &[f64]| {
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let product: f64 = a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).sum();
        let square = |v: &[f64], m: f64| v.iter().map(|x| (x - m).powi(2)).sum::<f64>();
        product / (square(a, ma) * square(b, mb)).sqrt()
    };
    let elsewhere = counts(&DaySpec { house: 2, ..spec }, 1);
    let (same, different) = (correlation(&first, &other), correlation(&first, &elsewhere));
    assert!(same > 0.7 && different < 0.4, "{same} {different}");
}

#[test]
fn people_come_work_eat_and_leave() {
    let spec = DaySpec::warehouse(4, 7);
    let canteen = spec.places.iter().position(|place| place.kind == "canteen").unwrap();
    let people = spec.teams.iter().sum::<usize>() as u32;
    let mut simulation = simulation(spec, 3);
    let (mut noon, mut morning) = (0, 0);
    let inside = |simulation: &Simulation| day(simulation).counts(&simulation.crowd).iter().sum::<u32>();
    assert_eq!(inside(&simulation), 0);
    run(&mut simulation, 10.0, |simulation| {
        if simulation.steps() % 1500 == 0 {
            let at_canteen = day(simulation).counts(&simulation.crowd)[canteen];
            match day(simulation).clock(simulation.time()) {
                hour if (9.0..11.0).contains(&hour) => morning += at_canteen,
                hour if (12.0..14.0).contains(&hour) => noon += at_canteen,
                _ => {}
            }
            if (9.0..16.0).contains(&day(simulation).clock(simulation.time())) {
                assert!(inside(simulation) > people * 8 / 10, "{}", inside(simulation));
            }
        }
    });
    assert!(noon > 5 * morning.max(1), "{noon} at noon, {morning} in the morning");
    assert!(inside(&simulation) < people / 2, "{} are still there", inside(&simulation));
}

#[test]
fn the_battery_follows_its_law() {
    let mut simulation = simulation(DaySpec { teams: vec![0], tasks: 20, ..DaySpec::warehouse(4, 7) }, 4);
    let (mut before, mut idle, mut moving, mut loaded) = (100.0, Vec::new(), Vec::new(), Vec::new());
    run(&mut simulation, 3.0, |simulation| {
        let porter = &day(simulation).porter;
        let (fall, v) = ((before - porter.charge) / 0.04 * 3600.0, simulation.robots[0].v);
        before = porter.charge;
        match (porter.is_charging(), porter.is_loaded()) {
            (false, false) if v.abs() < 1e-6 => idle.push(fall),
            (false, false) if v > 0.799 => moving.push(fall),
            (false, true) if v > 0.799 => loaded.push(fall),
            _ => {}
        }
    });
    for (falls, rate) in [(idle, 20.0), (moving, 25.0), (loaded, 75.0)] {
        assert!(
            falls.len() > 20 && falls.iter().all(|fall| (fall - rate).abs() < 0.2),
            "{rate}: {} {:?}",
            falls.len(),
            falls.first()
        );
    }
    // Nobody is in the way: every task is done in time.
    let porter = &day(&simulation).porter;
    assert!(porter.done > 3 && porter.failed == 0 && porter.wasted == 0.0, "{porter:?}");
}

#[test]
fn who_decides_is_obeyed_and_a_way_that_is_none_is_refused() {
    let mut simulation = simulation(DaySpec { teams: vec![0], ..DaySpec::warehouse(4, 7) }, 5);
    simulation.day.as_mut().unwrap().porter.guided = true;
    while day(&simulation).porter.open_leg().is_none() {
        simulation.step();
    }
    let leg = day(&simulation).porter.open_leg().unwrap().clone();
    let way = day(&simulation).map.way(leg.from, leg.to);
    let time = simulation.time();
    let decide = |simulation: &mut Simulation, places: &[usize]| {
        simulation.day.as_mut().unwrap().decide(time + 100.0, places)
    };
    assert!(!decide(&mut simulation, &[leg.from, leg.to]) && !decide(&mut simulation, &way[1..]));
    assert!(!decide(&mut simulation, &[]) && decide(&mut simulation, &way) && !decide(&mut simulation, &way));
    run(&mut simulation, 99.0 / 3600.0, |simulation| assert!(!day(simulation).porter.is_driving()));
    run(&mut simulation, 2.0 / 3600.0, |_| ());
    assert!(day(&simulation).porter.is_driving());
}

#[test]
fn people_leave_the_place_where_the_robot_is() {
    // The same day with a robot that stands at a busy place, and with one at its charger.
    let spec = DaySpec { tasks: 0, ..DaySpec::warehouse(4, 7) };
    let busy = |stands: Option<usize>| {
        let mut simulation = simulation(spec.clone(), 6);
        let mut sums = vec![0.0; spec.places.len()];
        run(&mut simulation, 3.0, |_| ());
        run(&mut simulation, 0.5, |_| ());
        if let Some(place) = stands {
            simulation.robots[0].position = day(&simulation).at(place);
        }
        run(&mut simulation, 0.4, |simulation| {
            let counts = day(simulation).counts(&simulation.crowd);
            sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += f64::from(count) * 0.04 / 1440.0);
        });
        sums
    };
    let alone = busy(None);
    let crowded = (0..alone.len()).max_by(|a, b| alone[*a].total_cmp(&alone[*b])).unwrap();
    let shunned = busy(Some(crowded))[crowded];
    assert!(
        alone[crowded] > 2.0 && shunned < alone[crowded] / 3.0,
        "{} with the robot {shunned}",
        alone[crowded]
    );
}

#[test]
fn a_wrong_day_is_refused_with_its_field() {
    let refused = |spec: DaySpec| Scenario::of_day("x", spec).check().unwrap_err().to_string();
    let house = || DaySpec::warehouse(2, 3);
    let cases = [
        (DaySpec { begins: f64::NAN, ..house() }, "day.begins"),
        (DaySpec { deadline: 0.5, ..house() }, "day.deadline"),
        (DaySpec { closed: vec!["moon".into()], ..house() }, "day.closed"),
        (DaySpec { arcs: vec![], ..house() }, "no way leads"),
    ];
    for (spec, reason) in cases {
        let stated = refused(spec);
        assert!(stated.contains(reason), "{stated}");
    }
    let robots = vec![RobotSpec::default(); 2];
    let stated = Scenario { robots, ..Scenario::of_day("x", house()) }.check().unwrap_err().to_string();
    assert!(stated.contains("one robot"), "{stated}");
}
