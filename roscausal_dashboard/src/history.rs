//! The whole run, for whoever looks back or comes late: one moment at a time, or all of it as series.
//!
//! It stays within a size however long the run is: when it is full, every second moment is dropped, and from then on
//! the moments kept are twice as far apart.

use roscausal_core::nodes::SceneOptions;
use serde_json::{Value as Json, json};

use crate::moment::Moment;

/// Time between two moments at first, seconds.
const EVERY_S: f64 = 0.1;
/// Most bodies in all moments together: about 16 MB.
const MOST_BODIES: usize = 400_000;
/// Most rows of the series that one page gets.
const MOST_ROWS: usize = 3_000;
/// Length of a trail, seconds.
const TRAIL_S: f64 = 8.0;
/// Most dots of a trail.
const MOST_DOTS: usize = 60;
/// If time goes back by more than this, a new run has begun. Seconds.
pub(crate) const NEW_RUN_S: f64 = 1.0;

/// The moments of a run, oldest first.
pub(crate) struct History {
    view: SceneOptions,
    moments: Vec<Moment>,
    every: f64,
    bodies: usize,
}

impl History {
    pub(crate) fn new(view: SceneOptions) -> Self {
        Self { view, moments: Vec::new(), every: EVERY_S, bodies: 0 }
    }

    /// What is shown: whose risk, and how wide the cone is.
    pub(crate) fn show(&mut self, view: SceneOptions) {
        self.view = view;
    }

    /// Whether a moment at `t` would be kept.
    pub(crate) fn is_due(&self, t: f64) -> bool {
        // Stamps have rounding errors, and a step of exactly 0.1 s is due.
        self.moments.last().is_none_or(|last| t < last.t - NEW_RUN_S || t - last.t > 0.999 * self.every)
    }

    pub(crate) fn push(&mut self, moment: Moment) {
        if self.moments.last().is_some_and(|last| moment.t < last.t - NEW_RUN_S) {
            *self = Self::new(self.view.clone());
        }
        self.bodies += moment.bodies();
        self.moments.push(moment);
        while self.bodies > MOST_BODIES && self.moments.len() > 2 {
            let mut keep = false;
            self.moments.retain(|_| {
                keep = !keep;
                keep
            });
            self.every *= 2.0;
            self.bodies = self.moments.iter().map(Moment::bodies).sum();
        }
    }

    /// The scene at `t`, or the one before it, with the trails that lead to it; null if there is none.
    pub(crate) fn scene(&self, t: f64, person: Option<u32>) -> Json {
        // A recorded stamp may be rounded on its way to the page and back.
        let after = self.moments.partition_point(|moment| moment.t <= t + 1e-4);
        let Some(moment) = self.moments.get(after.saturating_sub(1)) else { return Json::Null };
        let first = self.moments.partition_point(|past| past.t < moment.t - TRAIL_S);
        let past = &self.moments[first..after.max(first)];
        let stride = past.len().div_ceil(MOST_DOTS).max(1);
        let dots: Vec<_> = past.iter().step_by(stride).map(|past| past.dots(&self.view, person)).collect();
        let trail = |who: usize| dots.iter().filter_map(|dots| dots[who]).collect::<Vec<_>>();
        let mut json = moment.json(&self.view, person);
        json["trails"] = json!({"robot": trail(0), "person": trail(1)});
        json
    }

    /// The variables over the whole run, evenly thinned: rows of time and values, null where unknown.
    pub(crate) fn series(&self, person: Option<u32>) -> Json {
        let stride = self.moments.len().div_ceil(MOST_ROWS).max(1);
        let rows = self.moments.iter().step_by(stride).map(|moment| moment.row(&self.view, person));
        json!({
            "first": self.moments.first().map(|moment| moment.t),
            "last": self.moments.last().map(|moment| moment.t),
            "rows": rows.map(|row| json!(row)).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use roscausal_core::Time;
    use roscausal_msgs::{HumanState, Humans, RobotState};

    use super::*;

    fn moment(t: f64, people: u32) -> Moment {
        let person = |id| {
            let mut person = HumanState { id, ..HumanState::default() };
            person.pose2d.x = t;
            person.twist.linear.x = f64::from(id);
            person
        };
        let humans = Humans { humans: (1..=people).map(person).collect(), ..Humans::default() };
        let mut robot = RobotState::default();
        robot.pose2d.y = 3.0;
        Moment::new(Time::from_secs_f64(t), Some(&robot), &humans)
    }

    fn run(seconds: u32, people: u32) -> History {
        let mut history = History::new(SceneOptions::default());
        for tick in 0..seconds * 10 {
            let t = f64::from(tick) / 10.0;
            if history.is_due(t) {
                history.push(moment(t, people));
            }
        }
        history
    }

    #[test]
    fn a_moment_of_the_past_has_its_scene_and_the_trail_that_leads_to_it() {
        let history = run(60, 2);
        let scene = history.scene(20.05, Some(2));
        assert_eq!((scene["t"].as_f64(), scene["person"].as_u64()), (Some(20.0), Some(2)));
        assert_eq!(scene["people"][0]["x"].as_f64(), Some(20.0));
        let trail = scene["trails"]["person"].as_array().unwrap();
        assert!(trail.len() > 30 && trail.len() <= MOST_DOTS, "{}", trail.len());
        assert_eq!(trail[0][0].as_f64(), Some(12.0));
        // Before the first moment there is only the first; without any moment there is nothing.
        assert_eq!(history.scene(-5.0, None)["t"].as_f64(), Some(0.0));
        assert!(History::new(SceneOptions::default()).scene(1.0, None).is_null());
    }

    #[test]
    fn an_hour_with_a_hundred_people_fits_from_its_first_moment_to_its_last() {
        let history = run(3600, 100);
        assert!(history.bodies <= MOST_BODIES);
        let series = history.series(Some(7));
        assert_eq!(series["first"].as_f64(), Some(0.0));
        assert!(series["last"].as_f64().unwrap() > 3595.0);
        let rows = series["rows"].as_array().unwrap();
        assert!((1_000..=MOST_ROWS).contains(&rows.len()), "{}", rows.len());
        assert!(rows.iter().all(|row| row[1].as_f64() == Some(7.0)), "the speed of the person chosen");
    }

    #[test]
    fn a_run_that_starts_again_has_a_history_of_its_own() {
        let mut history = run(30, 1);
        assert!(history.is_due(0.0));
        history.push(moment(0.0, 1));
        assert_eq!(history.series(None)["rows"].as_array().map(Vec::len), Some(1));
    }
}
