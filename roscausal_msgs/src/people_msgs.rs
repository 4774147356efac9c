//! `people_msgs`.

use serde::{Deserialize, Serialize};

use crate::{geometry_msgs::Point, std_msgs::Header};

/// `people_msgs/Person`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Person {
    /// The person's name or number.
    pub name: String,
    /// Position.
    pub position: Point,
    /// Velocity in the header's frame.
    pub velocity: Point,
    /// From 0 to 1.
    pub reliability: f64,
    /// Names of the tags.
    pub tagnames: Vec<String>,
    /// Values of the tags, as many.
    pub tags: Vec<String>,
}
message!("people_msgs" Person uses [Point]);

/// `people_msgs/People`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct People {
    /// Time and frame.
    pub header: Header,
    /// The people.
    pub people: Vec<Person>,
}
message!("people_msgs" People uses [Header, Person]);
