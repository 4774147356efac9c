//! Places, the arcs between them, and the shortest ways.
//!
//! petgraph finds the ways: a well-kept library does it, and a route's search (`super::plan`) is its search too.

use std::collections::HashMap;

pub use petgraph::graph::NodeIndex;
use petgraph::{algo::floyd_warshall::floyd_warshall_path, graph::UnGraph};
use roscausal_discovery::{Error, Result};
use serde::{Deserialize, Serialize};

/// Most places of a map; the table of ways grows with their square.
const MOST_PLACES: usize = 500;

/// A place where somebody may be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Its name: letters, digits and `_`.
    pub name: String,
    /// Position in the map frame, metres.
    pub at: [f64; 2],
    /// What it is for; routes do not read it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub kind: String,
}

/// Places and arcs, and the shortest ways between all of them.
#[derive(Clone, Debug)]
pub struct Map {
    /// The places; all indices of places count in this list.
    pub places: Vec<Place>,
    /// The arcs, with their lengths in metres.
    pub graph: UnGraph<(), f64>,
    /// Length of the shortest way from one place to another, metres.
    pub distance: Vec<Vec<f64>>,
    /// The place after `a` on the shortest way from `a` to `b`.
    next: Vec<Vec<usize>>,
}

impl Map {
    /// The map of these places and of arcs between their names.
    ///
    /// # Errors
    /// No place or too many, a name that is used twice or is no name, an arc to no place, a place to which no way leads.
    pub fn new(places: Vec<Place>, arcs: &[[String; 2]]) -> Result<Self> {
        let n = places.len();
        Error::ensure((1..=MOST_PLACES).contains(&n), "places", || {
            format!("{n} places; give 1 to {MOST_PLACES}")
        })?;
        let mut graph: UnGraph<(), f64> = UnGraph::default();
        let mut index = HashMap::new();
        for place in &places {
            let legal = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let named = !place.name.is_empty() && place.name.chars().all(legal);
            let name = &place.name;
            Error::ensure(named && place.at.iter().all(|x| (-1e6..=1e6).contains(x)), "places", || {
                format!("'{name}' needs letters, digits and '_' as its name, and a position in metres")
            })?;
            let known = index.insert(place.name.as_str(), graph.add_node(()));
            Error::ensure(known.is_none(), "places", || format!("there are two places '{name}'"))?;
        }
        for ends in arcs {
            let find = |name: &String| {
                let known = index.get(name.as_str()).copied();
                known.ok_or_else(|| Error::param("arcs", format!("there is no place '{name}'")))
            };
            let (a, b) = (find(&ends[0])?, find(&ends[1])?);
            let [p, q] = [a, b].map(|end| places[end.index()].at);
            graph.update_edge(a, b, libm::hypot(p[0] - q[0], p[1] - q[1]));
        }
        let found = floyd_warshall_path(&graph, |edge| *edge.weight());
        let (pairs, before) = found.map_err(|_| Error::param("arcs", "an arc is shorter than nothing"))?;
        let length = |a: usize, b: usize| pairs[&(NodeIndex::new(a), NodeIndex::new(b))];
        if let Some(lost) = (0..n).find(|&b| length(0, b) == f64::MAX) {
            return Err(Error::param("arcs", format!("no way leads to '{}'", places[lost].name)));
        }
        // Ways are the same in both directions: the place before `a` on the way from `b` is the next one on the way to `b`.
        let next = |a: usize, b: usize| before[b][a].unwrap_or(b);
        Ok(Self {
            distance: (0..n).map(|a| (0..n).map(|b| length(a, b)).collect()).collect(),
            next: (0..n).map(|a| (0..n).map(|b| next(a, b)).collect()).collect(),
            places,
            graph,
        })
    }

    /// The place with that name.
    ///
    /// # Errors
    /// There is none; the nearest name is told.
    pub fn place(&self, name: &str) -> Result<usize> {
        let names: Vec<&str> = self.places.iter().map(|place| place.name.as_str()).collect();
        names.iter().position(|one| *one == name).ok_or_else(|| Error::unknown("place", name, &names))
    }

    /// The places of the shortest way from `from` to `to`, both among them.
    pub fn way(&self, from: usize, to: usize) -> Vec<usize> {
        let mut way = vec![from];
        let mut here = from;
        while here != to {
            here = self.next[here][to];
            way.push(here);
        }
        way
    }
}
