//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod adapters;
mod contract;
mod contract_itself;
mod drivers;
mod fanuc_ls_programs;
mod fanuc_ls_properties;
mod field;
mod kawasaki_as;
mod kawasaki_orders;
mod laser_eb90;
mod machines;
mod model;
mod refinement;
mod soak;
mod targets;
mod testkit_itself;
mod threads;
mod vectors;
