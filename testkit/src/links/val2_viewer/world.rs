//! What is in the model's world, and what can happen in it.

use core::time::Duration;

use robot_session::end::Rules;
use val2_viewer::host::machine::HostMachine;
use val2_viewer::workstation::machine::WorkstationMachine;
use val2_viewer::{HostConfig, WorkstationConfig, host, workstation};

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(100);
/// The ticks of a packet on the line.
pub(super) const LINE: u8 = 1;
/// The ticks of a display cycle.
pub(super) const CYCLE: u8 = 2;
pub(super) const INTERVAL: u8 = 2;
pub(super) const MAX_AGE: u8 = 2;
pub(super) const STALE_AFTER: u8 = 4;
pub(super) const PAUSE: u8 = 5;
/// The requests that the driver holds while the host does not read.
pub(super) const DRIVER: u8 = 3;
/// The ticks that they take to come out of it.
pub(super) const PILE: u8 = 1;

/// A system: bounds and faults.
#[derive(Debug, Clone, Copy)]
pub struct Exchange {
    /// The host's configuration.
    pub host: HostConfig,
    /// The workstation's configuration.
    pub workstation: WorkstationConfig,
    /// How many faults at most.
    pub faults: u8,
    /// The most ticks that a packet is late.
    pub delay: u8,
    /// The display goes on, and ALTER too.
    pub steady: bool,
    /// The source's first workstation, which asks in every display cycle, instead of the project's own.
    pub first_workstation: bool,
    /// The source's first host, which answers each request with a packet of its own, whenever it likes, instead of the project's own.
    pub first_host: bool,
}

impl Exchange {
    /// Both ends, an operator who pauses the display when he likes, and ALTER that ends and begins.
    pub fn free() -> Self {
        let tick = |ticks: u8| TICK * u32::from(ticks);
        Self {
            host: HostConfig { interval: tick(INTERVAL), max_age: tick(MAX_AGE), ..HostConfig::default() },
            workstation: WorkstationConfig {
                pause: tick(PAUSE),
                stale_after: tick(STALE_AFTER),
                ..WorkstationConfig::default()
            },
            faults: 1,
            delay: 1,
            steady: false,
            first_workstation: false,
            first_host: false,
        }
    }

    /// A display that goes on, and ALTER that does.
    pub fn steady() -> Self {
        Self { steady: true, faults: 0, delay: 0, ..Self::free() }
    }

    /// The source's first workstation.
    pub fn first_workstation() -> Self {
        let exchange = Self { first_workstation: true, ..Self::free() };
        exchange.without_at_workstation(workstation::Rule::Credit)
    }

    /// The source's first host.
    pub fn first_host() -> Self {
        Self { first_host: true, ..Self::free() }
    }

    pub(super) fn without_at_host(self, rule: host::Rule) -> Self {
        Self { host: HostConfig { rules: Rules::without(rule), ..self.host }, ..self }
    }

    pub(super) fn without_at_workstation(self, rule: workstation::Rule) -> Self {
        Self { workstation: WorkstationConfig { rules: Rules::without(rule), ..self.workstation }, ..self }
    }
}

/// A packet between the host and the workstation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Packet {
    /// Ticks until it arrives; 0 in the workstation's input.
    pub ticks: u8,
    /// It can be read.
    pub good: bool,
}

/// The state of everything.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The host's machine.
    pub host: HostMachine,
    /// The workstation's machine.
    pub workstation: WorkstationMachine,
    /// On the line and in the workstation's input, oldest first.
    pub up: Vec<Packet>,
    /// The requests that the host has not read, and how many of them were there when its connection was made.
    pub(super) requests: u8,
    pub(super) piled: u8,
    /// Ticks since the host's connection was made.
    pub(super) since_connected: u8,
    /// Packets that answer the pile, and whether the next one does.
    pub(super) pile_answers: u8,
    pub(super) pile_asked: bool,
    /// The host is not called, the workstation is not.
    pub(super) host_asleep: bool,
    pub(super) workstation_asleep: bool,
    /// ALTER runs: the host gets a pose in every tick.
    pub(super) alter: bool,
    /// Nothing arrives.
    pub(super) unplugged: bool,
    /// How old the host's newest pose is.
    pub(super) pose_age: u8,
    /// Ticks since the host's last packet.
    pub(super) since_sent: u8,
    /// Ticks since the last display cycle.
    pub(super) since_drawn: u8,
    /// The host has read a request on this connection that it has not answered.
    pub(super) asked: bool,
    /// The workstation may ask: first, after an answer, after a pause.
    pub(super) credit: bool,
    /// A request has no outcome yet.
    pub(super) open: bool,
    /// A request was sent on the workstation's connection, and no line has come since.
    pub(super) awaited: bool,
    /// Ticks since the pose that is shown has come.
    pub(super) shown: Option<u8>,
    pub(super) faults: u8,
    pub(super) wrong: Option<&'static str>,
}

impl State {
    /// The host is not called.
    pub fn is_host_asleep(&self) -> bool {
        self.host_asleep
    }

    /// The workstation is not called.
    pub fn is_workstation_asleep(&self) -> bool {
        self.workstation_asleep
    }

    /// ALTER runs.
    pub fn is_alter(&self) -> bool {
        self.alter
    }

    /// A request has no outcome yet.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// A pose is shown.
    pub fn is_shown(&self) -> bool {
        self.shown.is_some()
    }

    pub(super) fn is_host_open(&self) -> bool {
        self.host.link != host::machine::Link::Disconnected
    }

    pub(super) fn is_workstation_open(&self) -> bool {
        self.workstation != WorkstationMachine::Disconnected
    }
}

/// What happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The host does what came due.
    HostTimer,
    /// The host reads a request.
    Enquire,
    /// The host sends a packet.
    Answer(Fate),
    /// A host that sends unasked: a fault of the source's first host.
    SendUnasked,
    /// The workstation does what came due.
    Timer,
    /// The workstation draws.
    Draw,
    /// The workstation sends ENQ.
    Ask {
        /// It arrives.
        arrives: bool,
    },
    /// The workstation reads the oldest packet.
    Receive,
    /// Time passes.
    Tick,
    /// ALTER begins or ends.
    Alter,
    /// The host receives an ENQ that nobody has sent.
    NoiseAtHost,
    /// The workstation receives bytes that nobody has sent.
    NoiseAtWorkstation {
        /// They end as a line does.
        line: bool,
    },
    /// The host is not called any more.
    HostSleeps,
    /// The host is called again.
    HostWakes,
    /// The workstation is not called any more.
    WorkstationSleeps,
    /// The workstation is called again.
    WorkstationWakes,
    /// Nothing arrives any more at either end.
    Unplug,
    /// The line is there again.
    Plug,
    /// A new host on the same line.
    RestartHost,
    /// The host's port is closed.
    CloseHost,
    /// It is opened.
    OpenHost,
    /// It is opened again, and nobody has said that it was closed.
    ReopenHost,
    /// A new workstation on the same line.
    RestartWorkstation,
    /// The workstation's port is closed.
    CloseWorkstation,
    /// It is opened.
    OpenWorkstation,
    /// It is opened again, and nobody has said that it was closed.
    ReopenWorkstation,
}

/// What becomes of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It arrives, this many ticks late.
    Late(u8),
    /// Nothing of it arrives.
    Lost,
    /// It arrives with a wrong checksum.
    Corrupt,
}

impl Act {
    pub(super) fn is_fault(self) -> bool {
        match self {
            Self::Ask { arrives } => !arrives,
            Self::Answer(fate) => !matches!(fate, Fate::Late(_)),
            Self::HostTimer
            | Self::Enquire
            | Self::Timer
            | Self::Draw
            | Self::Receive
            | Self::Tick
            | Self::Alter
            | Self::HostWakes
            | Self::WorkstationWakes
            | Self::Plug
            | Self::OpenHost
            | Self::OpenWorkstation => false,
            Self::SendUnasked
            | Self::NoiseAtHost
            | Self::NoiseAtWorkstation { .. }
            | Self::HostSleeps
            | Self::WorkstationSleeps
            | Self::Unplug
            | Self::RestartHost
            | Self::CloseHost
            | Self::ReopenHost
            | Self::RestartWorkstation
            | Self::CloseWorkstation
            | Self::ReopenWorkstation => true,
        }
    }
}
