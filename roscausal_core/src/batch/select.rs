//! Which people are recorded or shown: the parameter `sel_agent`.

use std::{collections::BTreeSet, fmt, str::FromStr};

use roscausal_msgs::{HumanState, geometry_msgs::Pose2D};

/// A selection of people (`sel_agent`): `1000`, `3,7`, `nearest:2`, `all`, `nobody`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Select {
    /// Everybody.
    #[default]
    All,
    /// The people with these ids.
    Ids(BTreeSet<u32>),
    /// The `N` people who are nearest to the robot in most rows of a batch.
    Nearest(usize),
    /// Nobody: only the robot and signals are recorded, whichever there are.
    Nobody,
}

impl Select {
    /// Whether this person may be recorded.
    pub fn admits(&self, id: u32) -> bool {
        match self {
            Self::Ids(ids) => ids.contains(&id),
            Self::All | Self::Nearest(_) => true,
            Self::Nobody => false,
        }
    }

    /// The selected ones of `people`, in ascending order of id; for `nearest`, in order of distance from the robot.
    /// If a single person is selected who is not there, the first person who is there takes their place.
    pub fn of(&self, people: &[HumanState], robot: Option<&Pose2D>) -> Vec<HumanState> {
        match self {
            Self::All => people.to_vec(),
            Self::Nobody => Vec::new(),
            Self::Ids(ids) => {
                let chosen: Vec<HumanState> =
                    people.iter().filter(|person| ids.contains(&person.id)).cloned().collect();
                let only = ids.len() == 1 && chosen.is_empty();
                if only { people.first().cloned().into_iter().collect() } else { chosen }
            }
            Self::Nearest(number) => {
                let (x, y) = robot.map_or((0.0, 0.0), |robot| (robot.x, robot.y));
                let mut all = people.to_vec();
                let distance = |person: &HumanState| (person.pose2d.x - x).hypot(person.pose2d.y - y);
                all.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
                all.truncate(*number);
                all
            }
        }
    }
}

impl FromStr for Select {
    type Err = String;

    /// `all`, `nobody`, `nearest:N`, an id, or several separated by commas.
    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = "all, nobody, nearest:N (such as nearest:2), an id, or ids such as 3,7";
        let fault = || format!("'{text}' names nobody; allowed: {allowed}");
        let text = text.trim().trim_matches(['[', ']']);
        if text.eq_ignore_ascii_case("all") || text.is_empty() {
            return Ok(Self::All);
        }
        if text.eq_ignore_ascii_case("nobody") {
            return Ok(Self::Nobody);
        }
        if let Some(number) = text.strip_prefix("nearest:") {
            return match number.trim().parse() {
                Ok(number) if number > 0 => Ok(Self::Nearest(number)),
                _ => Err(fault()),
            };
        }
        let ids: Result<BTreeSet<u32>, _> = text.split(',').map(|id| id.trim().parse()).collect();
        ids.map(Self::Ids).map_err(|_| fault())
    }
}

impl fmt::Display for Select {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::Nobody => f.write_str("nobody"),
            Self::Nearest(number) => write!(f, "nearest:{number}"),
            Self::Ids(ids) => f.write_str(&ids.iter().map(u32::to_string).collect::<Vec<_>>().join(",")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_selected_by_id_by_distance_or_all() {
        assert_eq!("1000".parse(), Ok(Select::Ids([1000].into())));
        assert_eq!("[3, 7]".parse(), Ok(Select::Ids([3, 7].into())));
        assert_eq!("nearest:2".parse(), Ok(Select::Nearest(2)));
        assert_eq!("all".parse(), Ok(Select::All));
        for select in [Select::All, Select::Nobody, Select::Nearest(2), Select::Ids([3, 7].into())] {
            assert_eq!(select.to_string().parse(), Ok(select));
        }
        assert!("nearest:0".parse::<Select>().is_err());
        assert!("bob".parse::<Select>().expect_err("no id").contains("allowed: all, nobody, nearest:N"));
    }

    #[test]
    fn people_who_are_there_are_chosen_by_number_list_nearness_or_all() {
        let person =
            |id, x| HumanState { id, pose2d: Pose2D { x, ..Pose2D::default() }, ..HumanState::default() };
        let people = [person(1, 9.0), person(2, 1.0), person(3, 4.0)];
        let ids = |text: &str| -> Vec<u32> {
            let select: Select = text.parse().expect(text);
            select.of(&people, Some(&Pose2D::default())).iter().map(|person| person.id).collect()
        };
        assert_eq!(ids("2"), [2]);
        assert_eq!(ids("1,3"), [1, 3]);
        assert_eq!(ids("nearest:2"), [2, 3]);
        assert_eq!(ids("all"), [1, 2, 3]);
        assert_eq!(ids("1000"), [1]);
    }
}
