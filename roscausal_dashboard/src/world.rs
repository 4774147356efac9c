//! The state of the page, kept from the messages, as JSON.

use std::collections::{BTreeMap, VecDeque};

use roscausal_core::{
    Time,
    nodes::SceneOptions,
    state::scene::{RiskCone, speed},
};
use roscausal_msgs::{
    CausalLink, CausalModelInfo, HumanState, Humans, RobotState,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    geometry_msgs::{Point, Pose2D},
};
use serde_json::{Value as Json, json};

use crate::hub::{Frame, Hub, Keep};

/// Samples of the strip charts that a new browser gets.
const SAMPLES: usize = 600;
/// Largest evidence of one model that goes to the page, in bytes.
const MOST_EVIDENCE: usize = 2_000_000;
/// If stamps go back by more than this, a new run has begun. Seconds.
const NEW_RUN_S: f64 = 1.0;

/// The state of the page.
pub(crate) struct World {
    view: SceneOptions,
    robot: Option<RobotState>,
    humans: Humans,
    /// Time, speed, distance to goal and risk of the person shown.
    samples: VecDeque<[f64; 4]>,
    nodes: BTreeMap<String, DiagnosticStatus>,
    models: u64,
    /// Batches that the data node has reported as written.
    batches: u64,
    time: Time,
    scene_changed: bool,
    status_changed: bool,
}

impl World {
    pub(crate) fn new(view: SceneOptions) -> Self {
        Self {
            view,
            robot: None,
            humans: Humans::default(),
            samples: VecDeque::new(),
            nodes: BTreeMap::new(),
            models: 0,
            batches: 0,
            time: Time::ZERO,
            scene_changed: false,
            status_changed: false,
        }
    }

    pub(crate) fn robot(&mut self, state: RobotState) {
        self.at(state.header.stamp);
        self.robot = Some(state);
        self.scene_changed = true;
    }

    pub(crate) fn humans(&mut self, humans: Humans) {
        self.at(humans.header.stamp);
        self.humans = humans;
        self.scene_changed = true;
        if let Some(person) = self.person() {
            let risk = self.cone(Some(&person)).map_or(f64::NAN, |cone| cone.risk);
            let sample = [self.time.as_secs_f64(), speed(&person.twist), to_goal(&person), risk];
            self.samples.push_back(sample);
            if self.samples.len() > SAMPLES {
                self.samples.pop_front();
            }
        }
    }

    pub(crate) fn diagnostics(&mut self, message: DiagnosticArray, hub: &Hub) {
        for status in message.status {
            let level_before = self.nodes.get(&status.name).map(|before| before.level);
            if level_before != Some(status.level) && (level_before.is_some() || status.level != 0) {
                self.say(hub, &format!("{}: {}", status.name, status.message));
            }
            self.nodes.insert(status.name.clone(), status);
        }
        let batches = self.figure("batches written").unwrap_or(0);
        if batches > self.batches {
            self.say(hub, &format!("batch {batches} recorded"));
        }
        self.batches = batches;
        self.status_changed = true;
    }

    pub(crate) fn model(&mut self, info: &CausalModelInfo, hub: &Hub) {
        self.models += 1;
        let frame = Frame { kind: "model", data: model_json(self.models, info).to_string().into() };
        hub.send(frame, Keep::All);
        let seconds = match info.run_time_s {
            // Simulated time stands still meanwhile.
            seconds if seconds > 0.0 => format!(", found in {seconds:.1} s"),
            _ => String::new(),
        };
        let (number, count) = (self.models, info.links.len());
        self.say(hub, &format!("model {number}: {count} links from {}{seconds}", info.batch_id));
    }

    /// Sends the scene if it has changed.
    pub(crate) fn send_scene(&mut self, hub: &Hub) {
        if std::mem::take(&mut self.scene_changed) {
            hub.send(Frame { kind: "scene", data: self.scene_json().to_string().into() }, Keep::Last);
        }
    }

    /// Sends the nodes' health and the progress if they have changed. Keeps the series for later browsers.
    pub(crate) fn send_status(&mut self, hub: &Hub) {
        if std::mem::take(&mut self.status_changed) {
            hub.send(Frame { kind: "status", data: self.status_json().to_string().into() }, Keep::Last);
        }
        let samples: Vec<Json> = self.samples.iter().map(|s| json!(s.map(rounded))).collect();
        hub.keep_only(Frame { kind: "series", data: Json::Array(samples).to_string().into() });
    }

    fn at(&mut self, stamp: Time) {
        if self.time.secs_since(stamp) > NEW_RUN_S {
            self.samples.clear();
            self.robot = None;
            self.humans = Humans::default();
            self.time = stamp;
        }
        self.time = self.time.max(stamp);
    }

    /// The person shown: the selected one, or the first.
    fn person(&self) -> Option<HumanState> {
        self.view.person(&self.humans.humans, self.robot.as_ref())
    }

    fn cone(&self, person: Option<&HumanState>) -> Option<RiskCone> {
        self.view.cone(person?, self.robot.as_ref()?)
    }

    fn scene_json(&self) -> Json {
        let robot = self.robot.as_ref().map(|robot| {
            let mut json = body(&robot.pose2d, speed(&robot.twist), &robot.goal);
            json["frame"] = json!(robot.header.frame_id);
            json
        });
        let person = |person: &HumanState| {
            let mut json = body(&person.pose2d, speed(&person.twist), &person.goal);
            json["id"] = json!(person.id);
            json
        };
        let chosen = self.person();
        let people: Vec<Json> = self.humans.humans.iter().map(person).collect();
        let (chosen, cone) = (chosen.as_ref(), self.cone(chosen.as_ref()));
        let risk = cone.map(|cone| rounded(cone.risk));
        let cone = cone.map(|cone| {
            json!({
                "corners": cone.corners.map(|corner| point(&corner)),
                "ahead": point(&cone.ahead),
                "collision": cone.collision,
                "distance": rounded(cone.distance),
                "risk": rounded(cone.risk),
            })
        });
        json!({
            "t": rounded(self.time.as_secs_f64()),
            "robot": robot,
            "people": people,
            "person": chosen.map(|person| person.id),
            "cone": cone,
            "v": chosen.map(|person| rounded(speed(&person.twist))),
            "dg": chosen.map(|person| rounded(to_goal(person))),
            "risk": risk,
        })
    }

    fn status_json(&self) -> Json {
        let node = |status: &DiagnosticStatus| {
            let values: Vec<Json> = status.values.iter().map(|pair| json!([pair.key, pair.value])).collect();
            json!({"name": status.name, "level": status.level, "message": status.message, "values": values})
        };
        json!({
            "t": rounded(self.time.as_secs_f64()),
            "nodes": self.nodes.values().map(node).collect::<Vec<_>>(),
            "rows": self.figure("rows of the open batch"),
            "rows_of": self.figure("rows of a batch"),
            "batches": self.figure("batches written"),
            "waiting": self.figure("batches waiting"),
            "tests": self.figure("tests done"),
            "tests_of": self.figure("tests in all"),
            "models": self.models,
        })
    }

    /// A number that one of the nodes reports in its diagnostics.
    fn figure(&self, key: &str) -> Option<u64> {
        let pairs = self.nodes.values().flat_map(|status| &status.values);
        pairs.filter(|pair| pair.key == key).find_map(|pair| pair.value.parse().ok())
    }

    fn say(&self, hub: &Hub, text: &str) {
        let json = json!({"t": rounded(self.time.as_secs_f64()), "text": text});
        hub.send(Frame { kind: "message", data: json.to_string().into() }, Keep::All);
    }
}

fn model_json(number: u64, info: &CausalModelInfo) -> Json {
    let link = |link: &CausalLink| {
        json!({
            "cause": link.cause,
            "effect": link.effect,
            "lag": link.lag,
            "value": rounded(link.value),
            "p": link.p_value,
        })
    };
    json!({
        "number": number,
        "t": rounded(info.header.stamp.as_secs_f64()),
        "batch": info.batch_id,
        "method": info.method,
        "test": info.cond_ind_test,
        "alpha": info.alpha,
        "dt": info.dt,
        "samples": info.n_samples,
        "seconds": rounded(info.run_time_s),
        "features": info.candidate_features,
        "links": info.links.iter().map(link).collect::<Vec<_>>(),
    })
}

/// Evidence for the page, if it is JSON and not too large. It is written anew, because a frame has no line breaks.
pub(crate) fn evidence_frame(text: &str) -> Option<Frame> {
    if text.len() > MOST_EVIDENCE {
        return None;
    }
    let json: Json = serde_json::from_str(text).ok()?;
    (json["batch"].is_string() && json["evidence"]["links"].is_array())
        .then(|| Frame { kind: "evidence", data: json.to_string().into() })
}

fn body(pose: &Pose2D, speed: f64, goal: &Point) -> Json {
    let goal = (goal.x.is_finite() && goal.y.is_finite()).then(|| point(goal));
    json!({"x": rounded(pose.x), "y": rounded(pose.y), "theta": rounded(pose.theta), "v": rounded(speed), "goal": goal})
}

fn point(point: &Point) -> Json {
    json!([rounded(point.x), rounded(point.y)])
}

fn to_goal(person: &HumanState) -> f64 {
    (person.goal.x - person.pose2d.x).hypot(person.goal.y - person.pose2d.y)
}

/// To a tenth of a millimetre. JSON turns values that are not finite into null.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    fn world() -> World {
        World::new(SceneOptions::default())
    }

    fn stamped(secs: f64) -> roscausal_msgs::std_msgs::Header {
        roscausal_msgs::std_msgs::Header { stamp: Time::from_secs_f64(secs), frame_id: "map".into() }
    }

    fn robot(secs: f64) -> RobotState {
        let mut robot = RobotState { header: stamped(secs), ..RobotState::default() };
        robot.pose2d.x = 3.0;
        robot.goal = Point { x: f64::NAN, y: f64::NAN, z: 0.0 };
        robot
    }

    fn people(secs: f64) -> Humans {
        let person = |id| HumanState { header: stamped(secs), id, ..HumanState::default() };
        Humans { header: stamped(secs), humans: vec![person(7), person(1000)] }
    }

    #[test]
    fn the_scene_has_everybody_and_the_cone_of_the_person_chosen() {
        let mut world = world();
        world.robot(robot(1.0));
        world.humans(people(1.0));
        let scene = world.scene_json();
        assert_eq!((scene["robot"]["x"].as_f64(), scene["person"].as_u64()), (Some(3.0), Some(1000)));
        assert_eq!(scene["people"].as_array().map(Vec::len), Some(2));
        assert_eq!(scene["cone"]["distance"].as_f64(), Some(3.0));
        assert!(scene["robot"]["goal"].is_null() && !scene.to_string().contains("NaN"));
        assert_eq!(world.samples.len(), 1);
    }

    #[test]
    fn a_run_that_starts_again_starts_the_page_again() {
        let mut world = world();
        world.robot(robot(100.0));
        world.humans(people(100.0));
        world.robot(robot(1.0));
        assert!(world.samples.is_empty() && world.humans.humans.is_empty());
        assert_eq!(world.scene_json()["t"].as_f64(), Some(1.0));
    }

    #[test]
    fn evidence_has_no_line_breaks_and_anything_else_is_left_out() {
        let good = "{\"batch\": \"a\\r\\nb\",\r\n \"evidence\": {\"links\": []}}";
        let frame = evidence_frame(good).expect("a frame");
        assert!(frame.kind == "evidence" && !frame.data.contains(['\r', '\n']), "{}", frame.data);
        for bad in
            ["", "[]", "{\"batch\": 1, \"evidence\": {\"links\": []}}", "{\"batch\": \"a\"}", "no JSON\r\n"]
        {
            assert_eq!(evidence_frame(bad), None, "{bad}");
        }
        assert_eq!(evidence_frame(&format!("{good}{}", " ".repeat(MOST_EVIDENCE))), None);
    }

    #[test]
    fn troubles_and_batches_become_messages() {
        let hub = Hub::new();
        let mut world = world();
        let status = |level, message: &str, written: u64| DiagnosticArray {
            status: vec![DiagnosticStatus {
                level,
                name: "data".into(),
                message: message.into(),
                values: vec![roscausal_msgs::diagnostic_msgs::KeyValue {
                    key: "batches written".into(),
                    value: written.to_string(),
                }],
                ..DiagnosticStatus::default()
            }],
            ..DiagnosticArray::default()
        };
        for message in [status(0, "running", 0), status(1, "no messages", 0), status(1, "no messages", 1)] {
            world.diagnostics(message, &hub);
        }
        let said: Vec<String> = hub.join().0.iter().map(|frame| frame.data.to_string()).collect();
        assert!(
            said.len() == 2 && said[0].contains("data: no messages") && said[1].contains("batch 1"),
            "{said:?}"
        );
    }
}
