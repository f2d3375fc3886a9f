//! The settings of the operator's cell.

use val2_alter::{HostConfig, Policy};

use crate::alter::{LIMITS, Profile, host_config};
use cellwire_links::settings::{Configure, FieldVisitor};

/// The settings of the cell.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The settings of the ALTER session.
    pub alter: HostConfig,
    /// The settings of the polls of the ball.
    pub polls: isra_ball::HostConfig,
    /// The settings of the answers to the workstation.
    pub viewer: val2_viewer::HostConfig,
    /// The meaning of the hand's values.
    pub profile: Profile,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            alter: HostConfig { limits: LIMITS, policy: Policy::Ignore, ..host_config() },
            polls: isra_ball::HostConfig::default(),
            viewer: val2_viewer::HostConfig::default(),
            profile: Profile::for_limits(LIMITS, 100),
        }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { alter, polls, viewer, profile } = self;
        alter.configure(fields);
        fields.group("ball", |fields| polls.configure(fields));
        fields.group("viewer", |fields| viewer.configure(fields));
        fields.group("profile", |fields| profile.configure(fields));
    }
}
