//! Statistics of a run: speed by distance to the goal, goals, encounters, the fraction of time that the robot
//! drives at its speed. They are computed from the truth, without sensor noise.

use roscausal_core::Result;

use crate::{Scenario, Simulation, simulation::STEP};

/// Distances to the goal between which the mean speed is taken, metres.
pub const BANDS: [(f64, f64); 4] = [(4.0, 6.0), (2.0, 3.0), (1.0, 1.5), (0.5, 1.0)];
/// Collision courses closer together than this are one encounter, seconds.
const SAME_ENCOUNTER: f64 = 2.0;
/// Braking may show up to this long after the collision course, seconds.
const AFTERMATH: f64 = 1.0;

/// One period on collision course with a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// Its first moment, seconds.
    pub start: f64,
    /// Its last moment on collision course, seconds.
    pub end: f64,
    /// Lowest speed of the person during it and shortly after, m/s.
    pub least_speed: f64,
    /// Shortest distance from the robot during it and shortly after, metres.
    pub least_distance: f64,
}

/// The statistics of one run, for its first person and first robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Goals reached.
    pub goals: u64,
    /// Mean speed in each of [`BANDS`], m/s; NaN if the person never was there.
    pub speeds: [f64; 4],
    /// Highest speed of the person, m/s.
    pub top_speed: f64,
    /// Highest acceleration of the person, m/s2.
    pub top_acceleration: f64,
    /// Fraction of time that the robot drives within 0.01 m/s of its top speed.
    pub robot_at_speed: f64,
    /// Fraction of time that the robot drives below 0.02 m/s.
    pub robot_stopped: f64,
    /// Fraction of time on collision course.
    pub collision_course: f64,
    /// The encounters.
    pub encounters: Vec<Encounter>,
}

impl Statistics {
    /// Runs the scenario with this seed to its end.
    ///
    /// # Errors
    /// A wrong field of the scenario.
    pub fn of(scenario: &Scenario, seed: u64) -> Result<Self> {
        let mut simulation = Simulation::new(scenario, seed)?;
        let mut found = Self::default();
        let mut sums = [(0.0, 0u64); BANDS.len()];
        let (mut at_speed, mut stopped, mut course) = (0u64, 0u64, 0u64);
        let mut last_speed = None;
        while !simulation.is_over() {
            simulation.step();
            let time = simulation.time();
            if let Some(robot) = simulation.robots.first() {
                at_speed += u64::from((robot.v - robot.params.speed).abs() < 0.01);
                stopped += u64::from(robot.v < 0.02);
            }
            let Some(person) = simulation.people.first() else { continue };
            let distance = person.position.distance(person.goal);
            for (band, sum) in BANDS.iter().zip(&mut sums) {
                if (band.0..band.1).contains(&distance) {
                    *sum = (sum.0 + person.v, sum.1 + 1);
                }
            }
            found.top_speed = found.top_speed.max(person.v);
            let change = (person.v - last_speed.unwrap_or(person.v)) / STEP;
            found.top_acceleration = found.top_acceleration.max(change);
            last_speed = Some(person.v);
            if let Some(robot) = simulation.robots.first() {
                let approach = person.approach(robot.position, robot.velocity());
                let on_course = approach.is_collision_course(2.0, 5.0);
                course += u64::from(on_course);
                found.meet(time, on_course, person.v, person.position.distance(robot.position));
            }
        }
        let share = |count: u64| count as f64 / simulation.steps().max(1) as f64;
        found.goals = simulation.people.first().map_or(0, |person| person.goals_reached);
        found.speeds = sums.map(|(sum, count)| sum / count as f64);
        found.robot_at_speed = share(at_speed);
        found.robot_stopped = share(stopped);
        found.collision_course = share(course);
        Ok(found)
    }

    fn meet(&mut self, time: f64, on_course: bool, speed: f64, distance: f64) {
        match self.encounters.last_mut() {
            Some(last) if time - last.end < if on_course { SAME_ENCOUNTER } else { AFTERMATH } => {
                last.least_speed = last.least_speed.min(speed);
                last.least_distance = last.least_distance.min(distance);
                if on_course {
                    last.end = time;
                }
            }
            _ if on_course => {
                let start =
                    Encounter { start: time, end: time, least_speed: speed, least_distance: distance };
                self.encounters.push(start);
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEDS: std::ops::RangeInclusive<u64> = 1..=20;

    fn runs(scenario: &Scenario) -> Vec<Statistics> {
        SEEDS.map(|seed| Statistics::of(scenario, seed).unwrap()).collect()
    }

    fn mean(runs: &[Statistics], get: impl Fn(&Statistics) -> f64) -> f64 {
        runs.iter().map(get).sum::<f64>() / runs.len() as f64
    }

    /// The published recording has one run. Its statistics must be typical of ours.
    #[test]
    fn thor_looks_like_the_published_recording() {
        let runs = runs(&Scenario::default());
        // Mean speeds 4-6, 2-3, 1-1.5 and 0.5-1 m from the goal.
        for (band, measured) in [1.46, 1.24, 1.0, 0.86].into_iter().enumerate() {
            for run in &runs {
                assert!((run.speeds[band] - measured).abs() < 0.08, "{band}: {:?}", run.speeds);
            }
        }
        for run in &runs {
            assert!((14..=20).contains(&run.goals), "{}", run.goals);
            assert!((run.top_speed - 1.5).abs() < 0.02 && run.top_acceleration < 0.7 + 1e-9);
            assert!((0.75..=0.87).contains(&run.robot_at_speed), "{}", run.robot_at_speed);
            assert!((0.03..=0.11).contains(&run.robot_stopped), "{}", run.robot_stopped);
        }
        // Measured: 17 goals, 6 encounters, 3 % of the time on collision course.
        assert!((15.5..=19.0).contains(&mean(&runs, |run| run.goals as f64)));
        assert!((2.5..=8.0).contains(&mean(&runs, |run| run.encounters.len() as f64)));
        assert!((0.015..=0.05).contains(&mean(&runs, |run| run.collision_course)));
    }

    #[test]
    fn encounters_show_as_dips_of_speed_at_a_distance() {
        let met: Vec<Encounter> =
            runs(&Scenario::default()).into_iter().flat_map(|run| run.encounters).collect();
        let lasting: Vec<_> = met.iter().filter(|one| one.end - one.start > 1.0).collect();
        let dips = lasting.iter().filter(|one| (0.2..=0.9).contains(&one.least_speed)).count();
        assert!(dips * 10 >= lasting.len() * 8, "{dips} of {}", lasting.len());
        assert!(met.iter().all(|one| one.least_distance > 0.4), "nobody is run over");
    }

    #[test]
    fn a_person_who_ignores_robots_keeps_her_speed_in_encounters() {
        let mut scenario = Scenario::default();
        scenario.people[0].walk.avoids = false;
        let met: Vec<Encounter> = runs(&scenario).into_iter().flat_map(|run| run.encounters).collect();
        let dips = met.iter().filter(|one| one.least_speed < 0.5).count();
        assert!(dips * 10 <= met.len() * 3, "{dips} of {}: only at their goals", met.len());
    }

    #[test]
    fn paths_cross_at_the_centre() {
        let crossing = runs(&Scenario::named("pass_by_the_centre").unwrap());
        assert!(mean(&crossing, |run| run.encounters.len() as f64) > 3.0);
        let parked = runs(&Scenario::named("robot_off").unwrap());
        assert!(parked.iter().all(|run| run.robot_stopped == 1.0));
    }
}
