//! What a table of trajectories does not say, from the motion in it: how many frames are a second, the unit of places, whether
//! headings are degrees.
//!
//! 1. Frames per second: those at which places and velocities of the file agree. Without velocities: 25, if people then walk like
//!    people, or else the usual rate at which they do.
//! 2. The unit: the one in which people walk like people, from 0.2 to 2.5 m/s in the middle.
//! 3. Headings are degrees if they are larger than a turn, or if only then people walk where they look.
//!
//! What fits nobody is refused, unless the user says it.

use std::f64::consts::TAU;

use roscausal_discovery::Named;

use super::sample::{PositionUnit, Sample};
use crate::batch::table::median;

/// How fast people walk in the middle, m/s.
const WALK: std::ops::RangeInclusive<f64> = 0.2..=2.5;
/// The middle of it, and the fastest for which a rate that nothing tells is taken as that of ETH and UCY.
const USUAL_WALK: f64 = 1.26;
const BRISK: f64 = 1.6;
/// Slower than this no unit is guessed beside a rate that nothing tells: another rate is likelier.
const LIKELY: f64 = 0.4;
/// Slower than this nobody moves who moves at all, m/s.
const SLOWEST: f64 = 0.02;
/// Frames per second of ETH and UCY.
const USUAL_RATE: f64 = 25.0;
/// Rates of cameras and trackers.
const RATES: [f64; 18] =
    [1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.5, 8.0, 10.0, 12.5, 15.0, 16.0, 20.0, 25.0, 30.0, 50.0, 60.0];
/// Samples over which a way is compared with the velocities along it.
const STRETCH: usize = 10;

/// What the table does not say.
pub(super) struct Missing {
    /// Times are frames, of an unknown rate.
    pub(super) rate: bool,
    /// The unit of places, if it is known.
    pub(super) unit: Option<PositionUnit>,
}

/// What was found, and what to tell of it.
pub(super) struct Found {
    /// Frames per second; 1 if times are seconds.
    pub(super) rate: f64,
    pub(super) unit: PositionUnit,
    pub(super) notes: Vec<String>,
}

/// The rate and the unit at which people walk like people.
///
/// # Errors
/// There are none.
pub(super) fn found(tracks: &[&[Sample]], missing: &Missing) -> Result<Found, String> {
    let mut notes = Vec::new();
    let agreed = agreement(tracks).filter(|_| missing.rate).filter(|rate| (0.9..=130.0).contains(rate));
    let rate = if missing.rate { agreed.map_or(USUAL_RATE, nearest_rate) } else { 1.0 };
    let Some(usual) = usual_speed(tracks) else {
        return Ok(Found { rate, unit: missing.unit.unwrap_or(PositionUnit::METRES), notes });
    };
    let units: &[PositionUnit] = match missing.unit.as_slice() {
        [] => &[PositionUnit::METRES, PositionUnit::CENTIMETRES, PositionUnit::MILLIMETRES],
        of_user => of_user,
    };
    let first = units[0];
    let metres = |rate: f64, unit: PositionUnit| usual * rate / unit.per_metre();
    let off = |rate: f64, unit: PositionUnit| libm::log(metres(rate, unit) / USUAL_WALK).abs();
    let is_known = !missing.rate || agreed.is_some();
    let fits = |rate: f64, metres: f64| {
        WALK.contains(&metres) && (is_known || rate != USUAL_RATE || metres <= BRISK)
    };
    let best = |rates: &[f64], units: &[PositionUnit]| {
        let all = rates.iter().flat_map(|&rate| units.iter().map(move |&unit| (rate, unit)));
        let fitting = all.filter(|&(rate, unit)| fits(rate, metres(rate, unit)));
        fitting.min_by(|a, b| off(a.0, a.1).total_cmp(&off(b.0, b.1)))
    };
    // The user's unit is taken as it is, and so are metres if people move at all.
    let slow = (SLOWEST..*WALK.start()).contains(&metres(rate, PositionUnit::METRES));
    let chosen = best(&[rate], &[first])
        .or_else(|| best(&[rate], units).filter(|&(rate, unit)| is_known || metres(rate, unit) >= LIKELY))
        .or_else(|| best(&[rate], &[PositionUnit::FEET]).filter(|_| is_known && missing.unit.is_none()))
        .or_else(|| best(&RATES, units).filter(|_| !is_known))
        .or_else(|| (slow || missing.unit.is_some()).then_some((rate, first)));
    let Some((rate, unit)) = chosen else {
        return Err(format!(
            "nobody walks so: in metres{} the usual speed would be {:.3} m/s, and no usual unit or rate makes it one from {} to {} \
             m/s; {} (m, cm, mm, ft){} say what they are",
            if missing.rate { format!(", at {rate} frames per second,") } else { String::new() },
            metres(rate, PositionUnit::METRES),
            WALK.start(),
            WALK.end(),
            Named("position_unit"),
            if missing.rate { format!(" and {}", Named("frame_rate")) } else { String::new() }
        ));
    };
    if missing.rate {
        let why = match agreed {
            Some(_) => "at which places and velocities agree".to_owned(),
            None if rate == USUAL_RATE => "as those of ETH and UCY".to_owned(),
            None => format!(
                "at which people walk; at {USUAL_RATE} they would be {:.0} times as fast",
                USUAL_RATE / rate
            ),
        };
        let setting = Named("frame_rate");
        notes.push(format!("frames are taken as {rate} per second, {why} ({setting} says otherwise)"));
    }
    let name = match unit {
        _ if missing.unit.is_some() => None,
        PositionUnit::CENTIMETRES => Some("centimetres"),
        PositionUnit::MILLIMETRES => Some("millimetres"),
        PositionUnit::FEET => Some("feet"),
        _ => None,
    };
    let setting = Named("position_unit");
    if let Some(name) = name {
        let speed = metres(rate, PositionUnit::METRES);
        notes.push(format!(
            "positions are taken as {name}: in metres, the usual speed would be {speed:.0} m/s ({setting} says otherwise)"
        ));
    } else if missing.unit.is_none() && slow {
        let speed = metres(rate, unit);
        notes.push(format!(
            "people are slow: {speed:.2} m/s in the middle, in metres ({setting} says otherwise)"
        ));
    }
    Ok(Found { rate, unit, notes })
}

/// The usual rate next to one that was measured, if it is near enough; otherwise the measured one with three digits.
fn nearest_rate(measured: f64) -> f64 {
    let off = |rate: &f64| libm::log(rate / measured).abs();
    let near = RATES.into_iter().min_by(|a, b| off(a).total_cmp(&off(b))).filter(|rate| off(rate) < 0.03);
    let scale = libm::pow(10_f64, 2.0 - libm::log10(measured).floor());
    near.unwrap_or((measured * scale).round() / scale)
}

/// What the velocities are, in the ways that were covered per time of the table: frames per second, or 1 for seconds. By least
/// squares over short stretches.
fn agreement(tracks: &[&[Sample]]) -> Option<f64> {
    let (mut both, mut squares) = (0.0, 0.0);
    for stretch in tracks.iter().flat_map(|track| track.chunks(STRETCH)) {
        let mut way = (0.0, 0.0);
        for pair in stretch.windows(2) {
            let [Some(a), Some(b)] = [pair[0].velocity, pair[1].velocity] else { return None };
            let half = (pair[1].time - pair[0].time) / 2.0;
            way = (way.0 + half * (a.0 + b.0), way.1 + half * (a.1 + b.1));
        }
        let (Some(first), Some(last)) = (stretch.first(), stretch.last()) else { continue };
        let covered = (last.place.0 - first.place.0, last.place.1 - first.place.1);
        both += way.0 * covered.0 + way.1 * covered.1;
        squares += covered.0 * covered.0 + covered.1 * covered.1;
    }
    (squares > 0.0 && both > 0.0).then(|| both / squares)
}

/// The middle of the agents' usual speeds, in units of the table; those who never move do not count.
fn usual_speed(tracks: &[&[Sample]]) -> Option<f64> {
    let speed = |pair: &[Sample]| length(pair) / (pair[1].time - pair[0].time);
    let of_agent = |track: &&[Sample]| median(track.windows(2).map(speed).filter(|speed| *speed > 0.0));
    median(tracks.iter().filter_map(of_agent))
}

fn length(pair: &[Sample]) -> f64 {
    let (a, b) = (pair[0].place, pair[1].place);
    libm::hypot(b.0 - a.0, b.1 - a.1)
}

/// What to tell if headings are degrees.
pub(super) fn degrees<'a>(tracks: impl Iterator<Item = &'a [Sample]>) -> Option<String> {
    let (mut largest, mut count, mut agrees) = (0.0_f64, 0.0, [0.0; 2]);
    for pair in tracks.flat_map(|track| track.windows(2)) {
        let heading = pair[0].heading;
        if heading.is_nan() {
            continue;
        }
        largest = largest.max(heading.abs());
        if length(pair) > 0.0 {
            let way = libm::atan2(pair[1].place.1 - pair[0].place.1, pair[1].place.0 - pair[0].place.0);
            count += 1.0;
            agrees =
                [agrees[0] + libm::cos(heading - way), agrees[1] + libm::cos(heading.to_radians() - way)];
        }
    }
    let why = match (largest > 1.1 * TAU, agrees[1] - agrees[0] > 0.3 * count && count > 5.0) {
        (true, _) => format!("they are up to {largest:.0}"),
        (false, true) => "people then walk where they look".to_owned(),
        (false, false) => return None,
    };
    Some(format!("headings are taken as degrees: {why}"))
}

#[cfg(test)]
mod tests {
    use roscausal_discovery::mix;

    use super::*;

    fn noise(i: usize) -> f64 {
        mix(i as u64) as f64 / u64::MAX as f64 - 0.5
    }

    /// Eight people, each at a speed of its own; times in frames, places and velocities in units of which `per` are a metre.
    fn people(rate: f64, per: f64, seed: usize, velocities: bool) -> Vec<Vec<Sample>> {
        let walk = |k: usize| {
            let (speed, turn) = (0.7 + 0.8 * (noise(seed + k) + 0.5), 6.0 * noise(seed + 77 * k));
            let at = |i: usize| speed * (1.0 + 0.2 * (0.9 * i as f64 / rate).sin());
            let mut place = (10.0 * noise(seed + k), 5.0 * noise(seed + 3 * k));
            let sample = |i: usize| {
                let (v, heading) = (at(i) * per, turn + 0.3 * (0.4 * i as f64 / rate).sin());
                place = (place.0 + v / rate * heading.cos(), place.1 + v / rate * heading.sin());
                let seen = |x: f64, j: usize| x + 0.01 * per * noise(seed + 1000 * k + 2 * i + j);
                Sample {
                    time: (6 * i) as f64 / 6.0,
                    place: (seen(place.0, 0), seen(place.1, 1)),
                    velocity: velocities.then(|| (v * heading.cos(), v * heading.sin())),
                    speed: f64::NAN,
                    heading,
                    goal: (f64::NAN, f64::NAN),
                }
            };
            (0..80).map(sample).collect()
        };
        (0..8).map(walk).collect()
    }

    fn of(tracks: &[Vec<Sample>], missing: &Missing) -> Result<Found, String> {
        found(&tracks.iter().map(Vec::as_slice).collect::<Vec<_>>(), missing)
    }

    #[test]
    fn the_rate_at_which_places_and_velocities_agree_is_the_true_one_in_any_unit() {
        let missing = Missing { rate: true, unit: None };
        for (seed, rate) in [2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 25.0, 30.0, 16.0, 20.0].into_iter().enumerate()
        {
            for unit in [PositionUnit::METRES, PositionUnit::CENTIMETRES, PositionUnit::MILLIMETRES] {
                let tracks = people(rate, unit.per_metre() * 1.0, 10_000 * seed, true);
                let found = of(&tracks, &missing).expect("people");
                assert_eq!((found.rate, found.unit), (rate, unit), "{:?}", found.notes);
            }
        }
    }

    #[test]
    fn without_velocities_the_rate_and_unit_are_those_of_people_and_what_nobody_walks_is_refused() {
        let missing = Missing { rate: true, unit: None };
        let found = |rate: f64, per: f64| of(&people(rate, per, 5, false), &missing).expect("people");
        assert_eq!((found(25.0, 1.0).rate, found(25.0, 1.0).unit), (25.0, PositionUnit::METRES));
        assert_eq!((found(25.0, 100.0).rate, found(25.0, 100.0).unit), (25.0, PositionUnit::CENTIMETRES));
        assert_eq!(found(2.5, 1.0).rate, 2.5, "{:?}", found(2.5, 1.0).notes);
        // At 25 they would walk 0.2 m/s in millimetres.
        let of_12 = found(12.5, 100.0);
        assert_eq!(of_12.unit, PositionUnit::CENTIMETRES, "{:?}", of_12.notes);
        let seconds = Missing { rate: false, unit: None };
        let in_seconds = |per: f64| of(&people(1.0, per, 5, false), &seconds);
        assert_eq!(in_seconds(1.0 / 0.3048).map(|found| found.unit), Ok(PositionUnit::FEET));
        assert!(in_seconds(12.0).is_err_and(|reported| reported.contains("nobody walks so")));
        let of_user = Missing { rate: false, unit: Some(PositionUnit::METRES) };
        assert!(of(&people(1.0, 40.0, 5, false), &of_user).is_ok());
    }

    #[test]
    fn headings_are_degrees_by_range_or_because_people_walk_where_they_look() {
        for (scale, is) in [(1.0, false), (57.295_78, true)] {
            let mut tracks = people(10.0, 1.0, 9, false);
            for track in &mut tracks {
                for i in 1..track.len() {
                    let (a, b) = (track[i - 1].place, track[i].place);
                    track[i - 1].heading = (b.1 - a.1).atan2(b.0 - a.0) * scale;
                }
            }
            assert_eq!(degrees(tracks.iter().map(Vec::as_slice)).is_some(), is, "{scale}");
        }
    }
}
