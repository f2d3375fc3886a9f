//! The constants of the models of both ends, their properties, and the common parts of their bytes.

use core::time::Duration;

use val2_alter::controller::machine::DueMessage;
use val2_alter::{
    ControllerConfig, End, Exception, Framing, HostConfig, HostMessage, Limits, List, Message, Mode, Motion,
    RobotMessage, SegmentStatus, Start,
};

pub(super) const ONCE: &str = "an exception is executed once at most";
pub(super) const DONE: &str = "what is reported done was executed";
pub(super) const NOT_DONE: &str = "what is reported not done was not executed";
pub(super) const OUTCOME: &str = "one outcome for each exception";
pub(super) const NESTED: &str = "the exception subroutine is not started while it runs";
pub(super) const INFORMED: &str = "a message reports every interruption";
pub(super) const WORDS: &str = "a word that is left out is zero in the controller";
pub(super) const STALE: &str = "the arm follows only a fresh target";
pub(super) const FITS: &str = "a reply ends in the window that the host knows";
pub(super) const ZEROS: &str = "a stop is done when the arm was sent to rest";
pub(super) const SILENT: &str = "after a stop no message is answered";
pub(super) const UNASKED: &str = "the arm does not move in an interruption";
pub(super) const INVENTED_MODE: &str = "only the configured mode runs";
pub(super) const REFUSED: &str = "a start is refused only when it was corrupt too often, without a pause";
pub(super) const TRIES: &str = "a start is given up only after its attempts";
pub(super) const SILENCE: &str = "a controller that sends nothing is reported as lost";

/// A quarter of a cycle.
pub const TICK: Duration = Duration::from_millis(7);
/// The age in ticks from which on the caller's target is not followed.
pub(super) const FRESH: u8 = 2;
/// The exception of every job.
pub(super) const GRIP: Exception = Exception::CloseGripper;
/// The word of an axis that moves.
pub(super) const MOVES: i16 = 5;

const BAUD: u32 = 19_200;
/// A silence within a frame that has ended by the next tick.
const GAP: Option<Duration> = Some(Duration::from_millis(4));

/// Returns the configuration of a host on a slow line, on which one word fits, and another one only if it is in use already.
pub(super) fn host() -> HostConfig {
    HostConfig {
        mode: Mode(18),
        baud: BAUD,
        subroutine: true,
        reserve: Duration::from_millis(10),
        limits: Limits::NONE,
        target_timeout: TICK * u32::from(FRESH),
        silence_cycles: 2,
        gap: GAP,
        ..HostConfig::default()
    }
}

/// Returns the configuration of a controller on such a line.
pub(super) fn controller() -> ControllerConfig {
    ControllerConfig { mode: Mode(19), baud: BAUD, subroutine: true, gap: GAP, ..ControllerConfig::default() }
}

/// The bytes that a decoder holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum DecoderContents {
    /// No bytes.
    Nothing,
    /// The start mark of a frame.
    Head,
    /// Bytes outside of any frame, which are not reported yet.
    Noise,
    /// A corrupt frame, which was reported.
    Corrupt,
}

impl DecoderContents {
    /// Returns the contents of the decoder after additional noise.
    pub(super) fn with_noise(self) -> Self {
        if self == Self::Nothing { Self::Noise } else { self }
    }

    /// Returns the bytes of a frame that are still to come.
    pub(super) fn rest_of(self, mut frame: Vec<u8>) -> Vec<u8> {
        if self == Self::Head { frame.split_off(HEAD) } else { frame }
    }
}

/// The length of a start mark.
const HEAD: usize = 3;

/// A byte outside of any frame.
pub(super) const NOISE: u8 = 0x55;

/// Returns the start mark of a frame.
pub(super) fn head() -> Vec<u8> {
    let mut frame = bytes(&HostMessage::StartReply(val2_alter::StartCode::Accept));
    frame.truncate(HEAD);
    frame
}

/// Returns the frame of a message.
pub(super) fn bytes<M: Message>(message: &M) -> Vec<u8> {
    let mut out = vec![0; message.encoded_len(Framing::DEFAULT)];
    let Ok(length) = message.encode(Framing::DEFAULT, &mut out) else { panic!("it has a form") };
    out.truncate(length);
    out
}

/// Returns the frame of a message with another checksum.
pub(super) fn corrupt<M: Message>(message: &M) -> Vec<u8> {
    let mut frame = bytes(message);
    frame.last_mut().into_iter().for_each(|checksum| *checksum ^= 0x04);
    frame
}

/// Returns a message of the controller.
pub(super) fn message(what: DueMessage, mode: Mode) -> RobotMessage {
    match what {
        DueMessage::Start(error) => RobotMessage::Start(Start { error, ..Start::new(mode, List::EMPTY) }),
        DueMessage::Motion(phase, error) => RobotMessage::Motion(Motion {
            phase,
            error,
            segment_status: SegmentStatus::Normal,
            segment: 1,
            percent: 0,
            transform: None,
        }),
        DueMessage::End(error) => RobotMessage::End(End { error }),
    }
}
