//! A world of which all is known: the robot's speed drives a person's, one row later. A tracker with a rate, jitter and losses of its
//! own sees the person; the robot and human nodes and the recorder of the data node make rows of what it says.

use ndarray::Array2;
use roscausal_core::{
    Result, Time,
    batch::{
        Field, Recording, Sampling, Select,
        recorder::{Recorder, RecorderConfig},
    },
    inbox::{Inbox, Next},
    loopback::{Loopback, LoopbackNode},
    middleware::{Middleware, Publish, Qos},
    nodes,
};
use roscausal_discovery::{Control, DataFrame, PcAlpha, Settings, analyse, methods::Method, mix};
use roscausal_msgs::{
    Humans, RobotState,
    geometry_msgs::PoseWithCovarianceStamped,
    nav_msgs::Odometry,
    pedsim_msgs::{TrackedPerson, TrackedPersons},
    std_msgs::Header,
    tf2_msgs::TFMessage,
};

#[path = "random.rs"]
mod random;
use random::Random;

/// The person.
const ID: u64 = 7;
/// Odometry and poses for each row.
const ROBOT_MESSAGES: f64 = 5.0;
/// Before the first stamp, so that no stamp is 0. Seconds.
const BEGIN_S: f64 = 120.0;

/// What the stamps of a jittering tracker are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stamps {
    /// It sees the person evenly, and its stamps are off by the jitter.
    Off,
    /// It sees the person unevenly, and its stamps say when.
    True,
}

/// A tracker, and the rows that are made of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tracker {
    /// Seconds between two sightings.
    pub(crate) interval_s: f64,
    /// Most seconds by which a sighting is early or late.
    pub(crate) jitter_s: f64,
    pub(crate) stamps: Stamps,
    /// Share of the sightings that get lost.
    pub(crate) lost: f64,
    /// Step between rows, seconds.
    pub(crate) dt_s: f64,
}

/// What an analysis finds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// A link at lag 0, which is not there.
    pub(crate) at_once: bool,
    /// The strength of the link that is there.
    pub(crate) strength: f64,
    /// Root of the mean squared error of the person's speed, in its standard deviations.
    pub(crate) error: f64,
}

/// The speeds of robot and person, row by row.
type Speeds = Vec<[f64; 2]>;

fn truth(rows: usize, random: &mut Random) -> Speeds {
    let (mut speeds, [mut robot, mut person]) = (Vec::with_capacity(rows), [0.0_f64; 2]);
    for _ in 0..rows {
        speeds.push([1.0 + robot, 1.0 + person]);
        let before = robot;
        robot = 0.6 * robot + 0.1 * random.normal();
        person = 0.2 * person + 0.4 * before + 0.04 * random.normal();
    }
    speeds
}

/// The speeds `t` seconds after the first row: between two rows they change evenly.
fn at(speeds: &Speeds, dt_s: f64, t: f64) -> [f64; 2] {
    let place = (t / dt_s).clamp(0.0, speeds.len() as f64 - 1.0);
    let (before, share) = (place.floor() as usize, place.fract());
    let next = speeds[(before + 1).min(speeds.len() - 1)];
    [0, 1].map(|who| speeds[before][who] + share * (next[who] - speeds[before][who]))
}

/// What is found in the exact speeds, in those that the nodes record with the rules `linear`, `hold` and `auto`, and in the exact
/// speeds of both at the moments at which the tracker saw the person: no rule knows more of them.
pub(crate) fn run(tracker: &Tracker, rows: usize, seed: u64) -> [Found; 5] {
    let mut random = Random(mix(seed));
    let exact = truth(rows, &mut random);
    let messages = messages(tracker, &exact, &mut random);
    let seen = analysed(&when_seen(tracker, &exact, &messages), &exact);
    let [linear, hold, auto] = record(tracker, &exact, messages).map(|recorded| {
        let begin = recorded.start.secs_since(Time::from_secs_f64(BEGIN_S));
        let first = (begin / tracker.dt_s).round() as usize;
        let person = &recorded.people[&(ID as u32)];
        // The last rows end with the recording.
        let rows = recorded.robot.len().min(person.len()).min(exact.len() - first) - 3;
        let found: Speeds =
            (0..rows).map(|row| [recorded.robot[row].get(Field::V), person[row].get(Field::V)]).collect();
        analysed(&found, &exact[first..first + rows])
    });
    [analysed(&exact, &exact), linear, hold, auto, seen]
}

/// Row by row the speeds of both when the tracker saw the person nearest to it; NaN where it did not within half a step.
fn when_seen(tracker: &Tracker, exact: &Speeds, messages: &[Message]) -> Speeds {
    let mut rows = vec![[f64::NAN; 2]; exact.len()];
    let mut off = vec![0.5; exact.len()];
    for seen in messages.iter().filter_map(|message| message.1) {
        let place = seen / tracker.dt_s;
        let row = place.round() as usize;
        if row < rows.len() && (place - row as f64).abs() <= off[row] {
            off[row] = (place - row as f64).abs();
            rows[row] = at(exact, tracker.dt_s, seen);
        }
    }
    rows
}

fn analysed(speeds: &[[f64; 2]], exact: &[[f64; 2]]) -> Found {
    let values = Array2::from_shape_fn((speeds.len(), 2), |(row, who)| speeds[row][who]);
    let data = DataFrame::new(vec![values], vec!["r_v".into(), "h_v".into()]).expect("two columns");
    let settings = Settings {
        method: Method::Pcmciplus,
        cond_ind_test: "parcorr".into(),
        pc_alpha: PcAlpha::Fixed(0.01),
        tau_min: 0,
        tau_max: 2,
        ..Settings::default()
    };
    let model = analyse(&data, &settings, &Control::default()).expect("an analysis");
    let mean = exact.iter().map(|row| row[1]).sum::<f64>() / exact.len() as f64;
    let squares: Vec<[f64; 2]> = speeds
        .iter()
        .zip(exact)
        .map(|(found, exact)| [(found[1] - exact[1]).powi(2), (exact[1] - mean).powi(2)])
        .filter(|[error, _]| !error.is_nan())
        .collect();
    let [error, variance] = [0, 1].map(|which| squares.iter().map(|square| square[which]).sum::<f64>());
    Found {
        at_once: model.links.iter().any(|link| link.lag == 0),
        strength: model.val_matrix[0][1][1].unwrap_or(0.0),
        error: (error / variance).sqrt(),
    }
}

enum Event {
    Robot(RobotState),
    Humans(Humans),
}

async fn listen(mw: &LoopbackNode, mut recorders: [Recorder; 3]) -> Result<[Recorder; 3]> {
    let inbox = Inbox::new(mw, 20_000);
    let (robot, humans) = (inbox.sender(), inbox.sender());
    let _robot =
        mw.subscribe("/roscausal/robot", Qos::Volatile(1000), move |m| robot.send(Event::Robot(m)))?;
    let _humans =
        mw.subscribe("/roscausal/humans", Qos::Volatile(1000), move |m| humans.send(Event::Humans(m)))?;
    loop {
        match inbox.awaited(mw, None).await {
            Next::Shutdown => return Ok(recorders),
            Next::Deadline => {}
            Next::Event(Event::Robot(state)) => {
                recorders.iter_mut().for_each(|recorder| recorder.robot(&state, mw.now()));
            }
            Next::Event(Event::Humans(people)) => {
                recorders.iter_mut().for_each(|recorder| recorder.humans(&people, mw.now()));
            }
        }
    }
}

/// What comes, by its stamp: a sighting of the person with its true moment, or (`None`) the robot's messages. Seconds.
type Message = (f64, Option<f64>);

fn messages(tracker: &Tracker, exact: &Speeds, random: &mut Random) -> Vec<Message> {
    let length = (exact.len() - 1) as f64 * tracker.dt_s;
    let interval = tracker.dt_s / ROBOT_MESSAGES;
    let mut messages: Vec<Message> =
        (0..(length / interval) as u32).map(|number| (f64::from(number) * interval, None)).collect();
    let phase = random.share();
    for number in 1..(length / tracker.interval_s) as u32 {
        let even = (f64::from(number) + phase) * tracker.interval_s;
        let (jitter, kept) =
            (tracker.jitter_s * (2.0 * random.share() - 1.0), random.share() >= tracker.lost);
        let stamp = even + jitter;
        let seen = if tracker.stamps == Stamps::True { stamp } else { even };
        if kept {
            messages.push((stamp, Some(seen)));
        }
    }
    messages.sort_by(|a, b| a.0.total_cmp(&b.0));
    messages
}

fn record(tracker: &Tracker, exact: &Speeds, messages: Vec<Message>) -> [Recording; 3] {
    let bus = Loopback::lockstep();
    let sensors = bus.node("sensors");
    let robot = bus.start_task("robot", async |mw| nodes::run_task("robot", &mw).await);
    let human = bus.start_task("human", async |mw| nodes::run_task("human", &mw).await);
    let recorders = [Sampling::Linear, Sampling::Hold, Sampling::Auto].map(|sampling| {
        let select = Select::Ids([ID as u32].into());
        let (dt_s, max_gap_s) = (tracker.dt_s, tracker.dt_s.max(0.5));
        Recorder::new(RecorderConfig { dt_s, ts_length_s: None, max_gap_s, sampling, select })
    });
    let data = bus.start_task("data", async move |mw| listen(&mw, recorders).await);
    let odometry = sensors.advertise("/mobile_base_controller/odom", Qos::Volatile(10)).expect("advertises");
    let pose = sensors.advertise("/robot_pose", Qos::Volatile(10)).expect("advertises");
    let people = sensors.advertise("/ped/control/teleop_persons", Qos::Volatile(10)).expect("advertises");
    let fixed = sensors.advertise("/tf_static", Qos::Latched).expect("advertises");
    fixed.publish(&TFMessage::default()).expect("publishes");
    for (t, sighting) in messages {
        let stamp = Time::from_secs_f64(BEGIN_S + t);
        bus.advance_to(stamp);
        let header = Header { stamp, frame_id: "map".into() };
        if let Some(seen) = sighting {
            let mut track = TrackedPerson { track_id: ID, ..TrackedPerson::default() };
            track.pose.pose.position.x = 3.0;
            track.pose.pose.orientation.w = 1.0;
            track.twist.twist.linear.x = at(exact, tracker.dt_s, seen)[1];
            people.publish(&TrackedPersons { header, tracks: vec![track] }).expect("publishes");
        } else {
            let mut message = Odometry { header: header.clone(), ..Odometry::default() };
            message.twist.twist.linear.x = at(exact, tracker.dt_s, t)[0];
            odometry.publish(&message).expect("publishes");
            let mut message = PoseWithCovarianceStamped { header, ..Default::default() };
            message.pose.pose.orientation.w = 1.0;
            pose.publish(&message).expect("publishes");
        }
        bus.settle();
    }
    bus.shutdown();
    robot.end().expect("no panic").expect("ends well");
    human.end().expect("no panic").expect("ends well");
    data.end().expect("no panic").expect("ends well").map(|mut recorder| {
        recorder.finish();
        recorder.take_batches().remove(0)
    })
}
