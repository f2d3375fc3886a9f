//! Listening to a serial line of unknown rate.

use std::io::{self, IsTerminal as _, Write};
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use cellwire_identify::{Sender, Stream};
use cellwire_links::link::Carrier;
use cellwire_links::{LINKS, Link};

use super::Args;
use super::input::Conversation;
use super::line::{Search, Setting, SettingScore, likely};
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::marked_port::MarkedPort;

/// A turn of each setting is this share of the time, within limits: short messages come seldom, and everything must have
/// its turn.
const TURNS: u32 = 40;
const MIN_TURN: Duration = Duration::from_millis(300);
const MAX_TURN: Duration = Duration::from_secs(2);
/// The interval at which the progress is shown, and an interrupt seen.
const TICK: Duration = Duration::from_millis(100);
/// The number of bytes that are kept.
const MAX_BYTES: usize = 1 << 20;
/// The number of settings that are tried with the links.
const TRIED: usize = 3;

/// The result of listening to a line.
pub(super) struct Line {
    pub(super) conversation: Conversation,
    /// Every setting, the likeliest first.
    pub(super) judged: Vec<SettingScore>,
    /// The number of these settings that are not ruled out.
    pub(super) likely: usize,
}

/// Finds the rate and the format of a line, and listens with them until the time is over or the user interrupts.
pub(super) fn listen(args: &Args, name: &str) -> Result<Line> {
    interrupt::on_interrupt(Policy::Note)?;
    let mut port = MarkedPort::open(name)?;
    let mut ear =
        PortListener { port: &mut port, end: Instant::now() + args.duration, begin: Instant::now() };
    let mut search = Search::default();
    let mut formats = Vec::new();
    for mode in super::line::OTHER_MODES {
        formats.extend(ear.port.set(super::line::RATES[0], mode)?.then_some(mode));
    }
    let turn = (args.duration / TURNS).clamp(MIN_TURN, MAX_TURN);
    while let Some(setting) = search.next(&|mode| formats.contains(&mode)).filter(|_| !ear.is_over()) {
        ear.listen(&mut search, setting, ear.end.min(Instant::now() + turn), false)?;
    }
    let mut judged = search.judged();
    ensure!(
        !judged.is_empty(),
        "nothing was received on {name} at any rate: check the receive line, and that the other end sends"
    );
    let links: Vec<&'static Link> = args.link.map_or_else(|| LINKS.iter().collect(), |link| vec![link]);
    for candidate in judged.iter_mut().take(TRIED) {
        if let Some(heard) = search.heard_with(candidate.setting) {
            candidate.explain(&links, &heard)?;
        }
    }
    judged.sort_by(|a, b| b.bits.total_cmp(&a.bits));
    let best = judged.first().map_or(Setting::eight_n_one(super::line::RATES[0]), |best| best.setting);
    let before = search.heard_with(best).unwrap_or_default().bytes.len();
    ear.listen(&mut search, best.heard_as(), ear.end, true)?;
    ear.progress("");
    let heard = search.heard_with(best).unwrap_or_default();
    let (first, rest) = heard.bytes.split_at(before.min(heard.bytes.len()));
    let sender = args.from.clone().map_or(Sender::Unknown, Sender::Named);
    let parts = [first, rest].map(<[u8]>::to_vec).into_iter().filter(|part| !part.is_empty()).collect();
    let stream = Stream { sender, parts, arrivals: heard.arrivals };
    let likely = likely(&judged).len();
    let carrier = Carrier::Serial(Some(best.baud));
    Ok(Line {
        conversation: Conversation { name: name.into(), carrier, streams: vec![stream] },
        judged,
        likely,
    })
}

struct PortListener<'a> {
    port: &'a mut MarkedPort,
    begin: Instant,
    end: Instant,
}

impl PortListener<'_> {
    fn is_over(&self) -> bool {
        interrupt::requested() || Instant::now() >= self.end
    }

    /// Listens with a setting until a time; unless it listens `on`, until enough bytes were received.
    fn listen(&mut self, search: &mut Search, setting: Setting, until: Instant, on: bool) -> Result<()> {
        self.port.set(setting.baud, setting.mode)?;
        search.listening(setting).times += 1;
        while Instant::now() < until && !self.is_over() {
            let heard = search.listening(setting);
            if heard.count() >= MAX_BYTES || !on && Search::has_enough(heard) {
                break;
            }
            let left = until.saturating_duration_since(Instant::now());
            let marked = self.port.read(left.min(TICK))?;
            if !marked.is_empty() {
                heard.take(self.begin.elapsed(), &marked);
            }
            let (count, broken) = (heard.count(), heard.broken);
            self.progress(&format!("{setting}: {count} characters, {broken} of them broken"));
        }
        Ok(())
    }

    /// Shows progress on one line of standard error, which is overwritten.
    fn progress(&self, text: &str) {
        let mut err = io::stderr();
        if err.is_terminal() {
            let left = self.end.saturating_duration_since(Instant::now()).as_secs();
            let text =
                if text.is_empty() { String::new() } else { format!("{text}; {left} s left, Ctrl-C ends") };
            let _ = write!(err, "\r\x1b[K{text}").and_then(|()| err.flush());
        }
    }
}
