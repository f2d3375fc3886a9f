//! A cell whose topics the broker refuses.

use crate::broker::{Broker, Message, Peer};
use crate::tool::Running;
use crate::{REFUSED, ball, figure, figure_in, get, site_command, until};

const HELD: &str = "held_records{cell=\"ball\"}";
const MADE: &str = "record_number{cell=\"ball\"}";
/// Not authorised.
const FORBIDDEN: u8 = 0x87;

/// Answers until this many records of the cell `free` have been taken since the last birth of the node, and at least `after`
/// of the cell `ball` were answered so: `answer` has its records' numbers. Returns what has come since that birth.
fn serve(peer: &mut Peer, count: usize, after: usize, answer: impl Fn(u64) -> u8) -> Vec<Message> {
    let (mut seen, mut answered) = (Vec::<Message>::new(), 0);
    while answered < after || of(&seen, "DDATA", "free").len() < count {
        let message = peer.any_message();
        if message.topic.contains("/NBIRTH/") {
            seen.clear();
        }
        if message.number.is_some() {
            let is_free = message.topic.ends_with("/free");
            peer.acknowledge(&message, if is_free { 0 } else { answer(message.record()) });
            answered += usize::from(!is_free);
        }
        seen.push(message);
    }
    assert_no_hole(&seen);
    seen
}

/// Answers nothing until this many records of a cell have come.
fn read(peer: &mut Peer, seen: &mut Vec<Message>, cell: &str, count: usize) {
    while of(seen, "DDATA", cell).len() < count {
        seen.push(peer.any_message());
    }
}

/// Asserts that no message number is missing; the birth of the node restarts the numbers.
fn assert_no_hole(seen: &[Message]) {
    let numbers = seen.iter().map(|message| message.read().seq.unwrap());
    assert!(numbers.eq((0..256).cycle().take(seen.len())));
}

fn assert_in_order(records: &[&Message]) {
    let first = records[0].record();
    assert!(records.iter().map(|message| message.record()).eq((first..).take(records.len())));
}

fn of<'a>(seen: &'a [Message], kind: &str, cell: &str) -> Vec<&'a Message> {
    seen.iter().filter(|message| message.topic == format!("spBv1.0/g/{kind}/n/{cell}")).collect()
}

fn is_historical(message: &Message) -> bool {
    message.read().metrics.iter().all(|metric| metric.is_historical == Some(true))
}

#[test]
fn a_cell_whose_topic_is_refused_is_held_until_it_is_taken_and_the_others_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let balls = [ball(), ball()];
    let broker = Broker::new();
    let cells = [("ball", &balls[0]), ("free", &balls[1])];
    let mut bridge = Running::start(site_command(folder.path(), &broker.address(), "", &cells));

    // The first three are taken, and then the access control is another.
    let mut peer = broker.accept(&[]);
    let seen = serve(&mut peer, 20, 4, |number| if number <= 3 { 0 } else { FORBIDDEN });
    assert!(of(&seen, "DBIRTH", "ball").is_empty() && of(&seen, "DDATA", "ball").is_empty());
    let line = bridge.line("\"held\"");
    assert!(line.contains("\"cell\":\"ball\"") && line.contains("\"why\":\"NotAuthorized\""), "{line}");
    assert!(line.contains("its records are held and one is retried each minute"), "{line}");
    until("records that are held", || figure(&bridge, HELD) > 5);

    // A new connection tries the first of them once.
    drop(peer);
    let mut peer = broker.accept(&[]);
    let tried = std::cell::RefCell::new(Vec::new());
    let seen = serve(&mut peer, 20, 1, |number| {
        tried.borrow_mut().push(number);
        FORBIDDEN
    });
    assert_eq!(tried.take(), [4]);
    assert!(of(&seen, "DBIRTH", "ball").is_empty() && of(&seen, "DDATA", "ball").is_empty());
    let figures = || {
        let text = get(&bridge, "/metrics");
        [HELD, MADE].map(|name| figure_in(&text, name))
    };
    let all_but_three = || {
        let [held, made] = figures();
        held + 3 == made
    };
    until("all but the first three held", all_but_three);

    // The next one takes it, but only when more were made on it, and others are on their way among them.
    drop(peer);
    let mut peer = broker.accept(&[]);
    let mut seen = Vec::new();
    read(&mut peer, &mut seen, "free", 10);
    until("all but the first three held", all_but_three);
    let kept = usize::try_from(figures()[1] - 3).unwrap();
    let trials = of(&seen, "DDATA", "ball");
    assert_eq!((trials.len(), trials[0].record()), (1, 4));
    peer.acknowledge(trials[0], 0);
    read(&mut peer, &mut seen, "ball", kept + 10);
    assert_no_hole(&seen);
    assert_in_order(&of(&seen, "DDATA", "free"));
    let came = of(&seen, "DDATA", "ball");
    assert_in_order(&came);
    assert!(came[..kept].iter().all(|message| is_historical(message)));
    assert!(!is_historical(came[came.len() - 1]));
    assert_eq!(of(&seen, "DBIRTH", "ball").len(), 1);
    bridge.line("\"released\"");
    assert_eq!((figure(&bridge, HELD), figure(&bridge, REFUSED)), (0, 0));
    assert_eq!(bridge.signal("-TERM"), Some(0));
    let again = |line: &String| line.contains("\"held\"") || line.contains("\"released\"");
    assert!(!bridge.rest().iter().any(again), "once");
}

#[test]
fn what_is_held_makes_room_in_a_full_store() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let size = "bytes = \"16KiB\"";
    let command = site_command(folder.path(), &broker.address(), size, &[("ball", &ball)]);
    let bridge = Running::start(command);
    let full = "dropped_total{why=\"full\"}";
    let mut peer = broker.accept(&[]);
    peer.any_message();
    let first = peer.message();
    peer.acknowledge(&first, FORBIDDEN);
    until("records that made room", || figure(&bridge, full) > 5);
    let text = get(&bridge, "/metrics");
    assert_eq!(figure_in(&text, HELD), figure_in(&text, "store_records"));
    assert!(figure_in(&text, HELD) > 50 && figure_in(&text, "store_bytes") <= 16 << 10, "{text}");
    drop(peer);
    let mut peer = broker.accept(&[]);
    let trial = peer.message();
    let oldest = trial.record();
    assert!(oldest > 5, "{oldest}");
    peer.acknowledge(&trial, 0);
    // The store is full until it is read: records after the trial that were dropped for others are counted as well.
    let (mut last, mut missing) = (oldest, oldest - 1);
    while last < oldest + figure_in(&text, HELD) + 30 {
        let message = peer.message();
        assert!(message.record() > last, "{} behind {last}", message.record());
        missing += message.record() - last - 1;
        last = message.record();
        peer.acknowledge(&message, 0);
    }
    assert_eq!((figure(&bridge, HELD), figure(&bridge, REFUSED)), (0, 0));
    // A record that made room while it was on its way has come all the same: the first, and the trial.
    let counted = figure(&bridge, full);
    assert!((missing..=missing + 2).contains(&counted), "{missing} are missing, {counted} were counted");
}
