//! One end against any peer.

use core::fmt::Debug;
use core::hash::Hash;
use core::time::Duration;

use robot_session::end::{Expiry, Input as _, Machine};

use super::machine::{DrawnMachine, Edge, age, drive};
use super::system::System;

/// The name of the property that is broken by an input which the state of the end does not allow.
pub const EXPECTED: &str = "no input is unexpected";

const NOW: Duration = Duration::ZERO;

/// A peer without a machine, given by two things only: its possible steps at each moment, and the state of its end's
/// jobs so far.
///
/// A peer that keeps the source's rules takes the steps that they permit; a peer that does anything sends everything
/// that a decoder can make of bytes. The model explores each step that they leave open.
///
/// It needs no bytes: [`Wired`](super::Wired) has those of each step, in a file of its own if the two are long.
pub trait Peer: Send + Sync + 'static {
    /// The end.
    type End: DrawnMachine + Send + Sync;
    /// The model's knowledge of the peer, the line and the jobs. Its times are relative to now, and are bounded.
    type Knowledge: Clone + Eq + Hash + Debug + Send + Sync;
    /// A step of the peer, the line or the end's user.
    type Step: Copy + PartialEq + Debug + Send + Sync;

    /// The length of a tick.
    const TICK: Duration;

    /// Returns the end's configuration.
    fn config(&self) -> &<Self::End as Machine>::Config;

    /// Returns the end at the start of its process.
    fn end(&self) -> Self::End;

    /// Returns the model's knowledge at that moment.
    fn known(&self) -> Self::Knowledge;

    /// Appends the steps that are possible now.
    fn steps(&self, end: &Self::End, known: &Self::Knowledge, steps: &mut Vec<Self::Step>);

    /// Returns the actor of a step.
    fn by(&self, step: Self::Step) -> Actor;

    /// Returns whether the end takes bytes now; otherwise they wait in the transport. By default, while it reads.
    fn takes(&self, end: &Self::End) -> bool {
        end.reads()
    }

    /// Applies a step; returns the end's input, if there is one.
    fn apply(&self, end: &Self::End, known: &mut Self::Knowledge, step: Self::Step) -> Option<InputOf<Self>>;

    /// Returns whether the end's program may handle expired deadlines, or send, now. By default, in any sequence.
    fn may_call(&self, _end: &Self::End, _known: &Self::Knowledge, _call: Call) -> bool {
        true
    }

    /// Called when the incomplete frame in the decoder is given up as corrupt, before
    /// [`Input::TIMEOUT`](robot_session::end::Input::TIMEOUT): see [`Machine::cuts`].
    fn cut(&self, _known: &mut Self::Knowledge) {}

    /// Returns the next input that the end gets from the same bytes, after an input or after bytes were given up.
    fn next(&self, _end: &Self::End, _known: &mut Self::Knowledge) -> Option<InputOf<Self>> {
        None
    }

    /// Returns the input for the transmission of this.
    fn sent(&self, what: &TransmitOf<Self>) -> InputOf<Self>;

    /// Returns the input after a message was sent, if it depends on more than [`Machine::transmit`].
    fn answer(
        &self,
        _end: &Self::End,
        _known: &mut Self::Knowledge,
        what: &TransmitOf<Self>,
    ) -> InputOf<Self> {
        self.sent(what)
    }

    /// Records an action of the end. A violation is kept for [`broken`](Self::broken).
    fn acted(
        &self,
        end: &Self::End,
        known: &mut Self::Knowledge,
        cause: CauseOf<Self>,
        action: ActionOf<Self>,
    );

    /// Called when a tick has passed.
    fn tick(&self, _known: &mut Self::Knowledge) {}

    /// Called when the end's process was restarted, and its owner's knowledge is lost. The new end has no connection.
    fn restarted(&self, known: &mut Self::Knowledge);

    /// Clears the parts of the end that the model does not count, such as job numbers.
    fn forget(&self, _end: &mut Self::End) {}

    /// Pushes the properties that do not hold.
    fn broken(&self, end: &Self::End, known: &Self::Knowledge, broken: &mut Vec<&'static str>);

    /// Returns whether all work is done: a run without faults leads here from every state. With a peer that does
    /// anything, this is not checked.
    fn is_over(&self, _end: &Self::End, _known: &Self::Knowledge) -> bool {
        true
    }

    /// Returns whether one of [`steps`](Self::steps) happens before time passes.
    fn is_urgent(&self, _end: &Self::End, _known: &Self::Knowledge) -> bool {
        false
    }

    /// Returns the next step, one of [`steps`](Self::steps), of a patient user and a peer that keeps the rules if no
    /// fault happens. `None`: time passes.
    fn fault_free_step(&self, _end: &Self::End, _known: &Self::Knowledge) -> Option<Self::Step> {
        None
    }
}

/// A call of the end's program, which its driver makes when it is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Call {
    /// Handles the expired deadlines.
    HandleTimeout,
    /// Sends the message that is due.
    PollTransmit,
}

/// The actor of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Actor {
    /// The line brings bytes. They wait in the transport until the end [takes](Peer::takes) them.
    Line,
    /// The end's user calls it.
    User,
    /// The step happens elsewhere, and the end does not notice.
    Others,
}

/// The cause of an end's action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause<W, T> {
    /// A connection was made, perhaps in place of another.
    Connected,
    /// The connection is lost.
    Disconnected,
    /// Something came due.
    Due,
    /// The end has sent this.
    Sent(T),
    /// A step.
    Step(W),
}

/// The [`Machine::Input`] of a peer's end.
pub type InputOf<P> = <<P as Peer>::End as Machine>::Input;
/// The [`Machine::Action`] of a peer's end.
pub type ActionOf<P> = <<P as Peer>::End as Machine>::Action;
/// The [`Machine::Transmit`] of a peer's end.
pub type TransmitOf<P> = <<P as Peer>::End as Machine>::Transmit;
/// The [`Cause`] of a peer's end.
pub type CauseOf<P> = Cause<<P as Peer>::Step, TransmitOf<P>>;

/// One end against any peer: a [`System`].
#[derive(Debug, Clone, Copy)]
pub struct EndWithPeer<P> {
    /// The peer.
    pub peer: P,
    /// The end is called late at times: due work waits, and time passes.
    pub late: bool,
    /// The connection is lost and the end's process restarted at any moment.
    pub breaks: bool,
}

/// The end, and the knowledge about its peer and user.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Scene<E, K> {
    /// The end.
    pub end: E,
    /// The model's knowledge of the peer.
    pub known: K,
    is_connected: bool,
    was_unexpected: bool,
}

/// One thing that happens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act<W> {
    /// A connection is made, perhaps in place of another.
    Connect,
    /// The connection is lost.
    Disconnect,
    /// Handles the expired deadlines.
    Due,
    /// Sends the message that is due.
    Send,
    /// The end's process is restarted.
    Restart,
    /// Time passes.
    Tick,
    /// A step.
    Step(W),
}

/// The end of a peer, and the knowledge about the peer.
pub type SceneOf<P> = Scene<<P as Peer>::End, <P as Peer>::Knowledge>;

impl<P: Peer> EndWithPeer<P> {
    /// Creates a system with an end that is called late, and connections that break.
    pub const fn new(peer: P) -> Self {
        Self { peer, late: true, breaks: true }
    }

    /// Handles expired deadlines before another step of this moment, if the session does so.
    fn expire(&self, scene: &mut SceneOf<P>, before: &[Expiry], edges: &mut Option<&mut Vec<Edge>>) {
        if before.contains(&P::End::EXPIRY) {
            while scene.end.expires(NOW) {
                self.time_out(scene, edges);
            }
        }
    }

    fn time_out(&self, scene: &mut SceneOf<P>, edges: &mut Option<&mut Vec<Edge>>) {
        if scene.end.cuts() {
            self.peer.cut(&mut scene.known);
            self.read_on(scene, None, edges);
        }
        // The bytes decoded just now may have cleared the deadline.
        if scene.end.expires(NOW) {
            self.drive(scene, Cause::Due, InputOf::<P>::TIMEOUT, edges);
            self.read_on(scene, None, edges);
        }
    }

    fn read_on(&self, scene: &mut SceneOf<P>, step: Option<P::Step>, edges: &mut Option<&mut Vec<Edge>>) {
        while let Some(input) = self.peer.next(&scene.end, &mut scene.known) {
            self.drive(scene, step.map_or(Cause::Due, Cause::Step), input, edges);
        }
    }

    fn drive(
        &self,
        scene: &mut SceneOf<P>,
        cause: CauseOf<P>,
        input: InputOf<P>,
        edges: &mut Option<&mut Vec<Edge>>,
    ) {
        match drive(&mut scene.end, input, self.peer.config(), edges) {
            Ok(action) => self.peer.acted(&scene.end, &mut scene.known, cause, action),
            Err(_) => scene.was_unexpected = true,
        }
    }

    /// Returns the acts of the driver that are possible now.
    fn due(&self, scene: &SceneOf<P>) -> impl Iterator<Item = Act<P::Step>> + use<P> {
        let may = |call| self.peer.may_call(&scene.end, &scene.known, call);
        let expires = scene.end.expires(NOW) && may(Call::HandleTimeout);
        let sends = scene.end.transmit(NOW, self.peer.config()).is_some() && may(Call::PollTransmit);
        expires.then_some(Act::Due).into_iter().chain(sends.then_some(Act::Send))
    }

    fn send(&self, scene: &mut SceneOf<P>, edges: &mut Option<&mut Vec<Edge>>) {
        self.expire(scene, &[Expiry::First, Expiry::BeforeTransmit, Expiry::BeforeBytes], edges);
        let Some(what) = scene.end.transmit(NOW, self.peer.config()) else { return };
        let sent = self.peer.answer(&scene.end, &mut scene.known, &what);
        self.drive(scene, Cause::Sent(what), sent, edges);
        // Bytes that were held are read when there is free space again.
        self.read_on(scene, None, edges);
    }

    fn say(&self, scene: &mut SceneOf<P>, step: P::Step, edges: &mut Option<&mut Vec<Edge>>) {
        match self.peer.by(step) {
            Actor::Line if !self.peer.takes(&scene.end) => return,
            Actor::Line => {
                self.expire(scene, &[Expiry::First, Expiry::BeforeInput, Expiry::BeforeBytes], edges);
            }
            Actor::User => self.expire(scene, &[Expiry::First], edges),
            Actor::Others => {}
        }
        if let Some(input) = self.peer.apply(&scene.end, &mut scene.known, step) {
            self.drive(scene, Cause::Step(step), input, edges);
            self.read_on(scene, Some(step), edges);
        }
    }
}

impl<P: Peer> System for EndWithPeer<P> {
    type State = SceneOf<P>;
    type Act = Act<P::Step>;

    fn init(&self) -> Self::State {
        let (end, known) = (self.peer.end(), self.peer.known());
        Scene { end, known, is_connected: false, was_unexpected: false }
    }

    fn acts(&self, scene: &Self::State, acts: &mut Vec<Self::Act>) {
        let is_due = scene.end.expires(NOW);
        let sends = scene.end.transmit(NOW, self.peer.config()).is_some();
        acts.extend(self.due(scene));
        let mut steps = Vec::new();
        self.peer.steps(&scene.end, &scene.known, &mut steps);
        acts.extend(steps.into_iter().map(Act::Step));
        let is_urgent = self.peer.is_urgent(&scene.end, &scene.known);
        if !is_urgent && (self.late || !(is_due || sends)) {
            acts.push(Act::Tick);
        }
        if !scene.is_connected {
            acts.push(Act::Connect);
        } else if self.breaks {
            acts.extend([Act::Connect, Act::Disconnect, Act::Restart]);
        }
    }

    fn step(&self, scene: &Self::State, act: Self::Act, edges: Option<&mut Vec<Edge>>) -> Self::State {
        let (mut scene, edges) = (scene.clone(), &mut { edges });
        match act {
            Act::Connect => {
                self.expire(&mut scene, &[Expiry::First], edges);
                scene.is_connected = true;
                self.drive(&mut scene, Cause::Connected, InputOf::<P>::CONNECTED, edges);
            }
            Act::Disconnect => {
                self.expire(&mut scene, &[Expiry::First], edges);
                scene.is_connected = false;
                self.drive(&mut scene, Cause::Disconnected, InputOf::<P>::DISCONNECTED, edges);
            }
            Act::Due => self.expire(&mut scene, &[P::End::EXPIRY], edges),
            Act::Send => self.send(&mut scene, edges),
            Act::Restart => {
                (scene.end, scene.is_connected) = (self.peer.end(), false);
                self.peer.restarted(&mut scene.known);
            }
            Act::Tick => {
                age(&mut scene.end, P::TICK);
                self.peer.tick(&mut scene.known);
            }
            Act::Step(step) => self.say(&mut scene, step, edges),
        }
        self.peer.forget(&mut scene.end);
        scene
    }

    fn broken(&self, scene: &Self::State, broken: &mut Vec<&'static str>) {
        if scene.was_unexpected {
            broken.push(EXPECTED);
        }
        self.peer.broken(&scene.end, &scene.known, broken);
    }

    fn fault_free_step(&self, scene: &Self::State) -> Option<Self::Act> {
        if !scene.is_connected {
            return Some(Act::Connect);
        }
        let step = || self.peer.fault_free_step(&scene.end, &scene.known).map_or(Act::Tick, Act::Step);
        Some(self.due(scene).next().unwrap_or_else(step))
    }

    fn is_over(&self, scene: &Self::State) -> bool {
        self.peer.is_over(&scene.end, &scene.known)
    }

    fn ticks(&self, act: Self::Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}
