//! The testkit itself: its link, its serial line, and its counts.

mod change;
mod link;
mod margins;
mod tally;
mod uart;
mod wire;
