//! The state of the model: both machines, the line between them, and a record of every request.

use core::time::Duration;

use fanuc_hmi_modbus::client::machine::ClientMachine;
use fanuc_hmi_modbus::server::machine::ServerMachine;
use fanuc_hmi_modbus::{ClientConfig, Framing, ServerConfig};
use robot_session::end::Machine as _;

pub(super) const TICK: Duration = Duration::from_millis(10);
pub(super) const UNIT: u8 = 1;

/// The caller's requests, the possible faults, and both configurations.
#[derive(Debug, Clone)]
pub(super) struct Setup {
    pub(super) client: ClientConfig,
    pub(super) server: ServerConfig,
    pub(super) jobs: Vec<Job>,
    /// Faults in all.
    pub(super) faults: u8,
    /// A server that takes frames without a silence between them for one corrupt frame, as the specification allows.
    pub(super) strict: bool,
}

/// A request that the caller makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Job {
    Unicast,
    Broadcast,
    /// To a unit that is not there.
    Absent,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct World {
    pub(super) client: ClientMachine<2>,
    pub(super) server: ServerMachine<2>,
    /// The job in each place of the client.
    pub(super) places: [u8; 2],
    /// The jobs whose replies wait at the server.
    pub(super) replies: Vec<Frame>,
    pub(super) down: Vec<Frame>,
    pub(super) up: Vec<Frame>,
    pub(super) line: Line,
    /// The contents of the client's decoder: the beginning of a reply, and all that came after it without a silence.
    pub(super) client_holds: Vec<Frame>,
    /// The frames in the server's decoder until the line is silent.
    pub(super) server_holds: Vec<Frame>,
    /// The server carries out a broadcast, and receives nothing.
    pub(super) busy: u8,
    pub(super) records: Vec<Record>,
    pub(super) next: u8,
    pub(super) epoch: u8,
    pub(super) faults: u8,
    pub(super) flags: Flags,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Frame {
    pub(super) job: u8,
    pub(super) transaction: u16,
    pub(super) ticks: u8,
    pub(super) what: What,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum What {
    Whole,
    /// The beginning of a long reply.
    Half,
    /// No frame.
    Noise,
    OtherUnit,
    Exception,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Line {
    Good,
    Lost { client: bool, server: bool },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Record {
    /// The number of executions, up to 2.
    pub(super) executed: u8,
    pub(super) outcome: Outcome,
    /// The connection on which it was made; 0 if it was not made on a connection.
    pub(super) epoch: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Outcome {
    None,
    Done,
    Refused,
    Unknown,
    NotSent,
    Announced,
    /// The client's process was restarted.
    Abandoned,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub(super) struct Flags {
    pub(super) foreign_reply: bool,
    pub(super) collision: bool,
    pub(super) other_unit: bool,
    pub(super) given_up: bool,
    pub(super) ended_twice: bool,
    pub(super) stale: bool,
    pub(super) unexpected: bool,
    pub(super) used: u8,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Act {
    Ask,
    ClientSend(Fate),
    ServerRead(Verdict),
    ServerTimer,
    ServerSend(Fate),
    ClientRead,
    ClientTimer,
    Lose,
    /// Bytes that were not sent arrive at the server.
    Noise,
    ClientNotices,
    ServerNotices,
    Connect,
    RestartClient,
    RestartServer,
    Tick,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    Good,
    /// Lost or corrupt.
    Lost,
    Late,
    Half,
    OtherUnit,
    /// Sent twice.
    Twice,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    CarryOut,
    Exception,
}

pub(super) const FOREIGN_REPLY: &str = "a reply is never taken for that of another request";
pub(super) const COLLISION: &str = "on a serial line nothing is sent while bytes arrive";
pub(super) const OTHER_UNIT: &str = "only the unit that was asked carries a request out";
pub(super) const GIVEN_UP: &str = "on a serial line a request that another frame follows is not answered";
pub(super) const ENDED_TWICE: &str = "each request has one outcome";
pub(super) const STALE: &str = "what waited when the connection was lost is not sent";
pub(super) const UNEXPECTED: &str = "a caller who keeps the contract sees nothing unexpected";
pub(super) const TWICE: &str = "nothing is carried out twice";
pub(super) const TRUE: &str = "done was carried out, refused and not sent were not";
pub(super) const COSTS: &str = "a fault costs no more than the requests in flight";
pub(super) const ENDS: &str = "a lost connection ends every request in flight";

impl Setup {
    pub(super) fn is_serial(&self) -> bool {
        matches!(self.client.framing, Framing::Rtu { .. })
    }

    pub(super) fn has_transactions(&self) -> bool {
        matches!(self.client.framing, Framing::Tcp)
    }

    /// Returns the unit to which a job is addressed.
    pub(super) fn unit(&self, job: u8) -> u8 {
        match self.jobs[usize::from(job)] {
            Job::Unicast => UNIT,
            Job::Broadcast => 0,
            Job::Absent => 2,
        }
    }
}

impl World {
    /// Loses the bytes in flight and the connection; `client` and `server` have noticed the loss already.
    pub(super) fn lose(&mut self, client: bool, server: bool) {
        self.down.clear();
        self.up.clear();
        self.line = Line::Lost { client, server };
    }

    pub(super) fn client_due(&self) -> bool {
        self.client.deadline().is_some_and(|at| at.is_zero())
    }
}
