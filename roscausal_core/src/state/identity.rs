//! Who is who: numbers for people whose tracker gives names, and for people whose tracker gives nothing but places.

use std::collections::{BTreeMap, BTreeSet};

use roscausal_msgs::{Time, geometry_msgs::Point};

/// Names or tracks that are remembered.
const MOST: usize = 4096;
/// Somebody may be this much farther away for each second since the last sighting. Metres per second.
const FASTEST: f64 = 2.0;

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
            return super::human::id_of(name);
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
    pub fn told(&self) -> String {
        let told = self.numbers.iter().filter(|(name, number)| number_in(name) != Some(**number));
        let mut told: Vec<(u32, &str)> = told.map(|(name, number)| (*number, name.as_str())).collect();
        told.sort_unstable();
        told.iter().take(20).map(|(number, name)| format!("{number} = {name}")).collect::<Vec<_>>().join(", ")
    }
}

/// The number in a name that is a number, or that ends in one after `_`, `-`, `/`, `#` or a space.
fn number_in(name: &str) -> Option<u32> {
    let number = name.rsplit(['_', '-', ' ', '/', '#']).next().unwrap_or(name);
    number.parse().ok().filter(|_| number.bytes().all(|byte| byte.is_ascii_digit()))
}

/// Tracks of people who are seen without identity: each sighting goes to the nearest track, if that is within the gate.
#[derive(Debug)]
pub struct Tracks {
    gate_m: f64,
    keep_s: f64,
    next: u32,
    tracks: Vec<(u32, Time, Point)>,
}

impl Tracks {
    /// Sightings at most `gate_m` (and 2 m for each second since) from a track belong to it. A track that was not seen for
    /// `keep_s` ends.
    pub fn new(gate_m: f64, keep_s: f64) -> Self {
        Self { gate_m, keep_s, next: 0, tracks: Vec::new() }
    }

    /// The ids of the people at these places, seen at the same time. The nearest pairs of track and place are joined first.
    pub fn ids(&mut self, stamp: Time, places: &[Point]) -> Vec<u32> {
        self.tracks.retain(|(_, seen, _)| (0.0..=self.keep_s).contains(&stamp.secs_since(*seen)));
        let mut pairs = Vec::new();
        for (track, (_, seen, at)) in self.tracks.iter().enumerate() {
            let gate = self.gate_m + FASTEST * stamp.secs_since(*seen);
            for (place, point) in places.iter().enumerate() {
                let distance = (point.x - at.x).hypot(point.y - at.y);
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
                self.tracks[track] = (self.tracks[track].0, stamp, *point);
                self.tracks[track].0
            }
            None => {
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
        assert_eq!(names.told(), "1 = rkvea, 2 = a3f19, 3 = b19, 4 = person_1, 5 = 12");
    }

    #[test]
    fn people_in_another_order_of_the_list_keep_their_ids() {
        let mut tracks = Tracks::new(0.8, 1.0);
        let secs = Time::from_secs_f64;
        assert_eq!(tracks.ids(secs(1.0), &[at(0.0, 0.0), at(3.0, 0.0)]), [0, 1]);
        assert_eq!(tracks.ids(secs(1.1), &[at(3.1, 0.0), at(0.1, 0.0)]), [1, 0]);
        // One leaves; the other is still herself, and who comes is somebody new.
        assert_eq!(tracks.ids(secs(1.2), &[at(3.2, 0.0)]), [1]);
        assert_eq!(tracks.ids(secs(1.3), &[at(9.0, 0.0), at(3.3, 0.0)]), [2, 1]);
        assert_eq!(tracks.ids(secs(5.0), &[at(3.3, 0.0)]), [3], "a track that was lost for long has ended");
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
}
