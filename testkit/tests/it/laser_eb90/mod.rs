//! laser-eb90: its reference vectors, and the host of the source.

mod article;
mod vectors;
