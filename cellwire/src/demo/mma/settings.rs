//! The settings of the demo.

use mmacell_proto::CentralConfig;
use mmacell_task::TaskConfig;

use super::cell::CONFIG;
use cellwire_links::settings::{Configure, FieldVisitor};

/// Parts of a run without a limit.
const PARTS: usize = 100;
/// The most parts: a run takes no longer than ten minutes at the usual speed.
pub(super) const MAX_PARTS: usize = 10_000;
/// The factor by which the cell runs faster than life, unless a setting gives another. The protocol's own times are not changed.
const SPEED: u32 = 200;
/// The settings of the demo.
#[derive(Debug)]
pub struct Settings {
    pub(super) parts: usize,
    pub(super) speed: u32,
    pub(super) stall_every: u64,
    pub(super) task: TaskConfig,
    pub(super) central: CentralConfig,
}

impl Default for Settings {
    fn default() -> Self {
        let (task, central) = (CONFIG, CentralConfig::DEFAULT);
        Self { parts: PARTS, speed: SPEED, stall_every: 0, task, central }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { parts, speed, stall_every, task, central } = self;
        fields.whole("parts", 1..=MAX_PARTS, "parts", "parts to place, without --for", parts);
        fields.whole(
            "speed",
            1..=10_000,
            "times",
            "how many times faster than real time the axes move",
            speed,
        );
        let about = "how many motions until one stops half-way without an error; 0: never";
        fields.whole("stall_every", 0..=u64::MAX, "motions", about, stall_every);
        fields.group("task", |fields| task.configure(fields));
        fields.group("central", |fields| central.configure(fields));
    }
}
