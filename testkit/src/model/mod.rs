//! The model: an end's machine and any peer, the line between them and the people at either end, explored exhaustively.
//!
//! A link's crate contains a pure machine for each end. `testkit::links` joins each to any peer, as a [`System`]: the
//! possible acts in a state, their results, and the broken properties. [`explore()`] visits every state breadth first, so
//! that a broken property comes with a shortest path to it.
//!
//! Time in a model is always zero: a tick of the system takes its length from every deadline, see [`age`]. States that behave
//! alike are then equal, and there are finitely many.
//!
//! [`Graph::walks`] gives paths that together visit every state and take every transition: [`refine()`] replays them
//! over bytes through the sessions. [`mermaid`] draws the transitions, and a [`Pair`] has the explorations of a link for
//! the command `model`.

mod against;
pub mod diagram;
mod explore;
mod fingerprint;
mod graph;
mod machine;
mod margins;
mod matrix;
mod pair;
mod refine;
mod runs;
#[cfg(feature = "stateright")]
mod second;
mod system;
mod table;
#[cfg(feature = "links")]
mod walk;
mod wired;

pub use against::{
    Act, ActionOf, Actor, Call, Cause, CauseOf, EXPECTED, EndWithPeer, InputOf, Peer, SceneOf, TransmitOf,
};
pub use diagram::{check_or_write, mermaid};
pub use explore::{Options, explore, explore_whole};
pub use graph::{DEADLOCK, Finding, Graph, STANDSTILL};
pub use machine::{DrawnMachine, Edge, Edges, age, drive};
pub use margins::{Margin, MarginResult, Step};
pub use matrix::{Cell, NOW, Rows};
pub use pair::{
    BrokenProperty, Depth, Diagram, ExplorationResult, MustFail, Pair, PeerAssumptions, Setting, at, both,
    draw,
};
pub use refine::{Refined, refine};
pub use system::{System, trace};
pub use table::Table;
#[cfg(feature = "links")]
pub use walk::walk;
pub use wired::{Follower, WRITTEN, Wired};
