//! A toy end: each byte is a request that is answered with the same byte before the next one is read.

use core::time::Duration;

use robot_session::end::{
    ByteDecoder, Core, CoreOf, Counters, End, EventQueue, Expiry, Machine, QueueSpace, is_due,
};
use robot_session::{Decoder as _, Unexpected};

/// The state of the end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EchoMachine {
    Disconnected,
    /// Waits for a request.
    Idle,
    /// Is to send the answer.
    Answering {
        byte: u8,
        from: Duration,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    Connected,
    Disconnected,
    Timeout,
    Byte(u8),
    Overrun,
    Sent,
}
robot_session::inputs!(Input: Byte, Overrun, Sent);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    Nothing,
    Answered(u8),
    Overrun,
}

impl Machine for EchoMachine {
    const END: &'static str = "echo";
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input;
    type Action = Action;
    type Transmit = u8;
    /// The delay of an answer.
    type Config = Duration;

    fn on(&mut self, now: Duration, input: Input, delay: &Duration) -> Result<Action, Unexpected> {
        match (*self, input) {
            (_, Input::Connected) => *self = Self::Idle,
            (_, Input::Disconnected) => *self = Self::Disconnected,
            (_, Input::Overrun) => return Ok(Action::Overrun),
            (Self::Idle, Input::Byte(byte)) => {
                *self = Self::Answering { byte, from: now.saturating_add(*delay) };
            }
            (Self::Answering { byte, from }, Input::Sent) if is_due(from, now) => {
                *self = Self::Idle;
                return Ok(Action::Answered(byte));
            }
            (_, Input::Timeout | Input::Byte(_) | Input::Sent) => return Err(self.unexpected(&input)),
        }
        Ok(Action::Nothing)
    }

    fn transmit(&self, now: Duration, _: &Duration) -> Option<u8> {
        match self {
            Self::Answering { byte, from } if is_due(*from, now) => Some(*byte),
            _ => None,
        }
    }

    fn deadline(&self) -> Option<Duration> {
        match self {
            Self::Answering { from, .. } => Some(*from),
            _ => None,
        }
    }

    fn expires(&self, _: Duration) -> bool {
        false
    }

    fn reads(&self) -> bool {
        !matches!(self, Self::Answering { .. })
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let Self::Answering { from, .. } = self {
            f(from);
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Disconnected => "Disconnected",
            Self::Idle => "Idle",
            Self::Answering { .. } => "Answering",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EchoEvent {
    /// An outcome.
    Answered(u8),
    Overrun,
    Unexpected(Unexpected),
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EchoStatistics {
    pub unexpected: u64,
    pub dropped_notices: u64,
}

impl Counters for EchoStatistics {
    fn unexpected(&mut self) -> &mut u64 {
        &mut self.unexpected
    }

    fn dropped_notices(&mut self) -> &mut u64 {
        &mut self.dropped_notices
    }
}

pub struct Echo {
    core: CoreOf<Self>,
}

impl Echo {
    pub fn new(delay: Duration) -> Self {
        Self { core: Core::new(delay, EchoMachine::Disconnected, ByteDecoder::new()) }
    }
}

impl End for Echo {
    type Machine = EchoMachine;
    type Decoder = ByteDecoder;
    type Events = EventQueue<EchoEvent, 4>;
    type Statistics = EchoStatistics;
    type Payload = ();

    const LINK: &'static str = "echo";
    const END: &'static str = "end";
    const MAX_INPUT: usize = 32;
    const MAX_TRANSMIT: usize = 1;
    const QUEUE_SPACE: QueueSpace = QueueSpace { connect: 3, read: 2, transmit: 1 };

    robot_session::core!(EchoEvent::Unexpected);

    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        let byte = self.core.decoder.next_frame()?.ok()?;
        Some((Input::Byte(byte), None))
    }

    fn act(&mut self, _: Duration, action: Action, _: Option<()>) {
        match action {
            Action::Nothing => {}
            Action::Answered(byte) => self.core.push_outcome(EchoEvent::Answered(byte)),
            Action::Overrun => self.core.events.push_notice(EchoEvent::Overrun),
        }
    }

    fn write(&mut self, _: Duration, byte: u8, out: &mut [u8]) -> Option<(usize, Input)> {
        *out.first_mut()? = byte;
        Some((1, Input::Sent))
    }

    fn overrun(&mut self, now: Duration) {
        self.advance(now, Input::Overrun, None);
    }
}
