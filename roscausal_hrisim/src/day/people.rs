//! The people of a working day: when they come, where they go, and how they walk.

use std::collections::HashMap;

use super::{Day, DaySpec, HOUR, of_kind, still_to_pass};
use crate::{
    geometry::Vec2,
    pedestrian::{Crowd, Pedestrian},
    rng::Rng,
    robot::Robot,
    social_force::{ROBOT_DISTANCE_FACTOR, SOCIAL_WEIGHT, desired, social},
};
use roscausal_reasoning::route::map::{Map, Place};

/// Within this distance of the robot people walk by the social force, metres.
const LOOKED_AT: f64 = 8.0;
/// Elsewhere they move once in this many steps.
const COARSE: u64 = 5;
/// People this near to each other feel each other, metres.
const FELT: f64 = 3.0;
/// Where the robot is nearer than this to a place, people leave it, and do not choose it, metres.
const SHUNNED: f64 = 6.0;
/// How likely somebody who stands at such a place leaves it within a second.
const LEAVES: f64 = 0.05;
/// From the entrance to where they come from and go to, metres.
const OUTSIDE: Vec2 = Vec2::new(-10.0, 0.0);
/// They stray at most this far from the straight line between two places, metres.
const STRAY: f64 = 1.5;

/// One person's day.
#[derive(Clone, Debug)]
pub(super) struct Worker {
    team: usize,
    /// When they come and go, seconds.
    shift: (f64, f64),
    /// The place where they are, or that they have passed.
    here: usize,
    /// Places still to pass, the next one last.
    way: Vec<usize>,
    /// Where exactly they go at the next place.
    spot: Vec2,
    /// Until when they stay, once there.
    until: f64,
}

/// How strongly each team is drawn to each place in each hour.
pub(super) fn weights(spec: &DaySpec, map: &Map) -> Vec<Vec<Vec<f64>>> {
    let zone = |place: &'_ Place| {
        place.name.rsplit_once('_').map_or(place.name.clone(), |(zone, _)| zone.to_owned())
    };
    let of_hour = |team: usize, hour: usize, rng: &mut Rng| -> Vec<f64> {
        let lunch = (spec.lunch - spec.begins).floor() as i64 + team as i64 == hour as i64;
        let mut zones = HashMap::new();
        let mut weight = |place: &Place| {
            let drawn = *zones.entry(zone(place)).or_insert_with(|| libm::exp(spec.contrast * rng.normal()));
            match place.kind.as_str() {
                "shelf" => drawn,
                "corridor" => 0.2 * drawn,
                "office" => 0.5 * drawn,
                "canteen" if lunch => 60.0,
                "canteen" => 0.5,
                _ => 0.0,
            }
        };
        map.places.iter().map(&mut weight).collect()
    };
    let of_team = |team: usize| {
        let mut rng = Rng::new(spec.house, team as u64);
        (0..spec.hours.ceil() as usize).map(|hour| of_hour(team, hour, &mut rng)).collect()
    };
    (0..spec.teams.len()).map(of_team).collect()
}

impl Day {
    /// The people before they come: all stand outside of the entrance.
    pub(super) fn people(&mut self) -> Crowd {
        let entrance = of_kind(&self.map, "entrance");
        let outside = self.at(entrance) + OUTSIDE;
        let mut members = Vec::new();
        for (team, count) in self.spec.teams.clone().into_iter().enumerate() {
            for _ in 0..count {
                let comes = self.rng.uniform(0.0, 0.5 * HOUR);
                let goes = (self.spec.hours - self.rng.uniform(0.2, 1.5)) * HOUR;
                let spot = outside + self.rng.normal2(0.5);
                let (shift, way) = ((comes, goes), Vec::new());
                self.workers.push(Worker { team, shift, here: entrance, way, spot, until: comes });
                let v_max = (1.2 + 0.2 * self.rng.normal()).clamp(0.6, 1.8);
                members.push(Pedestrian::new(members.len() as u32 + 1, spot, spot, v_max, members.len()));
            }
        }
        Crowd::new(members)
    }

    /// Moves the people by one step; who is far from the robot moves once in five.
    pub(super) fn walk(&mut self, dt: f64, step: u64, robot: &Robot, crowd: &mut Crowd) {
        let time = step as f64 * dt;
        for index in 0..self.workers.len() {
            let near = crowd.members[index].position.distance(robot.position) < LOOKED_AT;
            if near {
                self.walk_finely(index, dt, self.force(index, robot, crowd), crowd);
            } else if !(step + index as u64).is_multiple_of(COARSE) {
                continue;
            } else {
                walk_coarsely(&mut crowd.members[index], self.workers[index].spot, dt * COARSE as f64);
            }
            let passed = crowd.members[index].position.distance(self.workers[index].spot) < 0.6;
            if passed && self.workers[index].way.len() > 1 {
                self.go_on(index);
            } else if passed && self.workers[index].way.len() == 1 {
                self.arrive(index, time);
            } else if self.workers[index].way.is_empty() {
                self.stay(index, (time, if near { dt } else { dt * COARSE as f64 }), robot);
            }
            let goal =
                self.workers[index].way.first().map_or(self.workers[index].spot, |place| self.at(*place));
            crowd.members[index].goal = goal;
        }
    }

    fn go_on(&mut self, index: usize) {
        let passed = self.workers[index].way.pop().unwrap_or_default();
        let next = self.workers[index].way.last().copied().unwrap_or(passed);
        let spot = self.spot(next);
        let worker = &mut self.workers[index];
        (worker.here, worker.spot) = (passed, spot);
    }

    fn arrive(&mut self, index: usize, time: f64) {
        let place = self.workers[index].way.pop().unwrap_or_default();
        let minutes = match self.map.places[place].kind.as_str() {
            "canteen" => 25.0,
            "office" => 15.0,
            "corridor" => 1.0,
            _ => 10.0,
        };
        let stays = -minutes * 60.0 * libm::log(1.0 - self.rng.unit());
        let goes_home = time >= self.workers[index].shift.1 && place == of_kind(&self.map, "entrance");
        let outside = self.at(place) + OUTSIDE + self.rng.normal2(0.5);
        let worker = &mut self.workers[index];
        worker.here = place;
        worker.until = if goes_home { f64::INFINITY } else { time + stays };
        worker.spot = if goes_home { outside } else { worker.spot };
    }

    /// Leaves for another place when the time is over, or when the robot is here.
    fn stay(&mut self, index: usize, (time, dt): (f64, f64), robot: &Robot) {
        let (until, here) = (self.workers[index].until, self.workers[index].here);
        let came = time >= self.workers[index].shift.0;
        let shuns = came && until.is_finite() && self.at(here).distance(robot.position) < SHUNNED;
        if !(time >= until || shuns && self.rng.unit() < LEAVES * dt) {
            return;
        }
        let goes_home = time >= self.workers[index].shift.1;
        let to = if goes_home { of_kind(&self.map, "entrance") } else { self.choose(index, time, robot) };
        if to == here {
            self.workers[index].until = time + 30.0;
            return;
        }
        let way = still_to_pass(&self.map.way(here, to));
        let spot = self.spot(way.last().copied().unwrap_or(to));
        let worker = &mut self.workers[index];
        (worker.way, worker.spot) = (way, spot);
    }

    /// A place by the team's weights of the hour, other than where they are and where the robot is.
    fn choose(&mut self, index: usize, time: f64, robot: &Robot) -> usize {
        let drawn = self.rng.unit();
        let by_hour = &self.weights[self.workers[index].team];
        let hour = ((time / HOUR) as usize).min(by_hour.len().saturating_sub(1));
        let here = self.workers[index].here;
        let weight = |place: usize| {
            let free =
                self.open[place] && place != here && self.at(place).distance(robot.position) >= SHUNNED;
            if free { by_hour[hour][place] } else { 0.0 }
        };
        let mut left = drawn * (0..self.open.len()).map(weight).sum::<f64>();
        let found = (0..self.open.len()).find(|&place| {
            left -= weight(place);
            left < 0.0
        });
        found.unwrap_or(here)
    }

    /// Somewhere within 1.5 m of a place.
    fn spot(&mut self, place: usize) -> Vec2 {
        self.at(place) + self.rng.normal2(0.6).at_most(STRAY)
    }

    /// The push of the robot and of people nearby.
    fn force(&self, index: usize, robot: &Robot, crowd: &Crowd) -> Vec2 {
        let me = &crowd.members[index];
        let mut push =
            social(robot.position - me.position, me.velocity - robot.velocity(), ROBOT_DISTANCE_FACTOR);
        for (other, body) in crowd.members.iter().enumerate() {
            let offset = body.position - me.position;
            if other != index && offset.dot(offset) < FELT * FELT {
                push += social(offset, me.velocity - body.velocity, 1.0);
            }
        }
        push * SOCIAL_WEIGHT
    }

    fn walk_finely(&self, index: usize, dt: f64, force: Vec2, crowd: &mut Crowd) {
        let worker = &self.workers[index];
        let member = &mut crowd.members[index];
        let offset = worker.spot - member.position;
        let wish = if offset.norm() > 0.3 { offset.unit() } else { Vec2::ZERO };
        let pull = desired(member.v_max, wish, member.velocity);
        member.velocity = (member.velocity + (pull + force) * dt).at_most(member.v_max);
        member.position += member.velocity * dt;
        let way = crate::geometry::Segment { a: self.at(worker.here), b: worker.spot };
        let on_way = way.nearest(member.position);
        member.position = on_way + (member.position - on_way).at_most(2.0 * STRAY);
        turn(member);
    }
}

fn walk_coarsely(member: &mut Pedestrian, to: Vec2, dt: f64) {
    let offset = to - member.position;
    member.velocity = if offset.norm() > 0.3 { offset.unit() * member.v_max } else { Vec2::ZERO };
    member.position += (member.velocity * dt).at_most(offset.norm());
    turn(member);
}

fn turn(member: &mut Pedestrian) {
    if member.velocity.norm() > 1e-3 {
        member.theta = member.velocity.angle();
    }
}
