//! `cellwire replay`: plays one end of a capture, and reports where the other departs from it.

mod script;
mod transport;

use std::io;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use clap::ValueEnum;
use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};

use self::script::{Part, Reader, Script};
use self::transport::TransportArgs;
use super::codec::LinkArgs;
use super::compare::{Compare, Follow, IsCommand};
use super::recorded::{ConversationArgs, Party};
use cellwire_io::input::time;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{EventArgs, counted, remark};

/// Plays one end of a captured conversation against a program or a device, and reports where the other end differs from the
/// capture.
///
/// Prints the first five differences of each kind, one line of JSON each, with the captured and the actual message: `other`,
/// `missing`, `again` (sent again), `later` (after its successor), `more`, `command` (only numbers differ, and they command), or
/// `values` (only other numbers differ, such as measured ones), which do not affect the exit status. The last line has the
/// counts, and the first departure with the message before it. At a terminal these are a report of a few lines. Messages are
/// decoded with the given settings.
///
/// Numbers command in a job of a Kawasaki PC, and in all that a laser's host, a Modbus client, the central controller of
/// MM&A and a host of ALTER send. Kawasaki messages that only fill an empty packet are counted, not compared: how many there
/// are depends on the times.
///
/// The captured messages are sent unchanged: a device moves as it did. Only numbers that the other end chooses and this end
/// repeats, such as an order or transaction number, are replaced by the current ones, and a message with the current ones is
/// the same. An order number may be in a header or a field, as in the plant's table of messages (give its --settings).
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, override_usage = USAGE)]
pub struct Args {
    #[command(flatten)]
    of: LinkArgs,
    #[command(flatten)]
    conversation: ConversationArgs,
    /// The end to play: a side of the link, or the end that polls
    #[arg(long = "as", value_name = "END")]
    end: String,
    #[command(flatten)]
    transport: TransportArgs,
    /// When this end sends
    #[arg(long, value_enum, default_value_t = Pace::Turns)]
    pace: Pace,
    /// How much later than in the capture a message may come before it counts as missing
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = time(Duration::from_millis(10)..=Duration::from_secs(3600)))]
    patience: Duration,
    /// Count other numbers in commands as values: they do not affect the exit status
    #[arg(long)]
    ignore_commands: bool,
    /// Send exactly the captured bytes, without replaced numbers
    #[arg(long)]
    verbatim: bool,
    /// Print each difference, not only the first five of each kind
    #[arg(long)]
    all: bool,
    #[command(flatten)]
    events: EventArgs,
}

/// When this end sends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Pace {
    /// After the other end's preceding messages, with the captured delay
    Turns,
    /// Immediately after the other end's preceding messages
    Answers,
    /// At the captured times, whatever the other end sends
    Times,
}

const USAGE: &str = "\
cellwire replay [OPTIONS] --as <END> --listen <ADDR> <LINK> [FILE]
       cellwire replay [OPTIONS] --as <END> --connect <ADDR> <LINK> [FILE]
       cellwire replay [OPTIONS] --as <END> --serial <PORT> <LINK> [FILE]
       cellwire replay [OPTIONS] --as <END> --pty <LINKPATH> <LINK> [FILE]";

const EXAMPLES: &str = "\
Examples:
  cellwire replay laser tap.pcapng --as controller --pty /tmp/laser
      a captured laser controller, for a program that opens /tmp/laser
  cellwire replay kawasaki day.pcapng --as robot --connect 127.0.0.1:9105
      a robot that connects to a PC
  cellwire replay fanuc day.pcapng --as client --connect 192.168.0.10:502
      the requests of a client, to a server

Exit status: 0 the other end did what it did then   1 it departed from it";

/// Returns true when the other end did what it did then.
pub fn run(args: &Args) -> Result<bool> {
    let conversation = args.conversation.read()?;
    let parties = conversation.ends(args.of.link, &args.end)?;
    let Script { parts, expected } = Script::new(&args.of, &conversation, parties)?;
    ensure!(!parts.is_empty(), "the capture has no messages from `{}`", args.end);
    let [ours, other] = parties;
    let mut messages = parts.iter().flat_map(|part| &part.messages);
    ensure!(
        args.verbatim || ours.side.is_none() || messages.any(|(_, message)| message.is_some()),
        "nothing that `{}` sent in the capture is a message of {}: `cellwire identify` says what it is, --verbatim sends it as it is",
        args.end,
        args.of.link.short
    );
    args.events.choose();
    let follow = Follow::new(ours.side.or(other.side).map(|side| args.of.codec_of(side)).transpose()?);
    let is_command = other.side.and_then(|side| commands(args.of.link.short, side));
    let follow = follow.of_commands(is_command.filter(|_| !args.ignore_commands));
    let mut play = Play {
        reader: Reader::new(&args.of, other.side)?,
        compare: Compare::new(expected, follow, args.all),
        begun: None,
        heard: Instant::now(),
        is_closed: false,
    };
    interrupt::on_interrupt(Policy::End)?;
    let mut transport = args.transport.open(&args.end)?;
    let mut sent = 0;
    // The times of the capture count from its first message, from either end.
    let mut last = Instant::now();
    if parts.first().is_some_and(|part| part.after == 0) {
        play.begun = Some(last);
    }
    for part in &parts {
        play.wait_for(&mut *transport, args, part, &mut last)?;
        if play.is_closed {
            break;
        }
        let bytes = if args.verbatim { part.bytes.clone() } else { play.bytes(args, ours, part)? };
        if let Err(error) = send(&mut *transport, &bytes) {
            remark(&format!("the connection has ended: {error}"));
            break;
        }
        last = Instant::now();
        sent += 1;
        let all = counted(parts.len(), "message");
        interrupt::account(format!("{sent} of {all} sent, which may have an effect"));
    }
    play.rest(&mut *transport, args.patience)?;
    play.linger(&mut *transport);
    let Play { mut reader, mut compare, begun, .. } = play;
    let at = begun.map_or(Duration::ZERO, |begun| begun.elapsed());
    let mut items = Vec::new();
    reader.finish(&mut |content| items.push(content))?;
    items.iter().try_for_each(|content| compare.take(at, content))?;
    let is_same = compare.finish("replayed", &[("sent", sent), ("of", parts.len())])?;
    Ok(is_same && sent == parts.len())
}

/// Returns the values with which an end commands a machine, by name.
fn commands(link: &str, side: &str) -> Option<IsCommand> {
    match (link, side) {
        // The PC's other numbers depend on the progress of the robot.
        ("kawasaki", "pc") => Some(|name| name == "work"),
        // The client chooses the transaction.
        ("fanuc", "client") => Some(|name| name != "transaction"),
        ("laser" | "alter", "host") | ("mma", "central") => Some(|_| true),
        _ => None,
    }
}

/// Sends all of it, also through a port that has not room for all at once.
fn send(transport: &mut dyn Transport, bytes: &[u8]) -> io::Result<()> {
    let mut left = bytes;
    while let SendOutcome::Part(length) = transport.send(left)? {
        left = left.get(length..).unwrap_or_default();
        transport.wait_for_room(Wait::default())?;
    }
    Ok(())
}

struct Play {
    reader: Reader,
    compare: Compare,
    begun: Option<Instant>,
    /// When a message came last.
    heard: Instant,
    is_closed: bool,
}

impl Play {
    /// Returns the bytes of a part, with the numbers that the other end has chosen.
    fn bytes(&self, args: &Args, ours: Party, part: &Part) -> Result<Vec<u8>> {
        let Some(side) = ours.side.filter(|_| !part.messages.is_empty()) else {
            return Ok(part.bytes.clone());
        };
        let mut bytes = Vec::new();
        for (its, message) in &part.messages {
            let followed = message.as_ref().and_then(|message| self.compare.follow.followed(message));
            match followed {
                Some(message) => bytes.extend(args.of.codec_of(side)?.encode(message)?),
                None => bytes.extend_from_slice(its),
            }
        }
        Ok(bytes)
    }

    /// Reads until it is time to send a part. `last` is when something was sent or came last.
    fn wait_for(
        &mut self,
        transport: &mut dyn Transport,
        args: &Args,
        part: &Part,
        last: &mut Instant,
    ) -> Result<()> {
        let mut waited = Instant::now();
        while !self.is_closed {
            let due = match (args.pace, self.begun) {
                (Pace::Times, Some(begun)) => Some(begun + part.at),
                _ if self.compare.passed < part.after => None,
                (Pace::Turns, _) => Some((*last).max(self.heard) + part.delay),
                (Pace::Answers | Pace::Times, _) => Some(Instant::now()),
            };
            let now = Instant::now();
            match due {
                Some(due) if due <= now => return Ok(()),
                Some(due) => self.read(transport, due - now)?,
                None => {
                    let before = self.compare.passed;
                    self.read(transport, Duration::from_millis(50))?;
                    if self.compare.passed > before || self.begun.is_none() {
                        waited = Instant::now();
                    } else if waited.elapsed() > self.patience(args, part) + part.delay {
                        // The next of them may come all the same.
                        self.compare.missed(1);
                        waited = Instant::now();
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the time for which the messages before a part are awaited; it is shorter if they have no content.
    fn patience(&self, args: &Args, part: &Part) -> Duration {
        const OF_FILLERS: Duration = Duration::from_millis(500);
        let only_fillers = self.compare.awaits_only_fillers(part.after);
        if only_fillers { args.patience.min(OF_FILLERS) } else { args.patience }
    }

    /// Reads what comes after the last part was sent.
    fn rest(&mut self, transport: &mut dyn Transport, patience: Duration) -> Result<()> {
        self.heard = Instant::now();
        while !self.is_closed && !self.compare.is_over() {
            let Some(left) = patience.checked_sub(self.heard.elapsed()) else { return Ok(()) };
            self.read(transport, left)?;
        }
        Ok(())
    }

    /// Keeps the line for as long as the other end may need to read the last message.
    fn linger(&mut self, transport: &mut dyn Transport) {
        const LINGER: Duration = Duration::from_millis(500);
        let end = Instant::now() + LINGER;
        while !self.is_closed
            && let Some(left) = end.checked_duration_since(Instant::now())
        {
            self.is_closed = !matches!(
                transport.receive(&mut [0; 4096], Wait::limited(left)),
                Ok(ReceiveOutcome::Bytes(_) | ReceiveOutcome::Nothing)
            );
        }
    }

    fn read(&mut self, transport: &mut dyn Transport, limit: Duration) -> Result<()> {
        let mut buffer = [0; 4096];
        let length = match transport.receive(&mut buffer, Wait::limited(limit)) {
            Ok(ReceiveOutcome::Bytes(length)) => length,
            Ok(ReceiveOutcome::Nothing) => return Ok(()),
            Ok(_) | Err(_) => {
                self.is_closed = true;
                return Ok(());
            }
        };
        let begun = *self.begun.get_or_insert_with(Instant::now);
        let mut items = Vec::new();
        self.reader.push(buffer.get(..length).unwrap_or_default(), &mut |content| items.push(content))?;
        for content in &items {
            self.heard = Instant::now();
            self.compare.take(begun.elapsed(), content)?;
        }
        Ok(())
    }
}
