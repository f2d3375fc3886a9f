//! One end and any peer: a random walk of the model's [`Peer`](crate::model::Peer), whose steps are bytes on a bad line.
//!
//! After every step the session is compared with its machine, the bytes that it sends and its events with the machine's
//! decisions, and the jobs with the properties of the model. A job is a step that the end receives or loses.

use core::time::Duration;
use std::collections::HashMap;

use robot_session::contract::Rng;
use robot_session::end::Machine as _;

use super::against::{Act, Actor, EndWithPeer, SceneOf};
use super::fingerprint::fingerprint;
use super::system::System as _;
use super::wired::{Follower, Wired};
use crate::link::{Delivery, End, Link};
use crate::soak::{Log, Tally};

/// The most steps to the end of all work, without faults.
const CALM: usize = 5000;
/// The most ticks for which the end is not called.
const ASLEEP: u64 = 200;

/// Walks at random with a seed; returns the tally.
pub fn walk<P: Wired>(against: &EndWithPeer<P>, seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let (steps, bad) = (50 + rng.below(2000), [0.2, 0.5, 0.9][rng.below(3)]);
    // The probability that something happens when a patient user and an obliging peer would let time pass.
    let idle = [bad, 0.8, 0.97, 0.97][rng.below(4)];
    let mut walk = Walk {
        against,
        follower: Follower::new(&against.peer),
        scene: against.init(),
        link: Link::new(seed, P::FAULTS),
        rng,
        log,
        tally: Tally::default(),
        visits: HashMap::new(),
        rest: None,
        held: None,
        is_clean: true,
        is_calm: false,
        is_forged: false,
    };
    for step in 0..steps + CALM {
        if step == steps {
            walk.calm();
        }
        if walk.is_judged() || walk.is_calm && against.is_over(&walk.scene) {
            break;
        }
        let often = if against.fault_free_step(&walk.scene) == Some(Act::Tick) { idle } else { bad };
        if !walk.turn(often) {
            break;
        }
    }
    let is_stuck = !walk.is_judged() && !against.is_over(&walk.scene);
    let jobs = walk.tally.once + walk.tally.not_done + walk.tally.forged;
    Tally { jobs, stuck: is_stuck.into(), faults: walk.link.counts(), ..walk.tally }
}

struct Walk<'a, P: Wired> {
    against: &'a EndWithPeer<P>,
    follower: Follower<'a, P>,
    scene: SceneOf<P>,
    link: Link,
    rng: Rng,
    log: Log,
    tally: Tally,
    /// The number of visits of each state.
    visits: HashMap<u128, u32>,
    /// A step of which the beginning has arrived, its bytes, and how many of them have arrived.
    rest: Option<(P::Step, Vec<u8>, usize)>,
    /// A step that the session holds until it reads again.
    held: Option<P::Step>,
    /// The decoder holds no bytes of a step that the line has damaged.
    is_clean: bool,
    /// The faults have ended.
    is_calm: bool,
    /// The end has received a message that was not sent: corruption that no check sees. The rest of the walk proves nothing.
    is_forged: bool,
}

impl<P: Wired> Walk<'_, P> {
    fn is_judged(&self) -> bool {
        self.tally.invented > 0 || self.is_forged
    }

    /// Ends the faults.
    fn calm(&mut self) {
        self.is_calm = true;
        self.link.heal();
        if self.rest.is_some() {
            self.step(Act::Connect);
        }
    }

    /// Does one step, or several of time. Returns false if no step is possible.
    fn turn(&mut self, often: f64) -> bool {
        if self.rest.is_some() && self.rng.chance(0.5) {
            self.finish();
            return true;
        }
        let fault_free_step = self
            .against
            .fault_free_step(&self.scene)
            .filter(|act| self.rest.is_none() || !self.is_heard(*act));
        let is_bad = !self.is_calm && self.rng.chance(often);
        let Some(act) = fault_free_step.filter(|_| !is_bad).or_else(|| self.choose()) else { return false };
        // A program that is not called for a while.
        let is_asleep = act == Act::Tick && self.against.late && !self.is_calm && self.rng.chance(0.01);
        let times = if is_asleep { 1 + self.rng.next_u64() % ASLEEP } else { 1 };
        self.step(act);
        for _ in 1..times {
            if self.is_judged() || !self.acts(&self.scene).contains(&act) {
                break;
            }
            self.step(act);
        }
        true
    }

    /// Returns whether the act consists of bytes that the end reads.
    fn is_heard(&self, act: Act<P::Step>) -> bool {
        matches!(act, Act::Step(step) if self.against.peer.by(step) == Actor::Line)
    }

    fn takes(&self, scene: &SceneOf<P>) -> bool {
        self.against.peer.takes(&scene.end)
    }

    /// The possible acts in a scene. No other step is received before the rest of one.
    fn acts(&self, scene: &SceneOf<P>) -> Vec<Act<P::Step>> {
        let mut acts = Vec::new();
        self.against.acts(scene, &mut acts);
        acts.retain(|act| self.rest.is_none() || !self.is_heard(*act));
        acts
    }

    /// Delivers bytes in these pieces. Returns false if the session differs from its machine.
    fn receive<'b>(&mut self, pieces: impl IntoIterator<Item = &'b [u8]>) -> bool {
        let heard = self.follower.receive(pieces);
        heard.as_ref().err().into_iter().for_each(|error| self.find(error));
        heard.is_ok()
    }

    /// Returns the act that leads to the state with the fewest visits. Only few acts break the connection.
    fn choose(&mut self) -> Option<Act<P::Step>> {
        let acts = self.acts(&self.scene);
        let breaks = |act: &Act<P::Step>| matches!(act, Act::Connect | Act::Disconnect | Act::Restart);
        let has_others = acts.iter().any(|act| !breaks(act));
        let is_likely = |act: &Act<P::Step>| !(breaks(act) && has_others && self.rng.chance(0.95));
        let likely: Vec<_> = acts.iter().copied().filter(is_likely).collect();
        let visits = |act: &Act<P::Step>| {
            let next = self.against.step(&self.scene, *act, None);
            let times = |of: u128| self.visits.get(&of).copied().unwrap_or_default();
            (times(fingerprint(&next)), times(fingerprint(&next.end)), self.rng.next_u64())
        };
        let visited: Vec<_> = likely.iter().map(visits).zip(&likely).collect();
        visited.into_iter().min_by_key(|(visits, _)| *visits).map(|(_, act)| *act)
    }

    fn step(&mut self, act: Act<P::Step>) {
        self.log.line(self.follower.now, format_args!("{act:?}"));
        if matches!(act, Act::Connect | Act::Disconnect | Act::Restart) {
            (self.rest, self.held) = (None, None);
        }
        let bytes = match self.follower.act(&self.scene, act) {
            Ok(bytes) => bytes,
            Err(error) => return self.find(&error),
        };
        match act {
            Act::Step(step) if self.is_heard(act) => {
                if self.takes(&self.scene) {
                    self.say(step, bytes);
                }
            }
            act => {
                if !bytes.is_empty() {
                    self.tally.once += 1;
                    let (pieces, _) = self.carry(act, &bytes);
                    if !self.receive(pieces.iter().map(Vec::as_slice)) {
                        return;
                    }
                }
                // A connection begins with no bytes of the previous one.
                self.is_clean |= matches!(act, Act::Connect | Act::Restart);
                let next = self.against.step(&self.scene, act, None);
                self.follow(act, next);
            }
        }
        self.visited();
    }

    /// Sends the bytes of a step: whole, in two parts with a pause between them, with the next step, or until the connection
    /// breaks.
    fn say(&mut self, step: P::Step, mut bytes: Vec<u8>) {
        // Bytes that arrive at a deadline first cause the work that is due.
        if self.is_calm || self.scene.end.expires(Duration::ZERO) {
            return self.deliver(step, &bytes);
        }
        if self.against.breaks && self.rng.chance(0.01) {
            bytes.truncate(self.rng.below(bytes.len() + 1));
            return self.cut(step, &bytes);
        }
        if !self.is_clean || self.held.is_some() {
            return self.deliver(step, &bytes);
        }
        if bytes.len() > 1 && self.against.peer.may_pause(step) && self.rng.chance(0.05) {
            let (head, rest) = bytes.split_at(1 + self.rng.below(bytes.len() - 1));
            self.log.line(self.follower.now, format_args!("  {} bytes come later", rest.len()));
            if !self.receive([head]) {
                return;
            }
            let arrived = head.len();
            self.rest = Some((step, bytes, arrived));
            let same = self.scene.clone();
            return self.follow(Act::Step(step), same);
        }
        if self.rng.chance(0.1) {
            return self.glue(step, bytes);
        }
        self.deliver(step, &bytes);
    }

    /// Delivers the rest of a step's bytes, if the peer may still take that step; otherwise they never arrive.
    fn finish(&mut self) {
        let Some((step, bytes, arrived)) = self.rest.take() else { return };
        let act = Act::Step(step);
        let is_said =
            self.acts(&self.scene).contains(&act) && self.follower.speak(&self.scene.known, step) == bytes;
        if is_said && self.takes(&self.scene) {
            let rest = bytes.get(arrived..).unwrap_or_default();
            self.log.line(self.follower.now, format_args!("{act:?}, its last {} bytes", rest.len()));
            if !self.receive([rest]) {
                return;
            }
            let heard = self.against.step(&self.scene, act, None);
            self.tally.once += 1;
            self.follow(act, heard);
            self.visited();
        } else {
            self.is_clean = false;
            self.tally.not_done += 1;
        }
    }

    /// Lets another step arrive in the same read.
    fn glue(&mut self, step: P::Step, mut bytes: Vec<u8>) {
        let between = self.against.step(&self.scene, Act::Step(step), None);
        let mut acts = self.acts(&between);
        let joins = |act: &Act<P::Step>| matches!(act, Act::Step(step) if self.against.peer.may_join(*step));
        acts.retain(|act| self.is_heard(*act) && joins(act));
        let Some(Act::Step(next)) = acts.get(self.rng.below(acts.len().max(1))).copied() else {
            return self.deliver(step, &bytes);
        };
        self.log.line(self.follower.now, format_args!("  and {next:?}"));
        bytes.extend(self.follower.speak(&between.known, next));
        if !self.receive([bytes.as_slice()]) {
            return;
        }
        self.tally.once += 2;
        let heard = if self.takes(&between) {
            self.against.step(&between, Act::Step(next), None)
        } else {
            self.held = Some(next);
            between
        };
        self.follow(Act::Step(next), heard);
    }

    /// Checks that the session is in the state of the model. A step whose bytes are buffered is applied when the
    /// session reads again.
    fn follow(&mut self, act: Act<P::Step>, mut next: SceneOf<P>) {
        if self.takes(&next)
            && let Some(held) = self.held.take()
        {
            self.log.line(self.follower.now, format_args!("  {held:?} was held"));
            next = self.against.step(&next, Act::Step(held), None);
        }
        let Some(difference) = self.follower.differs(&next) else {
            self.scene = next;
            return;
        };
        if self.is_clean {
            return self.find(&difference);
        }
        match self.late(act).into_iter().find(|scene| self.follower.differs(scene).is_none()) {
            Some(late) => self.scene = late,
            None => self.forge(),
        }
    }

    /// Ends the connection within a step.
    fn cut(&mut self, step: P::Step, bytes: &[u8]) {
        self.log.line(self.follower.now, format_args!("  cut after {} bytes", bytes.len()));
        if !self.receive([bytes]) {
            return;
        }
        let heard = self.against.step(&self.scene, Act::Step(step), None);
        let mut scenes = self.lost(step);
        scenes.extend([self.scene.clone(), heard]);
        match scenes.into_iter().find(|scene| self.follower.differs(scene).is_none()) {
            Some(scene) => {
                self.tally.not_done += 1;
                self.scene = scene;
                self.step(Act::Connect);
            }
            None if self.is_clean => self.find(&format!("{step:?}, cut")),
            None => self.forge(),
        }
    }

    /// Returns the pieces in which bytes arrive over the bad line, and whether it has changed them.
    fn carry(&mut self, act: Act<P::Step>, bytes: &[u8]) -> (Vec<Vec<u8>>, bool) {
        if matches!(act, Act::Step(step) if !self.against.peer.may_split(step)) {
            return (vec![bytes.to_vec()], false);
        }
        let before = self.link.counts();
        self.link.send(End::A, Duration::ZERO, bytes);
        let delivered = core::iter::from_fn(|| self.link.receive(End::B, Duration::MAX));
        let pieces = delivered
            .filter_map(|part| if let Delivery::Bytes(bytes) = part { Some(bytes) } else { None })
            .collect();
        (pieces, self.link.counts().corruption() > before.corruption())
    }

    /// Delivers a step over the bad line: it is received or lost.
    fn deliver(&mut self, step: P::Step, bytes: &[u8]) {
        let (pieces, is_hurt) = self.carry(Act::Step(step), bytes);
        if !self.receive(pieces.iter().map(Vec::as_slice)) {
            return;
        }
        self.tally.corrupt += u64::from(is_hurt);
        self.is_clean &= !is_hurt;
        let heard = self.against.step(&self.scene, Act::Step(step), None);
        let difference = self.follower.differs(&heard);
        let mut others = Vec::new();
        if !self.is_clean {
            others.extend(self.lost(step));
            others.extend(self.late(Act::Step(step)));
        }
        let lost = others.into_iter().find(|scene| self.follower.differs(scene).is_none());
        match (difference, lost) {
            // If the session does not show whether the step was applied, it counts as not applied.
            (Some(_), Some(lost)) => self.lose(lost, is_hurt),
            (None, Some(lost)) if is_hurt => self.lose(lost, is_hurt),
            (None, _) => {
                self.tally.once += 1;
                // If it makes no difference, the bytes may still wait.
                self.is_clean |= heard.end != self.scene.end && self.against.peer.is_last(step);
                self.scene = heard;
            }
            (Some(_), None) if !self.is_clean => self.forge(),
            (Some(difference), None) => self.find(&difference),
        }
    }

    /// Returns the scenes after a step whose bytes are lost in part. Bytes that are not a message may also trigger an
    /// action that is due.
    fn lost(&self, step: P::Step) -> Vec<SceneOf<P>> {
        let strings = self.against.peer.lost(&self.scene.known, step);
        let due = self.against.step(&self.scene, Act::Due, None);
        let receive = |scene: &SceneOf<P>, words: &[P::Step]| {
            words.iter().fold(scene.clone(), |scene, step| self.against.step(&scene, Act::Step(*step), None))
        };
        strings.iter().flat_map(|words| [receive(&self.scene, words), receive(&due, words)]).collect()
    }

    /// Returns the scene after an act if the end has given up damaged bytes before it.
    fn late(&self, act: Act<P::Step>) -> Option<SceneOf<P>> {
        let before = self.against.step(&self.scene, Act::Step(self.against.peer.given_up()?), None);
        Some(self.against.step(&before, act, None))
    }

    fn lose(&mut self, lost: SceneOf<P>, is_hurt: bool) {
        self.tally.not_done += 1;
        self.tally.refused += u64::from(is_hurt);
        self.scene = lost;
    }

    fn forge(&mut self) {
        self.log.line(self.follower.now, format_args!("corruption has made a word that nobody has said"));
        (self.tally.forged, self.tally.unseen) = (self.tally.forged + 1, self.tally.unseen + 1);
        self.is_forged = true;
    }

    fn find(&mut self, what: &str) {
        self.log.line(self.follower.now, format_args!("!!! {what}"));
        self.tally.invented += 1;
    }

    fn visited(&mut self) {
        *self.visits.entry(fingerprint(&self.scene)).or_default() += 1;
        *self.visits.entry(fingerprint(&self.scene.end)).or_default() += 1;
        let mut broken = Vec::new();
        self.against.broken(&self.scene, &mut broken);
        broken.first().into_iter().for_each(|property| self.find(property));
    }
}
