//! Which people are recorded or shown: the parameter `sel_agent`.

use std::{collections::BTreeSet, fmt, str::FromStr};

use roscausal_msgs::{HumanState, geometry_msgs::Pose2D};

/// A selection of people (`sel_agent`): `1000`, `3,7`, `nearest:2`, `all`, `nobody`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Select {
    /// Everybody.
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

    /// The selected one of `people`: the first, for `nearest` the one who is nearest to the robot.
    ///
    /// Where the robot is `alone`, the first person takes the place of a single selected person who is not there, and (0, 0) that of a
    /// robot that has not been heard yet. One of several robots has nobody then: the person would be another's.
    pub fn one(&self, people: &[HumanState], robot: Option<&Pose2D>, alone: bool) -> Option<HumanState> {
        let (x, y) = robot.map_or((0.0, 0.0), |robot| (robot.x, robot.y));
        let distance = |person: &HumanState| libm::hypot(person.pose2d.x - x, person.pose2d.y - y);
        let stands_in = matches!(self, Self::Ids(ids) if ids.len() == 1) && alone;
        let chosen = match self {
            Self::Nearest(_) if robot.is_none() && !alone => None,
            Self::Nearest(_) => people.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))),
            _ => people.iter().find(|person| self.admits(person.id)),
        };
        chosen.or(people.first().filter(|_| stands_in)).cloned()
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
    fn the_one_who_is_shown_is_chosen_by_number_list_nearness_or_all() {
        let person =
            |id, x| HumanState { id, pose2d: Pose2D { x, ..Pose2D::default() }, ..HumanState::default() };
        let people = [person(1, 9.0), person(2, 1.0), person(3, 4.0)];
        let id = |text: &str, alone| {
            let select: Select = text.parse().expect(text);
            select.one(&people, Some(&Pose2D::default()), alone).map(|person| person.id)
        };
        for (text, one) in
            [("2", Some(2)), ("2,3", Some(2)), ("nearest:2", Some(2)), ("all", Some(1)), ("nobody", None)]
        {
            assert_eq!((id(text, true), id(text, false)), (one, one), "{text}");
        }
        let near = |alone| Select::Nearest(1).one(&people, None, alone).map(|person| person.id);
        assert_eq!((near(true), near(false)), (Some(2), None), "the robot has not been heard");
        assert_eq!((id("1000", true), id("1000", false), id("7,1000", true)), (Some(1), None, None));
    }
}
