//! Which people a node is about: `1000`, `1,2,3`, `nearest:2`, `all`.

use roscausal_msgs::{HumanState, geometry_msgs::Pose2D};

use crate::{Error, Result};

/// A choice among people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Agents {
    /// Everybody.
    All,
    /// These, by number; a single one that is not there is replaced by the first person.
    Ids(Vec<u32>),
    /// The nearest to the robot.
    Nearest(usize),
}

impl Agents {
    pub(crate) fn parse(parameter: &str, text: &str) -> Result<Self> {
        let fault = || {
            let allowed = "give a number, a list such as '1,2', 'nearest:N' or 'all'";
            Error::param(parameter, format!("'{text}' names nobody; {allowed}"))
        };
        let text = text.trim().trim_start_matches('[').trim_end_matches(']');
        match text.split_once(':') {
            Some(("nearest", n)) => match n.trim().parse() {
                Ok(n) if n > 0 => Ok(Self::Nearest(n)),
                _ => Err(fault()),
            },
            Some(_) => Err(fault()),
            None if text.is_empty() || text == "all" => Ok(Self::All),
            None => {
                let ids: std::result::Result<Vec<u32>, _> =
                    text.split(',').map(|id| id.trim().parse()).collect();
                ids.map(Self::Ids).map_err(|_| fault())
            }
        }
    }

    /// Those chosen, in ascending order of number (the nearest in order of distance).
    pub(crate) fn select(&self, people: &[HumanState], robot: Option<&Pose2D>) -> Vec<HumanState> {
        match self {
            Self::All => people.to_vec(),
            Self::Ids(ids) => {
                let chosen: Vec<HumanState> =
                    people.iter().filter(|p| ids.contains(&p.id)).cloned().collect();
                let only = ids.len() == 1 && chosen.is_empty();
                if only { people.first().cloned().into_iter().collect() } else { chosen }
            }
            Self::Nearest(n) => {
                let (x, y) = robot.map_or((0.0, 0.0), |robot| (robot.x, robot.y));
                let mut all = people.to_vec();
                let distance = |p: &HumanState| (p.pose2d.x - x).hypot(p.pose2d.y - y);
                all.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
                all.truncate(*n);
                all
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(id: u32, x: f64) -> HumanState {
        HumanState { id, pose2d: Pose2D { x, ..Pose2D::default() }, ..HumanState::default() }
    }

    fn ids(text: &str) -> Vec<u32> {
        let people = [person(1, 9.0), person(2, 1.0), person(3, 4.0)];
        let agents = Agents::parse("sel_agent", text).expect(text);
        agents.select(&people, Some(&Pose2D::default())).iter().map(|p| p.id).collect()
    }

    #[test]
    fn people_are_chosen_by_number_list_nearness_or_all() {
        assert_eq!(ids("2"), [2]);
        assert_eq!(ids("1,3"), [1, 3]);
        assert_eq!(ids("nearest:2"), [2, 3]);
        assert_eq!(ids("all"), [1, 2, 3]);
        assert_eq!(ids("1000"), [1]);
        assert!(Agents::parse("sel_agent", "bob").is_err());
    }
}
