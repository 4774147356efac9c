//! The state of the page, kept from the messages, as JSON.

use std::collections::{BTreeMap, BTreeSet};

use roscausal_core::{
    Time,
    nodes::{SceneOptions, model_messages::model_of},
};
use roscausal_discovery::{Link, LinkMark, Model};
use roscausal_msgs::{
    CausalModelInfo, Humans, ModelChange, ModelChanges, RobotState,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus},
    pedsim_msgs::LineObstacles,
};
use serde_json::{Value as Json, json};

use crate::{
    history::NEW_RUN_S,
    hub::{Frame, Hub, Keep},
    moment::{Moment, rounded},
};

/// Largest evidence of one model that goes to the page, in bytes.
const MOST_EVIDENCE: usize = 2_000_000;
/// Most sentences of a kind that are shown of one summary, and their length.
const MOST_SENTENCES: usize = 10;
const MOST_CHARS: usize = 2_000;
/// Most walls that are drawn, and most interventions that are followed.
const MOST_WALLS: usize = 2_000;
const MOST_COLUMNS: usize = 100;

/// The state of the page.
#[derive(Default)]
pub(crate) struct World {
    view: SceneOptions,
    robot: Option<RobotState>,
    humans: Humans,
    /// Interventions that are on, by the name of their column.
    imposed: BTreeMap<String, String>,
    /// The walls as they were last sent.
    walls: String,
    nodes: BTreeMap<String, DiagnosticStatus>,
    models: u64,
    /// The stages of changes that were told: id and status.
    stages: BTreeSet<(String, u8)>,
    /// Batches that the data node has reported as written.
    batches: u64,
    time: Time,
    scene_changed: bool,
    status_changed: bool,
}

impl World {
    pub(crate) fn new(view: SceneOptions) -> Self {
        Self { view, ..Self::default() }
    }

    pub(crate) fn robot(&mut self, state: RobotState, hub: &Hub) {
        self.at(state.header.stamp);
        self.robot = Some(state);
        self.moved(hub);
    }

    pub(crate) fn humans(&mut self, humans: Humans, hub: &Hub) {
        self.at(humans.header.stamp);
        self.humans = humans;
        self.moved(hub);
    }

    fn moved(&mut self, hub: &Hub) {
        self.scene_changed = true;
        // A recording that is played fast has many moments between two frames of the page: all of them are kept.
        let mut history = hub.history();
        if history.is_due(self.time.as_secs_f64()) {
            history.push(self.moment());
        }
    }

    /// The walls of the map, where somebody tells them.
    pub(crate) fn walls(&mut self, walls: &LineObstacles, hub: &Hub) {
        let ends = |wall: &roscausal_msgs::pedsim_msgs::LineObstacle| {
            [wall.start.x, wall.start.y, wall.end.x, wall.end.y].map(rounded)
        };
        let known =
            walls.obstacles.iter().map(ends).filter(|ends| ends.iter().all(|value| value.is_finite()));
        let data = json!(known.take(MOST_WALLS).collect::<Vec<_>>()).to_string();
        if data != self.walls {
            self.walls.clone_from(&data);
            hub.send(Frame { kind: "walls", data: data.into() }, Keep::Last);
        }
    }

    /// What is imposed on the robot and the people: `{"context": {column: values}}`, empty values for what is off.
    pub(crate) fn interventions(&mut self, text: &str, hub: &Hub) {
        let Ok(json) = serde_json::from_str::<Json>(text) else { return };
        let Some(columns) = json["context"].as_object() else { return };
        for (name, values) in columns.iter().take(MOST_COLUMNS) {
            let values: Vec<String> = values.as_array().into_iter().flatten().map(Json::to_string).collect();
            let now = (!values.is_empty()).then(|| values.join(", "));
            if self.imposed.get(name) == now.as_ref() {
                continue;
            }
            let text = match &now {
                Some(value) => format!("intervention {name} = {value} begins"),
                None => format!("intervention {name} ends"),
            };
            self.tell(hub, &text, json!({"kind": "do", "name": name, "on": now.is_some()}));
            match now {
                Some(value) => self.imposed.insert(name.clone(), value),
                None => self.imposed.remove(name),
            };
        }
    }

    pub(crate) fn diagnostics(&mut self, message: DiagnosticArray, hub: &Hub) {
        for status in message.status {
            let level_before = self.nodes.get(&status.name).map(|before| before.level);
            if level_before != Some(status.level) && (level_before.is_some() || status.level != 0) {
                self.tell(hub, &format!("{}: {}", status.name, status.message), json!({"kind": "health"}));
            }
            self.nodes.insert(status.name.clone(), status);
        }
        let batches = self.figure("batches written").unwrap_or(0);
        if batches > self.batches {
            self.tell(hub, &format!("batch {batches} recorded"), json!({"kind": "batch"}));
        }
        self.batches = batches;
        self.status_changed = true;
    }

    pub(crate) fn model(&mut self, info: &CausalModelInfo, hub: &Hub) {
        self.models += 1;
        let model = model_of(info);
        let data = model_json(self.models, info, &model).to_string().into();
        hub.keep_model(self.models, model);
        hub.send(Frame { kind: "model", data }, Keep::All);
        let seconds = match info.run_time_s {
            // Simulated time stands still meanwhile.
            seconds if seconds > 0.0 => format!(", found in {seconds:.1} s"),
            _ => String::new(),
        };
        let (number, count) = (self.models, info.links.len());
        let text = format!("model {number}: {count} links from {}{seconds}", info.batch_id);
        self.tell(hub, &text, json!({"kind": "model"}));
    }

    /// Changes of mechanisms: each stage once, at the time when the link changed, or, if that is not told, when it was told.
    pub(crate) fn changes(&mut self, message: &ModelChanges, hub: &Hub) {
        for change in &message.changes {
            let confirmed = change.status == ModelChange::CONFIRMED;
            if !self.stages.insert((change.id.clone(), change.status)) {
                continue;
            }
            self.tell(hub, &change.description, json!({"kind": "mechanism"}));
            let (from, to) = (change.changed_from.as_secs_f64(), change.changed_to.as_secs_f64());
            let t = if confirmed && to > 0.0 { 0.5 * (from + to) } else { change.told.as_secs_f64() };
            let kind = ["suspected", "confirmed", "withdrawn"].get(usize::from(change.status)).unwrap_or(&"");
            let data = json!({
                "t": t, "kind": kind, "text": change.description, "regime": confirmed,
                "batch": change.batch_id, "cause": change.cause, "effect": change.effect,
            });
            hub.send(Frame { kind: "change", data: data.to_string().into() }, Keep::All);
        }
    }

    /// Sends the scene if it has changed.
    pub(crate) fn send_scene(&mut self, hub: &Hub) {
        if std::mem::take(&mut self.scene_changed) {
            let scene = self.moment().json(&self.view, None);
            hub.send(Frame { kind: "scene", data: scene.to_string().into() }, Keep::Last);
        }
    }

    /// Sends the nodes' health and the progress if they have changed.
    pub(crate) fn send_status(&mut self, hub: &Hub) {
        if std::mem::take(&mut self.status_changed) {
            hub.send(Frame { kind: "status", data: self.status_json().to_string().into() }, Keep::Last);
        }
    }

    fn at(&mut self, stamp: Time) {
        if self.time.secs_since(stamp) > NEW_RUN_S {
            self.robot = None;
            self.humans = Humans::default();
            self.time = stamp;
        }
        self.time = self.time.max(stamp);
    }

    fn moment(&self) -> Moment {
        Moment::new(self.time, self.robot.as_ref(), &self.humans)
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

    /// Sends a message with what the timeline needs to show it.
    fn tell(&self, hub: &Hub, text: &str, mut details: Json) {
        details["t"] = json!(rounded(self.time.as_secs_f64()));
        details["text"] = json!(text);
        hub.send(Frame { kind: "message", data: details.to_string().into() }, Keep::All);
    }
}

fn model_json(number: u64, info: &CausalModelInfo, model: &Model) -> Json {
    let link = |link: &Link| {
        // What the arrow of a cause does not say.
        let words = (link.mark != LinkMark::Forward).then(|| link.sentence());
        json!({
            "words": words,
            "cause": link.cause,
            "effect": link.effect,
            "lag": link.lag,
            "value": link.value.filter(|value| value.is_finite()).map_or(1.0, rounded),
            "tested": link.value.is_some_and(f64::is_finite),
            "p": link.p_value.filter(|p| p.is_finite()).unwrap_or(0.0),
            "confidence": link.confidence.map(rounded),
        })
    };
    json!({
        "number": number,
        "t": rounded(info.header.stamp.as_secs_f64()),
        "from": rounded(info.start_time.as_secs_f64()),
        "to": rounded(info.end_time.as_secs_f64()),
        "batch": info.batch_id,
        "method": info.method,
        "test": info.cond_ind_test,
        "smallest_p": model.smallest_p(),
        "level_name": model.link_level_in_words().0,
        "level": model.link_level(),
        "has_sign": model.has_sign(),
        "dt": info.dt,
        "samples": info.n_samples,
        "seconds": rounded(info.run_time_s),
        "features": model.features,
        "links": model.links.iter().map(link).collect::<Vec<_>>(),
    })
}

/// Evidence for the page, if it is JSON and not too large, and what may be said of its model, which is kept as long as the model.
/// Both are written anew, because a frame has no line breaks.
pub(crate) fn evidence_frames(text: &str) -> Option<[(Frame, Keep); 2]> {
    if text.len() > MOST_EVIDENCE {
        return None;
    }
    let json: Json = serde_json::from_str(text).ok()?;
    let (batch, evidence) = (&json["batch"], &json["evidence"]);
    let sentences = |field: &str| -> Vec<String> {
        let all = json[field].as_array().into_iter().flatten().filter_map(Json::as_str);
        all.take(MOST_SENTENCES).map(|text| text.chars().take(MOST_CHARS).collect()).collect()
    };
    let said = json!({"batch": batch, "conclusion": sentences("conclusion"), "advice": sentences("advice")});
    let frame = |kind, data: Json| Frame { kind, data: data.to_string().into() };
    (batch.is_string() && evidence["links"].is_array()).then(|| {
        let evidence = frame("evidence", json!({"batch": batch, "evidence": evidence}));
        [(frame("summary", said), Keep::All), (evidence, Keep::Few)]
    })
}

#[cfg(test)]
mod tests {
    use roscausal_core::nodes::model_messages::{Origin, causal_model_info};
    use roscausal_msgs::{HumanState, geometry_msgs::Point, pedsim_msgs::LineObstacle};

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
        let (mut world, hub) = (world(), Hub::new());
        world.robot(robot(1.0), &hub);
        world.humans(people(1.0), &hub);
        let scene = world.moment().json(&world.view, None);
        assert_eq!((scene["robot"]["x"].as_f64(), scene["person"].as_u64()), (Some(3.0), Some(1000)));
        assert_eq!(scene["people"].as_array().map(Vec::len), Some(2));
        assert_eq!(scene["people"][1]["cone"]["distance"].as_f64(), Some(3.0));
        assert!(scene["robot"]["goal"].is_null() && !scene.to_string().contains("NaN"));
        // The reader may choose somebody else.
        assert_eq!(world.moment().json(&world.view, Some(7))["person"].as_u64(), Some(7));
        assert_eq!(hub.history().series(None)["rows"].as_array().map(Vec::len), Some(1));
    }

    #[test]
    fn a_model_tells_the_level_that_decided_on_its_links() {
        let reported = |method: &str, pc_alpha| {
            let info = CausalModelInfo {
                method: method.into(),
                alpha: 0.05,
                pc_alpha,
                ..CausalModelInfo::default()
            };
            let json = model_json(1, &info, &model_of(&info));
            (json["level_name"].as_str().map(str::to_owned), json["level"].as_f64())
        };
        assert_eq!(reported("pcmci", 0.2), (Some("alpha".to_owned()), Some(0.05)));
        assert_eq!(reported("lpcmci", 0.01), (Some("pc_alpha".to_owned()), Some(0.01)));
        // Equal levels are not mixed up; 0 stands for a choice by score.
        assert_eq!(reported("pcmciplus", 0.05), (Some("pc_alpha".to_owned()), Some(0.05)));
        assert_eq!(reported("pcmciplus", 0.0), (Some("pc_alpha".to_owned()), None));
        assert_eq!(reported("somebody's own", 0.2), (Some("alpha".to_owned()), Some(0.05)));
    }

    #[test]
    fn a_run_that_starts_again_starts_the_page_again() {
        let (mut world, hub) = (world(), Hub::new());
        world.robot(robot(100.0), &hub);
        world.humans(people(100.0), &hub);
        world.robot(robot(1.0), &hub);
        assert!(world.humans.humans.is_empty());
        assert_eq!(world.moment().t, 1.0);
        assert_eq!(hub.history().series(None)["first"].as_f64(), Some(1.0));
    }

    #[test]
    fn an_intervention_is_told_when_it_begins_and_when_it_ends() {
        let (mut world, hub) = (world(), Hub::new());
        let text = |value: &str| format!("{{\"context\": {{\"do_robot_speed\": {value}, \"<b>\": []}}}}");
        for value in ["[]", "[0.2]", "[0.2]", "[]", "no JSON"] {
            world.interventions(&text(value), &hub);
        }
        let reported: Vec<Json> =
            hub.join().0.iter().map(|frame| serde_json::from_str(&frame.data).unwrap()).collect();
        let on = |json: &Json| (json["name"].as_str().map(str::to_owned), json["on"].as_bool());
        let name = || Some("do_robot_speed".to_owned());
        assert_eq!(
            reported.iter().map(on).collect::<Vec<_>>(),
            [(name(), Some(true)), (name(), Some(false))]
        );
        assert!(reported[0]["text"].as_str().unwrap().contains("= 0.2 begins"));
    }

    #[test]
    fn each_stage_of_a_change_is_a_mark_once_and_a_confirmed_one_begins_a_regime() {
        let (mut world, hub) = (world(), Hub::new());
        let change = |status: u8| ModelChange {
            id: "change-1".into(),
            status,
            told: Time::from_secs_f64(30.0),
            changed_from: Time::from_secs_f64(if status == ModelChange::CONFIRMED { 10.0 } else { 0.0 }),
            changed_to: Time::from_secs_f64(if status == ModelChange::CONFIRMED { 14.0 } else { 0.0 }),
            description: "a no longer drives b".into(),
            cause: "a".into(),
            effect: "b".into(),
            batch_id: "batch_2".into(),
            ..ModelChange::default()
        };
        let (first, second) = (change(ModelChange::SUSPECTED), change(ModelChange::CONFIRMED));
        for changes in [vec![first.clone()], vec![first, second]] {
            world.changes(&ModelChanges { changes, ..ModelChanges::default() }, &hub);
        }
        let frames = hub.join().0;
        let marks = frames.iter().filter(|frame| frame.kind == "change");
        let marks: Vec<Json> = marks.map(|frame| serde_json::from_str(&frame.data).unwrap()).collect();
        let of = |json: &Json| (json["t"].as_f64().unwrap(), json["regime"].as_bool().unwrap());
        assert_eq!(marks.iter().map(of).collect::<Vec<_>>(), [(30.0, false), (12.0, true)]);
        assert_eq!(frames.iter().filter(|frame| frame.kind == "message").count(), 2);
        // By these the page finds the model and the arrow.
        for (key, value) in [("batch", "batch_2"), ("cause", "a"), ("effect", "b")] {
            assert_eq!(marks[1][key], value, "{}", marks[1]);
        }
    }

    #[test]
    fn the_page_has_the_facts_of_each_study() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/studies");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|end| end == "json")).collect();
        assert_eq!(files.len(), 12);
        for file in files {
            let model = Model::from_json(&std::fs::read(&file).unwrap()).unwrap();
            let (summary, origin) = (model.summary(), Origin { batch_id: "b".into(), ..Origin::default() });
            let info = causal_model_info(&model, &stamped(1.0), &origin, None);
            let page = model_json(1, &info, &model_of(&info));
            let links = page["links"].as_array().unwrap();
            let between: Vec<&Json> = links.iter().filter(|link| link["cause"] != link["effect"]).collect();
            assert_eq!(between.len(), summary.links.len(), "{file:?}");
            for link in &summary.links {
                let is_it = |of: &&&Json| {
                    of["cause"] == link.cause.as_str()
                        && of["effect"] == link.effect.as_str()
                        && of["lag"] == link.lag
                };
                let shown = between.iter().find(is_it).unwrap();
                let off = shown["value"].as_f64().unwrap() - link.value.unwrap();
                assert!(
                    off.abs() < 1e-4 && shown["p"].as_f64() == link.p_value,
                    "{file:?}: {shown} {link:?}"
                );
            }
            let own = links.iter().filter(|link| link["cause"] == link["effect"]);
            let own: BTreeSet<&str> = own.filter_map(|link| link["cause"].as_str()).collect();
            let past: BTreeSet<&str> = summary.own_past.iter().map(String::as_str).collect();
            assert_eq!(own, past, "{file:?}");
            assert_eq!(
                (page["test"].as_str(), page["dt"].as_f64()),
                (Some(model.cond_ind_test.as_str()), model.dt)
            );
            // What the discovery node sends beside it.
            let advice: Vec<&String> = summary.advice.iter().map(|advice| &advice.text).collect();
            let sent = json!({
                "batch": "b", "conclusion": summary.conclusion, "advice": advice, "evidence": {"links": []},
            });
            let [(said, _), _] = evidence_frames(&sent.to_string()).unwrap();
            let said: Json = serde_json::from_str(&said.data).unwrap();
            assert_eq!(
                (&said["conclusion"], &said["advice"]),
                (&sent["conclusion"], &sent["advice"]),
                "{file:?}"
            );
        }
    }

    #[test]
    fn walls_are_sent_once_and_those_without_a_place_never() {
        let (mut world, hub) = (world(), Hub::new());
        let wall = |x: f64| LineObstacle { start: Point { x, y: 0.0, z: 0.0 }, ..LineObstacle::default() };
        let walls = LineObstacles { obstacles: vec![wall(1.0), wall(f64::NAN)], ..LineObstacles::default() };
        let (_, mut frames) = hub.join();
        world.walls(&walls, &hub);
        world.walls(&walls, &hub);
        assert_eq!(frames.try_recv().unwrap().data.as_ref(), "[[1.0,0.0,0.0,0.0]]");
        assert!(frames.try_recv().is_err());
    }

    #[test]
    fn evidence_has_no_line_breaks_and_anything_else_is_left_out() {
        let good = "{\"batch\": \"a\\r\\nb\",\r\n \"evidence\": {\"links\": []}}";
        for (frame, _) in evidence_frames(good).expect("frames") {
            assert!(!frame.data.contains(['\r', '\n']), "{}", frame.data);
        }
        for bad in
            ["", "[]", "{\"batch\": 1, \"evidence\": {\"links\": []}}", "{\"batch\": \"a\"}", "no JSON\r\n"]
        {
            assert_eq!(evidence_frames(bad), None, "{bad}");
        }
        assert_eq!(evidence_frames(&format!("{good}{}", " ".repeat(MOST_EVIDENCE))), None);
    }

    #[test]
    fn conclusion_and_advice_are_kept_as_long_as_their_model_and_the_evidence_is_not() {
        let hub = Hub::new();
        for k in 0..50 {
            let text = json!({
                "batch": format!("batch_{k}"), "conclusion": ["Firm: a drives b."], "advice": ["Record longer."],
                "evidence": {"links": []},
            });
            let frames = evidence_frames(&text.to_string()).expect("frames");
            frames.into_iter().for_each(|(frame, keep)| hub.send(frame, keep));
        }
        let frames = hub.join().0;
        let of = |kind: &str| -> Vec<Json> {
            let frames = frames.iter().filter(|frame| frame.kind == kind);
            frames.map(|frame| serde_json::from_str(&frame.data).unwrap()).collect()
        };
        assert_eq!((of("summary").len(), of("evidence").len()), (50, 20));
        let first = &of("summary")[0];
        assert_eq!(first["batch"], "batch_0");
        assert_eq!(first["conclusion"], json!(["Firm: a drives b."]));
        assert_eq!(first["advice"], json!(["Record longer."]));
        // A stranger's sentences have a bound.
        let long = json!({"batch": "b", "conclusion": vec!["x".repeat(3000); 30], "evidence": {"links": []}});
        let [(summary, _), _] = evidence_frames(&long.to_string()).expect("frames");
        assert!(summary.data.len() < 21_000, "{}", summary.data.len());
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
        let stated: Vec<String> = hub.join().0.iter().map(|frame| frame.data.to_string()).collect();
        assert!(
            stated.len() == 2 && stated[0].contains("data: no messages") && stated[1].contains("batch 1"),
            "{stated:?}"
        );
    }
}
