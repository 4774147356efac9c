//! The built-in post-processing: from recorded states to the paper's variables, or to features that the user
//! defines.

use std::{cell::Cell, collections::BTreeMap};

use roscausal_discovery::names::plain;

use super::{
    expression::{Expression, Moment, Who},
    range::possible,
    recording::{Column, Recording},
    risk::{Body, RiskModel, risk_exponent},
    tracks::Values,
};
use crate::{Error, Result, ensure, grammar::rejoined, mix};

/// Larger exponents of the risk cannot be: bodies would have to meet at more than 5 m/s at a distance of 0.1 m. The cell is
/// emptied and counted.
const LARGEST_EXPONENT: f64 = 50.0;

/// What to compute, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Postprocess {
    /// The version of the risk.
    pub risk_model: RiskModel,
    /// Each `risk(...)` in a row is that of this many rows earlier (0 or 1; the published result used 1); nothing else is
    /// lagged.
    pub risk_lag: usize,
    /// Standard deviation of the noise on the risk's exponent.
    pub risk_noise: f64,
    /// Seed of that noise.
    pub seed: u64,
    /// Radius that is added around the robot, metres.
    pub obs_size: f64,
    /// Distance beyond which nobody is on collision course, metres.
    pub safe_dist: f64,
    /// What a person may collide with: the robot, or the nearest of robots and people.
    pub obstacle: Obstacle,
    /// The features.
    pub features: Vec<Feature>,
}

/// The obstacle that the risk is computed for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Obstacle {
    /// The robot, as in the paper.
    #[default]
    Robot,
    /// The nearest of all robots and other people in the batch.
    Nearest,
}

roscausal_discovery::words!(Obstacle, "obstacle": Robot "robot", Nearest "nearest");

/// A named expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Column name.
    pub name: String,
    /// Its definition.
    pub expression: Expression,
}

/// The features of a batch, for each person if there are several.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// One entry per feature (and person), each with one value per row.
    pub columns: Vec<Column>,
    /// Cells that were emptied because they held what cannot be, by column: recorded ones (`h_7_v`) and risks.
    pub emptied: BTreeMap<String, usize>,
}

impl Feature {
    /// A feature from its name and expression.
    ///
    /// # Errors
    /// A bad name or expression, as an error of this parameter.
    pub fn new(parameter: &str, name: &str, text: &str) -> Result<Self> {
        let legal = |c: char| c.is_alphanumeric() || "_-.{}\\".contains(c);
        let name = name.trim();
        Error::ensure(!name.is_empty() && name.chars().all(legal) && name != "time", parameter, || {
            format!("'{name}' is not a valid feature name; use letters, digits and '_', such as h_dg = ...")
        })?;
        let expression = Expression::parse(text.trim())
            .map_err(|reason| Error::param(parameter, format!("{name} = {reason}")))?;
        Ok(Self { name: name.to_owned(), expression })
    }

    /// The paper's three features, called `names`.
    ///
    /// # Errors
    /// A number of `names` other than three, a duplicate or a bad name.
    pub fn defaults(names: &[String]) -> Result<Vec<Self>> {
        let [v, dg, risk] = names else {
            let reason =
                format!("{} names given; three are needed: speed, distance to goal, risk", names.len());
            return Err(Error::param("feature_names", reason));
        };
        let items = [(v, "h.v"), (dg, "dist(h, h.goal)"), (risk, "risk(h, r)")];
        let feature = |(name, text): (&String, &str)| Self::new("feature_names", name, text);
        Self::distinct("feature_names", items.into_iter().map(feature).collect())
    }

    /// Parses the features of a parameter (`name = expression` each). An item without `=` continues the previous one, so a list that
    /// was split at commas is whole again.
    ///
    /// # Errors
    /// A bad definition, or a duplicate name.
    pub fn parse(parameter: &str, items: &[String]) -> Result<Vec<Self>> {
        let definitions = rejoined(items, |item| item.contains('='));
        let parse = |definition: &String| match definition.split_once('=') {
            Some((name, text)) => Self::new(parameter, name, text),
            None => {
                Err(Error::param(parameter, format!("'{definition}' has no '='; write name = expression")))
            }
        };
        Self::distinct(parameter, definitions.iter().map(parse).collect())
    }

    fn distinct(parameter: &str, features: Result<Vec<Self>>) -> Result<Vec<Self>> {
        let features = features?;
        for (i, feature) in features.iter().enumerate() {
            ensure(features[..i].iter().all(|other| plain(&other.name) != plain(&feature.name)), || {
                Error::param(parameter, format!("'{}' is defined twice", feature.name))
            })?;
        }
        Ok(features)
    }
}

impl Postprocess {
    /// Computes the features of a batch.
    ///
    /// # Errors
    /// A batch without people, if a feature is about a person.
    pub fn run(&self, batch: &Recording) -> Result<Features> {
        let of_person = self.features.iter().find(|feature| feature.expression.mentions_human());
        if let Some(feature) = of_person.filter(|_| batch.people.is_empty()) {
            let reason = format!("nobody is in the batch, but '{}' tells of a person", feature.name);
            return Err(Error::Data(reason));
        }
        Ok(self.features_of(batch, 0, batch.people.len() > 1))
    }

    /// The same of the newest row alone, while a batch is recorded: each column's name and value. `tail` has the row and, where there
    /// is one, the row before it; `first` is the place of the tail's first row in its batch. With `by_id` names carry the person's id.
    pub fn newest(&self, tail: &Recording, first: usize, by_id: bool) -> Vec<(String, f64)> {
        let value = |column: Column| (column.name, column.values.last().copied().unwrap_or(f64::NAN));
        self.features_of(tail, first, by_id).columns.into_iter().map(value).collect()
    }

    /// The features of `batch`, whose first row is row `first` of the batch that it began; `by_id`: names carry the person's id.
    fn features_of(&self, batch: &Recording, first: usize, by_id: bool) -> Features {
        let (batch, mut emptied) = possible(batch);
        let mut columns = Vec::new();
        for feature in &self.features {
            if !feature.expression.mentions_human() {
                columns.push(self.column(feature, feature.name.clone(), (&batch, first), None, &mut emptied));
                continue;
            }
            for (id, rows) in &batch.people {
                let name = if by_id { name_for(&feature.name, *id) } else { feature.name.clone() };
                columns.push(self.column(feature, name, (&batch, first), Some((*id, rows)), &mut emptied));
            }
        }
        columns.extend(batch.signal_columns());
        columns.extend(batch.context_columns());
        Features { columns, emptied }
    }

    /// One column of `batch`, whose first row is row `first` of the batch that it began.
    fn column(
        &self,
        feature: &Feature,
        name: String,
        (batch, first): (&Recording, usize),
        person: Option<(u32, &Vec<Values>)>,
        emptied: &mut BTreeMap<String, usize>,
    ) -> Column {
        let impossible = Cell::new(0);
        let id = person.map_or(0, |(id, _)| u64::from(id));
        let stream = mix(self.seed ^ mix(batch.start.as_nanos() as u64) ^ mix(id.wrapping_add(1)));
        let human = |row: usize| person.and_then(|(_, rows)| rows.get(row)).unwrap_or(&Values::UNKNOWN);
        let risk = |row: usize, a: Who, b: Who| {
            let index = (first + row) as u64;
            let noise = if self.risk_noise > 0.0 { self.risk_noise * normal(stream, index) } else { 0.0 };
            let [a, b] = [a, b].map(|who| match who {
                Who::Human => human(row).body(),
                Who::Robot => batch.robot[row].body(),
            });
            let nearest = match self.obstacle {
                Obstacle::Robot => b,
                Obstacle::Nearest => nearest(&a, &b, batch, row, person.map(|(id, _)| id)),
            };
            let exponent = risk_exponent(&a, &nearest, self.risk_model, self.obs_size, self.safe_dist);
            if exponent > LARGEST_EXPONENT {
                impossible.set(impossible.get() + 1);
                return f64::NAN;
            }
            // The noise is small beside the bound.
            libm::exp(exponent + noise)
        };
        let late_risk =
            |row: usize, a, b| row.checked_sub(self.risk_lag).map_or(f64::NAN, |earlier| risk(earlier, a, b));
        let value = |row: usize| {
            feature.expression.value(&BatchRow { row, first, batch, people: &human, risk: &late_risk })
        };
        let values = (0..batch.n_rows()).map(value).collect();
        if impossible.get() > 0 {
            *emptied.entry(name.clone()).or_default() += impossible.get();
        }
        Column { name, unit: feature.expression.unit(), values }
    }
}

/// A row of a batch, and the person it is about.
struct BatchRow<'a> {
    row: usize,
    /// Place of the first row in the batch that it began.
    first: usize,
    batch: &'a Recording,
    people: &'a dyn Fn(usize) -> &'a Values,
    risk: &'a dyn Fn(usize, Who, Who) -> f64,
}

impl Moment for BatchRow<'_> {
    fn time(&self) -> f64 {
        self.batch.stamp(self.first + self.row).as_secs_f64()
    }

    fn body(&self, who: Who) -> &Values {
        match who {
            Who::Human => (self.people)(self.row),
            Who::Robot => &self.batch.robot[self.row],
        }
    }

    fn risk(&self, a: Who, b: Who) -> f64 {
        (self.risk)(self.row, a, b)
    }

    fn earlier(&self, rows: usize) -> Option<Self> {
        Some(Self { row: self.row.checked_sub(rows)?, ..*self })
    }
}

/// The body nearest to `a` among `b`, the other robots, and all people except `person`.
fn nearest(a: &Body, b: &Body, batch: &Recording, row: usize, person: Option<u32>) -> Body {
    let people = batch.people.iter().filter(|(id, _)| Some(**id) != person).map(|(_, rows)| rows);
    let known = batch.others.values().chain(people).filter_map(|rows| rows.get(row)).map(Values::body);
    let distance = |other: &Body| libm::hypot(other.x - a.x, other.y - a.y);
    // Bodies that are absent or have no heading are not obstacles.
    let bodies =
        std::iter::once(*b).chain(known).filter(|other| distance(other).is_finite() && other.vx.is_finite());
    bodies.min_by(|one, two| distance(one).total_cmp(&distance(two))).unwrap_or(*b)
}

/// The name of a feature if there are several people: `h_v` becomes `h_7_v`.
fn name_for(name: &str, id: u32) -> String {
    name.strip_prefix("h_").map_or_else(|| format!("{name}_{id}"), |rest| format!("h_{id}_{rest}"))
}

/// A standard normal number; it depends on stream and index only (Box and Muller 1958).
fn normal(stream: u64, index: u64) -> f64 {
    let uniform =
        |salt: u64| ((mix(stream ^ mix(2 * index + salt)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    (-2.0 * libm::log(uniform(0))).sqrt() * libm::cos(std::f64::consts::TAU * uniform(1))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::Time;

    fn settings() -> Postprocess {
        let names = ["h_v", "h_dg", "h_risk"].map(str::to_owned);
        Postprocess {
            risk_model: RiskModel::V1_1,
            risk_lag: 0,
            risk_noise: 0.0,
            seed: 1,
            obs_size: 2.0,
            safe_dist: 5.0,
            obstacle: Obstacle::Robot,
            features: Feature::defaults(&names).expect("the paper's"),
        }
    }

    /// Somebody on the x axis, without a goal.
    fn at_x(x: f64, theta: f64, v: f64) -> Values {
        Values { x, y: 0.0, theta, v, omega: 0.0, ..Values::UNKNOWN }
    }

    /// The robot at rest at (4, 0). People at the origin walk along x and have their goal at (3, 4).
    fn batch(ids: &[u32], speeds: &[f64]) -> Recording {
        let person = |v: &f64| Values::from_array([3.0, 4.0, 0.0, 0.0, 0.0, *v, 0.0]);
        Recording {
            start: Time::from_secs_f64(1.0),
            dt_ns: 100_000_000,
            frame: "map".into(),
            robot: vec![at_x(4.0, 0.0, 0.0); speeds.len()],
            people: ids
                .iter()
                .map(|id| (*id, speeds.iter().map(person).collect()))
                .collect::<BTreeMap<_, _>>(),
            others: BTreeMap::new(),
            context: BTreeMap::new(),
            signals: Vec::new(),
            complete: true,
            ended_by: None,
            length_s: None,
        }
    }

    #[test]
    fn the_nearest_robot_or_person_can_be_the_obstacle() {
        // The robot is 4 m ahead of person 3. Person 7 comes towards them from 1.5 m. Robot2 stands at 3 m.
        let mut crowd = batch(&[3], &[1.0]);
        crowd.people.insert(7, vec![at_x(1.5, std::f64::consts::PI, 1.0)]);
        crowd.others.insert("robot2".into(), vec![at_x(3.0, 0.0, 0.0)]);
        let risk = |obstacle, batch: &Recording| {
            let features = Postprocess { obstacle, ..settings() }.run(batch).expect("computes").columns;
            features.iter().find(|column| column.name.ends_with("risk")).expect("a risk").values[0].ln()
        };
        let of = |v_rel: f64, d: f64| 0.1 + v_rel / d + 2.0 / d.hypot(2.0);
        assert!((risk(Obstacle::Robot, &crowd) - of(1.0, 4.0)).abs() < 1e-12);
        assert!((risk(Obstacle::Nearest, &crowd) - of(2.0, 1.5)).abs() < 1e-12);
        crowd.people.remove(&7);
        assert!((risk(Obstacle::Nearest, &crowd) - of(1.0, 3.0)).abs() < 1e-12);
    }

    #[test]
    fn what_is_imposed_stands_beside_the_features() {
        let mut imposed = batch(&[3], &[1.0, 1.0]);
        imposed.context.insert("do_human_v".into(), vec![vec![], vec![1.0]]);
        let columns = settings().run(&imposed).expect("computes").columns;
        assert_eq!((columns[3].name.as_str(), &columns[3].values[..]), ("do_human_v", &[0.0, 1.0][..]));
    }

    #[test]
    fn the_papers_variables_are_those_computed_by_hand() {
        let features = settings().run(&batch(&[1000], &[1.0, 0.0])).expect("computes").columns;
        let names: Vec<&str> = features.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["h_v", "h_dg", "h_risk"]);
        assert_eq!(features[0].values, [1.0, 0.0]);
        assert_eq!(features[1].values, [5.0, 5.0]);
        let exponent = 0.1 + 1.0 / 4.0 + 2.0 / 20f64.sqrt();
        assert!((features[2].values[0] - exponent.exp()).abs() < 1e-12);
        assert_eq!(features[2].values[1], 1.0);
    }

    #[test]
    fn a_lagged_risk_is_that_of_the_row_before_and_the_first_is_missing() {
        let now = settings().run(&batch(&[1], &[1.0, 0.5, 0.2])).expect("computes").columns;
        let late = Postprocess { risk_lag: 1, ..settings() };
        let late = late.run(&batch(&[1], &[1.0, 0.5, 0.2])).expect("computes").columns;
        assert!(late[2].values[0].is_nan());
        assert_eq!(late[2].values[1..], now[2].values[..2]);
        assert_eq!(late[0], now[0]);
    }

    #[test]
    fn the_lag_is_that_of_the_risk_however_it_is_written_and_of_nothing_else() {
        let values = |text: &str, risk_lag| {
            let features = vec![Feature::new("features", "it", text).expect("a feature")];
            let late = Postprocess { risk_lag, features, ..settings() };
            late.run(&batch(&[1], &[1.0, 0.5, 0.2])).expect("computes").columns.remove(0).values
        };
        let (risk, now) = (values("risk(h, r)", 0), values("h.v", 0));
        assert_eq!(values("h.v", 1), now);
        assert_eq!(values("risk (h , r)", 1)[1..], risk[..2]);
        assert_eq!(values("2 * risk(h, r)", 1)[1..], [2.0 * risk[0], 2.0 * risk[1]]);
        let sum = values("risk(h,r)+h.v", 1);
        assert!(sum[0].is_nan());
        assert_eq!(sum[1..], [risk[0] + now[1], risk[1] + now[2]]);
    }

    #[test]
    fn a_person_out_of_sight_has_no_variables_and_a_silent_robot_no_risk() {
        let mut gone = batch(&[1], &[1.0, 1.0, 1.0]);
        gone.people.get_mut(&1).expect("the person")[1] = Values::UNKNOWN;
        gone.robot[2] = Values::UNKNOWN;
        for risk_noise in [0.0, 0.02] {
            let features = Postprocess { risk_noise, ..settings() }.run(&gone).expect("computes");
            let [v, dg, risk] = [0, 1, 2].map(|i| features.columns[i].values.clone());
            assert!(v[1].is_nan() && dg[1].is_nan() && risk[1].is_nan(), "{risk:?}");
            assert!(v[2] == 1.0 && risk[2].is_nan(), "{risk:?}");
            assert!(risk[0].is_finite() && features.emptied.is_empty());
        }
    }

    #[test]
    fn what_cannot_be_is_emptied_and_counted() {
        let features = settings().run(&batch(&[7], &[1.0, 100.0, f64::NAN])).expect("computes");
        assert!(features.columns[0].values[1].is_nan() && features.columns[2].values[1].is_nan());
        assert_eq!(features.emptied, BTreeMap::from([("h_7_v".to_owned(), 1)]));
        // Two bodies that meet at 0.1 m with 45 m/s.
        let mut meet = batch(&[7], &[0.05]);
        meet.people.insert(7, vec![at_x(0.0, 0.0, 0.05)]);
        meet.robot = vec![at_x(0.1, std::f64::consts::PI, 45.0)];
        let features = settings().run(&meet).expect("computes");
        assert!(features.columns[2].values[0].is_nan());
        assert_eq!(features.emptied, BTreeMap::from([("h_risk".to_owned(), 1)]));
    }

    #[test]
    fn the_smaller_of_a_number_and_something_unknown_is_unknown() {
        let features = vec![Feature::new("features", "it", "min(h.v, 1) + max(2, h.v)").expect("a feature")];
        let mut gone = batch(&[1], &[0.5]);
        gone.people.insert(1, vec![Values::UNKNOWN]);
        let values =
            Postprocess { features, ..settings() }.run(&gone).expect("computes").columns.remove(0).values;
        assert!(values[0].is_nan());
    }

    #[test]
    fn noise_is_seeded_and_of_the_size_asked_for() {
        let noisy = |seed| Postprocess { risk_noise: 0.02, seed, ..settings() };
        let speeds = vec![0.0; 4000];
        let risk = |seed| noisy(seed).run(&batch(&[1], &speeds)).expect("computes").columns.remove(2).values;
        assert_eq!(risk(1), risk(1));
        assert_ne!(risk(1), risk(2));
        let exponents: Vec<f64> = risk(1).iter().map(|risk| risk.ln()).collect();
        let mean = exponents.iter().sum::<f64>() / 4000.0;
        let deviation = (exponents.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!(mean.abs() < 0.002 && (deviation - 0.02).abs() < 0.001, "{mean} {deviation}");
    }

    #[test]
    fn several_people_have_columns_of_their_own_and_absence_is_missing() {
        let mut two = batch(&[3, 7], &[1.0, 1.0]);
        two.people.insert(7, vec![Values::UNKNOWN, Values::from_array([3.0, 4.0, 0.0, 0.0, 0.0, 1.0, 0.0])]);
        let features = settings().run(&two).expect("computes").columns;
        let names: Vec<&str> = features.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["h_3_v", "h_7_v", "h_3_dg", "h_7_dg", "h_3_risk", "h_7_risk"]);
        assert!(features[1].values[0].is_nan() && features[1].values[1] == 1.0);
    }

    #[test]
    fn features_of_the_users_own_replace_the_papers() {
        let items = ["d = dist(h", " r)", "r_v = r.v; twice = 2 * h.v"].map(str::to_owned);
        let features = Feature::parse("features", &items).expect("three features");
        let mine = Postprocess { features, ..settings() };
        let columns = mine.run(&batch(&[3, 7], &[1.5])).expect("computes").columns;
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["d_3", "d_7", "r_v", "twice_3", "twice_7"]);
        assert_eq!((columns[0].values[0], columns[3].values[0]), (4.0, 3.0));
    }

    #[test]
    fn a_bad_feature_names_the_parameter() {
        let fault = |item: &str| Feature::parse("features", &[item.to_owned()]).expect_err(item).to_string();
        assert!(fault("h.v").starts_with("parameter 'features': 'h.v' has no '='"));
        assert!(fault("a,b = 1").contains("not a valid feature name"));
        assert!(fault("a = 1; a = 2").contains("twice"));
        assert!(fault("a = dist(h)").contains("takes 2"));
    }
}
