//! The rows of both machines' tables.

use core::time::Duration;

use robot_session::Machine as _;
use val2_viewer::host::machine::{self as host, HostMachine, Link, Pose};
use val2_viewer::workstation::machine::{self as workstation, Display, Picture, Request, WorkstationMachine};
use val2_viewer::{HostConfig, WorkstationConfig};

use crate::model::{Drawn, NOW, Rows};

const PAST: Duration = NOW.saturating_sub(Duration::from_millis(1));
const FUTURE: Duration = NOW.saturating_add(Duration::from_millis(1));

/// The host.
#[derive(Debug)]
pub enum Host {}

impl Rows for Host {
    type Machine = HostMachine;

    fn states() -> Vec<HostMachine> {
        let at = |from| [Link::Ready { from }, Link::Asked { from }];
        let links = [&[Link::Disconnected][..], &at(FUTURE), &at(PAST)].concat();
        let poses = [Pose::Unknown, Pose::Known { until: FUTURE }, Pose::Known { until: PAST }];
        links.into_iter().flat_map(|link| poses.map(|pose| HostMachine { link, pose })).collect()
    }

    fn inputs() -> Vec<host::Input> {
        use host::Input as On;
        vec![On::Connected, On::Disconnected, On::Timeout, On::Pose, On::Enquiry, On::Sent]
    }

    fn config() -> HostConfig {
        HostConfig::default()
    }

    fn row(machine: &HostMachine, now: Duration) -> String {
        let link = match machine.link {
            Link::Ready { from } | Link::Asked { from } if now >= from => ", due",
            Link::Disconnected | Link::Ready { .. } | Link::Asked { .. } => "",
        };
        let pose = match machine.pose {
            Pose::Known { until } if now >= until => ", too old",
            Pose::Known { .. } | Pose::Unknown => "",
        };
        format!("{}{link}{pose}", machine.name())
    }
}

/// The workstation.
#[derive(Debug)]
pub enum Workstation {}

impl Rows for Workstation {
    type Machine = WorkstationMachine;

    fn states() -> Vec<WorkstationMachine> {
        let waiting = [FUTURE, PAST].map(|again_from| Request::Waiting { again_from });
        let requests = [&[Request::Allowed, Request::Due][..], &waiting].concat();
        let pictures = [Picture::Stale, Picture::Live { until: FUTURE }, Picture::Live { until: PAST }];
        let displays = requests
            .into_iter()
            .flat_map(|request| pictures.map(|picture| Display { request, picture }))
            .map(WorkstationMachine::Connected);
        core::iter::once(WorkstationMachine::Disconnected).chain(displays).collect()
    }

    fn inputs() -> Vec<workstation::Input> {
        use workstation::Input as On;
        let corrupt = [true, false].map(|line| On::Corrupt { line });
        [&[On::Connected, On::Disconnected, On::Timeout, On::Draw, On::Sent, On::Pose], &corrupt[..]].concat()
    }

    fn config() -> WorkstationConfig {
        WorkstationConfig::default()
    }

    fn row(machine: &WorkstationMachine, now: Duration) -> String {
        let WorkstationMachine::Connected(display) = machine else { return machine.name().into() };
        let request = match display.request {
            Request::Waiting { again_from } if now >= again_from => ", paused",
            Request::Allowed | Request::Due | Request::Waiting { .. } => "",
        };
        let picture = match display.picture {
            Picture::Live { until } if now >= until => ", too old",
            Picture::Live { .. } | Picture::Stale => "",
        };
        format!("{}{request}{picture}", machine.name())
    }
}

impl Drawn for HostMachine {}
impl Drawn for WorkstationMachine {}
