//! Where and when should a robot go? Places, what is to be expected at each of them over the day, and the best way and moment.
//!
//! [`map::Map`] has the places; [`levels::Levels`] says how many people are to be expected at a place at an hour, by a causal model of
//! the counts; [`pace`] what they cost the robot; [`plan::House::best`] which way and moment cost least.

pub mod days;
pub mod levels;
pub mod map;
pub mod pace;
pub mod plan;
