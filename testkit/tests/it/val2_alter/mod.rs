//! VAL II ALTER: both ends on one line.

mod common;
mod motion;
mod session;
