//! Who is who: numbers for people whose tracker gives names, for people whose tracker gives nothing but places, and for people
//! whom their tracker lost and found again under another number.

use std::collections::{BTreeMap, BTreeSet};

use roscausal_msgs::{Time, geometry_msgs::Point};

/// Names or tracks that are remembered.
const MOST: usize = 4096;
/// Where numbers are not joined, changes of numbers are looked for within this time. Seconds.
const WATCHED_S: f64 = 2.0;
/// Somebody may be this much farther away for each second since the last sighting. Metres per second.
const FASTEST: f64 = 2.0;
/// Nobody runs faster. Metres per second.
const RUNS: f64 = 10.0;

/// Whether two sightings, so many seconds apart, are farther apart than anybody runs and `gate_m`.
pub(crate) fn is_leap([dx, dy]: [f64; 2], secs: f64, gate_m: f64) -> bool {
    libm::hypot(dx, dy) > gate_m + RUNS * secs.abs()
}

/// Numbers for names: the number in the name (`person_12` is 12), otherwise, or if it is taken, the smallest free one.
/// ROS4HRI's `rkvea` becomes 1, the next one 2.
#[derive(Debug, Default)]
pub struct Names {
    numbers: BTreeMap<String, u32>,
    taken: BTreeSet<u32>,
}

impl Names {
    /// The number of this name.
    pub fn number(&mut self, name: &str) -> u32 {
        if let Some(number) = self.numbers.get(name) {
            return *number;
        }
        if self.numbers.len() >= MOST {
            return id_of(name);
        }
        let free = |number: &u32| !self.taken.contains(number);
        let number = number_in(name).filter(free).or_else(|| (1..).find(free)).unwrap_or(0);
        if number.to_string() != name {
            tracing::info!("person '{name}' is number {number}");
        }
        self.taken.insert(number);
        self.numbers.insert(name.to_owned(), number);
        number
    }

    /// Which number stands for which name, where they are not the same: `1 = rkvea, 2 = pqwzt`.
    pub fn reported(&self) -> String {
        let reported = self.numbers.iter().filter(|(name, number)| number_in(name) != Some(**number));
        let mut reported: Vec<(u32, &str)> =
            reported.map(|(name, number)| (*number, name.as_str())).collect();
        reported.sort_unstable();
        let reported = reported.iter().take(20).map(|(number, name)| format!("{number} = {name}"));
        reported.collect::<Vec<_>>().join(", ")
    }
}

/// The number in a name that is a number, or that ends in one after `_`, `-`, `/`, `#` or a space.
fn number_in(name: &str) -> Option<u32> {
    let number = name.rsplit(['_', '-', ' ', '/', '#']).next().unwrap_or(name);
    number.parse().ok().filter(|_| number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// What a tracker tells about the identity of a person.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Who {
    /// Their number.
    Number(u32),
    /// Their name.
    Name(String),
    /// Nothing.
    Unknown,
}

/// How people are told apart.
#[derive(Clone, Copy, Debug)]
pub struct Gates {
    /// A sighting within this many metres of a track, and 2 m for each second since, belongs to it.
    pub metres: f64,
    /// A track without identity ends after this many seconds.
    pub keep_s: f64,
    /// A new number near somebody who was lost for at most this many seconds is theirs; 0: never.
    pub rejoin_s: f64,
}

/// The ids of all people of one node.
#[derive(Debug, Default)]
pub struct Identities {
    /// Numbers of names.
    pub names: Names,
    tracks: Tracks,
    lost: Lost,
    /// Whether a new number near somebody who was lost becomes theirs.
    rejoins: bool,
    /// How often somebody was at once farther away than anybody runs.
    pub leaps: u64,
}

impl Identities {
    /// Nobody is known yet.
    pub fn new(gates: Gates) -> Self {
        let rejoins = gates.rejoin_s > 0.0;
        let rejoin_s = if rejoins { gates.rejoin_s } else { WATCHED_S };
        Self {
            names: Names::default(),
            tracks: Tracks::new(gates.metres, gates.keep_s),
            lost: Lost { gate_m: gates.metres, rejoin_s, ..Lost::default() },
            rejoins,
            leaps: 0,
        }
    }

    /// Where numbers are not joined: how often a new one began where another had ended within two seconds, and the first such pair;
    /// empty if never.
    pub fn changed(&self) -> String {
        let Some((old, new)) = self.lost.first.filter(|_| !self.rejoins) else { return String::new() };
        format!("{}, the first: {new} where {old} was", self.lost.changes)
    }

    /// The ids of the people of one message, who are at these places, all in one frame.
    pub fn ids(&mut self, stamp: Time, people: &[(Who, Point)]) -> Vec<u32> {
        let unknown = people.iter().filter(|(who, _)| *who == Who::Unknown);
        let places: Vec<Point> = unknown.map(|(_, place)| *place).collect();
        for (who, _) in people {
            if let Who::Number(number) = who {
                self.tracks.leave(*number);
            }
        }
        let mut by_place = self.tracks.ids(stamp, &places).into_iter();
        let id = |(who, _): &(Who, Point)| match who {
            Who::Number(number) => *number,
            Who::Name(name) => self.names.number(name),
            Who::Unknown => by_place.next().unwrap_or_default(),
        };
        let ids: Vec<u32> = people.iter().map(id).collect();
        let places: Vec<Point> = people.iter().map(|(_, place)| *place).collect();
        let has_leapt = |(id, place): (&u32, &Point)| {
            let known = self.lost.person.get(id).and_then(|person| self.lost.last.get(person));
            let Some((seen, at)) = known else { return false };
            is_leap([place.x - at.x, place.y - at.y], stamp.secs_since(*seen), self.lost.gate_m)
        };
        self.leaps += ids.iter().zip(&places).filter(|one| has_leapt(*one)).count() as u64;
        let found = self.lost.found(stamp, &ids, &places);
        if self.rejoins { found } else { ids }
    }
}

/// Tracks that end, and begin again under another number.
#[derive(Debug, Default)]
struct Lost {
    gate_m: f64,
    rejoin_s: f64,
    /// How often somebody was found again under another number, and the first time: as whom, and under which.
    changes: u64,
    first: Option<(u32, u32)>,
    /// The person behind each number of the tracker.
    person: BTreeMap<u32, u32>,
    /// When and where each person was seen last.
    last: BTreeMap<u32, (Time, Point)>,
}

impl Lost {
    /// The people behind the tracker's numbers. A number that is new belongs to the nearest person who is missing and was
    /// seen near there not long ago.
    fn found(&mut self, stamp: Time, numbers: &[u32], places: &[Point]) -> Vec<u32> {
        self.last.retain(|_, (seen, _)| (0.0..=self.rejoin_s).contains(&stamp.secs_since(*seen)));
        if self.person.len() >= MOST {
            let last = &self.last;
            self.person.retain(|_, person| last.contains_key(person));
        }
        // A number that is known keeps its person, unless the person is here already.
        let mut here = BTreeSet::new();
        let known = |number: &u32| self.person.get(number).copied().filter(|person| here.insert(*person));
        let mut people: Vec<Option<u32>> = numbers.iter().map(known).collect();
        let mut pairs = Vec::new();
        for (place, _) in people.iter().enumerate().filter(|(_, person)| person.is_none()) {
            for (person, (seen, at)) in self.last.iter().filter(|(person, _)| !here.contains(*person)) {
                let distance = libm::hypot(places[place].x - at.x, places[place].y - at.y);
                if distance <= self.gate_m + FASTEST * stamp.secs_since(*seen) {
                    pairs.push((distance, place, *person));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, place, person) in pairs {
            if people[place].is_none() && here.insert(person) {
                tracing::debug!("person {person} was lost and is found again as {}", numbers[place]);
                self.changes += 1;
                self.first.get_or_insert((person, numbers[place]));
                people[place] = Some(person);
            }
        }
        let mut found = Vec::with_capacity(numbers.len());
        for (place, number) in numbers.iter().enumerate() {
            let is_free = |id: &u32| !here.contains(id) && !self.last.contains_key(id);
            let own = || Some(*number).filter(is_free).or_else(|| (1..).find(is_free)).unwrap_or(*number);
            let person = people[place].unwrap_or_else(own);
            here.insert(person);
            self.person.insert(*number, person);
            self.last.insert(person, (stamp, places[place]));
            found.push(person);
        }
        found
    }
}

/// Tracks of people who are seen without identity: each sighting goes to the nearest track, if that is within the gate.
#[derive(Debug, Default)]
pub struct Tracks {
    gate_m: f64,
    keep_s: f64,
    next: u32,
    /// Numbers of people whose tracker has ids.
    taken: BTreeSet<u32>,
    tracks: Vec<(u32, Time, Point)>,
}

impl Tracks {
    /// Sightings at most `gate_m` (and 2 m for each second since) from a track belong to it. A track that was not seen for
    /// `keep_s` ends.
    pub fn new(gate_m: f64, keep_s: f64) -> Self {
        Self { gate_m, keep_s, ..Self::default() }
    }

    /// Leaves a number to somebody else.
    fn leave(&mut self, number: u32) {
        if self.taken.len() < MOST {
            self.taken.insert(number);
        }
    }

    /// The ids of the people at these places, seen at the same time. The nearest pairs of track and place are joined first.
    pub fn ids(&mut self, stamp: Time, places: &[Point]) -> Vec<u32> {
        // A message may come out of order.
        self.tracks.retain(|(_, seen, _)| stamp.secs_since(*seen).abs() <= self.keep_s);
        let mut pairs = Vec::new();
        for (track, (_, seen, at)) in self.tracks.iter().enumerate() {
            let gate = self.gate_m + FASTEST * stamp.secs_since(*seen).abs();
            for (place, point) in places.iter().enumerate() {
                let distance = libm::hypot(point.x - at.x, point.y - at.y);
                if distance <= gate {
                    pairs.push((distance, track, place));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let (mut of_place, mut joined) = (vec![None; places.len()], BTreeSet::new());
        for (_, track, place) in pairs {
            if of_place[place].is_none() && joined.insert(track) {
                of_place[place] = Some(track);
            }
        }
        let seen = places.iter().zip(of_place).map(|(point, track)| match track {
            Some(track) => {
                let (id, seen, _) = self.tracks[track];
                if stamp >= seen {
                    self.tracks[track] = (id, stamp, *point);
                }
                id
            }
            None => {
                while self.taken.contains(&self.next) {
                    self.next = self.next.wrapping_add(1);
                }
                let id = self.next;
                self.next = self.next.wrapping_add(1);
                if self.tracks.len() < MOST {
                    self.tracks.push((id, stamp, *point));
                }
                id
            }
        });
        seen.collect()
    }
}

/// An id for a person whose tracker uses 64-bit numbers: the same number if it fits, otherwise a hash of it.
pub fn id_of_number(number: u64) -> u32 {
    u32::try_from(number).unwrap_or_else(|_| hashed(&number.to_le_bytes()))
}

/// FNV-1a, kept away from the small numbers that trackers use.
fn hashed(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(*b)).wrapping_mul(0x0100_0193)) | 0x8000_0000
}

/// An id for a person whose tracker uses text: the digits at its end, otherwise a hash of the text.
pub fn id_of(name: &str) -> u32 {
    let before = name.trim_end_matches(|c: char| c.is_ascii_digit());
    name[before.len()..].parse().unwrap_or_else(|_| hashed(name.as_bytes()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(x: f64, y: f64) -> Point {
        Point { x, y, z: 0.0 }
    }

    #[test]
    fn names_get_small_numbers_and_no_two_names_one_number() {
        let mut names = Names::default();
        let numbers =
            ["person_12", "rkvea", "a3f19", "7", "b19", "person_1", "12", "rkvea"].map(|n| names.number(n));
        assert_eq!(numbers, [12, 1, 2, 7, 3, 4, 5, 1]);
        assert_eq!(names.reported(), "1 = rkvea, 2 = a3f19, 3 = b19, 4 = person_1, 5 = 12");
    }

    #[test]
    fn people_in_another_order_of_the_list_keep_their_ids() {
        let mut tracks = Tracks::new(0.8, 1.0);
        let secs = Time::from_secs_f64;
        assert_eq!(tracks.ids(secs(1.0), &[at(0.0, 0.0), at(3.0, 0.0)]), [0, 1]);
        assert_eq!(tracks.ids(secs(1.1), &[at(3.1, 0.0), at(0.1, 0.0)]), [1, 0]);
        // One leaves; the other is still the same, and who comes is somebody new.
        assert_eq!(tracks.ids(secs(1.2), &[at(3.2, 0.0)]), [1]);
        assert_eq!(tracks.ids(secs(1.3), &[at(9.0, 0.0), at(3.3, 0.0)]), [2, 1]);
        assert_eq!(tracks.ids(secs(5.0), &[at(3.3, 0.0)]), [3], "a track that was lost for long has ended");
    }

    fn rejoining(rejoin_s: f64) -> Identities {
        Identities::new(Gates { metres: 0.8, keep_s: 1.0, rejoin_s })
    }

    #[test]
    fn somebody_who_was_lost_is_found_again_under_another_number() {
        let secs = Time::from_secs_f64;
        let two = [(Who::Number(4), at(0.0, 0.0)), (Who::Number(5), at(5.0, 0.0))];
        let later = [(Who::Number(9), at(0.9, 0.0)), (Who::Number(5), at(5.2, 0.0))];
        let mut identities = rejoining(3.0);
        assert_eq!(identities.ids(secs(1.0), &two), [4, 5]);
        assert_eq!(identities.ids(secs(1.1), &two[1..]), [5]);
        assert_eq!(identities.ids(secs(2.0), &later), [4, 5], "9 is where 4 was lost");
        assert_eq!(identities.ids(secs(2.1), &later[..1]), [4], "and stays the same");
        // The old number comes back beside the new one: somebody else.
        let both = [(Who::Number(9), at(1.0, 0.0)), (Who::Number(4), at(1.2, 0.0))];
        let ids = identities.ids(secs(2.2), &both);
        assert!(ids[0] == 4 && ids[1] != 4 && ids[1] != 5, "{ids:?}");
        // Too far, or too late: somebody new.
        assert_eq!(identities.ids(secs(2.3), &[(Who::Number(30), at(60.0, 0.0))]), [30]);
        assert_eq!(identities.ids(secs(20.0), &[(Who::Number(31), at(60.0, 0.0))]), [31]);
        let mut off = rejoining(0.0);
        off.ids(secs(1.0), &two);
        assert_eq!(off.ids(secs(2.0), &later), [9, 5], "without the option, a new number is a new person");
        assert_eq!(
            (off.changed().as_str(), identities.changed().as_str()),
            ("1, the first: 9 where 4 was", "")
        );
    }

    #[test]
    fn two_people_with_one_number_are_noticed_and_one_who_runs_is_not() {
        let seen = |secs: f64, x: f64, identities: &mut Identities| {
            identities.ids(Time::from_secs_f64(secs), &[(Who::Number(7), at(x, 0.0))]);
        };
        let (mut runs, mut two) = (rejoining(0.0), rejoining(0.0));
        for step in 0..20 {
            let secs = 1.0 + 0.1 * f64::from(step);
            seen(secs, 0.8 * f64::from(step), &mut runs);
            seen(secs, 0.0, &mut two);
            seen(secs, 8.0, &mut two);
        }
        assert_eq!((runs.leaps, two.leaps), (0, 39));
    }

    #[test]
    fn people_without_a_number_never_get_that_of_somebody_else() {
        let mut identities = rejoining(0.0);
        let people =
            [(Who::Number(0), at(0.0, 0.0)), (Who::Unknown, at(5.0, 0.0)), (Who::Number(2), at(9.0, 0.0))];
        assert_eq!(identities.ids(Time::from_secs_f64(1.0), &people), [0, 1, 2]);
        let people = [(Who::Unknown, at(20.0, 0.0)), (Who::Unknown, at(5.1, 0.0))];
        assert_eq!(identities.ids(Time::from_secs_f64(1.1), &people), [3, 1]);
    }

    proptest! {
        #[test]
        fn people_who_walk_apart_keep_their_ids_in_any_order(
            order in prop::collection::vec(prop::collection::vec(0_u8..255, 4), 2..30),
        ) {
            let mut tracks = Tracks::new(0.8, 1.0);
            let mut known = BTreeMap::new();
            for (step, keys) in order.iter().enumerate() {
                let mut people: Vec<usize> = (0..4).collect();
                people.sort_by_key(|person| keys[*person]);
                let t = 0.1 * step as f64;
                // Each walks at 1 m/s, 3 m from the next.
                let places: Vec<Point> = people.iter().map(|person| at(t, 3.0 * *person as f64)).collect();
                for (person, id) in people.iter().zip(tracks.ids(Time::from_secs_f64(1.0 + t), &places)) {
                    prop_assert_eq!(*known.entry(*person).or_insert(id), id);
                }
            }
        }
    }

    #[test]
    fn a_number_that_does_not_fit_is_nobody_elses() {
        assert_eq!(id_of_number(7), 7);
        let large = (1_u64 << 32) + 7;
        assert_ne!(id_of_number(large), 7, "cut off, it would be person 7");
        assert_eq!(id_of_number(large), id_of_number(large));
        assert_ne!(id_of_number(large), id_of_number(large + 1));
    }

    #[test]
    fn names_become_stable_numbers() {
        assert_eq!(id_of("person_12"), 12);
        assert_eq!(id_of("anna"), id_of("anna"));
        assert_ne!(id_of("anna"), id_of("berta"));
    }
}
