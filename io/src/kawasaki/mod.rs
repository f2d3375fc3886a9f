//! The connection of either end of kawasaki-msg, over TCP or UDP, and the run of a PC.

pub mod meeting;
pub mod pc;
pub mod peer;
