//! The rules of [`robot_session::Session`].

use core::fmt::Debug;
use core::time::Duration;

use robot_session::Session;

use crate::rng::Rng;

/// One end of a link, as the contract is checked for it.
pub trait End {
    /// The session.
    type Session: Session<Event: Debug>;

    /// Its name.
    const NAME: &'static str;

    /// Whether [`Session::handle_input`] takes datagrams, whose borders mean something.
    const DATAGRAMS: bool = false;

    /// A session with its default configuration, or with one where every time is `Duration::MAX`.
    fn new(endless: bool) -> Self::Session;

    /// Something that a caller may do now, drawn at random; also what only a careless caller does.
    fn request(session: &mut Self::Session, now: Duration, rng: &mut Rng);

    /// Bytes that the other end may send, drawn at random.
    fn message(rng: &mut Rng) -> Vec<u8>;

    /// Whether an event reports what is so until more bytes come: then it depends on how the input is cut.
    fn is_provisional(_event: &<Self::Session as Session>::Event) -> bool {
        false
    }
}

/// What an end has done: each event and each transmission, in order.
type Trace = Vec<String>;

/// Holds a session to the contract, on `seeds` random strings of calls.
pub fn session<E: End>(seeds: u64) {
    for seed in 0..seeds {
        for endless in [false, true] {
            let once = run::<E>(seed, endless, Caller::Plain);
            for caller in [Caller::Often, Caller::SmallBuffer, Caller::Pieces] {
                if caller != Caller::Pieces || !E::DATAGRAMS && !is_careless(seed) {
                    let other = run::<E>(seed, endless, caller);
                    assert_eq!(once, other, "{}: seed {seed}, endless {endless}, {caller:?}", E::NAME);
                }
            }
        }
    }
}

/// Ways to call a session that must make no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Caller {
    Plain,
    /// Asks for the timeout, and handles it, more often than it must.
    Often,
    /// First with a buffer that is too small.
    SmallBuffer,
    /// Input byte by byte.
    Pieces,
}

/// Whether bytes also come without a connection. Each such call may be reported, so pieces are not the same there.
fn is_careless(seed: u64) -> bool {
    seed.is_multiple_of(4)
}

/// Whether time comes to its end.
fn ends(seed: u64) -> bool {
    seed.is_multiple_of(3)
}

fn run<E: End>(seed: u64, endless: bool, caller: Caller) -> Trace {
    let mut rng = Rng::new(seed);
    let (mut session, mut trace, mut now) = (E::new(endless), Trace::new(), Duration::ZERO);
    let mut connected = false;
    for _ in 0..60 {
        match rng.below(16) {
            0 => {
                session.handle_connected(now);
                connected = true;
            }
            1 if rng.chance(0.3) => {
                session.handle_disconnected(now);
                connected = false;
            }
            2..7 => E::request(&mut session, now, &mut rng),
            7..11 => {
                let mut bytes = E::message(&mut rng);
                if rng.chance(0.2) && !bytes.is_empty() {
                    let at = rng.below(bytes.len());
                    bytes[at] ^= 1 << rng.below(8);
                }
                if (connected && session.wants_input()) || is_careless(seed) {
                    input(&mut session, now, &bytes, caller);
                }
            }
            11 => {
                let noise: Vec<u8> = (0..rng.below(80)).map(|_| rng.next_u64() as u8).collect();
                if (connected && session.wants_input()) || is_careless(seed) {
                    input(&mut session, now, &noise, caller);
                }
            }
            12 => {
                let due = session.poll_timeout().filter(|at| *at < LATEST || ends(seed));
                now = due.unwrap_or(now).clamp(now, LATEST);
            }
            13 => {
                let step = rng.log_uniform(Duration::from_micros(10), Duration::from_secs(100));
                now = now.saturating_add(step).min(LATEST);
            }
            14 if ends(seed) && rng.chance(0.1) => now = LATEST,
            15 => session.handle_transmitted(now),
            _ => {}
        }
        drain::<E>(&mut session, now, caller, &mut trace);
    }
    // Every deadline is due then, again and again: what is reported need not end, but nothing panics.
    for _ in 0..10 {
        session.handle_timeout(Duration::MAX);
        let _ = session.poll_event();
        let _ = session.poll_transmit(Duration::MAX, &mut vec![0; E::Session::MAX_TRANSMIT]);
    }
    trace
}

/// The latest time at which a deadline may still lie ahead: [`Duration::MAX`] is never.
const LATEST: Duration = Duration::MAX.saturating_sub(Duration::from_nanos(1));

fn input(session: &mut impl Session, now: Duration, bytes: &[u8], caller: Caller) {
    if caller == Caller::Pieces {
        bytes.chunks(1).for_each(|byte| session.handle_input(now, byte));
    } else {
        session.handle_input(now, bytes);
    }
}

/// Until the session has nothing to do: then its timeout lies ahead.
fn drain<E: End>(session: &mut E::Session, now: Duration, caller: Caller, trace: &mut Trace) {
    const MANY: usize = 10_000;
    let begin = trace.len();
    let mut out = vec![0; E::Session::MAX_TRANSMIT];
    for round in 0.. {
        assert!(round < MANY, "{}: at {now:?} a timeout is due again and again", E::NAME);
        let before = trace.len();
        session.handle_timeout(now);
        while let Some(event) = session.poll_event() {
            if E::is_provisional(&event) {
                continue;
            }
            trace.push(format!("{now:?} {event:?}"));
            assert!(trace.len() < begin + MANY, "{}: events without end: {:?}", E::NAME, trace.last());
        }
        loop {
            if caller == Caller::SmallBuffer {
                // A message may be short enough for it.
                let length = session.poll_transmit(now, &mut []);
                assert_eq!(length, None, "{}: a transmission without bytes", E::NAME);
            }
            let Some(length) = session.poll_transmit(now, &mut out) else { break };
            assert!(length > 0, "{}: a transmission without bytes", E::NAME);
            trace.push(format!("{now:?} {:02X?}", &out[..length]));
            assert!(trace.len() < begin + MANY, "{}: transmissions without end", E::NAME);
        }
        let is_due = session.poll_timeout().is_some_and(|at| at <= now);
        if caller == Caller::Often {
            let _ = session.poll_timeout();
            session.handle_timeout(now);
            session.handle_timeout(now);
        }
        // A transmission that is given up makes a timeout due at once.
        if trace.len() == before && !is_due {
            break;
        }
    }
    assert!(session.poll_timeout().is_none_or(|at| at > now), "{}: nothing is left to do", E::NAME);
    assert!(session.poll_event().is_none(), "{}: an event that nothing has caused", E::NAME);
}
