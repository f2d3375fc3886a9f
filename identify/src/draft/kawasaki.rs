//! A plant's table of messages.

use core::fmt::Write as _;

use anyhow::{Result, ensure};
use serde_json::Value;

use super::Said;

/// A message of the plant: all that one end sends by one name.
struct Kind {
    side: &'static str,
    name: String,
    /// Where in the conversation each was, and its values: those of its header, then its fields.
    all: Vec<(usize, Vec<String>)>,
    /// How many of them are of the header.
    header: usize,
}

/// What a message is for, and how sure that is.
struct Guess<'a> {
    role: &'static str,
    kind: Option<&'a Kind>,
    why: &'static str,
    /// The field at each place.
    fields: Vec<String>,
    /// Of one that there is.
    is_sure: bool,
}

/// The roles that a plant may lack.
const OPTIONAL: [&str; 3] = ["job_ack", "pause", "order_interrupt"];

impl Kind {
    fn values(&self, at: usize) -> impl Iterator<Item = &str> {
        self.all.iter().filter_map(move |(_, values)| values.get(at)).map(String::as_str)
    }

    fn numbers(&self, at: usize) -> Vec<i64> {
        self.values(at).filter_map(|value| value.parse().ok()).collect()
    }

    /// How many places it has: those of the shortest.
    fn width(&self) -> usize {
        self.all.iter().map(|(_, values)| values.len()).min().unwrap_or_default()
    }

    fn first(&self) -> usize {
        self.all.first().map_or(usize::MAX, |(at, _)| *at)
    }

    fn begins_before(&self, other: &Self) -> bool {
        self.first() < other.first()
    }

    /// The value that is the same in all.
    fn constant(&self, at: usize) -> Option<&str> {
        let first = self.values(at).next()?;
        self.values(at).all(|value| value == first).then_some(first)
    }
}

/// The draft of a conversation.
pub(super) fn draft(said: &[Said]) -> Result<String> {
    let kinds = kinds(said);
    let of = |side: &'static str| kinds.iter().filter(move |kind| kind.side == side);
    let is_shared =
        |kind: &&Kind| kinds.iter().any(|other| other.side != kind.side && other.name == kind.name);
    let wide = |kind: &&Kind| (kind.all.len() * kind.width(), kind.width());
    let job = of("pc").filter(|kind| !is_shared(kind)).max_by_key(wide).filter(|kind| kind.all.len() > 3);
    ensure!(
        job.is_some(),
        "no jobs are in the capture: let the robot work through an order, and capture that"
    );
    let Some(job) = job else { return Ok(String::new()) };
    let orders = orders(job, &kinds);
    // The one that counts, of which the robot speaks, and for which it asks; of equals the first.
    let of_robot = || kinds.iter().filter(|it| it.side == "robot");
    let wanted = |at: usize| of_robot().map(|it| asked(it, job, at)).sum::<usize>();
    let spoken = |at: usize| {
        let known = job.numbers(at);
        let counts = |it: &Kind| (0..it.width()).filter(|at| steps(it, *at) > 0).collect::<Vec<_>>();
        let all = of_robot().flat_map(|it| counts(it).into_iter().flat_map(|at| it.numbers(at)));
        all.filter(|number| known.contains(number)).count()
    };
    let counting = (0..job.width()).rev().filter(|at| steps(job, *at) > 0);
    let number = counting.max_by_key(|at| (spoken(*at), wanted(*at), steps(job, *at))).unwrap_or_default();
    let jobs = job.numbers(number);
    let last_job = jobs.iter().copied().max().unwrap_or_default();
    let fields = Fields { orders: &orders, kinds: &kinds, jobs: &jobs };

    let mut guesses = vec![job_guess(job, number, &fields)];
    let mut left: Vec<&Kind> = kinds.iter().filter(|kind| !core::ptr::eq(*kind, job)).collect();
    let mut take = |choose: &dyn Fn(&[&Kind]) -> Option<usize>| choose(&left).map(|at| left.remove(at));
    let best = |left: &[&Kind], of: &dyn Fn(&Kind) -> Option<i64>| {
        let scores = left.iter().enumerate().filter_map(|(at, kind)| Some((of(kind)?, at)));
        scores.max_by_key(|(score, at)| (*score, core::cmp::Reverse(*at))).map(|(_, at)| at)
    };
    let size = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);

    let status =
        take(&|left| best(left, &|it| (is_shared(&it) && it.width() > it.header).then(|| size(it.width()))));
    let filler = take(&|left| best(left, &|it| (it.width() == it.header).then(|| size(it.all.len()))));
    // The other end's of the same name.
    for shared in [status, filler].into_iter().flatten() {
        take(&|left| left.iter().position(|it| it.name == shared.name));
    }
    let start =
        take(&|left| best(left, &|it| (it.side == "pc" && it.begins_before(job)).then(|| -size(it.first()))));
    let end =
        take(&|left| best(left, &|it| (it.side == "pc" && job.begins_before(it)).then(|| size(it.first()))));
    let interrupt = take(&|left| best(left, &|it| (it.side == "pc").then_some(0)));
    let is_asked = |it: &Kind| asked(it, job, number);
    let request = take(&|left| {
        best(left, &|it| (it.side == "robot" && is_asked(it) * 3 > it.all.len()).then(|| size(is_asked(it))))
    });
    let order_ack = take(&|left| {
        best(left, &|it| (it.side == "robot" && it.begins_before(job)).then(|| -size(it.first())))
    });
    let has_number = |it: &Kind| (0..it.width()).any(|at| steps(it, at) > 0);
    let job_ack =
        take(&|left| best(left, &|it| (it.side == "robot" && has_number(it)).then(|| size(it.all.len()))));
    let after_end = |it: &Kind| end.is_none_or(|end| end.begins_before(it));
    let end_ack =
        take(&|left| best(left, &|it| (it.side == "robot" && after_end(it)).then(|| size(it.first()))));
    let pause = take(&|left| best(left, &|it| (it.side == "robot").then(|| size(it.all.len()))));

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
        let is_sure = role != "pause" && role != "order_interrupt";
        guesses.push(Guess { role, kind, why, fields: kind.map(named).unwrap_or_default(), is_sure });
    }
    let why = "comes after the end of an order";
    let named = end_ack.map(|kind| fields.of_end(kind, last_job)).unwrap_or_default();
    guesses.push(Guess { role: "end_ack", kind: end_ack, why, fields: named, is_sure: true });
    let both: Vec<&Kind> =
        kinds.iter().filter(|kind| status.is_some_and(|it| it.name == kind.name)).collect();
    let why = "both ends send it, with the most fields";
    let (named, is_sure) = fields.of_status(&both, job.first());
    guesses.push(Guess { role: "status", kind: status, why, fields: named, is_sure });
    let named = filler.map(|kind| (0..kind.header).map(|at| fields.plain(kind, at, "unused")).collect());
    let why = "it has no fields";
    let named = named.unwrap_or_default();
    guesses.push(Guess { role: "filler", kind: filler, why, fields: named, is_sure: true });
    text(&guesses, job, number, &left, &acks(job_ack), &fields)
}

fn kinds(said: &[Said]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for (at, Said { side, message, .. }) in said.iter().enumerate() {
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

/// How many of these messages have the number of the job that follows, at this place of a job.
fn asked(kind: &Kind, job: &Kind, number: usize) -> usize {
    let asks = |(at, values): &&(usize, Vec<String>)| {
        let next = job.all.iter().find(|(of_job, _)| of_job > at).and_then(|(_, values)| values.get(number));
        next.is_some_and(|next| values.iter().any(|value| value == next))
    };
    kind.all.iter().filter(asks).count()
}

/// How often a number is one more than the last, or up to ten.
fn steps(kind: &Kind, at: usize) -> usize {
    let numbers = kind.numbers(at);
    let grows = |(before, now): &(&i64, &i64)| (1..=10).contains(&(*now - *before));
    let falls = |(before, now): &(&i64, &i64)| now < before;
    let pairs = || numbers.iter().zip(numbers.iter().skip(1));
    let up = pairs().filter(grows).count();
    if up * 2 > numbers.len() && pairs().filter(falls).count() * 3 < numbers.len() { up } else { 0 }
}

/// The numbers of orders: what the jobs have alike, and other messages too.
fn orders(job: &Kind, kinds: &[Kind]) -> Vec<String> {
    let others = |value: &str| {
        let has = |kind: &&Kind| {
            kind.all.iter().any(|(_, values)| values.iter().skip(kind.header).any(|it| it == value))
        };
        kinds.iter().filter(has).count()
    };
    let few = |at: &usize| {
        let mut values: Vec<&str> = job.values(*at).collect();
        values.sort_unstable();
        values.dedup();
        values.len() * 4 <= job.all.len()
    };
    let places = (0..job.width()).filter(few);
    let most = places.max_by_key(|at| job.values(*at).next().map_or(0, others));
    let mut found: Vec<String> = most.into_iter().flat_map(|at| job.values(at)).map(str::to_owned).collect();
    found.sort_unstable();
    found.dedup();
    found
}

struct Fields<'a> {
    orders: &'a [String],
    kinds: &'a [Kind],
    jobs: &'a [i64],
}

impl Fields<'_> {
    fn is_order(&self, kind: &Kind, at: usize) -> bool {
        let known = kind.values(at).filter(|value| self.orders.iter().any(|it| it == value)).count();
        known * 2 > kind.all.len()
    }

    /// A constant that every message with a header has at this place of it, or that is no number.
    fn as_constant(&self, kind: &Kind, at: usize) -> Option<String> {
        let value = kind.constant(at).filter(|_| !self.is_order(kind, at))?;
        let alike = self.kinds.iter().all(|it| it.header <= at || it.constant(at) == Some(value));
        let is_constant = at < kind.header && alike || value.parse::<i64>().is_err() && !value.is_empty();
        is_constant.then(|| format!("={value}"))
    }

    /// A field of a job that nothing but the plant knows.
    fn is_own(&self, job: &Kind, number: usize, at: usize) -> bool {
        at != number && !self.is_order(job, at) && self.as_constant(job, at).is_none()
    }

    /// A field that is an order, a constant, or else the other.
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

    /// The fields of a status, and whether its messages show all of them.
    fn of_status(&self, both: &[&Kind], first_job: usize) -> (Vec<String>, bool) {
        let Some(width) = both.iter().map(|kind| kind.width()).min() else { return (Vec::new(), false) };
        let mut all: Vec<&(usize, Vec<String>)> = both.iter().flat_map(|kind| &kind.all).collect();
        all.sort_by_key(|(at, _)| *at);
        let values =
            |at: usize| all.iter().filter_map(move |(when, values)| Some((*when, values.get(at)?.as_str())));
        let numbers =
            |at: usize| -> Vec<i64> { values(at).filter_map(|(_, value)| value.parse().ok()).collect() };
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
        // What is queued is ahead of what is executed.
        let sums: Vec<i64> = counting.iter().map(|at| numbers(*at).iter().sum()).collect();
        let is_apart = sums.first() != sums.last();
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
        let has = |name: &str| named.iter().any(|it| it == name);
        let is_sure = is_apart && ["order", "phase", "queued", "executed", "ended"].into_iter().all(has);
        (named, is_sure)
    }
}

fn job_guess<'a>(job: &'a Kind, number: usize, fields: &Fields<'_>) -> Guess<'a> {
    let mut named: Vec<String> = Vec::new();
    let is_own = |at: usize| fields.is_own(job, number, at);
    for at in 0..job.width() {
        match () {
            () if is_own(at) && named.iter().any(|it| it == "work") => {}
            () if is_own(at) => named.push("work".into()),
            () if at == number => named.push("number".into()),
            () => named.push(fields.plain(job, at, "unused")),
        }
    }
    let why = "the PC sends most of it, and its number counts";
    Guess { role: "job", kind: Some(job), why, fields: named, is_sure: true }
}

/// The interval of acknowledgements: the number that most of them are multiples of.
fn acks(job_ack: Option<&Kind>) -> Option<i64> {
    let kind = job_ack?;
    let at = (0..kind.width()).max_by_key(|at| steps(kind, *at))?;
    let numbers = kind.numbers(at);
    (1..=20)
        .rev()
        .find(|every| numbers.iter().filter(|it| *it % every == 0).count() * 10 >= numbers.len() * 7)
}

fn text(
    guesses: &[Guess<'_>],
    job: &Kind,
    number: usize,
    left: &[&Kind],
    acks: &Option<i64>,
    fields: &Fields<'_>,
) -> Result<String> {
    let mut text = String::from("# A draft from a capture: correct what has a ?.\n\n");
    let is_latin1 = fields.kinds.iter().any(|kind| {
        !kind.name.is_ascii()
            || kind.all.iter().any(|(_, values)| values.iter().any(|value| !value.is_ascii()))
    });
    writeln!(text, "charset = \"{}\"", if is_latin1 { "latin1" } else { "ascii" })?;
    match acks {
        Some(every) => writeln!(text, "acks = {every} # ? most acknowledged jobs have such numbers")?,
        None => writeln!(text, "# acks = 1 # ? no job is acknowledged in the capture")?,
    }
    let highest = fields.jobs.iter().max().copied().unwrap_or_default();
    writeln!(text, "# max_number = 9999 # ? the highest in the capture is {highest}")?;
    let own = (0..job.width()).filter(|at| fields.is_own(job, number, *at));
    for (count, at) in own.enumerate() {
        let decimals =
            job.values(at).filter_map(|value| value.split_once('.')).map(|(_, places)| places.len());
        let numbers: Vec<f64> = job.values(at).filter_map(|value| value.parse().ok()).collect();
        writeln!(text, "\n[[job]]\nname = \"field_{}\" # ? its name in your tables", count + 1)?;
        if numbers.len() < job.all.len() {
            let longest = job.values(at).map(|value| value.chars().count()).max().unwrap_or_default();
            writeln!(text, "kind = \"text\"\nlength = [0, {longest}] # ? the longest in the capture")?;
            continue;
        }
        let (low, high) =
            numbers.iter().fold((f64::MAX, f64::MIN), |(low, high), it| (low.min(*it), high.max(*it)));
        match decimals.max() {
            None => writeln!(text, "kind = \"whole\"\nrange = [{low}, {high}] # ? that of the capture")?,
            Some(places) => writeln!(
                text,
                "kind = \"decimal\"\nplaces = {places}\nrange = [{low:?}, {high:?}] # ? that of the capture"
            )?,
        }
    }
    for Guess { role, kind, why, fields, is_sure } in guesses {
        writeln!(text, "\n[messages.{role}]")?;
        let Some(kind) = kind else {
            let lacks = if OPTIONAL.contains(role) { "sent = false " } else { "" };
            let then =
                if *role == "order_interrupt" { "; without it the PC needs takeover = \"end\"" } else { "" };
            writeln!(text, "{lacks}# ? not in the capture{then}")?;
            continue;
        };
        let doubt = if *is_sure { "" } else { "? " };
        let list = |fields: &[String]| serde_json::to_string(fields);
        let (header, fields) = fields.split_at(kind.header.min(fields.len()));
        writeln!(
            text,
            "name = {} # {doubt}{} of them: {why}",
            serde_json::to_string(&kind.name)?,
            kind.all.len()
        )?;
        writeln!(text, "header = {}\nfields = {}", list(header)?, list(fields)?)?;
    }
    for kind in left {
        writeln!(
            text,
            "\n# ? {} is sent by the {}, {} times: it fits no role",
            kind.name,
            kind.side,
            kind.all.len()
        )?;
    }
    Ok(text)
}
