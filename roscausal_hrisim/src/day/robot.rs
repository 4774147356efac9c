//! The robot of a working day: its tasks, its way along the places, its battery.
//!
//! A task is two ways: to the place where a load waits, and with the load to where it belongs. Each has a deadline of 1.6 times its
//! free travel time, from when the robot sets out. Who decides says when to set out and by which places ([`Day::decide`]); without anybody
//! the robot sets out at once on the shortest way. When nothing is to be done it goes to its charger.

use super::{Battery, Day, DaySpec, HOUR, of_kind, position, still_to_pass};
use crate::{
    geometry::Vec2,
    pedestrian::Crowd,
    rng::Rng,
    robot::{Robot, RobotOrders},
    world::World,
};
use roscausal_reasoning::route::map::{Map, NodeIndex};

/// A place is passed within this distance, metres, and reached within this one.
const PASSED: f64 = 1.0;
const REACHED: f64 = 0.6;
/// Each person who walks or stands ahead within this distance slows the robot down, metres.
const MINDED: f64 = 4.0;
/// It goes to its charger below this charge, percent, and leaves it for a task above this one.
const LOW: f64 = 25.0;
const ENOUGH: f64 = 50.0;
/// Seconds for starting, turning and stopping that a free way takes beside its length at top speed.
const STARTING: f64 = 6.0;
/// An empty robot is brought to its charger after this time, seconds.
const CARRIED: f64 = 1800.0;

/// Something to carry from one place to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// When it is given, seconds.
    pub given: f64,
    /// Where the load waits.
    pub from: usize,
    /// Where it belongs.
    pub to: usize,
}

/// A way that waits for a decision.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    /// Where the robot is.
    pub from: usize,
    /// Where it has to go.
    pub to: usize,
    /// Whether it carries a load.
    pub loaded: bool,
    /// Seconds that the way may take from setting out.
    pub allowed: f64,
    /// When it has to set out at the latest.
    pub latest: f64,
}

#[derive(Clone, Debug, Default, PartialEq)]
enum Doing {
    #[default]
    Idle,
    /// Waits for a decision on this way, and then for its moment.
    Deciding(Leg, Option<(f64, Vec<usize>)>),
    /// On its way; `since` when; the places left, the next one last.
    Driving {
        leg: Leg,
        since: f64,
        left: Vec<usize>,
        late: bool,
    },
    ToCharger(Vec<usize>),
    Charging,
    Empty(f64),
}

/// The robot's work of the day.
#[derive(Clone, Debug, Default)]
pub struct Porter {
    /// All tasks of the day.
    pub tasks: Vec<Task>,
    /// The first task that has not begun.
    next: usize,
    /// The load's target, once it is fetched.
    fetched: Option<Task>,
    doing: Doing,
    /// Whether somebody else decides ([`Day::decide`]); otherwise it takes the shortest way at once.
    pub guided: bool,
    /// Charge, percent.
    pub charge: f64,
    /// Where it is, or where it passed last.
    pub here: usize,
    /// Tasks done in time.
    pub done: usize,
    /// Tasks that came too late or were never begun.
    pub failed: usize,
    /// How often the battery was empty.
    pub empty: usize,
    /// Metres driven.
    pub driven: f64,
    /// Metres of ways that failed.
    pub wasted: f64,
    way_driven: f64,
    top_speed: f64,
    charger: usize,
}

impl Porter {
    pub(super) fn new(spec: &DaySpec, map: &Map, mut rng: Rng, top_speed: f64) -> Self {
        let work: Vec<usize> = (0..map.places.len()).filter(|&k| map.places[k].kind == "dock").collect();
        let here = of_kind(map, "charger");
        let mut given: Vec<f64> =
            (0..spec.tasks).map(|_| rng.uniform(0.5, spec.hours - 0.7) * HOUR).collect();
        given.sort_by(f64::total_cmp);
        let mut task = |given: f64| {
            let mut pair = || [work[rng.below(work.len())], work[rng.below(work.len())]];
            let far = |[a, b]: &[usize; 2]| map.distance[*a][*b] >= 25.0;
            let drawn = (0..100).map(|_| pair()).find(far).unwrap_or([work[0], work[work.len() - 1]]);
            Task { given, from: drawn[0], to: drawn[1] }
        };
        let tasks = if work.is_empty() { Vec::new() } else { given.into_iter().map(&mut task).collect() };
        Self {
            tasks,
            doing: Doing::Charging,
            charge: 100.0,
            here,
            top_speed,
            charger: here,
            ..Self::default()
        }
    }

    /// The way on which somebody has to decide.
    pub fn open_leg(&self) -> Option<&Leg> {
        if let Doing::Deciding(leg, None) = &self.doing { Some(leg) } else { None }
    }

    /// Whether it carries a load.
    pub fn is_loaded(&self) -> bool {
        matches!(&self.doing, Doing::Deciding(leg, _) | Doing::Driving { leg, .. } if leg.loaded)
    }

    /// Whether it stands at its charger.
    pub fn is_charging(&self) -> bool {
        self.doing == Doing::Charging
            || self.here == self.charger && matches!(self.doing, Doing::Deciding(..))
    }

    /// Whether it is on a way.
    pub fn is_driving(&self) -> bool {
        matches!(self.doing, Doing::Driving { .. } | Doing::ToCharger(_))
    }

    fn leg(&self, map: &Map, spec: &DaySpec, to: usize, loaded: bool, latest: f64) -> Leg {
        let free = map.distance[self.here][to] / self.top_speed + STARTING;
        Leg { from: self.here, to, loaded, allowed: spec.deadline * free, latest }
    }

    /// What to do when nothing is being done.
    fn next_doing(&mut self, map: &Map, spec: &DaySpec, time: f64) -> Doing {
        let charging = self.is_charging();
        while self.tasks.get(self.next).is_some_and(|task| task.given + spec.patience < time) {
            self.failed += 1;
            self.next += 1;
        }
        let may = self.charge > if charging { ENOUGH } else { LOW };
        if let Some(task) = self.tasks.get(self.next).copied().filter(|task| task.given <= time && may) {
            self.next += 1;
            self.fetched = Some(task);
            return Doing::Deciding(self.leg(map, spec, task.from, false, task.given + spec.patience), None);
        }
        if self.here == self.charger {
            return Doing::Charging;
        }
        Doing::ToCharger(still_to_pass(&map.way(self.here, self.charger)))
    }

    fn drain(&mut self, battery: &Battery, v: f64, dt: f64) {
        if self.is_charging() {
            self.charge = (self.charge + 100.0 * dt / (battery.charge * HOUR)).min(100.0);
            return;
        }
        let (idle, moving) = (100.0 / (battery.idle * HOUR), 100.0 / (battery.moving * HOUR));
        let fall = idle + (moving - idle) * v.abs() / self.top_speed;
        let load = if self.is_loaded() { battery.load } else { 1.0 };
        self.charge = (self.charge - fall * load * dt).max(0.0);
    }
}

impl Day {
    /// Decides on the open way: set out at `depart` (seconds; at the latest when it has to), by these places, the first of which is
    /// where the robot is. Returns whether that is a way from there to where it has to go.
    pub fn decide(&mut self, depart: f64, places: &[usize]) -> bool {
        let joined =
            |pair: &[usize]| self.map.graph.contains_edge(NodeIndex::new(pair[0]), NodeIndex::new(pair[1]));
        if let Doing::Deciding(leg, decided @ None) = &mut self.porter.doing
            && (places.first(), places.last()) == (Some(&leg.from), Some(&leg.to))
            && places.windows(2).all(joined)
        {
            *decided = Some((depart.min(leg.latest), still_to_pass(places)));
            return true;
        }
        false
    }

    /// Drives the robot by one step.
    pub(super) fn drive(&mut self, dt: f64, step: u64, world: &World, robot: &mut Robot, crowd: &Crowd) {
        let time = step as f64 * dt;
        let doing = std::mem::take(&mut self.porter.doing);
        self.porter.doing = self.go_on_with(doing, time, robot);
        let target = match &self.porter.doing {
            Doing::Driving { left, .. } | Doing::ToCharger(left) => left.last().map(|place| self.at(*place)),
            _ => None,
        };
        robot.waypoints = target.into_iter().collect();
        let ahead = |p: Vec2| {
            let offset = p - robot.position;
            offset.norm() < MINDED && offset.dot(Vec2::polar(1.0, robot.theta)) > 0.0
        };
        let minded = crowd.members.iter().filter(|member| ahead(member.position)).count();
        let walkers: Vec<_> = crowd.members.iter().map(|member| member.position).collect();
        let speed = Some(robot.params.speed / (1.0 + 4.0 * minded as f64));
        let before = robot.position;
        robot.step(dt, step, world, &walkers, RobotOrders { speed, off: target.is_none() });
        let moved = robot.position.distance(before);
        self.porter.driven += moved;
        self.porter.way_driven += moved;
        self.porter.drain(&self.spec.battery, robot.v, dt);
        if self.porter.charge <= 0.0 && !matches!(self.porter.doing, Doing::Empty(_)) {
            self.porter.empty += 1;
            self.porter.failed += usize::from(self.porter.fetched.take().is_some());
            self.porter.doing = Doing::Empty(time + CARRIED);
        }
    }

    fn go_on_with(&mut self, doing: Doing, time: f64, robot: &mut Robot) -> Doing {
        let porter = &mut self.porter;
        let reached =
            |place: usize, within: f64| robot.position.distance(position(&self.map, place)) < within;
        match doing {
            Doing::Idle | Doing::Charging => {
                porter.doing = doing;
                porter.next_doing(&self.map, &self.spec, time)
            }
            Doing::Deciding(leg, None) if !porter.guided => {
                let way = still_to_pass(&self.map.way(leg.from, leg.to));
                Doing::Deciding(leg, Some((time, way)))
            }
            Doing::Deciding(leg, Some((depart, left))) if depart <= time => {
                porter.way_driven = 0.0;
                Doing::Driving { leg, since: time, left, late: false }
            }
            Doing::Driving { leg, since, mut left, mut late } => {
                late |= time - since > leg.allowed;
                let within = if left.len() > 1 && !late { PASSED } else { REACHED };
                if left.last().is_some_and(|&place| reached(place, within)) {
                    porter.here = left.pop().unwrap_or_default();
                    if late {
                        porter.wasted += porter.way_driven;
                        porter.failed += 1;
                        porter.fetched = None;
                        return Doing::Idle;
                    }
                }
                if !left.is_empty() {
                    return Doing::Driving { leg, since, left, late };
                }
                match porter.fetched.take() {
                    Some(task) if !leg.loaded => {
                        porter.fetched = Some(task);
                        let latest = time.max(leg.latest);
                        Doing::Deciding(porter.leg(&self.map, &self.spec, task.to, true, latest), None)
                    }
                    _ => {
                        porter.done += 1;
                        Doing::Idle
                    }
                }
            }
            Doing::ToCharger(mut left) => {
                let within = if left.len() > 1 { PASSED } else { REACHED };
                if left.last().is_some_and(|&place| reached(place, within)) {
                    porter.here = left.pop().unwrap_or_default();
                    // A task that has come in the meantime is begun from here.
                    return porter.next_doing(&self.map, &self.spec, time);
                }
                Doing::ToCharger(left)
            }
            Doing::Empty(until) if time >= until => {
                (porter.here, robot.position) = (porter.charger, position(&self.map, porter.charger));
                Doing::Charging
            }
            waiting => waiting,
        }
    }
}
