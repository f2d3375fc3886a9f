//! The connection of either end of kawasaki-msg, over TCP or UDP.

pub mod meeting;
pub mod peer;
