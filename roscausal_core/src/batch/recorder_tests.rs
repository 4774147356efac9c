//! Tests of the recorder: rows, gaps, people who come and go, jumps of the clock, other frames, interventions.

use roscausal_msgs::{HumanState, std_msgs::Header};

use super::*;

fn config() -> RecorderConfig {
    RecorderConfig {
        dt_s: 0.1,
        ts_length_s: Some(1.0),
        max_gap_s: 0.5,
        sampling: Sampling::Linear,
        select: Select::All,
    }
}

fn header(secs: f64, frame: &str) -> Header {
    Header { stamp: Time::from_secs_f64(secs), frame_id: frame.into() }
}

fn robot(secs: f64) -> RobotState {
    let mut state = RobotState { header: header(secs, "map"), ..RobotState::default() };
    state.pose2d.x = 10.0 * secs;
    state.twist.linear.x = 0.3;
    state.twist.linear.y = 0.4;
    state.goal.x = f64::NAN;
    state
}

fn person(id: u32, secs: f64) -> HumanState {
    let mut state = HumanState { header: header(secs, "map"), id, ..HumanState::default() };
    state.pose2d.x = f64::from(id) + secs;
    state
}

fn humans(secs: f64, people: Vec<HumanState>) -> Humans {
    Humans { header: header(secs, "map"), humans: people }
}

/// Robot at 20 Hz, people at 25 Hz.
fn run(config: RecorderConfig, secs: std::ops::Range<f64>, ids: impl Fn(f64) -> Vec<u32>) -> Recorder {
    let mut recorder = Recorder::new(config);
    feed(&mut recorder, secs, ids);
    recorder
}

fn feed(recorder: &mut Recorder, secs: std::ops::Range<f64>, ids: impl Fn(f64) -> Vec<u32>) {
    let start = secs.start;
    for i in 0..((secs.end - start) * 100.0).round() as usize {
        let t = start + i as f64 / 100.0;
        if i % 5 == 0 {
            recorder.robot(&robot(t), Time::ZERO);
        }
        if i % 4 == 0 {
            let people = ids(t).into_iter().map(|id| person(id, t)).collect();
            recorder.humans(&humans(t, people), Time::ZERO);
        }
    }
}

#[test]
fn rows_lie_at_a_true_fixed_step_and_batches_follow_without_a_hole() {
    let mut recorder = run(config(), 5.03..9.0, |_| vec![1]);
    let batches = recorder.take_batches();
    assert_eq!(batches.len(), 2);
    let starts: Vec<i64> = batches.iter().map(|b| b.start.as_nanos()).collect();
    assert_eq!(starts, [5_100_000_000, 6_100_000_000]);
    for batch in &batches {
        assert!(batch.complete && batch.gaps().is_empty());
        assert_eq!(batch.n_rows(), 10);
        for (row, (robot, person)) in batch.robot.iter().zip(&batch.people[&1]).enumerate() {
            let t = batch.stamp(row).as_secs_f64();
            assert!((robot.x - 10.0 * t).abs() < 1e-6 && (person.x - 1.0 - t).abs() < 1e-6);
            assert!((robot.v - 0.5).abs() < 1e-12 && robot.gx.is_nan());
        }
    }
}

#[test]
fn a_short_batch_is_kept_and_says_so() {
    let mut recorder = run(config(), 5.0..6.44, |_| vec![1]);
    assert!(recorder.take_batches().is_empty());
    recorder.finish();
    let batches = recorder.take_batches();
    assert_eq!((batches.len(), batches[0].n_rows(), batches[1].n_rows()), (2, 10, 5));
    assert!(batches[0].complete && !batches[1].complete);
    let until_the_end = RecorderConfig { ts_length_s: None, ..config() };
    let mut recorder = run(until_the_end, 5.0..6.44, |_| vec![1]);
    recorder.finish();
    let batches = recorder.take_batches();
    assert!(batches.len() == 1 && batches[0].complete && batches[0].n_rows() == 15);
}

#[test]
fn a_person_who_leaves_and_returns_is_nan_in_between() {
    let mut recorder =
        run(config(), 5.0..9.0, |t| if (5.3..5.99).contains(&t) { vec![1] } else { vec![1, 2] });
    let batch = recorder.take_batches().remove(0);
    let known: Vec<bool> = batch.people[&2].iter().map(|values| values.x.is_finite()).collect();
    assert_eq!(known, [true, true, true, false, false, false, false, false, false, false]);
    assert!(batch.people[&1].iter().all(|values| values.x.is_finite()));
    assert_eq!(recorder.take_batches().len(), 0);
}

#[test]
fn a_person_who_comes_late_was_not_there_before() {
    let mut recorder = run(config(), 5.0..9.0, |t| if t < 5.55 { vec![1] } else { vec![1, 2] });
    let batch = recorder.take_batches().remove(0);
    let known: Vec<bool> = batch.people[&2].iter().map(|values| values.x.is_finite()).collect();
    assert_eq!(known, [false, false, false, false, false, false, true, true, true, true]);
}

#[test]
fn recording_begins_when_robot_and_person_are_there() {
    let mut recorder = run(config(), 5.0..9.0, |t| if t < 6.41 { vec![] } else { vec![1] });
    let batches = recorder.take_batches();
    assert_eq!(batches[0].start.as_nanos(), 6_500_000_000);
    assert!(recorder.counts().waited >= 15);
    let mut recorder = Recorder::new(config());
    recorder.humans(&humans(1.0, vec![]), Time::ZERO);
    recorder.robot(&robot(1.0), Time::ZERO);
    assert!(recorder.trouble().is_some_and(|t| t.contains("nobody has been seen")));
}

#[test]
fn only_the_selected_are_recorded_and_a_wrong_choice_is_told() {
    let only_two = RecorderConfig { select: Select::Ids([2].into()), ..config() };
    let batch = run(only_two, 5.0..8.0, |_| vec![1, 2, 3]).take_batches().remove(0);
    assert_eq!(batch.people.keys().copied().collect::<Vec<_>>(), [2]);
    let nobody = RecorderConfig { select: Select::Ids([1000].into()), ..config() };
    let recorder = run(nobody, 5.0..8.0, |_| vec![3, 7]);
    assert!(recorder.trouble().is_some_and(|t| t.contains("people seen: 3, 7")));
    // The robot is at x = 10 t, the people at id + t: the larger id is nearer.
    let nearest = RecorderConfig { select: Select::Nearest(1), ..config() };
    let batch = run(nearest, 5.0..8.0, |_| vec![1, 9]).take_batches().remove(0);
    assert_eq!(batch.people.keys().copied().collect::<Vec<_>>(), [9]);
}

#[test]
fn the_first_rows_are_made_by_the_rule_of_all_others() {
    let mut recorder =
        Recorder::new(RecorderConfig { sampling: Sampling::Auto, ts_length_s: None, ..config() });
    for i in 0..400 {
        let t = f64::from(i) / 100.0;
        recorder.robot(&robot(t), Time::ZERO);
        // At 10 Hz, 30 ms after each row; the person is away for a second.
        if i % 10 == 3 && !(150..250).contains(&i) {
            recorder.humans(&humans(t, vec![person(7, t)]), Time::ZERO);
        }
    }
    recorder.finish();
    let batch = recorder.take_batches().remove(0);
    let rows = &batch.people[&7];
    let start = batch.start.as_secs_f64();
    let held: Vec<usize> = (0..rows.len()).filter(|row| rows[*row].x.is_finite()).collect();
    assert!(held.len() >= 28, "{} rows", held.len());
    for row in held {
        let late = rows[row].x - 7.0 - (start + 0.1 * row as f64);
        assert!((late - 0.03).abs() < 1e-6, "row {row} holds what was {late} s later");
    }
}

#[test]
fn a_gap_longer_than_max_gap_stays_nan() {
    let mut recorder = Recorder::new(config());
    feed(&mut recorder, 5.0..5.31, |_| vec![1]);
    feed(&mut recorder, 5.85..8.0, |_| vec![1]);
    let batch = recorder.take_batches().remove(0);
    let known: Vec<bool> = batch.robot.iter().map(|values| values.x.is_finite()).collect();
    assert_eq!(known, [true, true, true, true, false, false, false, false, false, true]);
}

#[test]
fn duplicates_and_messages_out_of_order_change_nothing() {
    let ordered = run(config(), 5.0..8.0, |_| vec![1]).take_batches();
    let mut recorder = Recorder::new(config());
    let mut states: Vec<RobotState> = (0..60).map(|i| robot(5.0 + 0.05 * f64::from(i))).collect();
    states.chunks_mut(3).for_each(<[RobotState]>::reverse);
    for (i, state) in states.iter().enumerate() {
        recorder.robot(state, Time::ZERO);
        let mut wrong = state.clone();
        wrong.pose2d.x = -1.0;
        recorder.robot(&wrong, Time::ZERO);
        if i % 3 == 2 {
            let t = 5.0 + 0.05 * (i - 2) as f64;
            for t in [t, t + 0.04, t + 0.08, t + 0.12] {
                recorder.humans(&humans(t, vec![person(1, t)]), Time::ZERO);
            }
        }
    }
    let shuffled = recorder.take_batches();
    assert!(recorder.counts().duplicates >= 50);
    assert_eq!(ordered.len(), shuffled.len());
    for (a, b) in ordered.iter().zip(&shuffled) {
        assert_eq!(a.start, b.start);
        for (a, b) in a.robot.iter().zip(&b.robot) {
            assert_eq!(a.x, b.x);
        }
    }
}

#[test]
fn a_clock_that_goes_back_ends_the_batch_and_begins_another() {
    let mut recorder = Recorder::new(config());
    feed(&mut recorder, 50.0..50.41, |_| vec![1]);
    feed(&mut recorder, 5.0..7.0, |_| vec![1]);
    let batches = recorder.take_batches();
    assert!(!batches[0].complete);
    assert_eq!((batches[0].n_rows(), batches[0].ended_by), (5, Some(EndedBy::ClockJump)));
    assert!(batches[1].complete);
    assert!(recorder.counts().jumps >= 1);
}

#[test]
fn nan_and_infinity_become_missing_values() {
    let mut recorder = Recorder::new(config());
    let mut bad = robot(5.1);
    bad.pose2d.y = f64::INFINITY;
    recorder.robot(&robot(5.0), Time::ZERO);
    recorder.robot(&bad, Time::ZERO);
    recorder.humans(&humans(5.0, vec![person(1, 5.0)]), Time::ZERO);
    recorder.humans(&humans(5.1, vec![person(1, 5.1)]), Time::ZERO);
    recorder.finish();
    let batch = recorder.take_batches().remove(0);
    assert!(batch.robot[1].y.is_nan() && batch.robot[1].x.is_finite());
}

#[test]
fn people_in_another_frame_are_left_out() {
    let mut recorder = Recorder::new(config());
    recorder.robot(&robot(5.0), Time::ZERO);
    let mut foreign = humans(5.0, vec![person(1, 5.0)]);
    foreign.header.frame_id = "odom".into();
    recorder.humans(&foreign, Time::ZERO);
    assert_eq!(recorder.counts().foreign_frame, 1);
    let mut moved = robot(5.1);
    moved.header.frame_id = "odom".into();
    recorder.robot(&moved, Time::ZERO);
    assert_eq!(recorder.frame.as_deref(), Some("odom"));
}

#[test]
fn another_frame_of_the_robot_ends_the_batch_and_begins_one_in_that_frame() {
    let mut recorder = run(config(), 5.0..5.75, |_| vec![1]);
    for i in 0..300 {
        let t = 5.75 + 0.01 * f64::from(i);
        let (mut moved, mut people) = (robot(t), humans(t, vec![person(1, t)]));
        moved.header.frame_id = "map_of_the_second_floor".into();
        people.header.frame_id.clone_from(&moved.header.frame_id);
        recorder.robot(&moved, Time::ZERO);
        recorder.humans(&people, Time::ZERO);
    }
    let batches = recorder.take_batches();
    let (before, after) = (&batches[0], &batches[1]);
    assert_eq!((before.frame.as_str(), before.complete), ("map", false));
    assert_eq!(before.ended_by, Some(EndedBy::FrameChange));
    assert_eq!((after.frame.as_str(), after.complete), ("map_of_the_second_floor", true));
    // No row mixes the two frames, and no row is lost except those at the change.
    let end = before.start.plus_secs(0.1 * before.n_rows() as f64);
    assert!(after.start >= end && after.start.secs_since(end) < 0.25, "{end:?} {:?}", after.start);
    assert!(before.n_rows() >= 7);
}

#[test]
fn people_who_come_after_their_row_was_made_are_counted() {
    let late = |by: f64| {
        let mut recorder = Recorder::new(config());
        for i in 0..200 {
            let t = 5.0 + 0.05 * f64::from(i);
            recorder.robot(&robot(t), Time::ZERO);
            recorder.humans(&humans(t - by, vec![person(1, t - by)]), Time::ZERO);
        }
        (recorder.counts().late, recorder.counts().rows > 0)
    };
    assert_eq!(late(0.45), (0, true));
    assert!(late(1.2).0 > 150 && late(3.0).0 > 150, "{:?} {:?}", late(1.2), late(3.0));
    // Somebody who is kept for a while was seen in time.
    let mut recorder = Recorder::new(config());
    feed(&mut recorder, 5.0..7.0, |_| vec![1]);
    for i in 0..28 {
        let t = 7.0 + 0.05 * f64::from(i);
        recorder.robot(&robot(t), Time::ZERO);
        recorder.humans(&humans(t, vec![person(1, 6.96)]), Time::ZERO);
    }
    assert_eq!(recorder.counts().late, 0);
}

#[test]
fn memory_is_bounded_while_the_robot_is_silent() {
    let mut recorder = Recorder::new(config());
    for i in 0..5000 {
        let t = 1.0 + 0.04 * f64::from(i);
        recorder.humans(&humans(t, vec![person(i as u32 / 10, t)]), Time::ZERO);
    }
    assert!(recorder.people.len() < 20, "{}", recorder.people.len());
}

#[test]
fn what_is_imposed_is_recorded_row_by_row() {
    let mut recorder = Recorder::new(config());
    let tell = |recorder: &mut Recorder, text: &str| recorder.context(text, Time::ZERO);
    tell(&mut recorder, r#"{"stamp": 5.0, "context": {"do_robot_speed": []}}"#).expect("is understood");
    feed(&mut recorder, 5.03..5.42, |_| vec![1]);
    tell(&mut recorder, r#"{"stamp": 5.42, "context": {"do_robot_speed": [0.2]}}"#).expect("is understood");
    feed(&mut recorder, 5.42..5.7, |_| vec![1]);
    tell(&mut recorder, r#"{"stamp": 5.7, "context": {"do_robot_speed": [], "do_human_goal": [3, 4]}}"#)
        .expect("is understood");
    feed(&mut recorder, 5.7..8.0, |_| vec![1]);
    let batch = recorder.take_batches().remove(0);
    let columns: Vec<(String, Vec<f64>)> =
        batch.context_columns().into_iter().map(|column| (column.name, column.values)).collect();
    let goal = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    let speed = [0.0, 0.0, 0.0, 0.0, 0.2, 0.2, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(
        columns,
        [("do_human_goal".to_owned(), goal.to_vec()), ("do_robot_speed".to_owned(), speed.to_vec())]
    );
    for text in ["", "{}", r#"{"context": {"h_v": [1]}}"#, r#"{"context": {"do_a": "x"}}"#] {
        assert!(tell(&mut recorder, text).is_err(), "{text}");
    }
}

#[test]
fn other_robots_are_recorded_beside_the_one() {
    let mut recorder = Recorder::new(config());
    for i in 0..300 {
        let t = 5.03 + f64::from(i) / 100.0;
        if i % 5 == 0 {
            recorder.robot(&robot(t), Time::ZERO);
            let mut second = robot(t);
            second.pose2d.x = -t;
            recorder.other_robot("robot2", &second, Time::ZERO);
        }
        if i % 4 == 0 {
            recorder.humans(&humans(t, vec![person(1, t)]), Time::ZERO);
        }
    }
    let batch = recorder.take_batches().remove(0);
    for (row, values) in batch.others["robot2"].iter().enumerate() {
        assert!((values.x + batch.stamp(row).as_secs_f64()).abs() < 1e-6);
    }
    assert!(batch.columns(false).iter().any(|column| column.name == "r_robot2_x"));
}

#[test]
fn speeds_of_places_are_of_the_age_of_the_places_and_hold_uses_none_that_is_later() {
    // She stops at 13 s, and goes on at 16 s. The tracker, 20 Hz, tells places only, 2 cm off; its filter says nothing of use.
    let way = |t: f64| t.min(13.0) + (t - 16.0).max(0.0);
    let recorded = |sampling, until: f64| {
        let mut recorder = Recorder::new(RecorderConfig { ts_length_s: None, sampling, ..config() });
        for k in (0..).map(|k| 10.0 + 0.05 * f64::from(k)).take_while(|t| *t < until) {
            recorder.robot(&robot(k), Time::ZERO);
            let mut seen = person(1, k);
            seen.pose2d.x = way(k) + if ((20.0 * k) as u32).is_multiple_of(2) { 0.02 } else { -0.02 };
            (seen.twist.linear.x, seen.twist.angular.z) = (9.0, f64::NAN);
            recorder.humans(&humans(k, vec![seen]), Time::ZERO);
        }
        recorder.finish();
        let batch = recorder.take_batches().remove(0);
        move |t: f64| batch.people[&1][(t - batch.start.as_secs_f64()).mul_add(10.0, 0.5) as usize]
    };
    let (auto, hold) = (recorded(Sampling::Auto, 20.0), recorded(Sampling::Hold, 20.0));
    for (t, v) in [(11.5, 1.0), (12.4, 1.0), (14.0, 0.0), (15.0, 0.0), (17.5, 1.0)] {
        let values = auto(t);
        assert!((values.v - v).abs() < 0.1 && (values.x - way(t)).abs() < 0.02, "{t}: {values:?}");
    }
    // At the turn it is half of either; the filter is behind.
    let [smoothed, held] = [auto(13.0).v, hold(13.0).v];
    assert!((0.3..0.7).contains(&smoothed) && held > 0.8, "{smoothed} {held}");
    let cut = recorded(Sampling::Hold, 13.3);
    assert!(
        cut(13.0).v.to_bits() == held.to_bits() && hold(15.5).v < 0.1,
        "what comes later changes nothing"
    );
}
