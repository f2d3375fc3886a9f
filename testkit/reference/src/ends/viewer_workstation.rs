//! The workstation that draws the arm.

use core::time::Duration;

use anyhow::{Result, bail};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};
use val2_viewer::workstation::Rule;
use val2_viewer::workstation::machine::{Input, Picture, Request, WorkstationMachine};
use val2_viewer::{Decoder, Workstation, WorkstationConfig, WorkstationEvent};

use super::{Do, Driven, Fields, Hooks, Maker, event, live_until, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| {
        Ok(Box::new(Driven::<ViewerWorkstation>(Workstation::new(configuration(config, without)?)?)))
    },
    rules: || {
        ["Credit", "AskAgain", "CorruptIsAnswer", "NoiseIsNoAnswer", "Expire", "ReportEnd", "AskFirst"]
            .map(String::from)
            .to_vec()
    },
};

const RULES: [Rule; 7] = [
    Rule::Credit,
    Rule::AskAgain,
    Rule::CorruptIsAnswer,
    Rule::NoiseIsNoAnswer,
    Rule::Expire,
    Rule::ReportEnd,
    Rule::AskFirst,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<WorkstationConfig> {
    let mut made = WorkstationConfig::default();
    let mut fields = Fields(config.clone());
    fields.time("pause", &mut made.pause)?;
    fields.time("stale_after", &mut made.stale_after)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

struct ViewerWorkstation;

impl Hooks for ViewerWorkstation {
    type Session = Workstation;

    fn call(
        workstation: &mut Workstation,
        now: Duration,
        name: &str,
        _: Value,
    ) -> Result<Result<(), String>> {
        match name {
            "draw" => workstation.draw(now),
            _ => bail!("a workstation has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(workstation: &Workstation, happened: WorkstationEvent) -> Result<String> {
        Ok(match happened {
            WorkstationEvent::Pose(packet) => event("pose")
                .value("message", &packet)?
                .optional("live_until", live_until(workstation.live_until()).as_ref())?
                .end(),
            WorkstationEvent::Missed => event("missed").end(),
            WorkstationEvent::Stale => event("stale").end(),
            WorkstationEvent::Unasked(packet) => event("unasked").value("message", &packet)?.end(),
            WorkstationEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            WorkstationEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(workstation: &Workstation) -> String {
        workstation.machine().name().into()
    }

    fn cells(before: &Workstation, after: &Workstation, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        match input {
            Do::Connected => walk.on(Input::Connected),
            Do::Disconnected => walk.on(Input::Disconnected),
            Do::Input(bytes) => received(before, after, bytes).into_iter().for_each(|input| walk.on(input)),
            Do::Call { .. } => walk.on(Input::Draw),
            Do::Timeout => {}
            Do::Transmitted | Do::Nothing => return Vec::new(),
        }
        walk.cells
    }

    fn transmit_cells(before: &Workstation, now: Duration, sent: bool) -> Vec<String> {
        let mut walk = Walk::new(before, now);
        if sent {
            walk.on(Input::Ask);
        }
        walk.cells
    }
}

/// The machine's inputs in a step; first comes that time has passed.
struct Walk {
    machine: WorkstationMachine,
    now: Duration,
    cells: Vec<String>,
}

impl Walk {
    fn new(before: &Workstation, now: Duration) -> Self {
        let mut walk = Self { machine: *before.machine(), now, cells: Vec::new() };
        walk.on(Input::Timer);
        walk
    }

    fn on(&mut self, input: Input) {
        let cell = format!("{}: {}", row(&self.machine, self.now), input.name());
        if self.machine.on(self.now, input, &WorkstationConfig::default()).is_ok() {
            self.cells.push(cell);
        }
    }
}

/// The row of the matrix.
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

/// The inputs of a step before which nothing was held.
fn received(before: &Workstation, after: &Workstation, bytes: &[u8]) -> Vec<Input> {
    let mut decoder = Decoder::new();
    if decoder.push(bytes) < bytes.len() {
        return Vec::new();
    }
    let (mut inputs, mut corrupt) = (Vec::new(), 0);
    while let Some(line) = decoder.next_frame() {
        inputs.push(match line {
            Ok(_) => Input::Pose,
            Err(error) => {
                corrupt += 1;
                Input::Corrupt { line: error.is_line() }
            }
        });
    }
    let is_all = after.statistics().corrupt == before.statistics().corrupt + corrupt;
    if is_all { inputs } else { Vec::new() }
}
