//! The computer that polls the ball.

use core::time::Duration;

use anyhow::{Result, bail};
use isra_ball::host::Rule;
use isra_ball::host::machine::{Action, HostMachine, Input, Poll, Values};
use isra_ball::{Decoder, Host, HostConfig, HostEvent, Packet};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};

use super::{Do, Driven, Fields, Hooks, Maker, event, live_until, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<BallHost>(Host::new(configuration(config, without)?)?))),
    rules: &[
        "DrainFirst",
        "AwaitReply",
        "NotBefore",
        "ProveAge",
        "AgeFromPoll",
        "OldIsNotNew",
        "ReportEnd",
        "ForgetReply",
    ],
};

const RULES: [Rule; 8] = [
    Rule::DrainFirst,
    Rule::AwaitReply,
    Rule::NotBefore,
    Rule::ProveAge,
    Rule::AgeFromPoll,
    Rule::OldIsNotNew,
    Rule::ReportEnd,
    Rule::ForgetReply,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<HostConfig> {
    let mut made = HostConfig::default();
    let mut fields = Fields(config.clone());
    fields.take("baud", &mut made.baud)?;
    fields.time("period", &mut made.period)?;
    fields.time("max_delay", &mut made.max_delay)?;
    fields.time("max_age", &mut made.max_age)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

struct BallHost;

impl Hooks for BallHost {
    type Session = Host;

    fn call(_: &mut Host, _: Duration, name: &str, _: Value) -> Result<Result<(), String>> {
        bail!("a host has no call {name}")
    }

    fn event(host: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Packet(packet) => event("new")
                .value("message", &packet)?
                .optional("live_until", live_until(host.live_until()).as_ref())?
                .end(),
            HostEvent::Old(packet) => event("old").value("message", &packet)?.end(),
            HostEvent::Missed => event("missed").end(),
            HostEvent::Stale => event("stale").end(),
            HostEvent::Unasked(packet) => event("unasked").value("message", &packet)?.end(),
            HostEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(host: &Host) -> String {
        host.machine().name().into()
    }

    fn cells(before: &Host, after: &Host, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        match input {
            Do::Connected => walk.cell("Connected"),
            Do::Disconnected => walk.cell("Disconnected"),
            Do::Input(bytes) => {
                let count = |host: &Host| {
                    let counted = host.statistics();
                    counted.packets + counted.old + counted.unasked
                };
                if let Some(packet) = received(bytes).filter(|_| count(after) == count(before) + 1) {
                    walk.cell(Input::Packet { fresh: packet.status.is_fresh() }.name());
                }
            }
            Do::Timeout => {}
            Do::Transmitted | Do::Nothing | Do::Call { .. } => return Vec::new(),
        }
        walk.cells
    }

    fn transmit_cells(before: &Host, now: Duration, sent: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        if sent {
            walk.cell("Poll");
        }
        walk.cells
    }
}

/// The machine after what came due: with each input the session first does that.
struct Walk {
    machine: HostMachine,
    now: Duration,
    cells: Vec<String>,
}

impl Walk {
    fn new(before: &Host, now: Duration) -> Self {
        let mut walk = Self { machine: *before.machine(), now, cells: Vec::new() };
        loop {
            walk.cell("Timer");
            let action = walk.machine.on(now, Input::Timer, &HostConfig::default());
            if matches!(action, Ok(Action::None) | Err(_)) {
                return walk;
            }
        }
    }

    fn cell(&mut self, input: &str) {
        self.cells.push(format!("{}: {input}", row(&self.machine, self.now)));
    }
}

/// The row of the matrix.
fn row(machine: &HostMachine, now: Duration) -> String {
    let HostMachine::Connected(polling) = machine else { return machine.name().into() };
    let (poll, in_window) = match polling.poll {
        Poll::Idle { due } if now >= due => (", due", false),
        Poll::Idle { .. } => ("", false),
        Poll::Waiting { from, .. } if now < from => (", early", false),
        Poll::Waiting { until, .. } if now >= until => (", late", false),
        Poll::Waiting { .. } => ("", true),
    };
    let values = match polling.values {
        Values::Live { until } if now >= until => ", too old",
        Values::Live { .. } | Values::Stale => "",
    };
    let proof = if in_window && now < polling.proof_until { ", proof" } else { "" };
    format!("{}{poll}{values}{proof}", machine.name())
}

/// The packet of a step that has one.
fn received(bytes: &[u8]) -> Option<Packet> {
    let mut decoder = Decoder::new();
    if decoder.push(bytes) < bytes.len() {
        return None;
    }
    let packet = decoder.next_frame()?.and_then(|frame| frame.packet()).ok()?;
    decoder.next_frame().is_none().then_some(packet)
}
