//! The computer that a workstation asks for poses.

use core::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value};
use val2_viewer::host::Rule;
use val2_viewer::host::machine::{HostMachine, Input, Link, Pose};
use val2_viewer::{ENQ, Host, HostConfig, HostEvent};

use super::{Do, Driven, Fields, Hooks, Maker, event, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<ViewerHost>(Host::new(configuration(config, without)?)?))),
    rules: || ["DrainFirst", "Pace", "Expire", "ForgetRequest"].map(String::from).to_vec(),
};

const RULES: [Rule; 4] = [Rule::DrainFirst, Rule::Pace, Rule::Expire, Rule::ForgetRequest];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<HostConfig> {
    let mut made = HostConfig::default();
    let mut fields = Fields(config.clone());
    fields.time("interval", &mut made.interval)?;
    fields.time("max_age", &mut made.max_age)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

struct ViewerHost;

impl Hooks for ViewerHost {
    type Session = Host;

    fn call(host: &mut Host, now: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "set_pose" => host.set_pose(now, serde_json::from_value(argument)?),
            _ => bail!("a host has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(_: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Asked => event("asked").end(),
            HostEvent::Sent(packet) => event("sent").value("message", &packet)?.end(),
            HostEvent::Ignored => event("ignored").end(),
            HostEvent::Stale => event("stale").end(),
            HostEvent::Unknown(byte) => event("unknown").raw("byte", byte).end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(host: &Host) -> String {
        host.machine().name().into()
    }

    fn cells(before: &Host, _: &Host, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        match input {
            Do::Connected => walk.on(Input::Connected),
            Do::Disconnected => walk.on(Input::Disconnected),
            Do::Input(bytes) => {
                bytes.iter().filter(|byte| **byte == ENQ).for_each(|_| walk.on(Input::Enquiry))
            }
            Do::Call { .. } => walk.on(Input::Pose),
            Do::Timeout => {}
            Do::Transmitted | Do::Nothing => return Vec::new(),
        }
        walk.cells
    }

    fn transmit_cells(before: &Host, now: Duration, sent: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        if sent {
            walk.on(Input::Answer);
        }
        walk.cells
    }
}

/// The machine's inputs in a step; first comes that time has passed.
struct Walk {
    machine: HostMachine,
    now: Duration,
    cells: Vec<String>,
}

impl Walk {
    fn new(before: &Host, now: Duration) -> Self {
        let mut walk = Self { machine: *before.machine(), now, cells: Vec::new() };
        walk.on(Input::Timer);
        walk
    }

    fn on(&mut self, input: Input) {
        let cell = format!("{}: {}", row(&self.machine, self.now), input.name());
        if self.machine.on(self.now, input, &HostConfig::default()).is_ok() {
            self.cells.push(cell);
        }
    }
}

/// The row of the matrix.
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
