use std::{collections::BTreeSet, fmt, str::FromStr};

/// Which people are recorded (`sel_agent`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Select {
    /// Everybody.
    All,
    /// These.
    Ids(BTreeSet<u32>),
    /// The `N` people who are nearest to the robot in most rows of a batch.
    Nearest(usize),
}

impl Select {
    /// Whether this person may be recorded.
    pub fn admits(&self, id: u32) -> bool {
        match self {
            Self::Ids(ids) => ids.contains(&id),
            Self::All | Self::Nearest(_) => true,
        }
    }
}

impl FromStr for Select {
    type Err = String;

    /// `all`, `nearest:N`, an id, or several separated by commas.
    fn from_str(text: &str) -> Result<Self, String> {
        let fault = || {
            format!(
                "'{text}' names nobody; allowed: all, nearest:N (such as nearest:2), an id, or ids such as 3,7"
            )
        };
        let text = text.trim().trim_matches(['[', ']']);
        if text.eq_ignore_ascii_case("all") || text.is_empty() {
            return Ok(Self::All);
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
        for select in [Select::All, Select::Nearest(2), Select::Ids([3, 7].into())] {
            assert_eq!(select.to_string().parse(), Ok(select));
        }
        assert!("nearest:0".parse::<Select>().is_err());
        assert!("bob".parse::<Select>().expect_err("no id").contains("allowed: all, nearest:N"));
    }
}
