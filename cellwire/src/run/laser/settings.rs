//! The settings of a run: the host's session, and the command words of paths.

use laser_eb90::HostConfig;
use serde::{Deserialize, Serialize};

use cellwire_links::settings::{Configure, FieldVisitor};

/// A host, and how paths become instructions.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The configuration of the host's session.
    pub host: HostConfig,
    /// The command words, and the floats of each instruction.
    pub mapping: Mapping,
}

impl Settings {
    /// Returns the defaults on a line of this rate.
    pub fn at_baud(baud: u32) -> Self {
        Self { host: HostConfig::at_baud(baud), mapping: Mapping::default() }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { host, mapping } = self;
        fields.group("program", |fields| mapping.configure(fields));
        host.configure(fields);
    }
}

/// The mapping of the lines of a path to instructions: the profile of a plant.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    /// The command word of a motion to a point with the laser on.
    pub cut: u16,
    /// The command word of a motion to a point with the laser off.
    pub rapid: u16,
    /// The floats of both instructions, in their sequence.
    pub values: Vec<Coordinate>,
    /// The largest distance of a chord from its arc, in mm.
    pub tolerance: f64,
}

/// A float of an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Coordinate {
    /// The position along X, in mm.
    X,
    /// The position along Y, in mm.
    Y,
    /// The position along Z, in mm.
    Z,
    /// The rotation about X, in degrees.
    A,
    /// The rotation about Y, in degrees.
    B,
    /// The rotation about Z, in degrees.
    C,
    /// The feed, in mm/min.
    F,
    /// The power, as the program has it.
    S,
    /// The length of the path so far, in mm.
    Length,
}

impl Default for Mapping {
    fn default() -> Self {
        use Coordinate::{A, B, Length, X, Y, Z};
        Self { cut: 0x0101, rapid: 0x0102, values: vec![X, Y, Z, A, B, Length], tolerance: 0.05 }
    }
}

impl Configure for Mapping {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { cut, rapid, values, tolerance } = self;
        fields.whole("cut", 0..=u16::MAX, "", "the command word for a line with the laser on", cut);
        fields.whole("move", 0..=u16::MAX, "", "the command word of a line with the laser off", rapid);
        let shape = "[some of \"x\", \"y\", \"z\", \"a\", \"b\", \"c\", \"f\", \"s\", \"length\"]";
        fields.parsed("values", shape, "the floats of both, in order: mm, degrees, mm/min", values);
        fields.real("tolerance", 0.001..=10.0, "mm", "how far a chord may be from its arc", tolerance);
    }
}
