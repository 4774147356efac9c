//! Interventions: `do(robot.speed = x)`, `do(human.v = x)`, `do(human.goal = x, y)`, `robot off`, each from a start
//! to an end.
//!
//! They are written `robot.speed=0.2@60..90`, `human.v=1.0@10..20`, `human.goal=3,-4@0..30`, `robot.off@100..`.
//! With `robot[NAME]` or `human[ID]` an intervention concerns only that one. Times are seconds of simulated time.
//! Without an end it lasts for ever; without `@` it starts at once.

use std::{fmt, str::FromStr};

use roscausal_core::ensure;
use serde::{Deserialize, Serialize};

use crate::geometry::Vec2;

const FORMS: &str =
    "use robot.speed=0.2@60..90, robot.off@60..90, human.v=1.0@60..90 or human.goal=3,-4@60..90";

/// What is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// The robot's top speed, m/s.
    RobotSpeed(f64),
    /// The robot stands still.
    RobotOff,
    /// The person's speed, m/s, whatever they intend.
    HumanV(f64),
    /// The person's goal, in the map frame.
    HumanGoal(Vec2),
}

/// One intervention.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Intervention {
    /// What is set, and its value.
    pub target: Target,
    /// Robot name or person id; `None`: all of them.
    pub who: Option<String>,
    /// First moment, seconds.
    pub start: f64,
    /// First moment after it, seconds; infinite if it has no end.
    pub end: f64,
}

impl Intervention {
    /// Whether it is active: from `start` on, before `end`.
    pub fn is_active(&self, time: f64) -> bool {
        time >= self.start && time < self.end
    }

    /// Whether it concerns the robot or person of this name.
    pub(crate) fn concerns(&self, who: &str) -> bool {
        self.who.as_deref().is_none_or(|name| name == who)
    }

    /// Name of its context column, such as `do_robot_speed` or `do_human_v_1001`. A speed of 0 has a column of its
    /// own, in which 1 means "imposed", because 0 in a column of speeds means "not imposed".
    pub fn column(&self) -> String {
        let what = match self.target {
            Target::RobotOff | Target::RobotSpeed(0.0) => "do_robot_off",
            Target::RobotSpeed(_) => "do_robot_speed",
            Target::HumanV(0.0) => "do_human_stop",
            Target::HumanV(_) => "do_human_v",
            Target::HumanGoal(_) => "do_human_goal",
        };
        self.who.as_ref().map_or_else(|| what.to_owned(), |who| format!("{what}_{who}"))
    }

    /// The value of its context column while it is active.
    pub fn value(&self) -> Vec<f64> {
        match self.target {
            Target::RobotOff => vec![1.0],
            Target::RobotSpeed(x) | Target::HumanV(x) => vec![if x == 0.0 { 1.0 } else { x }],
            Target::HumanGoal(goal) => vec![goal.x, goal.y],
        }
    }

    /// Whether both set the same thing of the same robot or person at some moment.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        use Target::{HumanGoal, HumanV, RobotOff, RobotSpeed};
        let same = matches!(
            (self.target, other.target),
            (RobotSpeed(_) | RobotOff, RobotSpeed(_) | RobotOff)
                | (HumanV(_), HumanV(_))
                | (HumanGoal(_), HumanGoal(_))
        );
        let shared = if let (Some(one), Some(two)) = (&self.who, &other.who) { one == two } else { true };
        same && shared && self.start < other.end && other.start < self.end
    }
}

impl FromStr for Intervention {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let bad = |why: &str| format!("intervention '{text}': {why}; {FORMS}");
        let (order, times) = text.split_once('@').map_or((text, "0.."), |(order, times)| (order, times));
        let (name, value) = order.split_once('=').unzip();
        let (name, value) = (name.unwrap_or(order).trim(), value.map(str::trim));
        let (subject, field) =
            name.rsplit_once('.').or_else(|| name.rsplit_once(' ')).ok_or_else(|| bad("no field"))?;
        let (subject, who) = match subject.split_once('[') {
            None => (subject, None),
            Some((subject, rest)) => {
                let who = rest.strip_suffix(']').ok_or_else(|| bad("'[' without ']'"))?;
                (subject, Some(who.to_owned()))
            }
        };
        let number = |text: &str, what: &str| match text.trim().parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(bad(&format!("{what} '{text}' is not a finite number"))),
        };
        let speed = || {
            let v = number(value.unwrap_or(""), "the speed")?;
            if (0.0..=5.0).contains(&v) { Ok(v) } else { Err(bad("a speed is from 0 to 5 m/s")) }
        };
        let target = match (subject, field, value) {
            ("robot", "speed", _) => Target::RobotSpeed(speed()?),
            ("robot", "off", None) => Target::RobotOff,
            ("human", "v", _) => Target::HumanV(speed()?),
            ("human", "goal", Some(goal)) => {
                let (x, y) = goal.split_once(',').ok_or_else(|| bad("a goal is x,y"))?;
                Target::HumanGoal(Vec2::new(number(x, "x")?, number(y, "y")?))
            }
            _ => return Err(bad("there is nothing of that name to set")),
        };
        let (start, end) = times.split_once("..").ok_or_else(|| bad("times are start..end"))?;
        let start = number(if start.trim().is_empty() { "0" } else { start }, "the start")?;
        let end = if end.trim().is_empty() { f64::INFINITY } else { number(end, "the end")? };
        ensure(start >= 0.0, || bad("the start is 0 or more seconds"))?;
        ensure(end > start, || bad("the end comes after the start"))?;
        Ok(Self { target, who, start, end })
    }
}

impl fmt::Display for Intervention {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let who = self.who.as_ref().map_or_else(String::new, |who| format!("[{who}]"));
        match self.target {
            Target::RobotSpeed(x) => write!(out, "robot{who}.speed={x}")?,
            Target::RobotOff => write!(out, "robot{who}.off")?,
            Target::HumanV(x) => write!(out, "human{who}.v={x}")?,
            Target::HumanGoal(goal) => write!(out, "human{who}.goal={},{}", goal.x, goal.y)?,
        }
        write!(out, "@{}..", self.start)?;
        if self.end.is_finite() { write!(out, "{}", self.end) } else { Ok(()) }
    }
}

impl TryFrom<String> for Intervention {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Intervention> for String {
    fn from(one: Intervention) -> Self {
        one.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_is_read_and_written_back() {
        for text in [
            "robot.speed=0.2@60..90",
            "robot[robot1].speed=0@0..",
            "robot.off@1.5..2",
            "human.v=1.25@10..20",
            "human[1001].goal=3,-4.5@0..30",
        ] {
            assert_eq!(text.parse::<Intervention>().unwrap().to_string(), text);
        }
        let short: Intervention = "robot off".parse().unwrap();
        assert_eq!((short.target, short.start, short.end), (Target::RobotOff, 0.0, f64::INFINITY));
    }

    #[test]
    fn a_speed_of_zero_is_told_apart_from_no_intervention() {
        let of = |text: &str| {
            let one: Intervention = text.parse().unwrap();
            (one.column(), one.value())
        };
        assert_eq!(of("robot.speed=0@1..2"), ("do_robot_off".to_owned(), vec![1.0]));
        assert_eq!(of("robot[a].off@1..2"), ("do_robot_off_a".to_owned(), vec![1.0]));
        assert_eq!(of("human[7].v=0@1..2"), ("do_human_stop_7".to_owned(), vec![1.0]));
        assert_eq!(of("human.v=1.5@1..2"), ("do_human_v".to_owned(), vec![1.5]));
        assert_eq!(of("human.goal=0,-2@1..2"), ("do_human_goal".to_owned(), vec![0.0, -2.0]));
    }

    #[test]
    fn interventions_from_a_list_are_added_and_checked() {
        let mut scenario = crate::Scenario::default();
        let texts = ["human.goal=3", "-4@0..30", "robot.off@5..6"].map(str::to_owned);
        scenario.add_interventions(&texts).unwrap();
        let written: Vec<String> = scenario.interventions.iter().map(Intervention::to_string).collect();
        assert_eq!(written, ["human.goal=3,-4@0..30", "robot.off@5..6"]);
        let stated = scenario.add_interventions(&["robot.fly".to_owned()]).unwrap_err().to_string();
        assert!(stated.contains("'do'") && stated.contains("robot.speed"), "{stated}");
    }

    #[test]
    fn what_is_wrong_is_said() {
        let cases = [
            ("robot.speed", "the speed '' is not"),
            ("robot.speed=fast@1..2", "'fast' is not a finite number"),
            ("robot.speed=NaN@1..2", "not a finite number"),
            ("robot.speed=-1@1..2", "from 0 to 5"),
            ("robot.sped=1@1..2", "nothing of that name"),
            ("human.goal=1@1..2", "x,y"),
            ("human.v=1@2", "start..end"),
            ("human.v=1@-2..5", "0 or more"),
            ("human.v=1@5..5", "after the start"),
            ("human[3.v=1@5..6", "without ']'"),
            ("", "no field"),
        ];
        for (text, reason) in cases {
            let stated = text.parse::<Intervention>().unwrap_err();
            assert!(stated.contains(reason) && stated.contains("use robot.speed"), "{text}: {stated}");
        }
    }

    #[test]
    fn overlap_means_the_same_thing_of_the_same_one_at_the_same_time() {
        let overlap = |a: &str, b: &str| {
            a.parse::<Intervention>().unwrap().overlaps(&b.parse::<Intervention>().unwrap())
        };
        assert!(overlap("robot.speed=1@0..10", "robot.off@9..12"));
        assert!(overlap("human[1].v=1@0..10", "human.v=2@5.."));
        assert!(!overlap("robot.speed=1@0..10", "robot.speed=2@10..12"));
        assert!(!overlap("robot[a].speed=1@0..10", "robot[b].speed=2@0..10"));
        assert!(!overlap("human.v=1@0..10", "human.goal=2,2@0..10"));
    }
}
