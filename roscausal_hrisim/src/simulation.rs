//! The whole simulation, stepped at 25 Hz. The same scenario and seed give the same run, bit for bit.

use roscausal_core::{Error, Result};

use crate::{
    day::Day,
    geometry::Vec2,
    intervention::{Intervention, Target},
    pedestrian::{Crowd, Pedestrian, group_sizes},
    person::{Body, Person, Teleop},
    plans::{Goals, robot_waypoints},
    rng::Rng,
    robot::{Robot, RobotOrders},
    scenario::{PersonSpec, Scenario},
    world::World,
};

/// Length of a step, seconds (25 Hz).
pub const STEP: f64 = 0.04;
/// The same in nanoseconds.
pub const STEP_NANOS: i64 = 40_000_000;

/// Random streams. Each consumer has its own, so one more agent does not change the others.
mod stream {
    pub(super) const PERSON: u64 = 1 << 32;
    pub(super) const GOALS: u64 = 2 << 32;
    pub(super) const ROBOT: u64 = 3 << 32;
    pub(super) const CROWD: u64 = 4 << 32;
    pub(super) const PLACES: u64 = 5 << 32;
    pub(super) const DAY: u64 = 6 << 32;
}

/// A running simulation.
#[derive(Clone, Debug)]
pub struct Simulation {
    scenario: Scenario,
    seed: u64,
    world: World,
    steps: u64,
    /// The robots.
    pub robots: Vec<Robot>,
    /// The scripted or teleoperated people.
    pub people: Vec<Person>,
    /// The social-force pedestrians.
    pub crowd: Crowd,
    /// The working day, if it is one; the crowd is its people.
    pub day: Option<Day>,
    goals: Vec<Goals>,
    crowd_rng: Rng,
    interventions: Vec<Intervention>,
    robot_speed_scale: f64,
}

/// A context variable: an intervention and its current value.
#[derive(Clone, Debug, PartialEq)]
pub struct Context {
    /// Column name, such as `do_robot_speed`.
    pub name: String,
    /// The current value; empty if nothing is imposed.
    pub value: Vec<f64>,
}

impl Simulation {
    /// The scenario at time 0.
    ///
    /// # Errors
    /// A wrong field of the scenario ([`Scenario::check`]).
    pub fn new(scenario: &Scenario, seed: u64) -> Result<Self> {
        scenario.check()?;
        let world = scenario.world()?;
        let mut goals = Vec::new();
        let mut people = Vec::new();
        for (index, spec) in scenario.people.iter().enumerate() {
            let own = index as u64;
            let mut next = Goals::new(scenario, index, Rng::new(seed, stream::GOALS + own));
            let mut rng = Rng::new(seed, stream::PLACES + own);
            let start = start_of(spec, &world, &mut next, &mut rng);
            let goal = next.next(&world, start);
            let rng = Rng::new(seed, stream::PERSON + own);
            people.push(Person::new(scenario.person_id(index), spec.walk.clone(), start, goal, rng));
            goals.push(next);
        }
        let robots = scenario.robots.iter().enumerate().map(|(index, spec)| {
            let mut rng = Rng::new(seed, stream::ROBOT + index as u64);
            let mut waypoints = robot_waypoints(scenario, index);
            if waypoints.is_empty() {
                waypoints = random_waypoints(&world, &mut rng);
            }
            let first = waypoints.first().copied().unwrap_or(Vec2::ZERO);
            Robot::new(spec.name.clone(), spec.drive.clone(), spec.start.unwrap_or(first), waypoints, rng)
        });
        let robots: Vec<Robot> = robots.collect();
        let mut crowd_rng = Rng::new(seed, stream::CROWD);
        let top_speed = scenario.robots.first().map_or(1.0, |robot| robot.drive.speed);
        let day = scenario.day.as_ref().map(|day| Day::new(day, Rng::new(seed, stream::DAY), top_speed));
        let (day, crowd) = match day.transpose()? {
            Some((day, crowd)) => (Some(day), crowd),
            None => (None, crowd_of(scenario, &world, &mut crowd_rng)),
        };
        Ok(Self {
            scenario: scenario.clone(),
            seed,
            world,
            steps: 0,
            robots,
            people,
            crowd,
            day,
            goals,
            crowd_rng,
            interventions: scenario.interventions.clone(),
            robot_speed_scale: 1.0,
        })
    }

    /// Restarts at time 0. Interventions and commands given during the run are dropped.
    ///
    /// # Errors
    /// None for a scenario that has run before.
    pub fn reset(&mut self) -> Result<()> {
        *self = Self::new(&self.scenario, self.seed)?;
        Ok(())
    }

    /// The scenario it runs.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The seed of all randomness.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The map.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Simulated time since the start, seconds.
    pub fn time(&self) -> f64 {
        self.nanos() as f64 * 1e-9
    }

    /// Simulated time since the start, nanoseconds.
    pub fn nanos(&self) -> i64 {
        self.steps as i64 * STEP_NANOS
    }

    /// Steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Whether the scenario's duration is over.
    pub fn is_over(&self) -> bool {
        self.time() >= self.scenario.duration - STEP / 2.0
    }

    /// Moves everybody by one step. All of them see the same moment.
    pub fn step(&mut self) {
        if let (Some(day), [robot]) = (&mut self.day, &mut self.robots[..]) {
            day.step(STEP, self.steps, &self.world, robot, &mut self.crowd);
            self.steps += 1;
            return;
        }
        let time = self.time();
        self.renew_goals(time);
        let person = |of: &Person| Body { position: of.position, velocity: of.velocity(), is_robot: false };
        let robot = |of: &Robot| Body { position: of.position, velocity: of.velocity(), is_robot: true };
        let people: Vec<Body> = self.people.iter().map(person).collect();
        let robots: Vec<Body> = self.robots.iter().map(robot).collect();
        let crowd: Vec<Body> = self.crowd.members.iter().map(Crowd::body).collect();
        let walkers: Vec<Vec2> = people.iter().chain(&crowd).map(|body| body.position).collect();

        for index in 0..self.robots.len() {
            let orders = self.robot_orders(index, time);
            self.robots[index].step(STEP, self.steps, &self.world, &walkers, orders);
        }
        for index in 0..self.people.len() {
            let imposed = self.imposed_speed(self.people[index].id, time);
            let rest = people.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, body)| body);
            let others: Vec<Body> = robots.iter().chain(rest).chain(&crowd).copied().collect();
            self.people[index].step(STEP, self.steps, &self.world, &others, imposed);
        }
        if !self.crowd.members.is_empty() {
            let others: Vec<Body> = people.into_iter().chain(robots).collect();
            self.crowd.step(STEP, self.steps, &self.world, &others);
        }
        self.steps += 1;
    }

    fn renew_goals(&mut self, time: f64) {
        for (person, goals) in self.people.iter_mut().zip(&mut self.goals) {
            let id = person.id.to_string();
            let imposed = self.interventions.iter().find_map(|one| match one.target {
                Target::HumanGoal(goal) if one.is_active(time) && one.concerns(&id) => Some(goal),
                _ => None,
            });
            let arrived = person.has_arrived();
            if let Some(goal) = imposed {
                person.goals_reached += u64::from(arrived && person.goal != goal);
                person.goal = goal;
            } else if arrived {
                person.goals_reached += 1;
                person.goal = goals.next(&self.world, person.position);
            }
        }
        let (world, rng) = (&self.world, &mut self.crowd_rng);
        self.crowd
            .renew_goals(|member| world.random_free(rng, member.position, 0.6).unwrap_or(member.position));
    }

    fn robot_orders(&self, index: usize, time: f64) -> RobotOrders {
        let robot = &self.robots[index];
        let mut orders = RobotOrders { speed: Some(robot.params.speed * self.robot_speed_scale), off: false };
        for one in self.interventions.iter().filter(|one| one.is_active(time) && one.concerns(&robot.name)) {
            match one.target {
                Target::RobotSpeed(speed) => orders.speed = Some(speed),
                Target::RobotOff => orders.off = true,
                Target::HumanV(_) | Target::HumanGoal(_) => {}
            }
        }
        orders
    }

    fn imposed_speed(&self, id: u32, time: f64) -> Option<f64> {
        let id = id.to_string();
        self.interventions.iter().find_map(|one| match one.target {
            Target::HumanV(v) if one.is_active(time) && one.concerns(&id) => Some(v),
            _ => None,
        })
    }

    /// All interventions, past and future.
    pub fn interventions(&self) -> &[Intervention] {
        &self.interventions
    }

    /// Adds an intervention, in simulated time.
    ///
    /// # Errors
    /// It overlaps another one, concerns nobody, or sets a goal that cannot be reached.
    pub fn intervene(&mut self, one: Intervention) -> Result<()> {
        let mut scenario = self.scenario.clone();
        scenario.interventions.clone_from(&self.interventions);
        scenario.interventions.push(one);
        scenario.check()?;
        self.interventions = scenario.interventions;
        Ok(())
    }

    /// The current interventions, one entry per context column of the run, in a fixed order.
    pub fn context(&self) -> Vec<Context> {
        let time = self.time();
        let mut columns: Vec<Context> = Vec::new();
        for one in &self.interventions {
            let name = one.column();
            let value = if one.is_active(time) { one.value() } else { Vec::new() };
            match columns.iter_mut().find(|column| column.name == name) {
                Some(column) if column.value.is_empty() => column.value = value,
                Some(_) => {}
                None => columns.push(Context { name, value }),
            }
        }
        columns
    }

    /// Drives a person by hand from now on; `None` lets them walk on their own again.
    ///
    /// # Errors
    /// No person with that id, or a speed that is not finite.
    pub fn teleoperate(&mut self, id: u32, command: Option<Teleop>) -> Result<()> {
        let finite = command.is_none_or(|command| command.v.is_finite() && command.omega.is_finite());
        Error::ensure(finite, "cmd_vel", || "a speed is not a finite number")?;
        let person = self.people.iter_mut().find(|person| person.id == id);
        let unknown = || Error::param("person", format!("nobody has the id {id}"));
        person.ok_or_else(unknown)?.teleop = command;
        Ok(())
    }

    /// Scales the robots' own top speeds (`twist_mux/scaling_factor`) by 0 to 10. Other factors are ignored.
    pub fn scale_robot_speed(&mut self, factor: f64) {
        if (0.0..=10.0).contains(&factor) {
            self.robot_speed_scale = factor;
        }
    }

    /// A person's risk of collision with the nearest robot, by the paper's formula with weight v/10 for their own
    /// speed. Without robots it is that weight alone.
    pub fn risk(&self, person: &Person, size: f64, safe_distance: f64) -> f64 {
        let own = person.v / 10.0;
        let distance = |robot: &&Robot| robot.position.distance(person.position);
        let nearest = self.robots.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map_or(libm::exp(own), |robot| {
            person.approach(robot.position, robot.velocity()).risk(own, size, safe_distance)
        })
    }
}

fn start_of(spec: &PersonSpec, world: &World, goals: &mut Goals, rng: &mut Rng) -> Vec2 {
    let (min, max) = world.bounds();
    spec.start.unwrap_or_else(|| {
        let hub = world.random_free(rng, (min + max) * 0.5, 0.6).unwrap_or(Vec2::ZERO);
        goals.next(world, hub)
    })
}

/// A loop of four positions that are reachable from each other.
fn random_waypoints(world: &World, rng: &mut Rng) -> Vec<Vec2> {
    let mut waypoints = Vec::new();
    let (min, max) = world.bounds();
    let mut hub = (min + max) * 0.5;
    for _ in 0..4 {
        let Some(place) = world.random_free(rng, hub, 0.8) else { continue };
        waypoints.push(place);
        hub = waypoints[0];
    }
    waypoints
}

fn crowd_of(scenario: &Scenario, world: &World, rng: &mut Rng) -> Crowd {
    let spec = &scenario.pedestrians;
    let sizes = if spec.groups { group_sizes(spec.count, rng) } else { vec![1; spec.count] };
    let (min, max) = world.bounds();
    let hub = world.random_free(rng, (min + max) * 0.5, 0.6).unwrap_or((min + max) * 0.5);
    let mut members = Vec::new();
    for (group, size) in sizes.into_iter().enumerate() {
        let place = world.random_free(rng, hub, 0.8).unwrap_or(hub);
        let goal = world.random_free(rng, hub, 0.6).unwrap_or(hub);
        for _ in 0..size {
            let id = members.len() as u32 + 1;
            let start = world.moved(place, place + rng.normal2(0.4), 0.3);
            let v_max = (spec.speed_mean + spec.speed_sd * rng.normal()).clamp(0.3, 3.0);
            members.push(Pedestrian::new(id, start, goal, v_max, group));
        }
    }
    Crowd::new(members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::SCENARIOS;

    fn trace(simulation: &Simulation) -> Vec<u64> {
        let people = simulation.people.iter().map(|p| (p.position, p.v));
        let robots = simulation.robots.iter().map(|r| (r.position, r.v));
        let crowd = simulation.crowd.members.iter().map(|m| (m.position, m.theta));
        people
            .chain(robots)
            .chain(crowd)
            .flat_map(|(p, v)| [p.x.to_bits(), p.y.to_bits(), v.to_bits()])
            .collect()
    }

    fn run(scenario: &Scenario, seed: u64, steps: u64) -> Simulation {
        let mut simulation = Simulation::new(scenario, seed).unwrap();
        (0..steps).for_each(|_| simulation.step());
        simulation
    }

    #[test]
    fn same_seed_same_bits_and_another_seed_another_run() {
        for name in SCENARIOS {
            let scenario = Scenario::named(name).unwrap();
            let first = trace(&run(&scenario, 1, 500));
            assert_eq!(first, trace(&run(&scenario, 1, 500)), "{name}");
            assert_ne!(first, trace(&run(&scenario, 2, 500)), "{name}");
        }
    }

    #[test]
    fn reset_begins_the_same_run_again() {
        let scenario = Scenario::default();
        let mut simulation = run(&scenario, 3, 200);
        let first = trace(&simulation);
        simulation.intervene("robot.off@8.0..".parse().unwrap()).unwrap();
        simulation.reset().unwrap();
        assert_eq!(simulation.time(), 0.0);
        (0..200).for_each(|_| simulation.step());
        assert_eq!(trace(&simulation), first);
    }

    #[test]
    fn nobody_walks_through_a_wall_in_ten_thousand_steps() {
        for map in crate::world::MAPS {
            let scenario = Scenario { map: map.to_owned(), ..Scenario::crowd(12, 1) };
            let mut simulation = Simulation::new(&scenario, 1).unwrap();
            let mut goals = 0;
            for _ in 0..10_000 {
                let before: Vec<_> = simulation.crowd.members.iter().map(|m| (m.position, m.goal)).collect();
                simulation.step();
                for (member, (position, goal)) in simulation.crowd.members.iter().zip(before) {
                    assert!(member.position.is_finite());
                    assert!(
                        simulation.world.is_clear(position, member.position, 1e-6),
                        "{map}: {position:?}"
                    );
                    goals += usize::from(member.goal != goal);
                }
            }
            assert!(goals > 50, "{map}: they get about: {goals}");
        }
    }

    #[test]
    fn interventions_hold_from_start_to_end_and_show_as_context() {
        let scenario = Scenario {
            interventions: vec![
                "robot.speed=0.2@10..20".parse().unwrap(),
                "human.v=0.7@12..".parse().unwrap(),
            ],
            ..Scenario::default()
        };
        let mut simulation = Simulation::new(&scenario, 1).unwrap();
        let mut fastest = [0.0f64; 2];
        while simulation.time() < 30.0 {
            let time = simulation.time();
            let context = simulation.context();
            assert_eq!(context[0].name, "do_robot_speed");
            assert_eq!(context[0].value, if (10.0..20.0).contains(&time) { vec![0.2] } else { vec![] });
            assert_eq!(context[1].value, if time >= 12.0 { vec![0.7] } else { vec![] });
            simulation.step();
            if (12.0..19.0).contains(&time) {
                fastest[0] = fastest[0].max(simulation.robots[0].v);
            }
            fastest[1] = fastest[1].max(simulation.robots[0].v);
            if time > 15.0 {
                assert!((simulation.people[0].v - 0.7).abs() < 1e-9);
            }
        }
        assert!((fastest[0] - 0.2).abs() < 1e-9 && (fastest[1] - 0.5).abs() < 1e-9, "{fastest:?}");
    }

    #[test]
    fn an_imposed_goal_is_walked_to_and_waited_at() {
        let scenario =
            Scenario { interventions: vec!["human.goal=0,8@0..60".parse().unwrap()], ..Scenario::default() };
        let simulation = run(&scenario, 1, 1450);
        assert!(simulation.people[0].has_arrived());
        assert_eq!(simulation.people[0].goal, Vec2::new(0.0, 8.0));
        assert!(simulation.people[0].v < 0.01);
        let later = run(&scenario, 1, 1510);
        assert_ne!(later.people[0].goal, Vec2::new(0.0, 8.0));
    }

    #[test]
    fn overlapping_interventions_are_refused_while_running_too() {
        let mut simulation = Simulation::new(&Scenario::default(), 1).unwrap();
        simulation.intervene("robot.speed=0.2@5..9".parse().unwrap()).unwrap();
        let stated = simulation.intervene("robot.off@8..".parse().unwrap()).unwrap_err().to_string();
        assert!(stated.contains("overlaps"), "{stated}");
        assert_eq!(simulation.interventions().len(), 1);
    }

    #[test]
    fn a_teleoperated_person_obeys() {
        let mut simulation = Simulation::new(&Scenario::default(), 1).unwrap();
        simulation.teleoperate(1000, Some(Teleop { v: 0.5, omega: 0.1 })).unwrap();
        (0..100).for_each(|_| simulation.step());
        assert!(
            (simulation.people[0].v - 0.5).abs() < 1e-9 && (simulation.people[0].omega - 0.1).abs() < 1e-9
        );
        assert!(simulation.teleoperate(7, None).is_err());
        assert!(simulation.teleoperate(1000, Some(Teleop { v: f64::NAN, omega: 0.0 })).is_err());
    }
}
