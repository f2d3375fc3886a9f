//! Shadow ends, held against the session stories of the reference: whole, and each with one fault.

mod counts;
mod edges;
mod faults;
mod middle;
mod recorded;
mod stories;
mod unseen;
