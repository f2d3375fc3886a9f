//! What can be set of the operator's cell.

use val2_alter::{HostConfig, Policy};

use crate::cell::teleop::{LIMITS, Profile, host_config, polls};
use cellwire_links::settings::{Configure, Table};

/// What can be set of the cell.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// The ALTER session.
    pub alter: HostConfig,
    /// The polls of the ball.
    pub polls: isra_ball::HostConfig,
    /// The answers to the workstation.
    pub viewer: val2_viewer::HostConfig,
    /// What the hand's values mean.
    pub profile: Profile,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            alter: HostConfig { limits: LIMITS, policy: Policy::Ignore, ..host_config() },
            polls: polls(isra_ball::timing::BAUD),
            viewer: val2_viewer::HostConfig::default(),
            profile: Profile::for_limits(LIMITS, 100),
        }
    }
}

impl Configure for Settings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { alter, polls, viewer, profile } = self;
        alter.configure(table);
        table.group("ball", |table| polls.configure(table));
        table.group("viewer", |table| viewer.configure(table));
        table.group("profile", |table| profile.configure(table));
    }
}
