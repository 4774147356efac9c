//! One moment of the scene, small enough to keep a whole run, and its JSON for the page.

use roscausal_core::{Time, nodes::SceneOptions, state::scene::speed};
use roscausal_msgs::{
    HumanState, Humans, RobotState,
    geometry_msgs::{Point, Pose2D},
};
use serde_json::{Value as Json, json};

/// Robot and people at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Moment {
    /// Seconds.
    pub(crate) t: f64,
    robot: Option<Place>,
    people: Vec<(u32, Place)>,
}

/// Where somebody is, how fast, and where to. In single precision: a tenth of a millimetre within a kilometre.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    pose: [f32; 3],
    velocity: [f32; 2],
    goal: [f32; 2],
}

impl Moment {
    pub(crate) fn new(time: Time, robot: Option<&RobotState>, humans: &Humans) -> Self {
        let place = |pose: &Pose2D, twist: &roscausal_msgs::geometry_msgs::Twist, goal: &Point| Place {
            pose: [pose.x as f32, pose.y as f32, pose.theta as f32],
            velocity: [twist.linear.x as f32, twist.linear.y as f32],
            goal: [goal.x as f32, goal.y as f32],
        };
        let person = |one: &HumanState| (one.id, place(&one.pose2d, &one.twist, &one.goal));
        Self {
            t: time.as_secs_f64(),
            robot: robot.map(|robot| place(&robot.pose2d, &robot.twist, &robot.goal)),
            people: humans.humans.iter().map(person).collect(),
        }
    }

    /// How many bodies it has: what it weighs.
    pub(crate) fn bodies(&self) -> usize {
        1 + self.people.len()
    }

    /// The whole scene. `wanted` is the person that the reader has chosen; else it is the one of `view`.
    pub(crate) fn json(&self, view: &SceneOptions, wanted: Option<u32>) -> Json {
        let robot = self.robot.map(|place| place.robot());
        let person = |(id, place): &(u32, Place)| {
            let state = place.person(*id);
            let mut json = body(&state.pose2d, speed(&state.twist), &state.goal);
            json["id"] = json!(id);
            json["cone"] =
                robot.as_ref().and_then(|robot| view.cone(&state, robot)).map_or(Json::Null, |cone| {
                    json!({
                        "corners": cone.corners.map(|corner| point(&corner)),
                        "ahead": point(&cone.ahead),
                        "collision": cone.collision,
                        "distance": rounded(cone.distance),
                        "risk": rounded(cone.risk),
                    })
                });
            json
        };
        json!({
            "t": rounded(self.t),
            "robot": robot.as_ref().map(|robot| body(&robot.pose2d, speed(&robot.twist), &robot.goal)),
            "people": self.people.iter().map(person).collect::<Vec<_>>(),
            "person": self.person(view, wanted).map(|person| person.id),
        })
    }

    /// Where the robot and the person shown are: for trails.
    pub(crate) fn dots(&self, view: &SceneOptions, wanted: Option<u32>) -> [Option<[f64; 3]>; 2] {
        let dot = |pose: Pose2D| [self.t, pose.x, pose.y].map(rounded);
        [
            self.robot.map(|place| dot(place.robot().pose2d)),
            self.person(view, wanted).map(|person| dot(person.pose2d)),
        ]
    }

    /// The variables of the strip charts, in the order of `charts.js`.
    pub(crate) fn row(&self, view: &SceneOptions, wanted: Option<u32>) -> [f64; 13] {
        let unknown = f64::NAN;
        let robot = self.robot.map(|place| place.robot());
        let person = self.person(view, wanted);
        let cone = person.as_ref().zip(robot.as_ref()).and_then(|(person, robot)| view.cone(person, robot));
        let of = |pose: &Pose2D, v: f64, goal: &Point| {
            [v, (goal.x - pose.x).hypot(goal.y - pose.y), pose.x, pose.y, pose.theta]
        };
        let none = [unknown; 5];
        let [v, dg, x, y, theta] = person.as_ref().map_or(none, |p| of(&p.pose2d, speed(&p.twist), &p.goal));
        let [r_v, r_dg, r_x, r_y, r_theta] =
            robot.as_ref().map_or(none, |r| of(&r.pose2d, speed(&r.twist), &r.goal));
        let (risk, apart) = cone.map_or((unknown, unknown), |cone| (cone.risk, cone.distance));
        [self.t, v, dg, risk, apart, x, y, theta, r_v, r_dg, r_x, r_y, r_theta].map(rounded)
    }

    fn person(&self, view: &SceneOptions, wanted: Option<u32>) -> Option<HumanState> {
        let chosen = wanted.and_then(|id| self.people.iter().find(|(other, _)| *other == id));
        if let Some((id, place)) = chosen {
            return Some(place.person(*id));
        }
        let people: Vec<HumanState> = self.people.iter().map(|(id, place)| place.person(*id)).collect();
        view.person(&people, self.robot.map(|place| place.robot()).as_ref())
    }
}

impl Place {
    fn person(self, id: u32) -> HumanState {
        let mut state = HumanState { id, pose2d: self.pose(), goal: self.goal(), ..HumanState::default() };
        [state.twist.linear.x, state.twist.linear.y] = self.velocity.map(f64::from);
        state
    }

    fn robot(self) -> RobotState {
        let mut state = RobotState { pose2d: self.pose(), goal: self.goal(), ..RobotState::default() };
        [state.twist.linear.x, state.twist.linear.y] = self.velocity.map(f64::from);
        state
    }

    fn pose(self) -> Pose2D {
        let [x, y, theta] = self.pose.map(f64::from);
        Pose2D { x, y, theta }
    }

    fn goal(self) -> Point {
        let [x, y] = self.goal.map(f64::from);
        Point { x, y, z: 0.0 }
    }
}

fn body(pose: &Pose2D, speed: f64, goal: &Point) -> Json {
    let goal = (goal.x.is_finite() && goal.y.is_finite()).then(|| point(goal));
    json!({"x": rounded(pose.x), "y": rounded(pose.y), "theta": rounded(pose.theta), "v": rounded(speed), "goal": goal})
}

fn point(point: &Point) -> Json {
    json!([rounded(point.x), rounded(point.y)])
}

/// Like [`rounded`], but with four digits of a small value: the unit of a variable may be anything.
pub(crate) fn fine(value: f64) -> f64 {
    let near = rounded(value);
    if near.abs() >= 0.1 || !value.is_finite() {
        return near;
    }
    format!("{value:.3e}").parse().unwrap_or(near)
}

/// To a tenth of a millimetre. JSON turns values that are not finite into null.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
