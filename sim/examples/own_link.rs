//! A link of one's own, from its bytes to calls by await: a scale that is asked `W` and a number, and answers with the
//! number, the weight in grams and a sum of both. `cargo run -p cellwire-sim --all-features --example own_link --
//! 192.168.0.30:4001`
//!
//! ```text
//! W7\r ──▶    ◀── 7 +01250 5C\r
//! ```

use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;

use robot_session::Session;
use robot_session::tokio::{Reply, Reports, Service, Tcp, spawn};

const TIMEOUT: Duration = Duration::from_millis(200);

/// A weight in grams, or the reason that there is no weight.
type Weighed = Result<i32, NoWeight>;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum NoWeight {
    Silent,
    Corrupt,
    Disconnected,
}

fn encode(number: u8, grams: i32) -> String {
    let text = format!("{number} {grams:+06}");
    let sum = text.bytes().fold(0, u8::wrapping_add);
    format!("{text} {sum:02X}\r")
}

fn decode(line: &str) -> Option<(u8, i32)> {
    let (number, grams) = line.trim_end().rsplit_once(' ')?.0.split_once(' ')?;
    let read = (number.parse().ok()?, grams.parse().ok()?);
    (encode(read.0, read.1) == line).then_some(read)
}

/// Returns the next whole line.
fn next_line(bytes: &mut Vec<u8>) -> Option<String> {
    let end = bytes.iter().position(|byte| *byte == b'\r')?;
    Some(String::from_utf8_lossy(&bytes.drain(..=end).collect::<Vec<u8>>()).into_owned())
}

/// The end that asks, one question at a time.
#[derive(Debug, Default)]
struct Asker {
    connected: bool,
    number: u8,
    asks: bool,
    until: Option<Duration>,
    received: Vec<u8>,
    events: VecDeque<Weighed>,
}

impl Asker {
    /// Asks for the weight, which is an event. False while there is no connection, or another question.
    fn ask(&mut self) -> bool {
        let may_ask = self.connected && !self.asks && self.until.is_none();
        if may_ask {
            (self.asks, self.number) = (true, self.number.wrapping_add(1));
        }
        may_ask
    }

    fn end(&mut self, weighed: Weighed) {
        (self.asks, self.until) = (false, None);
        self.events.push_back(weighed);
    }
}

impl Session for Asker {
    type Event = Weighed;
    type Statistics = ();
    const MAX_INPUT: usize = 64;
    const MAX_TRANSMIT: usize = 5;

    fn handle_connected(&mut self, now: Duration) {
        self.handle_disconnected(now);
        self.connected = true;
    }

    fn handle_disconnected(&mut self, _: Duration) {
        self.connected = false;
        self.received.clear();
        if self.asks || self.until.is_some() {
            self.end(Err(NoWeight::Disconnected));
        }
    }

    fn handle_input(&mut self, _: Duration, bytes: &[u8]) {
        self.received.extend(bytes);
        while let Some(line) = next_line(&mut self.received) {
            match decode(&line) {
                // The answer to a question that was given up.
                Some((number, _)) if number != self.number => {}
                answer if self.until.is_some() => {
                    self.end(answer.map(|(_, grams)| grams).ok_or(NoWeight::Corrupt))
                }
                _ => {}
            }
        }
        let most = self.received.len().saturating_sub(64);
        self.received.drain(..most);
    }

    fn handle_timeout(&mut self, now: Duration) {
        if self.until.is_some_and(|until| until <= now) {
            self.end(Err(NoWeight::Silent));
        }
    }

    fn poll_event(&mut self) -> Option<Weighed> {
        self.events.pop_front()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let question = self.asks.then(|| format!("W{}\r", self.number))?;
        out.get_mut(..question.len())?.copy_from_slice(question.as_bytes());
        (self.asks, self.until) = (false, Some(now.saturating_add(TIMEOUT)));
        Some(question.len())
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.until
    }

    fn statistics(&self) {}
}

/// The caller that waits for the weight.
#[derive(Debug, Default)]
struct Weighing(Option<Reply<Weighed>>);

impl Service for Weighing {
    type Session = Asker;
    type Call = Reply<Weighed>;
    type Event = Weighed;

    fn has_room(&self, _: &Asker) -> bool {
        self.0.is_none()
    }

    fn call(&mut self, session: &mut Asker, _: Duration, reply: Reply<Weighed>) {
        if session.ask() {
            self.0 = Some(reply);
        } else {
            let _ = reply.send(Err(NoWeight::Disconnected));
        }
    }

    fn event(&mut self, _: &mut Asker, weighed: Weighed, reports: &mut Reports<'_, Weighed>) {
        if let Some(Err(abandoned)) = self.0.take().map(|reply| reply.send(weighed)) {
            reports.event(abandoned);
        }
    }

    fn refuse(&mut self, reply: Reply<Weighed>, _: &Arc<io::Error>) {
        // No peer is left to inform.
        let _ = reply.send(Err(NoWeight::Disconnected));
    }
}

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: ADDRESS")?;
    let (scale, task) = spawn(Asker::default(), Weighing::default(), Tcp::new(address));
    tokio::spawn(task.run());
    loop {
        println!("{:?}", scale.call(|reply| reply).await?);
        tokio::time::sleep(Duration::from_secs(1)).await;
    }
}

#[cfg(test)]
mod tests {
    use cellwire_sim::{Fault, Peer, Script, Settings as _};
    use robot_session::contract::{Observed, Subject};

    use super::*;

    /// The scale: it answers question n with a kilogram and n grams.
    #[derive(Debug, Clone, Default)]
    struct Scale {
        received: Vec<u8>,
        answers: VecDeque<u8>,
        asked: VecDeque<u8>,
    }

    impl Session for Scale {
        type Event = u8;
        type Statistics = ();
        const MAX_INPUT: usize = 64;
        const MAX_TRANSMIT: usize = 16;

        fn handle_connected(&mut self, _: Duration) {
            *self = Self::default();
        }

        fn handle_disconnected(&mut self, _: Duration) {}

        fn handle_input(&mut self, _: Duration, bytes: &[u8]) {
            self.received.extend(bytes);
            while let Some(line) = next_line(&mut self.received) {
                let number: Option<u8> =
                    line.strip_prefix('W').and_then(|number| number.trim_end().parse().ok());
                self.answers.extend(number);
                self.asked.extend(number);
            }
        }

        fn handle_timeout(&mut self, _: Duration) {}

        fn poll_event(&mut self) -> Option<u8> {
            self.asked.pop_front()
        }

        fn poll_transmit(&mut self, _: Duration, out: &mut [u8]) -> Option<usize> {
            let answer = self.answers.front().map(|number| encode(*number, 1000 + i32::from(*number)))?;
            out.get_mut(..answer.len())?.copy_from_slice(answer.as_bytes());
            self.answers.pop_front();
            Some(answer.len())
        }

        fn poll_timeout(&self) -> Option<Duration> {
            None
        }

        fn statistics(&self) {}
    }

    /// The session in strings of calls.
    struct Weighs;

    impl Subject for Weighs {
        type Session = Asker;
        /// The number of the answer, if it is not the one that is asked for.
        type Input = Option<u8>;
        type Call = ();

        fn session(&self, _: usize, _: bool) -> Asker {
            Asker::default()
        }

        fn input(&self, asker: &Asker, _: usize, other: &Option<u8>) -> Vec<u8> {
            encode(other.unwrap_or(asker.number), 1250).into_bytes()
        }

        fn call(&self, asker: &mut Asker, _: usize, _: Duration, (): &()) -> Option<String> {
            Some(format!("ask: {}", asker.ask()))
        }

        fn watch(&self) -> impl FnMut(Observed<'_, Weighed>) {
            let mut open = 0;
            move |happened| {
                match happened {
                    Observed::Called("ask: true") => open += 1,
                    Observed::Event(_) => open -= 1,
                    _ => {}
                }
                assert!((0..=1).contains(&open), "each question has one outcome");
            }
        }
    }

    #[test]
    fn the_session_keeps_the_contract() {
        robot_session::contract::session(&Weighs, 300);
    }

    #[tokio::test]
    async fn a_weight_is_that_of_its_own_question() {
        let sim = Peer(Scale::default()).listen("127.0.0.1:0").unwrap();
        let late = Fault::Delay(TIMEOUT + TIMEOUT / 2);
        let script = Script::new().answer(10, Fault::Drop).answer(20, late).answer(30, Fault::Corrupt);
        sim.faults().follow(script.answer(40, Fault::Cut).answer(50, Fault::Twice));
        let (scale, task) = spawn(Asker::default(), Weighing::default(), Tcp::new(sim.address().to_string()));
        tokio::spawn(task.run());
        let mut failed = Vec::new();
        for number in 1..=100 {
            match scale.call(|reply| reply).await.unwrap() {
                Ok(grams) => assert_eq!(grams, 1000 + number),
                Err(error) => failed.push((number, error)),
            }
        }
        // The late answer is still in front of that to the next question.
        assert_eq!(failed[..2], [(10, NoWeight::Silent), (20, NoWeight::Silent)]);
        assert!(
            failed.contains(&(30, NoWeight::Corrupt)) && failed.contains(&(40, NoWeight::Disconnected)),
            "{failed:?}"
        );
        assert_eq!((failed.len(), sim.faults().happened().len()), (4, 5));
        assert_eq!(sim.executed().len(), 100);
    }
}
