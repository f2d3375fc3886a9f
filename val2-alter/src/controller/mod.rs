//! The robot controller's end: a simulated MARK III.

mod config;

pub use config::{ControllerConfig, ControllerEvent, ControllerStats};

use core::time::Duration;

use crate::decoder::Decoder;
use crate::message::{
    AXES, Accumulation, End, ErrorCode, Exception, HostMessage, Message, Motion, MotionPhase, Reply,
    RobotMessage, SegmentStatus, Start, StartCode,
};
use crate::queue::Queue;
use crate::state::{ControllerInput, ControllerState};
use crate::timing::{self, Budget};
use crate::{Pose, SessionError, Transform};

/// The controller's session, and the arm that it moves. It never reads a clock and never blocks.
///
/// Order: [`handle_input`](Controller::handle_input) with what was read and the time when it arrived,
/// [`handle_timeout`](Controller::handle_timeout), [`poll_event`](Controller::poll_event) until `None`,
/// [`poll_transmit`](Controller::poll_transmit) and write what it gives, then wait for bytes until
/// [`poll_timeout`](Controller::poll_timeout). [`start`](Controller::start) executes the ALTER instruction.
///
/// The first good reply in the window of a message decides; what comes outside a window is thrown away. A reply that cannot
/// be read gives the error code of the next message, and the arm does not move by it; a missing one ends ALTER with
/// error 6. A session that is late itself sends the next message late: it never sends two in one cycle. Of 16 events that
/// nobody fetches, the oldest is dropped and counted.
#[derive(Debug, Clone)]
pub struct Controller {
    config: ControllerConfig,
    decoder: Decoder<HostMessage>,
    events: Queue<ControllerEvent, 16>,
    stats: ControllerStats,
    state: ControllerState,
    attempt: u8,
    /// When the next message is to be sent.
    slot: Duration,
    /// Until when a reply to the last one is taken.
    window: Option<Duration>,
    last_input: Duration,
    /// What was wrong with the last reply.
    error: ErrorCode,
    /// What was wrong with the bytes of this window.
    damage: Option<ErrorCode>,
    segment: (SegmentStatus, u16, u16),
    /// The words that the controller keeps, and what they did to the arm in the last cycle.
    words: [i16; AXES],
    applied: [i16; AXES],
    path: Pose,
    correction: Pose,
}

impl Controller {
    /// A controller whose program does not execute ALTER yet.
    pub fn new(config: ControllerConfig) -> Self {
        Self {
            config,
            decoder: Decoder::new(config.framing),
            events: Queue::new(),
            stats: ControllerStats::default(),
            state: ControllerState::Off,
            attempt: 0,
            slot: Duration::ZERO,
            window: None,
            last_input: Duration::ZERO,
            error: ErrorCode::None,
            damage: None,
            segment: (SegmentStatus::Normal, 1, 0),
            words: [0; AXES],
            applied: [0; AXES],
            path: config.home,
            correction: Pose::IDENTITY,
        }
    }

    /// Executes the ALTER instruction: the first start message is due at `now`. The path is the place where the arm stands
    /// (the source's program says `MOVES HERE`), until [`Controller::set_path`] changes it.
    ///
    /// # Errors
    /// [`SessionError::AlreadyStarted`]
    pub fn start(&mut self, now: Duration) -> Result<(), SessionError> {
        if self.state != ControllerState::Off {
            return Err(SessionError::AlreadyStarted);
        }
        self.path = self.pose();
        self.correction = Pose::IDENTITY;
        (self.words, self.applied) = ([0; AXES], [0; AXES]);
        (self.attempt, self.error, self.slot) = (0, ErrorCode::None, now);
        self.on(ControllerInput::Start);
        Ok(())
    }

    /// The program ends ALTER: the end message goes out with the next cycle.
    pub fn finish(&mut self) {
        if matches!(self.state, ControllerState::Running | ControllerState::Interrupted) {
            self.error = ErrorCode::None;
        }
        self.window = None;
        self.stand();
        self.on(ControllerInput::Finish);
    }

    /// The exception subroutine returns.
    pub fn resume(&mut self) {
        self.on(ControllerInput::Return);
    }

    /// Takes bytes that arrived at `now`. All of them are taken.
    pub fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.handle_timeout(now);
        let silent = now.saturating_sub(self.last_input);
        if self.decoder.pending() > 0 && self.config.gap.is_some_and(|gap| silent > gap) {
            self.decoder.finish();
            self.read();
        }
        self.last_input = now;
        let mut rest = bytes;
        while !rest.is_empty() && self.window.is_some() {
            let taken = self.decoder.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            self.read();
        }
    }

    /// Lets time pass: a window that closes without a good reply is a bad or a missing one.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.window.is_some_and(|closes| now >= closes) {
            self.decoder.finish();
            self.read();
            if self.window.take().is_some() {
                self.on_no_reply();
            }
        }
    }

    /// Writes the message that is due into `out`, which has room for [`Frame::MAX_LEN`](crate::Frame::MAX_LEN) bytes, and
    /// returns its length.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.handle_timeout(now);
        if self.state == ControllerState::Off || self.window.is_some() || now < self.slot {
            return None;
        }
        let message = match self.state {
            ControllerState::Starting => {
                let start = Start::new(self.config.mode, self.config.data);
                RobotMessage::Start(Start { error: self.error, ..start })
            }
            ControllerState::Running => RobotMessage::Motion(self.motion(MotionPhase::Running)),
            ControllerState::Interrupted => RobotMessage::Motion(self.motion(MotionPhase::Interrupted)),
            ControllerState::Ending | ControllerState::Off => RobotMessage::End(End { error: self.error }),
        };
        let len = message.encode(self.config.framing, out).ok()?;
        self.sent(now, len, &message);
        Some(len)
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<ControllerEvent> {
        self.events.pop()
    }

    /// When the window closes, or when the next message is to be sent.
    pub fn poll_timeout(&self) -> Option<Duration> {
        (self.state != ControllerState::Off).then(|| self.window.unwrap_or(self.slot))
    }

    /// Sets what the next messages say of the motion segment: its status, its number (from 1), and the part of it that is done
    /// ([`Motion::DONE`] is all).
    pub fn set_segment(&mut self, status: SegmentStatus, number: u16, percent: u16) {
        self.segment = (status, number, percent);
    }

    /// Moves the programmed path: the corrections of ALTER come on top of it.
    pub fn set_path(&mut self, path: Pose) {
        self.path = path;
    }

    /// Where the arm is: the path with all corrections.
    pub fn pose(&self) -> Pose {
        self.path.corrected(&self.correction, self.config.mode.frame(self.config.polarity))
    }

    /// The values that moved the arm in the last cycle (cumulative), or that hold it off the path (non-cumulative).
    pub fn values(&self) -> [i16; AXES] {
        self.applied
    }

    /// Where the session stands.
    pub fn state(&self) -> ControllerState {
        self.state
    }

    /// The configuration.
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }

    /// What has been counted.
    pub fn stats(&self) -> ControllerStats {
        ControllerStats { events_lost: self.events.lost(), ..self.stats }
    }

    fn motion(&self, phase: MotionPhase) -> Motion {
        let (segment_status, segment, percent) = self.segment;
        let transform = self.config.mode.has_transform();
        let transform = transform.then(|| Transform::from_pose_saturating(&self.pose(), &self.config.layout));
        Motion { phase, error: self.error, segment_status, segment, percent, transform }
    }

    fn sent(&mut self, now: Duration, len: usize, message: &RobotMessage) {
        let accumulation = self.config.mode.accumulation();
        let budget = Budget::new(accumulation, self.config.baud, len, 0);
        let closes = now + budget.request + budget.window;
        // On a raster of 28 ms; late once, the next one keeps its window too.
        self.slot = (self.slot + timing::CYCLE).max(closes);
        self.decoder.clear();
        self.damage = None;
        self.window = Some(closes);
        match message {
            RobotMessage::Start(_) => {
                self.attempt += 1;
                self.stats.attempts += 1;
            }
            RobotMessage::Motion(_) => self.stats.cycles += 1,
            RobotMessage::End(end) => {
                self.window = None;
                self.on(ControllerInput::EndSent);
                self.events.push(ControllerEvent::Ended(end.error));
            }
        }
    }

    fn read(&mut self) {
        while let Some(outcome) = self.decoder.next_frame() {
            if self.window.is_none() {
                self.decoder.clear();
                return;
            }
            match (self.state, outcome.map(|received| received.message)) {
                (ControllerState::Starting, Ok(HostMessage::StartReply(code))) => self.on_start_reply(code),
                (ControllerState::Running | ControllerState::Interrupted, Ok(HostMessage::Reply(reply))) => {
                    self.on_reply(reply)
                }
                (_, Ok(_)) => self.note(ErrorCode::Format),
                (_, Err(error)) => self.note(error.code()),
            }
        }
    }

    fn note(&mut self, code: ErrorCode) {
        self.damage.get_or_insert(code);
    }

    fn on_start_reply(&mut self, code: StartCode) {
        self.window = None;
        match code {
            StartCode::Accept => {
                self.error = ErrorCode::None;
                self.stats.starts += 1;
                self.on(ControllerInput::Accept);
                self.events.push(ControllerEvent::Started);
            }
            StartCode::Repeat => self.try_again(ErrorCode::None),
            StartCode::Refuse => {
                self.on(ControllerInput::Refuse);
                self.events.push(ControllerEvent::Refused);
            }
        }
    }

    fn on_reply(&mut self, reply: Reply) {
        self.window = None;
        self.error = ErrorCode::None;
        self.stats.replies += 1;
        self.on(ControllerInput::Reply);
        self.events.push(ControllerEvent::Reply(reply));
        if self.state != ControllerState::Running {
            self.stand();
        } else {
            if self.config.mode.uses_inputs() {
                self.move_arm(&reply);
            }
            if reply.exception != Exception::None {
                let (input, event) = if self.config.subroutine {
                    (ControllerInput::Exception, ControllerEvent::Exception(reply.exception))
                } else {
                    (ControllerInput::Abort, ControllerEvent::Aborted(reply.exception))
                };
                self.on(input);
                self.events.push(event);
            }
        }
    }

    /// The window closed without a good reply.
    fn on_no_reply(&mut self) {
        let code = self.damage.take().unwrap_or(ErrorCode::Timeout);
        self.events.push(ControllerEvent::BadReply(code));
        if self.state == ControllerState::Starting {
            self.try_again(code);
        } else if code == ErrorCode::Timeout {
            self.error = code;
            self.stats.timeouts += 1;
            self.on(ControllerInput::MissingReply);
        } else {
            self.error = code;
            self.stats.bad_replies += 1;
            self.on(ControllerInput::BadReply);
        }
        self.stand();
    }

    fn try_again(&mut self, code: ErrorCode) {
        self.error = code;
        if self.attempt < self.config.attempts {
            self.on(ControllerInput::Repeat);
        } else {
            self.on(ControllerInput::GaveUp);
            self.events.push(ControllerEvent::GaveUp);
        }
    }

    fn move_arm(&mut self, reply: &Reply) {
        let accumulation = self.config.mode.accumulation();
        let holds = self.config.unselected.holds(accumulation);
        for (word, sent) in self.words.iter_mut().zip(reply.values) {
            *word = sent.unwrap_or(if holds { *word } else { 0 });
        }
        self.applied = self.words;
        let set = Pose::from_values(self.words, &self.config.scale);
        self.correction = match accumulation {
            Accumulation::Cumulative => {
                self.correction.accumulated(&set, self.config.mode.frame(self.config.polarity))
            }
            Accumulation::NonCumulative => set,
        };
    }

    /// Without a reply the arm stands: no increment, and an offset stays.
    fn stand(&mut self) {
        if self.config.mode.accumulation() == Accumulation::Cumulative {
            self.applied = [0; AXES];
        }
    }

    fn on(&mut self, input: ControllerInput) {
        self.state = self.state.on(input);
    }
}
