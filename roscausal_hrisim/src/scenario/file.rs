//! Scenario files in TOML. An error names line and column of the field.

use std::path::Path;

use roscausal_core::{Error, Result, bounded};
use toml::de::{DeTable, DeValue};

use super::{SCENARIOS, Scenario};

impl Scenario {
    /// The built-in scenario `name`, or the one in the file `name` (`*.toml`).
    ///
    /// # Errors
    /// No such scenario or file, or a wrong field in it.
    pub fn load(name: &str) -> Result<Self> {
        if let Some(scenario) = Self::named(name) {
            return Ok(scenario);
        }
        let path = Path::new(name);
        if path.extension().is_none() && !path.exists() {
            let known = SCENARIOS.join(", ");
            let reason = format!("no scenario '{name}'; allowed: {known}, or the path of a .toml file");
            return Err(Error::param("scenario", reason));
        }
        Self::from_file(path)
    }

    /// Reads and checks a scenario file.
    ///
    /// # Errors
    /// A file that cannot be read, or a field that is unknown, of the wrong type or not allowed; with line and
    /// column.
    pub fn from_file(path: &Path) -> Result<Self> {
        Self::from_toml(&bounded::read_settings(path)?, path)
    }

    /// Reads and checks a scenario from text; `path` is only used in errors.
    ///
    /// # Errors
    /// As [`Scenario::from_file`].
    pub fn from_toml(text: &str, path: &Path) -> Result<Self> {
        let complain = |offset: Option<usize>, reason: &str| {
            let reason = reason.trim().replace('\n', "; ");
            let place = offset.map_or(String::new(), |offset| line_column(text, offset) + ": ");
            Error::file(path, place + &reason)
        };
        let mut scenario: Self = toml::from_str(text)
            .map_err(|error| complain(error.span().map(|span| span.start), error.message()))?;
        if scenario.name.is_empty() {
            scenario.name =
                path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        }
        match scenario.check() {
            Err(Error::Param { name, reason }) => {
                Err(complain(offset_of(text, &name), &format!("'{name}': {reason}")))
            }
            other => other.map(|()| scenario),
        }
    }
}

fn line_column(text: &str, offset: usize) -> String {
    let before = &text.as_bytes()[..offset.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let start = before.iter().rposition(|&byte| byte == b'\n').map_or(0, |newline| newline + 1);
    format!("line {line}, column {}", before.len() - start + 1)
}

/// The position in the text of the field with a path such as `people[0].walk.speed`, or of the deepest part of the
/// path that exists.
fn offset_of(text: &str, path: &str) -> Option<usize> {
    let table = DeTable::parse(text).ok()?;
    let mut found = None;
    let mut here: Option<&DeValue<'_>> = None;
    for part in path.split(['.', '[']) {
        let next = match (here, part.strip_suffix(']').map(str::parse::<usize>)) {
            (Some(DeValue::Array(items)), Some(Ok(index))) => items.get(index),
            (Some(DeValue::Table(fields)), _) => fields.get(part),
            (None, _) => table.get_ref().get(part),
            _ => None,
        };
        let Some(value) = next else { break };
        found = Some(value.span().start);
        here = Some(value.get_ref());
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(text: &str) -> String {
        Scenario::from_toml(text, Path::new("my.toml")).unwrap_err().to_string()
    }

    #[test]
    fn an_empty_file_is_thor() {
        let scenario = Scenario::from_toml("", Path::new("thor.toml")).unwrap();
        assert_eq!(scenario, Scenario::default());
    }

    #[test]
    fn every_builtin_scenario_is_sound_and_survives_a_file() {
        for name in SCENARIOS {
            let scenario = Scenario::named(name).unwrap();
            scenario.check().unwrap();
            let text = toml::to_string(&scenario).unwrap();
            assert_eq!(Scenario::from_toml(&text, Path::new("x.toml")).unwrap(), scenario, "{name}");
        }
    }

    #[test]
    fn a_wrong_field_is_named_with_line_and_allowed_values() {
        let cases = [
            ("plan = 'thor'\nspede = 1", "line 2, column 1", "unknown field `spede`"),
            ("plan = 'walk'", "line 1, column 8", "thor"),
            ("map = 'moon'", "line 1, column 7", "hall, corridor"),
            ("duration = nan", "line 1, column 12", "NaN is not allowed"),
            ("duration = -5.0", "line 1, column 12", "-5 is not allowed"),
            ("\n[[people]]\nwalk = { speed = 'x' }", "line 3", "invalid type"),
            ("[[people]]\nid = 7\nwalk.speed = 99.0", "line 3, column 14", "from 0.05 to 5"),
            ("[[people]]\nwalk.sped = 1.0", "line 2", "unknown field `sped`"),
            ("people = []", "line 1, column 10", "nobody to simulate"),
            ("[[robots]]\nwaypoints = [[0.0, 0.0], [9.9, 0.0]]", "line 2, column 26", "inside a wall"),
            ("[[robots]]\nwaypoints = [[0.0, 0.0], [19.0, 0.0]]", "line 2", "outside the walls"),
            (
                "walls = [[0.0, 0.0, 1.0, nan]]",
                "line 1",
                "NaN is not allowed; use a number from -10000 to 10000",
            ),
            ("walls = [[0.0, 0.0, 1e9, 0.0]]", "line 1", "use a number from -10000 to 10000"),
            (
                "interventions = ['robot.speed=0.2@60..90', 'robot.speed=0.3@80..100']",
                "line 1, column 44",
                "overlaps",
            ),
            ("interventions = ['robot.speed=0.2@-5..90']", "line 1", "0 or more"),
            ("interventions = ['human.goal=30,0@5..90']", "line 1", "outside the walls"),
            ("interventions = ['human[7].v=1@5..90']", "line 1", "allowed: 1000"),
            ("interventions = ['robot[a].off@5..90']", "line 1", "leave out the brackets"),
            ("robots = []\ninterventions = ['robot.off@5..90']", "line 2", "has no robot"),
            ("noise.person_speed = inf", "line 1", "inf is not allowed"),
        ];
        for (text, place, reason) in cases {
            let stated = complaint(text);
            assert!(
                stated.starts_with("my.toml: ") && stated.contains(place) && stated.contains(reason),
                "{stated}"
            );
            assert!(!stated.contains('\n'), "{stated}");
        }
    }

    #[test]
    fn goals_without_a_route_are_refused() {
        let text = "map = 'corridor_turn'\n[[robots]]\nwaypoints = [[-8.0, -8.0], [0.0, 5.0]]\n[[people]]\n\
                    areas = [[[-8.0, -8.0]], [[8.0, 8.0]]]";
        let stated = complaint(text);
        assert!(stated.contains("line 3") && stated.contains("no route from"), "{stated}");
    }

    #[test]
    fn an_unknown_scenario_lists_the_known_ones() {
        let stated = Scenario::load("thorr").unwrap_err().to_string();
        assert!(stated.contains("pass_by_the_centre"), "{stated}");
    }
}
