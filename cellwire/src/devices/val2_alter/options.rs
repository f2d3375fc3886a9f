//! The settings of the simulated robot.

use super::puma::PumaConfig;
use super::script;
use cellwire_links::settings::{Configure, FieldVisitor};

impl Configure for PumaConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { puma, script } = self;
        puma.configure(fields);
        let about = "events, with times since the first start: interrupt TIME, misread checksum, format, overflow, incomplete, \
                     mark or timeout, corrupt, status 1 to 13, finish, restart; each waits until ALTER runs";
        fields.parsed("script", script::SHAPE, about, script);
    }
}
