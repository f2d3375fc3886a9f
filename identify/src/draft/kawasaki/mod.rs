//! A plant's table of messages.

mod message;
mod proof;
mod text;

use anyhow::{Result, ensure};
use serde_json::Value;

use self::proof::{Proof, prove};
use super::SentMessage;

/// A message of the plant: all that one end sends by one name.
struct Kind {
    side: &'static str,
    name: String,
    /// The index of each message in the conversation, and its values: those of its header, then its fields.
    all: Vec<(usize, Vec<String>)>,
    /// The number of values that are of the header.
    header: usize,
}

/// The guessed role of a message.
struct Guess<'a> {
    role: &'static str,
    kind: Option<&'a Kind>,
    why: &'static str,
    /// The number of messages of the same name that the other end sends.
    others: usize,
    /// The capture proves the role.
    is_sure: bool,
    /// The fields between name and length, and those of the data.
    header: Line,
    fields: Line,
}

/// The fields of a line of the draft, and whether the capture proves all of them.
#[derive(Default, Clone)]
struct Line {
    fields: Vec<String>,
    is_sure: bool,
}

impl Kind {
    fn values(&self, at: usize) -> impl Iterator<Item = &str> {
        self.all.iter().filter_map(move |(_, values)| values.get(at)).map(String::as_str)
    }

    fn numbers(&self, at: usize) -> Vec<i64> {
        self.values(at).filter_map(number).collect()
    }

    /// Returns the value at an index of the `when`th message of the conversation.
    fn value_of(&self, when: usize, at: usize) -> Option<&str> {
        let (_, values) = self.all.iter().find(|(index, _)| *index == when)?;
        values.get(at).map(String::as_str)
    }

    /// Returns the number of places of the shortest message.
    fn width(&self) -> usize {
        self.all.iter().map(|(_, values)| values.len()).min().unwrap_or_default()
    }

    /// Returns the number of places of the longest message.
    fn longest(&self) -> usize {
        self.all.iter().map(|(_, values)| values.len()).max().unwrap_or_default()
    }

    fn first(&self) -> usize {
        self.all.first().map_or(usize::MAX, |(at, _)| *at)
    }

    fn begins_before(&self, other: &Self) -> bool {
        self.first() < other.first()
    }

    /// Returns the value that is the same in all messages.
    fn constant(&self, at: usize) -> Option<&str> {
        let first = self.values(at).next()?;
        self.values(at).all(|value| value == first).then_some(first)
    }

    /// Returns whether the values at an index are texts that are not numbers.
    fn is_text(&self, at: usize) -> bool {
        self.values(at).all(|value| !value.is_empty() && number(value).is_none())
    }
}

/// Returns a value as a number: blanks around it are allowed.
fn number(value: &str) -> Option<i64> {
    value.trim().parse().ok()
}

/// Returns the draft of a conversation.
pub(super) fn draft(said: &[SentMessage], charset: &str) -> Result<String> {
    let mut kinds = kinds(said);
    let proof = prove(&kinds);
    if let Some(pc) = proof.pc {
        // The jobs show which end is the PC.
        kinds.iter_mut().for_each(|kind| kind.side = if kind.side == pc { "pc" } else { "robot" });
    }
    let index = |kind: &Kind| kinds.iter().position(|it| core::ptr::eq(it, kind)).unwrap_or_default();
    let proven = |role: &str| proof.of(role).and_then(|at| kinds.get(at));
    let of = |side: &'static str| kinds.iter().filter(move |kind| kind.side == side);
    let is_shared =
        |kind: &&Kind| kinds.iter().any(|other| other.side != kind.side && other.name == kind.name);
    let wide = |kind: &&Kind| (kind.all.len() * kind.width(), kind.width());
    let likely = of("pc").filter(|kind| !is_shared(kind) && proof.is_free(index(kind))).max_by_key(wide);
    let job = proven("job").or(likely).filter(|kind| kind.all.len() > 3);
    ensure!(
        job.is_some(),
        "no jobs are in the capture: let the robot work through an order, and capture that"
    );
    let Some(job) = job else { return Ok(String::new()) };
    let orders = orders(job, &kinds);
    // Prefer the value that counts, that the robot reports, and that it requests; of equals the first.
    let of_robot = || kinds.iter().filter(|it| it.side == "robot");
    let wanted = |at: usize| of_robot().map(|it| asked(it, job, at)).sum::<usize>();
    let spoken = |at: usize| {
        let known = job.numbers(at);
        let counts = |it: &Kind| (0..it.width()).filter(|at| steps(it, *at) > 0).collect::<Vec<_>>();
        let all = of_robot().flat_map(|it| counts(it).into_iter().flat_map(|at| it.numbers(at)));
        all.filter(|number| known.contains(number)).count()
    };
    let counting = (0..job.width()).rev().filter(|at| steps(job, *at) > 0);
    let likely = counting.max_by_key(|at| (spoken(*at), wanted(*at), steps(job, *at))).unwrap_or_default();
    let shown = (0..job.width()).find(|at| proof.field(index(job), *at) == Some("number"));
    let number = shown.unwrap_or(likely);
    let jobs = job.numbers(number);
    let last_job = jobs.iter().copied().max().unwrap_or_default();
    let fields = UsedNames { orders: &orders, kinds: &kinds, jobs: &jobs };

    let is_left = |kind: &&Kind| !core::ptr::eq(*kind, job) && proof.is_free(index(kind));
    let mut left: Vec<&Kind> = kinds.iter().filter(is_left).collect();
    let mut take = |role: &str, choose: &dyn Fn(&[&Kind]) -> Option<usize>| {
        proven(role).or_else(|| choose(&left).map(|at| left.remove(at)))
    };
    let best = |left: &[&Kind], of: &dyn Fn(&Kind) -> Option<i64>| {
        let scores = left.iter().enumerate().filter_map(|(at, kind)| Some((of(kind)?, at)));
        scores.max_by_key(|(score, at)| (*score, core::cmp::Reverse(*at))).map(|(_, at)| at)
    };
    let size = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);

    let status = take("status", &|left| {
        best(left, &|it| (is_shared(&it) && it.width() > it.header).then(|| size(it.width())))
    });
    let filler =
        take("filler", &|left| best(left, &|it| (it.width() == it.header).then(|| size(it.all.len()))));
    // The other end's of the same name.
    for shared in [status, filler].into_iter().flatten() {
        take("", &|left| left.iter().position(|it| it.name == shared.name));
    }
    let start = take("order_start", &|left| {
        best(left, &|it| (it.side == "pc" && it.begins_before(job)).then(|| -size(it.first())))
    });
    let end = take("order_end", &|left| {
        best(left, &|it| (it.side == "pc" && job.begins_before(it)).then(|| size(it.first())))
    });
    let interrupt = take("order_interrupt", &|left| best(left, &|it| (it.side == "pc").then_some(0)));
    let is_asked = |it: &Kind| asked(it, job, number);
    let request = take("job_request", &|left| {
        best(left, &|it| (it.side == "robot" && is_asked(it) * 3 > it.all.len()).then(|| size(is_asked(it))))
    });
    let order_ack = take("order_ack", &|left| {
        best(left, &|it| (it.side == "robot" && it.begins_before(job)).then(|| -size(it.first())))
    });
    let has_number = |it: &Kind| (0..it.width()).any(|at| steps(it, at) > 0);
    let job_ack = take("job_ack", &|left| {
        best(left, &|it| (it.side == "robot" && has_number(it)).then(|| size(it.all.len())))
    });
    let after_end = |it: &Kind| end.is_none_or(|end| end.begins_before(it));
    let end_ack = take("end_ack", &|left| {
        best(left, &|it| (it.side == "robot" && after_end(it)).then(|| size(it.first())))
    });
    let pause = take("pause", &|left| best(left, &|it| (it.side == "robot").then(|| size(it.all.len()))));

    let own = |at: usize| match () {
        () if fields.is_own(job, number, at) => "work".into(),
        () if at == number => "number".into(),
        () => fields.plain(job, at, "unused"),
    };
    let draft = Draft { proof: &proof, index: &index };
    let mut guesses = vec![Guess {
        role: "job",
        kind: Some(job),
        why: "the PC sends most of it, and its number counts",
        others: 0,
        is_sure: proof.of("job").is_some(),
        ..draft.lines(job, &(0..job.width()).map(own).collect::<Vec<_>>())
    }];
    let plain = [
        ("job_ack", job_ack, "its number grows, below that of the jobs: executed", "number"),
        ("job_request", request, "the job of its number is what the PC sends next", "number"),
        ("pause", pause, "what the robot says beside the others", "queued"),
        ("order_start", start, "the first of the PC that comes before a job", "number"),
        ("order_ack", order_ack, "the first of the robot, before a job", "unused"),
        ("order_end", end, "the last of the PC that comes after a job", "unused"),
        ("order_interrupt", interrupt, "what the PC says beside the others", "unused"),
    ];
    for (role, kind, why, other) in plain {
        let named = |kind: &Kind| (0..kind.width()).map(|at| fields.plain(kind, at, other)).collect();
        guesses.push(draft.guess(role, kind, why, named));
    }
    let both: Vec<&Kind> =
        kinds.iter().filter(|kind| status.is_some_and(|it| it.name == kind.name)).collect();
    let constants = |kind: &Kind| (0..kind.width()).map(|at| fields.plain(kind, at, "unused")).collect();
    guesses.extend([
        draft.guess("end_ack", end_ack, "comes after the end of an order", |it| fields.of_end(it, last_job)),
        draft.guess("status", status, "the most fields of all", |_| fields.of_status(&both, job.first())),
        draft.guess("filler", filler, "it has no fields", constants),
    ]);
    for guess in &mut guesses {
        let Some(found) = guess.kind else { continue };
        let others = kinds.iter().filter(|it| it.name == found.name && it.side != found.side);
        guess.others = others.map(|it| it.all.len()).sum();
    }
    let work: Vec<usize> = (0..job.width())
        .filter(|at| proof.field(index(job), *at).map_or(own(*at) == "work", |it| it == "work"))
        .collect();
    text::draft(&guesses, job, &work, &left, acks(job_ack), (&fields, charset))
}

/// The proven roles and fields, for the lines of a draft.
struct Draft<'a> {
    proof: &'a Proof,
    index: &'a dyn Fn(&Kind) -> usize,
}

impl Draft<'_> {
    fn guess<'k>(
        &self,
        role: &'static str,
        kind: Option<&'k Kind>,
        why: &'static str,
        named: impl FnOnce(&Kind) -> Vec<String>,
    ) -> Guess<'k> {
        let Some(found) = kind else {
            return Guess {
                role,
                kind,
                why,
                others: 0,
                is_sure: false,
                header: Line::default(),
                fields: Line::default(),
            };
        };
        let is_sure = self.proof.of(role).is_some();
        Guess { role, kind, why, is_sure, ..self.lines(found, &named(found)) }
    }

    /// Returns the fields as proven, otherwise as guessed.
    fn lines<'k>(&self, kind: &Kind, guessed: &[String]) -> Guess<'k> {
        let line = |places: core::ops::Range<usize>| {
            let mut line = Line { fields: Vec::new(), is_sure: !self.proof.is_free((self.index)(kind)) };
            for (at, guessed) in guessed.iter().enumerate().filter(|(at, _)| places.contains(at)) {
                let proven = self.proof.field((self.index)(kind), at);
                line.is_sure &= proven.is_some();
                let field = proven.unwrap_or(guessed);
                // All of a job's own fields are one.
                if field != "work" || !line.fields.iter().any(|it| it == "work") {
                    line.fields.push(field.into());
                }
            }
            line
        };
        let (header, fields) = (line(0..kind.header), line(kind.header..usize::MAX));
        Guess { role: "", kind: None, why: "", others: 0, is_sure: false, header, fields }
    }
}

fn kinds(said: &[SentMessage]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for (at, SentMessage { side, message, .. }) in said.iter().enumerate() {
        let texts = |name: &str| -> Vec<String> {
            let values = message.get(name).and_then(Value::as_array).into_iter().flatten();
            values.filter_map(|value| value.as_str().map(str::to_owned)).collect()
        };
        let name = message.get("name").and_then(Value::as_str).unwrap_or_default();
        let header = texts("header");
        let (count, values) = (header.len(), [header, texts("fields")].concat());
        match kinds.iter_mut().find(|kind| kind.side == *side && kind.name == name) {
            Some(kind) => kind.all.push((at, values)),
            None => kinds.push(Kind { side, name: name.into(), all: vec![(at, values)], header: count }),
        }
    }
    kinds
}

/// Returns the number of these messages that have the number of the job that follows, at this place of a job.
fn asked(kind: &Kind, job: &Kind, number: usize) -> usize {
    let asks = |(at, values): &&(usize, Vec<String>)| {
        let next = match job.all.iter().find(|(of_job, _)| of_job > at) {
            Some((_, values)) => values.get(number).cloned(),
            // A robot also requests the job after the last.
            None => job.numbers(number).last().map(|last| (last + 1).to_string()),
        };
        next.is_some_and(|next| values.contains(&next))
    };
    kind.all.iter().filter(asks).count()
}

/// Returns how often a number is one more than the last, or up to ten.
fn steps(kind: &Kind, at: usize) -> usize {
    let numbers = kind.numbers(at);
    let grows = |(before, now): &(&i64, &i64)| (1..=10).contains(&(*now - *before));
    let falls = |(before, now): &(&i64, &i64)| now < before;
    let pairs = || numbers.iter().zip(numbers.iter().skip(1));
    let up = pairs().filter(grows).count();
    if up * 2 > numbers.len() && pairs().filter(falls).count() * 3 < numbers.len() { up } else { 0 }
}

/// Returns the numbers of orders: the value that the jobs of an order share, and that other messages have as well.
fn orders(job: &Kind, kinds: &[Kind]) -> Vec<String> {
    // A station's number, which is the same in every header.
    let is_station = |at: usize| {
        let of = job.constant(at);
        at < job.header && of.is_some() && kinds.iter().all(|it| it.header <= at || it.constant(at) == of)
    };
    let others = |value: &str| {
        let has = |kind: &&Kind| {
            kind.all.iter().any(|(_, values)| {
                let mut places = values.iter().enumerate();
                places.any(|(at, it)| it == value && !(at < kind.header && is_station(at)))
            })
        };
        kinds.iter().filter(has).count()
    };
    let few = |at: &usize| {
        let mut values: Vec<&str> = job.values(*at).collect();
        values.sort_unstable();
        values.dedup();
        values.len() * 4 <= job.all.len() && !is_station(*at)
    };
    let places = (0..job.width()).filter(few);
    let most = places.max_by_key(|at| job.values(*at).next().map_or(0, others));
    let mut found: Vec<String> = most.into_iter().flat_map(|at| job.values(at)).map(str::to_owned).collect();
    found.sort_unstable();
    found.dedup();
    found
}

struct UsedNames<'a> {
    orders: &'a [String],
    kinds: &'a [Kind],
    jobs: &'a [i64],
}

impl UsedNames<'_> {
    fn is_order(&self, kind: &Kind, at: usize) -> bool {
        let known = kind.values(at).filter(|value| self.orders.iter().any(|it| it == value)).count();
        known * 2 > kind.all.len()
    }

    /// Returns a constant that all messages with a header have at this place, or that is not a number.
    fn as_constant(&self, kind: &Kind, at: usize) -> Option<String> {
        let value = kind.constant(at).filter(|_| !self.is_order(kind, at))?;
        let alike = self.kinds.iter().all(|it| it.header <= at || it.constant(at) == Some(value));
        let is_constant = at < kind.header && alike || number(value).is_none() && !value.is_empty();
        is_constant.then(|| format!("={value}"))
    }

    /// Returns whether a field of a job is known to the plant alone.
    fn is_own(&self, job: &Kind, number: usize, at: usize) -> bool {
        at != number && !self.is_order(job, at) && self.as_constant(job, at).is_none()
    }

    /// Returns the kind of a field: an order, a constant, otherwise `other`.
    fn plain(&self, kind: &Kind, at: usize, other: &str) -> String {
        let numbers = kind.numbers(at);
        let fits = numbers.iter().all(|it| self.jobs.contains(it) || self.jobs.contains(&(it - 1)));
        match self.as_constant(kind, at) {
            Some(constant) => constant,
            None if self.is_order(kind, at) => "order".into(),
            None if fits && !numbers.is_empty() => other.into(),
            None => "unused".into(),
        }
    }

    fn of_end(&self, kind: &Kind, last: i64) -> Vec<String> {
        let named = |at: usize| match self.as_constant(kind, at) {
            Some(constant) => constant,
            None if self.is_order(kind, at) => "ended".into(),
            None if kind.numbers(at).last() == Some(&last) => "executed".into(),
            None => "order".into(),
        };
        (0..kind.width()).map(named).collect()
    }

    /// Returns the fields of a status.
    fn of_status(&self, both: &[&Kind], first_job: usize) -> Vec<String> {
        let Some(width) = both.iter().map(|kind| kind.width()).min() else { return Vec::new() };
        let mut all: Vec<&(usize, Vec<String>)> = both.iter().flat_map(|kind| &kind.all).collect();
        all.sort_by_key(|(at, _)| *at);
        let values =
            |at: usize| all.iter().filter_map(move |(when, values)| Some((*when, values.get(at)?.as_str())));
        let numbers = |at: usize| -> Vec<i64> { values(at).filter_map(|(_, value)| number(value)).collect() };
        let is_order = |value: &str| self.orders.iter().any(|it| it == value);
        let mut named: Vec<String> = vec![String::new(); width];
        let mut counting = Vec::new();
        for (at, named) in named.iter_mut().enumerate() {
            let constant = both.first().and_then(|kind| self.as_constant(kind, at));
            let early = values(at).any(|(when, value)| when < first_job && is_order(value));
            let (found, small) = (numbers(at), numbers(at).iter().all(|value| (0..=5).contains(value)));
            *named = match constant {
                Some(constant) => constant,
                None if early => "order".into(),
                None if values(at).any(|(_, value)| is_order(value)) => "ended".into(),
                None if small && found.iter().any(|value| *value > 0) => "phase".into(),
                None if found.iter().any(|value| self.jobs.contains(value)) => {
                    counting.push(at);
                    continue;
                }
                None => "unused".into(),
            };
        }
        // The number of queued jobs is ahead of the number of executed ones.
        let sums: Vec<i64> = counting.iter().map(|at| numbers(*at).iter().sum()).collect();
        let first = usize::from(sums.first() < sums.last());
        for (number, at) in counting.iter().enumerate() {
            let name = if number == first {
                "queued"
            } else if number < 2 {
                "executed"
            } else {
                "unused"
            };
            if let Some(named) = named.get_mut(*at) {
                *named = name.into();
            }
        }
        named
    }
}

/// Returns the interval of acknowledgements: the number of which most of them are multiples.
fn acks(job_ack: Option<&Kind>) -> Option<i64> {
    let kind = job_ack?;
    let at = (0..kind.width()).max_by_key(|at| steps(kind, *at))?;
    let numbers = kind.numbers(at);
    (1..=20)
        .rev()
        .find(|every| numbers.iter().filter(|it| *it % every == 0).count() * 10 >= numbers.len() * 7)
}
