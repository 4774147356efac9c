//! Pedestrians by the social force model. Each feels its neighbours, the walls and its group.

use crate::{
    geometry::Vec2,
    navigator::Navigator,
    neighbours::Neighbours,
    person::Body,
    rng::Rng,
    social_force::{
        NEIGHBOUR_RANGE, OBSTACLE_WEIGHT, ROBOT_DISTANCE_FACTOR, SOCIAL_WEIGHT, desired, group, obstacle,
        social,
    },
    world::World,
};

/// Radius of the body against walls, metres.
const BODY_RADIUS: f64 = 0.2;
/// Below this speed the heading stays unchanged, m/s.
const AT_REST: f64 = 1e-3;

/// One walking pedestrian.
#[derive(Clone, Debug)]
pub struct Pedestrian {
    /// Track id.
    pub id: u32,
    /// Position in the map frame, metres.
    pub position: Vec2,
    /// Velocity in the map frame, m/s.
    pub velocity: Vec2,
    /// Direction of motion; at rest the last one. Radians.
    pub theta: f64,
    /// Turning rate of that direction, rad/s.
    pub omega: f64,
    /// Preferred speed, which it never exceeds, m/s.
    pub v_max: f64,
    /// Its goal.
    pub goal: Vec2,
    /// A goal is reached within this distance, metres.
    pub arrival: f64,
    /// Group number; members of one group walk together.
    pub group: usize,
    navigator: Option<Navigator>,
}

impl Pedestrian {
    /// A pedestrian standing at `position`.
    pub fn new(id: u32, position: Vec2, goal: Vec2, v_max: f64, group: usize) -> Self {
        let theta = (goal - position).angle();
        let velocity = Vec2::ZERO;
        Self { id, position, velocity, theta, omega: 0.0, v_max, goal, arrival: 1.0, group, navigator: None }
    }

    /// Whether it is within the goal disc.
    pub fn has_arrived(&self) -> bool {
        self.position.distance(self.goal) <= self.arrival
    }

    /// Moves by one step of semi-implicit Euler under `force` plus [`desired`].
    fn step(&mut self, dt: f64, step: u64, world: &World, force: Vec2) {
        let target = Navigator::next(&mut self.navigator, world, self.position, self.goal, step);
        let pull = desired(self.v_max, (target - self.position).unit(), self.velocity);
        self.velocity = (self.velocity + (pull + force) * dt).at_most(self.v_max);
        let before = self.position;
        self.position = world.moved(before, before + self.velocity * dt, BODY_RADIUS);
        let heading = if self.velocity.norm() > AT_REST { self.velocity.angle() } else { self.theta };
        self.omega = crate::geometry::wrap(heading - self.theta) / dt;
        self.theta = heading;
    }
}

/// All pedestrians, and their groups.
#[derive(Clone, Debug, Default)]
pub struct Crowd {
    /// The pedestrians, ids ascending.
    pub members: Vec<Pedestrian>,
    groups: Vec<Vec<usize>>,
}

impl Crowd {
    /// A crowd of these pedestrians, with groups given by [`Pedestrian::group`].
    pub fn new(members: Vec<Pedestrian>) -> Self {
        let count = members.iter().map(|member| member.group + 1).max().unwrap_or(0);
        let mut groups = vec![Vec::new(); count];
        members.iter().enumerate().for_each(|(index, member)| groups[member.group].push(index));
        Self { members, groups }
    }

    /// Moves all by one step among robots and scripted people.
    pub(crate) fn step(&mut self, dt: f64, step: u64, world: &World, others: &[Body]) {
        let mut bodies: Vec<Body> = self.members.iter().map(Self::body).collect();
        bodies.extend_from_slice(others);
        let near = Neighbours::new(bodies.iter().map(|body| body.position), NEIGHBOUR_RANGE);
        let forces: Vec<Vec2> =
            (0..self.members.len()).map(|index| self.force(index, world, &bodies, &near)).collect();
        self.members.iter_mut().zip(forces).for_each(|(member, force)| member.step(dt, step, world, force));
    }

    pub(crate) fn body(member: &Pedestrian) -> Body {
        Body { position: member.position, velocity: member.velocity, is_robot: false }
    }

    /// Gives each group whose first member has arrived a new goal from `draw`.
    pub(crate) fn renew_goals(&mut self, mut draw: impl FnMut(&Pedestrian) -> Vec2) {
        for group in &self.groups {
            let first = group.first().map(|&first| &self.members[first]);
            let Some(first) = first.filter(|first| first.has_arrived()) else { continue };
            let goal = draw(first);
            group.iter().for_each(|&index| self.members[index].goal = goal);
        }
    }

    /// The forces on a pedestrian, except its own drive.
    fn force(&self, index: usize, world: &World, bodies: &[Body], near: &Neighbours) -> Vec2 {
        let me = &self.members[index];
        let mut push = Vec2::ZERO;
        near.each_near(me.position, |other| {
            let body = &bodies[other];
            let offset = body.position - me.position;
            if other != index && offset.dot(offset) <= NEIGHBOUR_RANGE * NEIGHBOUR_RANGE {
                let factor = if body.is_robot { ROBOT_DISTANCE_FACTOR } else { 1.0 };
                push += social(offset, me.velocity - body.velocity, factor);
            }
        });
        let walls =
            world.nearest_wall_point(me.position).map_or(Vec2::ZERO, |wall| obstacle(me.position, wall));
        let mates = self.groups[me.group].iter().filter(|&&mate| mate != index);
        let places: Vec<Vec2> = mates.map(|&mate| self.members[mate].position).collect();
        let together = group(me.position, me.velocity, me.theta, &places);
        push * SOCIAL_WEIGHT + walls * OBSTACLE_WEIGHT + together
    }
}

/// Sizes of groups, 1 + Poisson(1.1), that add up to `count`.
pub(crate) fn group_sizes(count: usize, rng: &mut Rng) -> Vec<usize> {
    let mut left = count;
    let mut sizes = Vec::new();
    while left > 0 {
        let size = (1 + rng.poisson(1.1)).min(left);
        sizes.push(size);
        left -= size;
    }
    sizes
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.04;

    fn hall() -> World {
        World::named("hall").unwrap()
    }

    #[test]
    fn a_lone_walker_reaches_its_goal_at_its_top_speed() {
        let mut crowd =
            Crowd::new(vec![Pedestrian::new(1, Vec2::new(-5.0, 0.0), Vec2::new(5.0, 0.0), 1.34, 0)]);
        let mut top = 0.0f64;
        for step in 0..250 {
            crowd.step(DT, step, &hall(), &[]);
            top = top.max(crowd.members[0].velocity.norm());
        }
        assert!(crowd.members[0].has_arrived());
        assert!((top - 1.34).abs() < 1e-3, "{top}");
    }

    #[test]
    fn two_walkers_head_on_pass_without_touching() {
        for offset in [0.0, 0.05, -0.2] {
            let (left, right) = (Vec2::new(-6.0, 0.0), Vec2::new(6.0, offset));
            let mut crowd = Crowd::new(vec![
                Pedestrian::new(1, left, right, 1.3, 0),
                Pedestrian::new(2, right, left, 1.3, 1),
            ]);
            let mut least = f64::MAX;
            for step in 0..375 {
                crowd.step(DT, step, &hall(), &[]);
                least = least.min(crowd.members[0].position.distance(crowd.members[1].position));
            }
            assert!(least > 0.5, "offset {offset}: {least}");
            assert!(crowd.members.iter().all(Pedestrian::has_arrived), "offset {offset}");
        }
    }

    #[test]
    fn heading_at_rest_is_the_last_one() {
        let mut walker = Pedestrian::new(1, Vec2::ZERO, Vec2::ZERO, 1.3, 0);
        walker.theta = 1.0;
        walker.step(DT, 0, &hall(), Vec2::ZERO);
        assert_eq!((walker.theta, walker.omega), (1.0, 0.0));
    }

    #[test]
    fn group_sizes_add_up_and_follow_their_law() {
        let mut rng = Rng::new(5, 0);
        let sizes = group_sizes(10_000, &mut rng);
        assert_eq!(sizes.iter().sum::<usize>(), 10_000);
        let mean = 10_000.0 / sizes.len() as f64;
        assert!((mean - 2.1).abs() < 0.05, "{mean}");
    }
}
