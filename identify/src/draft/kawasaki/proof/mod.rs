//! The roles and fields of a plant's messages that a conversation proves: each by two messages or more in their context.
//!
//! The rules are those of the link: the robot requests the next job by its number, acknowledges a job that is executed, and
//! begins an order on the PC's start message. All other parts of a draft are guesses. So are the messages that end and
//! interrupt an order, which look alike when its jobs are executed.

mod orders;

use std::collections::{BTreeMap, BTreeSet};

use super::{Kind, number};
use crate::draft::MIN_SIGHTINGS;

/// The fields of a status that every plant has: order, queued, executed. A filler has none of them.
const FIELDS_OF_A_STATUS: usize = 3;

/// Proven roles and fields. A message is its index in the list of all.
#[derive(Debug, Default)]
pub(super) struct Proof {
    /// The side that sends the jobs.
    pub(super) pc: Option<&'static str>,
    roles: BTreeMap<&'static str, usize>,
    fields: BTreeMap<usize, Vec<Option<String>>>,
}

impl Proof {
    /// Returns the message with a role.
    pub(super) fn of(&self, role: &str) -> Option<usize> {
        self.roles.get(role).copied()
    }

    /// Returns whether the message has no proven role.
    pub(super) fn is_free(&self, kind: usize) -> bool {
        !self.roles.values().any(|known| *known == kind)
    }

    /// Returns the field at an index of a message, counted from its header on, then its data.
    pub(super) fn field(&self, kind: usize, at: usize) -> Option<&str> {
        self.fields.get(&kind)?.get(at)?.as_deref()
    }
}

/// Returns the roles and fields that the messages prove.
pub(super) fn prove(kinds: &[Kind]) -> Proof {
    let mut proof = Proof::default();
    for (role, kind) in shared(kinds) {
        proof.roles.insert(role, kind);
    }
    if let Some(conversation) = Conversation::of(kinds) {
        proof.pc = Some(conversation.pc);
        conversation.prove(&mut proof);
    }
    let fields = proof.roles.iter().map(|(role, kind)| (*kind, constants(kinds, &proof, role, *kind)));
    for (kind, constant) in fields.collect::<Vec<_>>() {
        let known = proof.fields.entry(kind).or_default();
        known.resize(constant.len(), None);
        known.iter_mut().zip(constant).for_each(|(known, constant)| *known = known.take().or(constant));
    }
    proof
}

/// Status and filler: the only messages that both ends send.
fn shared(kinds: &[Kind]) -> Vec<(&'static str, usize)> {
    let mut found: Vec<(&'static str, usize)> = Vec::new();
    for (first, kind) in kinds.iter().enumerate() {
        let Some(other) = kinds.iter().skip(first + 1).find(|it| it.name == kind.name) else { continue };
        let varies = (0..kind.width().max(other.width()))
            .any(|at| kind.values(at).chain(other.values(at)).collect::<BTreeSet<_>>().len() > 1);
        let numbers = (0..kind.longest()).filter(|at| !kind.is_text(*at)).count();
        let role = match varies {
            true => "status",
            false if numbers < FIELDS_OF_A_STATUS => "filler",
            false => continue,
        };
        found.push((role, first));
    }
    // Two messages of one role contradict each other.
    let once = |role: &str| found.iter().filter(|(other, _)| *other == role).count() == 1;
    found.iter().copied().filter(|(role, _)| once(role)).collect()
}

/// Jobs, and the requests that they answer.
struct Conversation<'a> {
    kinds: &'a [Kind],
    pc: &'static str,
    job: usize,
    /// The place of a job's number.
    number: usize,
    /// The message that requests jobs, and the index of the requested number.
    request: Option<(usize, usize)>,
    /// The jobs between two that begin with number 1.
    runs: Vec<Run>,
    /// The place of a job's order, where that is proven.
    order: Option<usize>,
}

/// Jobs whose numbers follow each other.
struct Run {
    first: usize,
    last: usize,
    /// The number of the last.
    end: i64,
    order: String,
}

impl<'a> Conversation<'a> {
    /// Returns the only message that can be a job, if there is one: its numbers follow each other in one packet. If several
    /// fields count so, the number is the one that the other end requests.
    fn of(kinds: &'a [Kind]) -> Option<Self> {
        let (mut counted, mut asked) = (Vec::new(), Vec::new());
        let own = |kind: &Kind| !kinds.iter().any(|it| it.side != kind.side && it.name == kind.name);
        for (job, jobs) in kinds.iter().enumerate().filter(|(_, kind)| own(kind)) {
            for number in (0..jobs.width()).filter(|at| is_counted(jobs, *at)) {
                counted.push((job, number));
                let others = kinds.iter().enumerate().filter(|(_, it)| it.side != jobs.side && own(it));
                for (request, asks) in others {
                    let places = (0..asks.width()).filter(|at| is_asked(asks, *at, jobs, number));
                    asked.extend(places.map(|at| (number, (request, at))));
                }
            }
        }
        let &(job, first) = counted.first()?;
        let (number, request) = match asked.as_slice() {
            &[(number, request)] => (number, Some(request)),
            [] if counted.len() == 1 => (first, None),
            _ => return None,
        };
        if counted.iter().any(|(other, _)| *other != job) {
            return None;
        }
        let jobs = kinds.get(job)?;
        let mut conversation =
            Self { kinds, pc: jobs.side, job, number, request, runs: Vec::new(), order: None };
        conversation.runs = conversation.runs_of(jobs);
        let orders: Vec<usize> = (0..jobs.width()).filter(|at| conversation.is_order_of_jobs(*at)).collect();
        if let [order] = orders.as_slice() {
            conversation.order = Some(*order);
            for run in &mut conversation.runs {
                run.order = jobs.value_of(run.first, *order).unwrap_or_default().into();
            }
        }
        Some(conversation)
    }

    /// Returns the requested numbers, and the index of each request.
    fn asks(&self) -> impl Iterator<Item = (usize, i64)> {
        let asks = self.request.and_then(|(index, at)| Some((self.kinds.get(index)?, at)));
        asks.into_iter().flat_map(|(kind, place)| {
            kind.all.iter().filter_map(move |(at, values)| Some((*at, number(values.get(place)?)?)))
        })
    }

    fn runs_of(&self, jobs: &Kind) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for (at, values) in &jobs.all {
            let Some(end) = values.get(self.number).and_then(|it| number(it)) else { continue };
            match runs.last_mut() {
                Some(run) if end != 1 => (run.last, run.end) = (*at, end),
                _ => runs.push(Run { first: *at, last: *at, end, order: String::new() }),
            }
        }
        runs
    }

    /// Returns whether the jobs of a run have one number at an index, other runs have others, and the robot repeats them.
    fn is_order_of_jobs(&self, at: usize) -> bool {
        let Some(jobs) = self.kinds.get(self.job).filter(|_| at != self.number) else { return false };
        let of = |run: &Run| {
            let inside = jobs.all.iter().filter(|(when, _)| (run.first..=run.last).contains(when));
            let values: BTreeSet<&str> =
                inside.filter_map(|(_, values)| values.get(at)).map(String::as_str).collect();
            values.first().copied().filter(|value| values.len() == 1 && number(value).is_some())
        };
        let Some(orders) = self.runs.iter().map(of).collect::<Option<Vec<_>>>() else { return false };
        if orders.iter().collect::<BTreeSet<_>>().len() < MIN_SIGHTINGS {
            return false;
        }
        let robot = self.kinds.iter().enumerate().filter(|(_, kind)| kind.side != self.pc);
        robot.into_iter().any(|(index, kind)| {
            let order = |when: usize| orders.get(self.run_at(index, when)?).copied();
            (0..kind.width()).any(|place| repeats(kind, place, order))
        })
    }

    /// Returns the run that contains a message; for a request, the run of the job that answers it.
    fn run_at(&self, kind: usize, when: usize) -> Option<usize> {
        if self.request.is_none_or(|(request, _)| request != kind) {
            return self.runs.iter().position(|run| run.first < when && when < run.last);
        }
        let mut jobs = self.kinds.get(self.job)?.all.iter().map(|(at, _)| *at);
        let answer = jobs.find(|at| *at > when)?;
        let is_asked_again = self.asks().any(|(at, _)| when < at && at < answer);
        let run = self.runs.iter().position(|run| (run.first..=run.last).contains(&answer));
        run.filter(|_| !is_asked_again)
    }

    fn is_robot_only(&self, index: usize) -> bool {
        self.kinds.get(index).is_some_and(|kind| kind.side != self.pc && self.is_one_sided(kind))
    }

    fn is_one_sided(&self, kind: &Kind) -> bool {
        !self.kinds.iter().any(|it| it.side != kind.side && it.name == kind.name)
    }

    /// Returns the messages of one end that the other does not send, and whose roles are unknown.
    fn unknown(&self, of_pc: bool) -> impl Iterator<Item = (usize, &'a Kind)> {
        let known = [Some(self.job), self.request.map(|(request, _)| request)];
        let all = self.kinds.iter().enumerate();
        all.filter(move |(index, kind)| {
            !known.contains(&Some(*index)) && (kind.side == self.pc) == of_pc && self.is_one_sided(kind)
        })
    }

    fn prove(&self, proof: &mut Proof) {
        proof.roles.insert("job", self.job);
        if let Some((request, _)) = self.request {
            proof.roles.insert("job_request", request);
        }
        let acks = only(self.unknown(false).filter_map(|(index, kind)| Some((index, self.executed(kind)?))));
        if let Some((ack, _)) = acks {
            proof.roles.insert("job_ack", ack);
        }
        let pause = acks.and_then(|acks| {
            let others = self.unknown(false).filter(|(index, _)| *index != acks.0);
            only(others.filter_map(|(index, kind)| Some((index, self.queued(kind, acks)?))))
        });
        if let Some((pause, _)) = pause {
            proof.roles.insert("pause", pause);
        }
        if self.order.is_some() {
            self.prove_orders(proof);
        }
        let numbers = [("job", Some(self.number)), ("job_request", self.request.map(|it| it.1))];
        let numbers =
            numbers.into_iter().chain([("job_ack", acks.map(|it| it.1)), ("pause", pause.map(|it| it.1))]);
        for (role, at) in numbers {
            let (Some(kind), Some(at)) = (proof.of(role), at) else { continue };
            self.set(proof, kind, at, if role == "pause" { "queued" } else { "number" });
        }
        self.prove_work(proof);
    }

    fn set(&self, proof: &mut Proof, index: usize, at: usize, field: &str) {
        let Some(kind) = self.kinds.get(index) else { return };
        let fields = proof.fields.entry(index).or_insert_with(|| vec![None; kind.longest()]);
        if let Some(known) = fields.get_mut(at) {
            *known = Some(field.into());
        }
    }

    /// Proves the own fields of the jobs: the values that change from one job of an order to the next, and everything between two
    /// of them.
    fn prove_work(&self, proof: &mut Proof) {
        let Some(jobs) = self.kinds.get(self.job) else { return };
        let own: Vec<usize> = (0..jobs.width())
            .filter(|at| {
                *at != self.number && Some(*at) != self.order && self.changes(jobs, *at) >= MIN_SIGHTINGS
            })
            .collect();
        if let (Some(first), Some(last)) = (own.first(), own.last()) {
            let taken = |at: &usize| *at == self.number || Some(*at) == self.order;
            for at in (*first..=*last).filter(|at| !taken(at)) {
                self.set(proof, self.job, at, "work");
            }
        }
    }

    /// Returns the number of times that a value changes within a run.
    fn changes(&self, jobs: &Kind, at: usize) -> usize {
        changes_within(jobs, self.number, at)
    }

    fn run_of(&self, when: usize) -> Option<&Run> {
        self.runs.iter().rev().find(|run| run.first < when)
    }

    /// Returns the number of the job after the last that was queued then, or an earlier one: the highest that the robot has asked
    /// for in this run, before the next job.
    fn asked_by(&self, when: usize) -> Option<i64> {
        let run = self.run_of(when)?;
        let next = self.kinds.get(self.job)?.all.iter().map(|(at, _)| *at).find(|at| *at > when);
        let until = next.unwrap_or(usize::MAX);
        self.asks().filter(|(at, _)| run.first < *at && *at < until).map(|(_, asked)| asked).max()
    }

    /// Returns the only field of a message with numbers of jobs; all other fields are the same throughout a run.
    fn number_of(&self, kind: &Kind) -> Option<usize> {
        let has_numbers = |at: &usize| kind.values(*at).all(|it| number(it).is_some());
        let varies = |at: &usize| {
            let mut pairs = kind.all.iter().zip(kind.all.iter().skip(1));
            pairs.any(|(a, b)| {
                let is_one_run =
                    self.run_of(a.0).map(|run| run.first) == self.run_of(b.0).map(|run| run.first);
                is_one_run && a.1.get(*at) != b.1.get(*at)
            })
        };
        let places: Vec<usize> = (0..kind.longest()).filter(varies).collect();
        let [place] = places.as_slice() else { return None };
        Some(*place).filter(has_numbers)
    }

    /// Returns the place of the number of an executed job: later jobs were queued already, so it is not the last queued one.
    fn executed(&self, kind: &Kind) -> Option<usize> {
        let place = self.number_of(kind)?;
        let mut in_run: BTreeMap<usize, BTreeSet<i64>> = BTreeMap::new();
        for (at, values) in &kind.all {
            let (Some(run), Some(value)) = (self.run_of(*at), values.get(place).and_then(|it| number(it)))
            else {
                continue;
            };
            let numbers = in_run.entry(run.first).or_default();
            if self.asked_by(*at).is_some_and(|next| value + 1 < next) {
                numbers.insert(value);
            }
        }
        in_run.values().any(|numbers| numbers.len() >= MIN_SIGHTINGS).then_some(place)
    }

    /// Returns the index of the number of the job that was queued last: jobs before it are executed later, and the next one
    /// is requested.
    fn queued(&self, kind: &Kind, (ack, executed): (usize, usize)) -> Option<usize> {
        let place = self.number_of(kind)?;
        let acks = self.kinds.get(ack)?;
        let is_last = |(at, values): &&(usize, Vec<String>)| {
            let (Some(run), Some(value)) = (self.run_of(*at), values.get(place).and_then(|it| number(it)))
            else {
                return false;
            };
            let in_run = |when: usize| self.run_of(when).is_some_and(|other| other.first == run.first);
            let later = acks.all.iter().filter(|(when, _)| when > at && in_run(*when));
            let mut later = later.filter_map(|(_, values)| number(values.get(executed)?));
            let next = self.asks().find(|(when, _)| when > at && in_run(*when)).map(|(_, asked)| asked);
            later.any(|number| number < value) && next == Some(value + 1)
        };
        let proven: BTreeSet<_> =
            kind.all.iter().filter(is_last).filter_map(|(_, values)| number(values.get(place)?)).collect();
        (proven.len() >= MIN_SIGHTINGS).then_some(place)
    }
}

/// Returns the only item, if there is exactly one.
fn only<T>(mut all: impl Iterator<Item = T>) -> Option<T> {
    let first = all.next();
    first.filter(|_| all.next().is_none())
}

/// Returns whether a field counts jobs, while another field changes from one job to the next, as in no acknowledgement.
fn is_counted(kind: &Kind, at: usize) -> bool {
    // No job has the number 0.
    kind.values(at).all(|value| number(value).is_some_and(|it| it > 0))
        && is_sent_at_once(kind, at)
        && (0..kind.width()).any(|other| other != at && changes_within(kind, at, other) >= MIN_SIGHTINGS)
}

/// Returns whether messages with consecutive numbers follow each other without a message of the other end between them: a
/// robot sends only acknowledgements twice in a packet.
fn is_sent_at_once(kind: &Kind, counted: usize) -> bool {
    let pairs = kind.all.iter().zip(kind.all.iter().skip(1));
    let at_once = pairs.filter(|((at, before), (next, now))| {
        let numbers = [before, now].map(|values| values.get(counted).and_then(|it| number(it)));
        *next == at + 1 && matches!(numbers, [Some(before), Some(now)] if now == before + 1)
    });
    at_once.count() >= MIN_SIGHTINGS
}

/// Returns the number of times that a value differs in the job of the next number.
fn changes_within(kind: &Kind, counted: usize, at: usize) -> usize {
    let pairs = kind.all.iter().zip(kind.all.iter().skip(1));
    let changes = pairs.filter(|((_, before), (_, now))| {
        let numbers = [before, now].map(|values| values.get(counted).and_then(|it| number(it)));
        matches!(numbers, [Some(before), Some(now)] if now == before + 1) && before.get(at) != now.get(at)
    });
    changes.count()
}

/// Returns whether the number at an index of a message is always that of the next job.
fn is_asked(asks: &Kind, at: usize, jobs: &Kind, counted: usize) -> bool {
    let mut numbers = BTreeSet::new();
    let mut next_ask = asks.all.iter().map(|(when, _)| *when).skip(1);
    for (when, values) in &asks.all {
        let until = next_ask.next().unwrap_or(usize::MAX);
        let Some(asked) = values.get(at).and_then(|it| number(it)) else { return false };
        let Some((_, job)) = jobs.all.iter().find(|(job, _)| job > when && *job < until) else { continue };
        if job.get(counted).and_then(|it| number(it)) != Some(asked) {
            return false;
        }
        numbers.insert(asked);
    }
    numbers.len() >= MIN_SIGHTINGS
}

/// Returns whether a field has the order of each message whose order is known, for two orders or more.
fn repeats<'a>(kind: &Kind, at: usize, order: impl Fn(usize) -> Option<&'a str>) -> bool {
    let mut orders = BTreeSet::new();
    for (when, values) in &kind.all {
        let Some(order) = order(*when) else { continue };
        if values.get(at).map(String::as_str) != Some(order) {
            return false;
        }
        orders.insert(order);
    }
    orders.len() >= MIN_SIGHTINGS
}

/// Places that are the same in every message and can be nothing but a constant, or unused.
fn constants(kinds: &[Kind], proof: &Proof, role: &str, index: usize) -> Vec<Option<String>> {
    let Some(kind) = kinds.get(index) else { return Vec::new() };
    let of_filler = |at: usize| {
        let filler = kinds.get(proof.of("filler")?)?;
        filler.constant(at).filter(|_| at < filler.header)
    };
    let of_orders = || {
        let (Some(jobs), Some(order)) = (proof.of("job").and_then(|at| kinds.get(at)), proof.of("job"))
        else {
            return false;
        };
        let place = (0..jobs.width()).find(|at| proof.field(order, *at) == Some("order"));
        // Of two orders, as the jobs around them are.
        place.is_some_and(|place| {
            let before = |when: usize| jobs.all.iter().rev().find(|(at, _)| *at < when)?.1.get(place);
            kind.all.iter().filter_map(|(at, _)| before(*at)).collect::<BTreeSet<_>>().len() >= MIN_SIGHTINGS
        })
    };
    let of = |at: usize| {
        let value = kind.constant(at).filter(|_| kind.all.len() >= MIN_SIGHTINGS)?;
        let constant = format!("={value}");
        let is_number = number(value).is_some();
        match role {
            _ if at < kind.header && of_filler(at) == Some(value) && !value.is_empty() => Some(constant),
            "status" | "end_ack" | "pause" | "job" if value.is_empty() || is_number => None,
            "job" => None,
            _ if value.is_empty() => Some("unused".into()),
            "filler" => Some(constant),
            _ if !is_number => Some(constant),
            // The number of an order's first job.
            "order_start" if value.trim() == "1" => (at >= kind.header).then(|| "number".into()),
            "job_request" | "job_ack" | "order_ack" | "order_start" if of_orders() => Some(constant),
            _ => None,
        }
    };
    (0..kind.longest()).map(|at| of(at).filter(|_| at < kind.width())).collect()
}
