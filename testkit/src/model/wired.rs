//! The session of an end against any peer: each step of the model as bytes or calls.

use core::time::Duration;

use robot_session::Session as _;
use robot_session::end::{End, EventOf, Machine as _};

use super::against::{Act, ActionOf, Actor, EndWithPeer, Peer, SceneOf, TransmitOf};
use super::machine::age;
use super::refine::{Refined, refine};
use crate::faults::Faults;

/// The property that [`Wired::is_written`] states, wherever a session is compared with its machine.
pub const WRITTEN: &str = "messages are encoded as the source says";

/// A peer whose steps are bytes, or calls of the end's session: from these follow its refinement and its random walks.
pub trait Wired: Peer {
    /// The end's session.
    type Session: End<Machine = <Self as Peer>::End>;

    /// The faults of the line in a random walk. The times of a walk are those of the model.
    const FAULTS: Faults;

    /// The step with which the user polls the next outcome; `None` if the user polls every event at once.
    const POLL: Option<Self::Step> = None;

    /// Returns the session at the start of its process.
    fn session(&self) -> Self::Session;

    /// Returns the bytes of a step; none after making its call, or for a step that happens elsewhere.
    fn speak(
        &self,
        known: &Self::Knowledge,
        step: Self::Step,
        session: &mut Self::Session,
        now: Duration,
    ) -> Vec<u8>;

    /// Returns whether these bytes are the message that was to be sent; `bytes` is empty if no message is sent.
    fn is_written(&self, scene: &SceneOf<Self>, what: &TransmitOf<Self>, bytes: &[u8]) -> bool;

    /// Pushes the reports that an action makes.
    fn reports(&self, action: &ActionOf<Self>, reports: &mut Vec<String>);

    /// Returns the report of an event, in the form of [`reports`](Self::reports); `None` for an event without an action,
    /// such as corrupt bytes.
    fn reported(&self, event: &EventOf<Self::Session>) -> Option<String>;

    /// Returns the strings of steps that the end may receive in place of a step whose bytes the line has lost or changed.
    fn lost(&self, _known: &Self::Knowledge, _step: Self::Step) -> Vec<Vec<Self::Step>> {
        vec![Vec::new()]
    }

    /// Returns the step that the end receives when it gives up the bytes of such a step later.
    fn given_up(&self) -> Option<Self::Step> {
        None
    }

    /// Returns whether the end waits for the rest of this step without a limit.
    fn may_pause(&self, _step: Self::Step) -> bool {
        true
    }

    /// Returns whether the bytes of a step may arrive in pieces: not over datagrams, for example.
    fn may_split(&self, _step: Self::Step) -> bool {
        true
    }

    /// Returns whether this step may arrive in the same read as the previous one.
    fn may_join(&self, _step: Self::Step) -> bool {
        true
    }

    /// Returns whether the decoder is empty when the end has received this step.
    fn is_last(&self, _step: Self::Step) -> bool {
        true
    }
}

/// A session that follows the end of a scene, step by step.
#[derive(Debug)]
pub struct Follower<'a, P: Wired> {
    peer: &'a P,
    session: P::Session,
    /// The reports of the events that are not polled yet.
    unpolled: Vec<String>,
    /// The session's time.
    pub now: Duration,
}

impl<'a, P: Wired> Follower<'a, P> {
    /// Creates a session whose process has just started.
    pub fn new(peer: &'a P) -> Self {
        let mut session = peer.session();
        session.core_mut().moves = Some(Vec::new());
        Self { peer, session, unpolled: Vec::new(), now: Duration::from_secs(1) }
    }

    /// Applies an act to the session. Returns the bytes of a step, for [`receive`](Self::receive).
    ///
    /// # Errors
    /// The session sends or reports something other than its machine's decision.
    pub fn act(&mut self, scene: &SceneOf<P>, act: Act<P::Step>) -> Result<Vec<u8>, String> {
        let now = self.now;
        let mut bytes = Vec::new();
        match act {
            Act::Connect => self.session.handle_connected(now),
            Act::Disconnect => self.session.handle_disconnected(now),
            Act::Due => self.session.handle_timeout(now),
            Act::Send => self.send(scene)?,
            Act::Restart => *self = Self { now, ..Self::new(self.peer) },
            Act::Tick => self.now += P::TICK,
            Act::Step(step) if Some(step) == P::POLL => self.poll()?,
            // The bytes wait in the transport.
            Act::Step(step) if self.peer.by(step) == Actor::Line && !self.peer.takes(&scene.end) => {}
            Act::Step(step) => bytes = self.speak(&scene.known, step),
        }
        self.check_reports().map(|()| bytes)
    }

    /// Calls [`Wired::speak`].
    pub fn speak(&mut self, known: &P::Knowledge, step: P::Step) -> Vec<u8> {
        self.peer.speak(known, step, &mut self.session, self.now)
    }

    /// Delivers bytes in these pieces.
    ///
    /// # Errors
    /// As [`act`](Self::act).
    pub fn receive<'b>(&mut self, pieces: impl IntoIterator<Item = &'b [u8]>) -> Result<(), String> {
        pieces.into_iter().for_each(|piece| self.session.handle_input(self.now, piece));
        self.check_reports()
    }

    fn send(&mut self, scene: &SceneOf<P>) -> Result<(), String> {
        let due = scene.end.expires(Duration::ZERO);
        let what = scene.end.transmit(Duration::ZERO, self.peer.config()).filter(|_| !due);
        let mut out = vec![0; <P::Session as End>::MAX_TRANSMIT];
        let length = self.session.poll_transmit(self.now, &mut out);
        let sent = length.and_then(|length| out.get(..length)).unwrap_or_default();
        match what {
            Some(what) if !self.peer.is_written(scene, &what, sent) => {
                Err(format!("{what:?} is sent as {sent:02X?}"))
            }
            _ => Ok(()),
        }
    }

    /// Polls the next event that is reported.
    fn poll(&mut self) -> Result<(), String> {
        let peer = self.peer;
        let polled =
            core::iter::from_fn(|| self.session.poll_event()).find_map(|event| peer.reported(&event));
        let at = polled.as_ref().and_then(|report| self.unpolled.iter().position(|one| one == report));
        match (polled, at) {
            (Some(_), Some(at)) => drop(self.unpolled.remove(at)),
            (Some(report), None) => {
                return Err(format!("the session reports {report}, not {:?}", self.unpolled));
            }
            (None, _) if self.unpolled.is_empty() => {}
            (None, _) => return Err(format!("the session does not report {:?}", self.unpolled)),
        }
        Ok(())
    }

    /// Checks that the events are those of the machine's actions, unless [`poll`](Self::poll) does.
    fn check_reports(&mut self) -> Result<(), String> {
        let moves = self.session.core_mut().moves.replace(Vec::new()).unwrap_or_default();
        for (at, mut machine, input) in moves {
            if let Ok(action) = machine.on(at, input, self.peer.config()) {
                self.peer.reports(&action, &mut self.unpolled);
            }
        }
        if P::POLL.is_some() {
            return Ok(());
        }
        let events = core::iter::from_fn(|| self.session.poll_event());
        let mut reported: Vec<String> = events.filter_map(|event| self.peer.reported(&event)).collect();
        let mut decided = core::mem::take(&mut self.unpolled);
        decided.sort();
        reported.sort();
        if decided == reported { Ok(()) } else { Err(format!("{reported:?} is reported, not {decided:?}")) }
    }

    /// The difference between the session and the end of a scene.
    pub fn differs(&mut self, scene: &SceneOf<P>) -> Option<String> {
        let mut machine = self.session.machine().clone();
        age(&mut machine, self.now);
        self.peer.forget(&mut machine);
        let due = self.session.poll_timeout().map(|at| at.saturating_sub(self.now));
        if (&machine, due) != (&scene.end, scene.end.deadline()) {
            return Some(format!("{machine:?} until {due:?}, not {:?}", scene.end));
        }
        let is_silent = scene.end.transmit(Duration::ZERO, self.peer.config()).is_none();
        let mut out = vec![0; <P::Session as End>::MAX_TRANSMIT];
        (is_silent && !scene.end.expires(Duration::ZERO))
            .then(|| self.session.poll_transmit(self.now, &mut out))
            .flatten()
            .map(|length| format!("{length} bytes are sent unasked"))
    }
}

impl<P: Wired> EndWithPeer<P> {
    /// Walks every state and every transition of the end with its session, over bytes that come in two pieces.
    ///
    /// # Panics
    /// If the session differs from its machine.
    pub fn refined(&self) -> Refined {
        refine(
            self,
            || Follower::new(&self.peer),
            |follower, act, scene, _, path| {
                let heard = follower.act(scene, act).and_then(|bytes| {
                    let is_whole = matches!(act, Act::Step(step) if !self.peer.may_split(step));
                    let cut = if is_whole { 0 } else { path.len() % (bytes.len() + 1) };
                    let (head, tail) = bytes.split_at(cut);
                    follower.receive([head, tail].into_iter().filter(|piece| !piece.is_empty()))
                });
                heard.unwrap_or_else(|error| panic!("{error}: {path:?}"));
            },
            |follower, scene, path| assert_eq!(follower.differs(scene), None, "{path:?}"),
        )
    }
}
