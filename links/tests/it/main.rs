//! The integration tests of the crate, in one program: linked once.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

#[cfg(feature = "arbitrary")]
mod arbitrary;
mod asked;
mod configs;
mod explain;
mod json;
mod modbus_keys;
mod modbus_views;
mod plants;
mod rows;
mod shadow;
mod vectors;

use cellwire_links::Link;

fn link(name: &str) -> &'static Link {
    Link::by_name(name).unwrap()
}
