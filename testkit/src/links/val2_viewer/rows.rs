//! The rows of both machines' tables.

use core::time::Duration;

use robot_session::end::Machine as _;
use val2_viewer::host::machine::{self as host, HostMachine, Link, Pose};
use val2_viewer::workstation::machine::{self as workstation, Display, Picture, Request, WorkstationMachine};
use val2_viewer::{Flow, HostConfig, WorkstationConfig};

use crate::model::{DrawnMachine, NOW, Rows};

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
        let state = |link, pose| HostMachine { link, pose, flow: Flow::Free };
        let free = links.into_iter().flat_map(|link| poses.map(|pose| state(link, pose)));
        free.chain(Self::held()).collect()
    }

    fn inputs() -> Vec<host::Input> {
        use host::Input as On;
        let bytes = [On::Enquiry, On::Xoff, On::Xon];
        [&[On::Connected, On::Disconnected, On::Timeout, On::Pose], &bytes[..], &[On::Sent, On::Unsendable]]
            .concat()
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
        format!("{}{link}{pose}{}", machine.name(), held(machine.flow, now))
    }
}

impl Host {
    /// Returns states in which a packet would be sent, and states in which nothing is requested.
    fn held() -> impl Iterator<Item = HostMachine> {
        let pose = Pose::Known { until: FUTURE };
        let links = [Link::Ready { from: PAST }, Link::Asked { from: PAST }];
        links.into_iter().flat_map(move |link| HELD.map(|flow| HostMachine { link, pose, flow }))
    }
}

const HELD: [Flow; 2] = [Flow::Held { until: FUTURE }, Flow::Held { until: PAST }];

fn held(flow: Flow, now: Duration) -> &'static str {
    match flow {
        Flow::Free => "",
        Flow::Held { until } if now >= until => ", held for too long",
        Flow::Held { .. } => ", held",
    }
}

/// The workstation.
#[derive(Debug)]
pub enum Workstation {}

impl Rows for Workstation {
    type Machine = WorkstationMachine;

    fn states() -> Vec<WorkstationMachine> {
        let waiting = |again_from, missed_from| Request::Waiting { again_from, missed_from };
        let requests = [Request::Allowed, Request::Due, waiting(FUTURE, FUTURE), waiting(PAST, FUTURE)];
        let pictures = [Picture::Stale, Picture::Live { until: FUTURE }, Picture::Live { until: PAST }];
        // The picture is stale before an answer is too late.
        let late = [FUTURE, PAST].map(|again_from| Request::Overdue { again_from });
        let late = [&late[..], &[waiting(FUTURE, PAST)]].concat();
        let display = |request, picture| Display { request, picture, flow: Flow::Free };
        let displays = requests
            .into_iter()
            .flat_map(|request| pictures.map(|picture| display(request, picture)))
            .chain(late.into_iter().map(|request| display(request, Picture::Stale)))
            .chain(Self::held())
            .map(WorkstationMachine::Connected);
        core::iter::once(WorkstationMachine::Disconnected).chain(displays).collect()
    }

    fn inputs() -> Vec<workstation::Input> {
        use workstation::Input as On;
        let corrupt = [true, false].map(|line| On::Corrupt { line });
        let bytes = [&[On::Pose, On::Xoff, On::Xon], &corrupt[..]].concat();
        [&[On::Connected, On::Disconnected, On::Timeout, On::Draw, On::Sent], &bytes[..]].concat()
    }

    fn config() -> WorkstationConfig {
        WorkstationConfig::default()
    }

    fn row(machine: &WorkstationMachine, now: Duration) -> String {
        let WorkstationMachine::Connected(display) = machine else { return machine.name().into() };
        let request = match display.request {
            Request::Waiting { missed_from, .. } if now >= missed_from => ", too long",
            Request::Waiting { again_from, .. } | Request::Overdue { again_from } if now >= again_from => {
                ", paused"
            }
            Request::Allowed | Request::Due | Request::Waiting { .. } | Request::Overdue { .. } => "",
        };
        let picture = match display.picture {
            Picture::Live { until } if now >= until => ", too old",
            Picture::Live { .. } | Picture::Stale => "",
        };
        format!("{}{request}{picture}{}", machine.name(), held(display.flow, now))
    }
}

impl Workstation {
    /// Returns states in which a request would be sent, and states in which none would.
    fn held() -> impl Iterator<Item = Display> {
        let requests = [Request::Allowed, Request::Due];
        let display = |request, flow| Display { request, picture: Picture::Stale, flow };
        requests.into_iter().flat_map(move |request| HELD.map(|flow| display(request, flow)))
    }
}

impl DrawnMachine for HostMachine {}
impl DrawnMachine for WorkstationMachine {}
