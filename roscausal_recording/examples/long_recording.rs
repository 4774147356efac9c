//! Writes the recording for the benchmark in `docs/recordings.md`: odometry and pose at 100 Hz, 20 people at 25 Hz,
//! with messages of usual size.
//!
//! `cargo run --release -p roscausal_recording --example long_recording -- FILE.mcap MINUTES`
#![allow(clippy::expect_used, reason = "an example")]

use roscausal_core::Time;
use roscausal_msgs::{
    geometry_msgs::{Point, PoseWithCovarianceStamped, Quaternion},
    nav_msgs::Odometry,
    people_msgs::{People, Person},
    std_msgs::Header,
};
use roscausal_recording::McapWriter;

const BEGIN_S: f64 = 1.7e9;
const PEOPLE: u32 = 20;

fn header(stamp: Time, frame: &str) -> Header {
    Header { stamp, frame_id: frame.into() }
}

/// Position of the robot (number 0) or a person after `t` seconds.
fn place(number: u32, t: f64) -> Point {
    let (turn, phase) = (0.1 + 0.013 * f64::from(number), f64::from(number));
    Point { x: 6.0 * (turn * t + phase).cos(), y: 4.0 * (1.3 * turn * t + phase).sin(), z: 0.0 }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (path, minutes) = arguments.next().zip(arguments.next()).expect("arguments: FILE.mcap MINUTES");
    let minutes: f64 = minutes.parse().expect("MINUTES is a number");
    let mut writer = McapWriter::create(path).expect("the file can be made");
    for tick in 0..(minutes * 6000.0) as u32 {
        let t = f64::from(tick) * 0.01;
        let stamp = Time::from_secs_f64(BEGIN_S + t);
        let mut odometry = Odometry { header: header(stamp, "odom"), ..Odometry::default() };
        odometry.child_frame_id = "base_footprint".into();
        odometry.pose.pose.position = place(0, t);
        odometry.twist.twist.linear.x = 0.4 + 0.1 * (0.7 * t).sin();
        writer.write("/odom", stamp, &odometry).expect("written");
        let mut pose = PoseWithCovarianceStamped { header: header(stamp, "map"), ..Default::default() };
        pose.pose.pose.position = place(0, t);
        pose.pose.pose.orientation = Quaternion::from_yaw(0.1 * t);
        writer.write("/robot_pose", stamp, &pose).expect("written");
        if tick % 4 == 0 {
            let person = |number: u32| {
                let (position, next) = (place(number, t), place(number, t + 0.01));
                let velocity =
                    Point { x: (next.x - position.x) * 100.0, y: (next.y - position.y) * 100.0, z: 0.0 };
                let (reliability, tagnames, tags) = (0.9, vec![], vec![]);
                Person { name: number.to_string(), position, velocity, reliability, tagnames, tags }
            };
            let people = People { header: header(stamp, "map"), people: (1..=PEOPLE).map(person).collect() };
            writer.write("/people", stamp, &people).expect("written");
        }
    }
    println!("{} messages", writer.messages());
    writer.finish().expect("the file is whole");
}
