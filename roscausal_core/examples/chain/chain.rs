//! The whole chain in one process over the loopback bus. The sensor values are known functions of time, so a reader
//! of the batches can check every row.

use std::{
    io::Write as _,
    path::{Path, PathBuf},
    thread,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use roscausal_core::{
    Time,
    loopback::Loopback,
    middleware::{Middleware, Publish, Qos},
    nodes,
    params::Value,
};
use roscausal_msgs::{
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    geometry_msgs::{Point, Pose, PoseWithCovarianceStamped, Quaternion},
    nav_msgs::Odometry,
    pedsim_msgs::{TrackedPerson, TrackedPersons},
    std_msgs::Header,
};

/// What is recorded, and how fast.
#[derive(Clone, Debug)]
pub(crate) struct Chain {
    /// Folder that holds everything: `raw`, `pp`, `models`. The run ends when the file `stop` appears in it.
    pub(crate) dir: PathBuf,
    /// Odometry per second.
    pub(crate) odometry_hz: f64,
    /// Number of people, each seen 25 times per second.
    pub(crate) people: u32,
    /// Step and length of batches, seconds.
    pub(crate) batches: (f64, f64),
    /// No sensors: only analyse what is left.
    pub(crate) drain: bool,
    /// Further parameters, as (node, name, value).
    pub(crate) settings: Vec<(String, String, Value)>,
}

/// Position of the robot.
pub(crate) fn robot_x(t: f64) -> f64 {
    3.0 * (0.7 * t).sin()
}

/// Position of a person.
pub(crate) fn person_x(id: u32, t: f64) -> f64 {
    f64::from(id) + (1.3 * t + f64::from(id)).sin()
}

/// Seconds since 1970.
pub(crate) fn wall() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

impl Chain {
    /// A small, fast chain.
    pub(crate) fn new(dir: &Path) -> Self {
        let dir = dir.to_owned();
        Self { dir, odometry_hz: 50.0, people: 2, batches: (0.05, 1.0), drain: false, settings: Vec::new() }
    }

    /// Runs until `stop` appears, then ends cleanly. Returns the messages sent: odometry, people.
    pub(crate) fn run(&self) -> (u64, u64) {
        let bus = Loopback::live(|| Time::from_secs_f64(wall()));
        self.set_parameters(&bus);
        let names: &[&'static str] = if self.drain { &["data"] } else { &["robot", "human", "data"] };
        let recording: Vec<_> = names
            .iter()
            .map(|&name| bus.start(name, move |mw| nodes::run(name, &mw)).expect("a thread"))
            .collect();
        let _troubles = tell_troubles(&bus);
        let discovery = bus.node("discovery");
        let its_own = discovery.clone();
        let analysing = thread::spawn(move || nodes::run("discovery", &its_own));
        let sent = self.sense(&bus);
        bus.shutdown();
        recording.into_iter().for_each(|node| node.join().expect("no panic").expect("ends well"));
        discovery.shutdown();
        analysing.join().expect("no panic").expect("ends well");
        sent
    }

    fn set_parameters(&self, bus: &Loopback) {
        let path = |name: &str| Value::Str(self.dir.join(name).display().to_string());
        let text = |text: &str| Value::Str(text.to_owned());
        let (dt, ts_length) = self.batches;
        for (node, name, value) in [
            ("data", "data_dir", path("raw")),
            ("data", "pp_data_dir", path("pp")),
            ("data", "ts_length", Value::Double(ts_length)),
            ("data", "dt", Value::Double(dt)),
            ("data", "max_gap", Value::Double(0.25)),
            ("data", "sampling", text("linear")),
            ("data", "sel_agent", text("all")),
            ("data", "id_format", text("%Y%m%d_%H%M%S%.3f")),
            ("data", "features", Value::List(vec![text("r_x = r.x"), text("h_x = h.x"), text("h_v = h.v")])),
            ("discovery", "data_dir", path("pp")),
            ("discovery", "res_dir", path("models")),
            ("discovery", "cd_method", text("pcmci")),
            ("discovery", "cond_ind_test", text("parcorr")),
            ("discovery", "threads", Value::Int(1)),
            ("discovery", "nice", Value::Int(19)),
            ("discovery", "max_attempts", Value::Int(1000)),
        ] {
            bus.set_node_param(node, name, value);
        }
        for (node, name, value) in &self.settings {
            bus.set_node_param(node, name, value.clone());
        }
    }

    fn sense(&self, bus: &Loopback) -> (u64, u64) {
        let stop = self.dir.join("stop");
        if self.drain {
            while !stop.exists() {
                thread::sleep(Duration::from_millis(20));
            }
            return (0, 0);
        }
        let node = bus.node("sensors");
        let odometry = node.advertise("/mobile_base_controller/odom", Qos::Volatile(10)).expect("advertises");
        let pose = node.advertise("/robot_pose", Qos::Volatile(10)).expect("advertises");
        let people = node.advertise("/ped/control/teleop_persons", Qos::Volatile(10)).expect("advertises");
        let start = wall();
        let (mut ticks, mut poses, mut crowds) = (0_u64, 0_u64, 0_u64);
        loop {
            if ticks % 32 == 0 && stop.exists() {
                return (ticks, crowds);
            }
            let t = start + ticks as f64 / self.odometry_hz;
            let ahead = t - wall();
            if ahead > 0.0 {
                thread::sleep(Duration::from_secs_f64(ahead));
            }
            let stamp = Time::from_secs_f64(t);
            let header = |frame: &str| Header { stamp, frame_id: frame.into() };
            let mut message = Odometry { header: header("odom"), ..Odometry::default() };
            message.twist.twist.linear.x = 2.1 * (0.7 * t).cos();
            odometry.publish(&message).expect("publishes");
            ticks += 1;
            if (t - start) * 50.0 >= poses as f64 {
                poses += 1;
                let mut message = PoseWithCovarianceStamped { header: header("map"), ..Default::default() };
                message.pose.pose = at(robot_x(t), 0.0);
                pose.publish(&message).expect("publishes");
            }
            if (t - start) * 25.0 >= crowds as f64 {
                crowds += 1;
                let tracks = (0..self.people).map(|id| track(id, t)).collect();
                people.publish(&TrackedPersons { header: header("map"), tracks }).expect("publishes");
            }
        }
    }
}

/// Writes the problems of the nodes to stderr, each once.
fn tell_troubles(bus: &Loopback) -> impl Drop + use<> {
    let mut reported = std::collections::BTreeSet::new();
    let tell = move |message: DiagnosticArray| {
        for status in message.status {
            if status.level > DiagnosticStatus::OK
                && reported.len() < 100
                && reported.insert(status.message.clone())
            {
                // Stderr may be on the full disk as well. That is no reason to stop.
                let _ = writeln!(std::io::stderr(), "{}: {}", status.name, status.message);
            }
        }
    };
    bus.node("listener").subscribe("/diagnostics", Qos::Volatile(10), tell).expect("subscribes")
}

fn at(x: f64, y: f64) -> Pose {
    Pose { position: Point { x, y, z: 0.0 }, orientation: Quaternion::from_yaw(0.0) }
}

fn track(id: u32, t: f64) -> TrackedPerson {
    let mut track = TrackedPerson { track_id: u64::from(id), ..TrackedPerson::default() };
    track.pose.pose = at(person_x(id, t), 2.0);
    track.twist.twist.linear.x = 1.3 * (1.3 * t + f64::from(id)).cos();
    track
}
