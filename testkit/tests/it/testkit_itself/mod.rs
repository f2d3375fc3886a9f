//! The testkit itself: its link, its serial line, and what it counts.

mod change;
mod link;
mod margins;
mod tally;
mod uart;
mod wire;
