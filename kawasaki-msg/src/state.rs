//! Every transition of the two sessions, and nothing else: no bytes, no numbers, no clock.
//!
//! The connection and the order are two machines: an order outlives the connection, so that nothing is lost or repeated when
//! it comes back.
//!
//! ```text
//!               Connect               Opened
//!  Disconnected --------> Connecting --------> Connected
//!        ^                     |                   |
//!        +------- Closed ------+------- Closed ----+
//!
//!         Start             Accepted              End
//!   Idle --------> Starting ---------> Active -----------> Ending
//!    ^ ^              | ^   <--------- |  ^  \             |   |
//!    | |   Refused    | |    Foreign   |  |   \ Interrupt  |   |
//!    | +--------------+ |        Alarm |  | Recovered      |   |
//!    |                  |              v  |     \          |   |
//!    |                  |             Alarm      v         |   |
//!    |                  |                |   Interrupted <-+   |
//!    |                  |                +------>  |  Interrupt|
//!    +---- Over, Lost --+--------------------------+-----------+
//! ```
//!
//! Both ends walk the same tables. The PC waits for the robot in `Starting`; the robot passes through it at once.

/// The connection, as one end sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Link {
    /// There is none; the robot waits before it tries again.
    Disconnected,
    /// The robot is opening one; the PC listens.
    Connecting,
    /// Bytes can flow.
    Connected,
}

/// What happens to the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LinkEvent {
    /// Time to open a connection.
    Connect,
    /// It is open.
    Opened,
    /// It is closed, or could not be opened.
    Closed,
}

impl Link {
    /// Every state, in the order of the table.
    pub const ALL: [Self; 3] = [Link::Disconnected, Link::Connecting, Link::Connected];

    /// The next state; `None` when the event cannot happen in this one.
    pub const fn on(self, event: LinkEvent) -> Option<Self> {
        match (self, event) {
            (Link::Disconnected, LinkEvent::Connect) => Some(Link::Connecting),
            (Link::Disconnected | Link::Connecting, LinkEvent::Opened) => Some(Link::Connected),
            (Link::Connecting | Link::Connected, LinkEvent::Closed) => Some(Link::Disconnected),
            (Link::Connecting | Link::Connected, LinkEvent::Connect)
            | (Link::Connected, LinkEvent::Opened)
            | (Link::Disconnected, LinkEvent::Closed) => None,
        }
    }
}

impl LinkEvent {
    /// Every event, in the order of the table.
    pub const ALL: [Self; 3] = [LinkEvent::Connect, LinkEvent::Opened, LinkEvent::Closed];
}

/// How far an order is. The codes on the wire are ours: the source only says that the status message tells the phase
/// (thesis, section 11.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Phase {
    /// 0: no order.
    Idle,
    /// 1: the start was sent, its acknowledgement has not come.
    Starting,
    /// 2: jobs are sent and executed.
    Active,
    /// 3: no job follows; those in the queue are executed.
    Ending,
    /// 4: the queue is being cleared; the job that is being executed is the last.
    Interrupted,
    /// 5: nothing helped; the motion program has to (thesis, section 6.3).
    Alarm,
    /// A code that this version does not know. No session is ever in it.
    Other(u8),
}

/// What happens to an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OrderEvent {
    /// An order is to begin.
    Start,
    /// The robot has taken it.
    Accepted,
    /// The robot has not taken it, and it is given up.
    Refused,
    /// The robot is in another order of the same number: it has to be ended first.
    Foreign,
    /// No job follows.
    End,
    /// The order is to end now, from whatever side.
    Interrupt,
    /// The recovery ladder has come to its end.
    Alarm,
    /// The motion program has cleared the queue: try again.
    Recovered,
    /// The queue is empty and the robot's active order is 0.
    Over,
    /// The robot no longer knows the order.
    Lost,
}

impl Phase {
    /// Every state that a session can be in, in the order of the table.
    pub const ALL: [Self; 6] =
        [Phase::Idle, Phase::Starting, Phase::Active, Phase::Ending, Phase::Interrupted, Phase::Alarm];

    /// The next state; `None` when the event changes nothing in this one.
    pub const fn on(self, event: OrderEvent) -> Option<Self> {
        use OrderEvent as E;
        match (self, event) {
            (Phase::Idle, E::Start) => Some(Phase::Starting),
            (Phase::Starting, E::Accepted) => Some(Phase::Active),
            (Phase::Starting, E::Refused) => Some(Phase::Idle),
            (Phase::Active, E::Foreign) => Some(Phase::Starting),
            (Phase::Active | Phase::Alarm, E::End) => Some(Phase::Ending),
            (Phase::Starting | Phase::Active | Phase::Ending | Phase::Alarm, E::Interrupt) => {
                Some(Phase::Interrupted)
            }
            (Phase::Active, E::Alarm) => Some(Phase::Alarm),
            (Phase::Alarm, E::Recovered) => Some(Phase::Active),
            (Phase::Active | Phase::Ending | Phase::Interrupted | Phase::Alarm, E::Over | E::Lost) => {
                Some(Phase::Idle)
            }
            (Phase::Idle, E::Accepted | E::Refused | E::Foreign | E::End | E::Interrupt)
            | (Phase::Idle, E::Alarm | E::Recovered | E::Over | E::Lost)
            | (
                Phase::Starting,
                E::Start | E::Foreign | E::End | E::Alarm | E::Recovered | E::Over | E::Lost,
            )
            | (Phase::Active, E::Start | E::Accepted | E::Refused | E::Recovered)
            | (
                Phase::Ending | Phase::Interrupted,
                E::Start | E::Accepted | E::Refused | E::Foreign | E::End,
            )
            | (Phase::Ending | Phase::Interrupted, E::Alarm | E::Recovered)
            | (Phase::Interrupted, E::Interrupt)
            | (Phase::Alarm, E::Start | E::Accepted | E::Refused | E::Foreign | E::Alarm)
            | (Phase::Other(_), _) => None,
        }
    }
}

impl OrderEvent {
    /// Every event, in the order of the table.
    pub const ALL: [Self; 10] = [
        OrderEvent::Start,
        OrderEvent::Accepted,
        OrderEvent::Refused,
        OrderEvent::Foreign,
        OrderEvent::End,
        OrderEvent::Interrupt,
        OrderEvent::Alarm,
        OrderEvent::Recovered,
        OrderEvent::Over,
        OrderEvent::Lost,
    ];
}

impl From<u8> for Phase {
    fn from(code: u8) -> Self {
        match code {
            0 => Phase::Idle,
            1 => Phase::Starting,
            2 => Phase::Active,
            3 => Phase::Ending,
            4 => Phase::Interrupted,
            5 => Phase::Alarm,
            other => Phase::Other(other),
        }
    }
}

impl From<Phase> for u8 {
    fn from(phase: Phase) -> Self {
        match phase {
            Phase::Idle => 0,
            Phase::Starting => 1,
            Phase::Active => 2,
            Phase::Ending => 3,
            Phase::Interrupted => 4,
            Phase::Alarm => 5,
            Phase::Other(code) => code,
        }
    }
}
