//! Measures what a tracker that tells places only does to the links of a person's speed: where robot and person walk on independent paths,
//! and where the robot follows, how often the distance seems to drive the speed, which it does not; where the robot's speed drives the
//! person's, how often that is found. In the exact rows, with a tracker that tells velocities, and with one of places (`auto` and `hold`).
//! Prints a table in Markdown.
//!
//! ```sh
//! cargo run --release -p roscausal_core --example places [-- SEEDS [FIRST [SECONDS]]]
//! ```

#![allow(clippy::expect_used, reason = "a program that measures may end in a panic")]

use std::f64::consts::TAU;

use ndarray::Array2;
use roscausal_core::{
    Time,
    batch::{
        Field, Sampling, Select,
        recorder::{Recorder, RecorderConfig},
    },
    state::{
        human::{PeopleTracker, Sighting},
        identity::{Gates, Who},
    },
};
use roscausal_discovery::{Control, DataFrame, PcAlpha, Settings, analyse, methods::Method, mix};
use roscausal_msgs::{
    RobotState,
    geometry_msgs::{Pose2D, Twist},
    std_msgs::Header,
};

#[path = "../tests/common/random.rs"]
mod random;
use random::Random;

/// Seconds between two moments of the world, and before the first stamp.
const TICK_S: f64 = 0.01;
const BEGIN_S: f64 = 100.0;
const TAU_MAX: usize = 5;
/// Tests of each run together have the level 0.05.
const ALPHA: f64 = 0.01;
/// Hz and metres.
const TRACKERS: [(f64, f64); 9] = [
    (5.0, 0.005),
    (5.0, 0.05),
    (5.0, 0.1),
    (10.0, 0.005),
    (10.0, 0.05),
    (10.0, 0.1),
    (30.0, 0.005),
    (30.0, 0.05),
    (30.0, 0.1),
];
const STEPS_S: [f64; 2] = [0.1, 0.3];

#[derive(Clone, Copy)]
struct Walker {
    place: [f64; 2],
    heading: f64,
    speed: f64,
    goal: [f64; 2],
}

impl Walker {
    fn new(random: &mut Random, speed: f64) -> Self {
        let mut at = || 10.0 * random.share() - 5.0;
        Self { place: [at(), at()], heading: 0.0, speed, goal: [at(), at()] }
    }

    /// The next moment: towards the goal, a new one once it is near, with a speed that comes back to `usual` within `memory_s`.
    fn step(&mut self, random: &mut Random, usual: f64, memory_s: f64, spread: f64) {
        let to = |walker: &Self| [walker.goal[0] - walker.place[0], walker.goal[1] - walker.place[1]];
        if to(self)[0].hypot(to(self)[1]) < 0.7 {
            self.goal = [10.0 * random.share() - 5.0, 10.0 * random.share() - 5.0];
        }
        let turn = (to(self)[1].atan2(to(self)[0]) - self.heading + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        self.heading += turn.clamp(-1.5 * TICK_S, 1.5 * TICK_S);
        let noise = spread * (2.0 * TICK_S / memory_s).sqrt() * random.normal();
        self.speed = (self.speed + (usual - self.speed) * TICK_S / memory_s + noise).max(0.0);
        self.place[0] += TICK_S * self.speed * self.heading.cos();
        self.place[1] += TICK_S * self.speed * self.heading.sin();
    }

    fn twist(&self) -> Twist {
        let mut twist = Twist::default();
        (twist.linear.x, twist.linear.y) = (self.speed * self.heading.cos(), self.speed * self.heading.sin());
        twist
    }
}

#[derive(Clone, Copy, PartialEq)]
enum World {
    /// Both walk on independent paths.
    Apart,
    /// The robot goes where the person is, faster the farther they are.
    Follows,
    /// The robot's speed of a third of a second before is in the person's.
    Drives,
}

/// Robot and person at each moment.
fn walks(seconds: f64, world: World, random: &mut Random) -> Vec<[Walker; 2]> {
    let (mut robot, mut person) = (Walker::new(random, 0.6), Walker::new(random, 1.0));
    let mut all: Vec<[Walker; 2]> = Vec::new();
    for tick in 0..(seconds / TICK_S) as usize {
        let before = all.get(tick.saturating_sub(30)).map_or(0.6, |[robot, _]| robot.speed);
        robot.step(random, 0.6, 1.5, 0.2);
        person.step(random, if world == World::Drives { 0.4 + before } else { 1.0 }, 0.6, 0.18);
        if world == World::Follows {
            robot.goal = person.place;
            let [x, y] = [0, 1].map(|axis| person.place[axis] - robot.place[axis]);
            robot.speed += TICK_S * (x.hypot(y) - 1.5);
        }
        all.push([robot, person]);
    }
    all
}

type Rows = Vec<[f64; 3]>;

/// Distance, the person's speed, the robot's speed.
fn row(robot: &Walker, person: &Walker) -> [f64; 3] {
    let d = (robot.place[0] - person.place[0]).hypot(robot.place[1] - person.place[1]);
    [d, person.speed, robot.speed]
}

/// The rows that the nodes record, and the exact ones of the same times.
fn recorded(
    world: &[[Walker; 2]],
    [hz, noise]: [f64; 2],
    velocities: bool,
    (dt_s, sampling): (f64, Sampling),
    random: &mut Random,
) -> [Rows; 2] {
    let config = RecorderConfig { dt_s, ts_length_s: None, max_gap_s: 0.5, sampling, select: Select::All };
    let mut recorder = Recorder::new(config);
    let gates = Gates { metres: 0.8, keep_s: 1.0, rejoin_s: 0.0 };
    let mut tracker = PeopleTracker::new("map", "map", 1.0).with(gates, 0.05);
    let header = |tick: usize| Header {
        stamp: Time::from_secs_f64(BEGIN_S + TICK_S * tick as f64),
        frame_id: "map".into(),
    };
    let mut next = random.share() / hz;
    for (tick, [robot, person]) in world.iter().enumerate() {
        let now = header(tick).stamp;
        if tick % 2 == 0 {
            let pose2d = Pose2D { x: robot.place[0], y: robot.place[1], theta: robot.heading };
            let state =
                RobotState { header: header(tick), pose2d, twist: robot.twist(), ..RobotState::default() };
            recorder.robot(&state, now);
        }
        if TICK_S * tick as f64 >= next {
            next += 1.0 / hz;
            let mut seen = Sighting { id: 7, header: header(tick), ..Sighting::default() };
            seen.pose.position.x = person.place[0] + noise * random.normal();
            seen.pose.position.y = person.place[1] + noise * random.normal();
            seen.twist = velocities.then(|| person.twist());
            tracker.message(now, vec![(Who::Number(7), seen)]);
            while let Some(people) = tracker.next(|_| None) {
                recorder.humans(&people, now);
            }
        }
    }
    recorder.finish();
    let batch = recorder.take_batches().remove(0);
    let first = batch.start.secs_since(Time::from_secs_f64(BEGIN_S));
    let people = &batch.people[&7];
    // What begins and ends is not yet, or no longer, smoothed.
    let (from, to) = ((2.0 / dt_s) as usize, people.len() - (2.0 / dt_s) as usize);
    let of = |at: usize| {
        let (robot, person) = (batch.robot[at], people[at]);
        let d =
            (robot.get(Field::X) - person.get(Field::X)).hypot(robot.get(Field::Y) - person.get(Field::Y));
        [d, person.get(Field::V), robot.get(Field::V)]
    };
    let exact = |at: usize| {
        let [robot, person] = &world[((first + at as f64 * dt_s) / TICK_S).round() as usize];
        row(robot, person)
    };
    [(from..to).map(of).collect(), (from..to).map(exact).collect()]
}

/// In which share of the tests the distance seems to drive the person's speed, and whether the robot's speed does.
fn found(rows: &Rows) -> [f64; 2] {
    let values = Array2::from_shape_fn((rows.len(), 3), |(row, column)| rows[row][column]);
    let data = DataFrame::new(vec![values], vec!["d".into(), "h_v".into(), "r_v".into()]).expect("columns");
    let settings = Settings {
        method: Method::Pcmci,
        cond_ind_test: "parcorr".into(),
        pc_alpha: PcAlpha::Fixed(0.05),
        alpha: ALPHA,
        tau_min: 1,
        tau_max: TAU_MAX,
        ..Settings::default()
    };
    let model = analyse(&data, &settings, &Control::default()).expect("an analysis");
    let p = |from: usize, lag: usize| model.p_matrix[from][1][lag].unwrap_or(1.0);
    let tests = (1..=TAU_MAX).filter(|&lag| p(0, lag) <= ALPHA).count() as f64;
    let drives = (1..=TAU_MAX).any(|lag| p(2, lag) <= ALPHA / TAU_MAX as f64);
    [tests / TAU_MAX as f64, f64::from(drives)]
}

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().expect("a number"));
    let mut number = |usual: u64| numbers.next().unwrap_or(usual);
    let (seeds, first, seconds) = (number(200), number(1), number(300) as f64);
    println!(
        "| Hz | noise, cm | step, s | d -> h_v, apart: exact | velocities | auto | hold | follows: exact | velocities | auto | hold | \
         r_v -> h_v: exact | velocities | auto | hold | error, m/s: auto | hold |"
    );
    println!("|{}", "---|".repeat(17));
    for dt_s in STEPS_S {
        // A shorter step than the tracker's is another matter.
        for (hz, noise) in TRACKERS.into_iter().filter(|(hz, _)| hz * dt_s > 0.9) {
            let mut row = format!("| {hz} | {} | {dt_s} |", 100.0 * noise);
            let mut errors = [[0.0; 2]; 2];
            for world in [World::Apart, World::Follows, World::Drives] {
                let mut shares = [0.0; 4];
                for seed in first..first + seeds {
                    let mut random = Random(mix(seed));
                    let walks = walks(seconds, world, &mut random);
                    let mut rows = |velocities, sampling| {
                        recorded(&walks, [hz, noise], velocities, (dt_s, sampling), &mut random)
                    };
                    let [told, _] = rows(true, Sampling::Auto);
                    let [auto, exact] = rows(false, Sampling::Auto);
                    let [hold, exact_held] = rows(false, Sampling::Hold);
                    for (share, rows) in shares.iter_mut().zip([&exact, &told, &auto, &hold]) {
                        *share += found(rows)[usize::from(world == World::Drives)] / seeds as f64;
                    }
                    for (error, (rows, exact)) in
                        errors.iter_mut().zip([(&auto, &exact), (&hold, &exact_held)])
                    {
                        for (row, exact) in rows.iter().zip(exact).filter(|(row, _)| !row[1].is_nan()) {
                            error[0] += 1.0;
                            error[1] += (row[1] - exact[1]).powi(2);
                        }
                    }
                }
                shares.iter().for_each(|share| row += &format!(" {share:.3} |"));
            }
            errors.iter().for_each(|[rows, squares]| row += &format!(" {:.2} |", (squares / rows).sqrt()));
            println!("{row}");
        }
    }
}
