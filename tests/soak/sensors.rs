//! What a busy robot's sensors publish: odometry at 1 kHz, poses at 100 Hz and people at 25 Hz, each value a
//! function of the stamp. The peers of both backends send it.

use std::{
    thread::sleep,
    time::{Duration, Instant},
};

use roscausal_core::{
    Result,
    middleware::{Middleware, Publish, Qos},
};
use roscausal_msgs::{
    geometry_msgs::PoseWithCovarianceStamped,
    nav_msgs::Odometry,
    pedsim_msgs::{TrackedPerson, TrackedPersons},
    std_msgs::Header,
};

const ODOMETRY_HZ: u32 = 1000;

/// Publishes for this many seconds. Returns how many odometry, pose and people messages were sent.
pub(super) fn publish<M: Middleware>(mw: &M, seconds: u32, people: u64) -> Result<[u64; 3]> {
    let odometry = mw.advertise::<Odometry>("/mobile_base_controller/odom", Qos::Volatile(1000))?;
    let place = mw.advertise::<PoseWithCovarianceStamped>("/robot_pose", Qos::Volatile(100))?;
    let tracker = mw.advertise::<TrackedPersons>("/ped/control/teleop_persons", Qos::Volatile(100))?;
    while mw.is_ok()
        && [odometry.subscriber_count(), place.subscriber_count(), tracker.subscriber_count()].contains(&0)
    {
        sleep(Duration::from_millis(5));
    }
    // The subscribers' side learns of the match a little later.
    sleep(Duration::from_millis(500));
    let (started, mut sent) = (Instant::now(), [0; 3]);
    for step in 0..seconds * ODOMETRY_HZ {
        if !mw.is_ok() {
            break;
        }
        let stamp = mw.now();
        let t = stamp.as_secs_f64();
        let header = |frame: &str| Header { stamp, frame_id: frame.into() };
        let mut message = Odometry { header: header("odom"), ..Odometry::default() };
        message.twist.twist.linear.x = 0.5;
        odometry.publish(&message)?;
        sent[0] += 1;
        if step % (ODOMETRY_HZ / 100) == 0 {
            let mut message = PoseWithCovarianceStamped { header: header("map"), ..Default::default() };
            message.pose.pose.position.x = t.sin();
            message.pose.pose.orientation.w = 1.0;
            place.publish(&message)?;
            sent[1] += 1;
        }
        if step % (ODOMETRY_HZ / 25) == 0 {
            let tracks = (1..=people).map(|id| track(id, t)).collect();
            tracker.publish(&TrackedPersons { header: header("map"), tracks })?;
            sent[2] += 1;
        }
        let next = started + Duration::from_secs(u64::from(step + 1)) / ODOMETRY_HZ;
        sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(sent)
}

fn track(id: u64, t: f64) -> TrackedPerson {
    let mut track = TrackedPerson { track_id: id, ..TrackedPerson::default() };
    track.pose.pose.position.x = id as f64 + t.sin();
    track.pose.pose.orientation.w = 1.0;
    track.twist.twist.linear.x = t.cos();
    track
}
