//! A host and a controller, as their messages show them.

mod frame;

use core::time::Duration;

use anyhow::Result;
use laser_eb90::timing::transmission_time;
use laser_eb90::{Class, ControllerConfig, HostConfig, Refusal};
use serde_json::Value;

use self::frame::{first_word, items, judge, line};
use super::codec::Options;
use crate::settings;
use crate::shadow::{JITTER, LineEvent, Report, Setup, Shadow, ms};

const HOST: &str = "host";
const CONTROLLER: &str = "controller";
/// Fewer bytes are not answered (LE-85).
const SHORTEST_FRAME: u64 = 8;

pub(super) fn shadow(setup: &Setup<'_>) -> Result<Box<dyn Shadow>> {
    let baud = setup.baud().unwrap_or(laser_eb90::timing::BAUD);
    let mut host = setup.config(HOST, HostConfig::at_baud(baud), &[])?;
    let mut controller = setup.config(CONTROLLER, ControllerConfig::default(), &["queue"])?;
    // Both ends have the same words: those of the one whose configuration has them, or those that are set for both.
    if setup.has(HOST, "words") {
        controller.words = host.words;
    } else if !setup.has(CONTROLLER, "words") {
        controller.words = settings::read("laser", Options::default(), setup.settings)?.words;
    }
    host.words = controller.words;
    let (opened, asked, is_busy, open) = (None, None, false, HostBytes::default());
    Ok(Box::new(Laser { host, controller, opened, asked, is_busy, open }))
}

struct Laser {
    host: HostConfig,
    controller: ControllerConfig,
    /// When the connection was made, until the host has sent a frame.
    opened: Option<Duration>,
    /// The last frame of the host; `None` before the first.
    asked: Option<HostFrame>,
    /// An instruction of an earlier connection may be executed still.
    is_busy: bool,
    open: HostBytes,
}

/// The host's bytes since the last answer.
#[derive(Default)]
struct HostBytes {
    /// Bytes that are in no message yet.
    held: u64,
    /// Bytes of no message.
    corrupt: u64,
    /// When the last byte came.
    last: Duration,
    /// The longest pause within the buffered bytes.
    pause: Duration,
}

/// A frame of the host.
struct HostFrame {
    word: Option<u16>,
    class: Option<Class>,
    length: u64,
    /// When its last byte has left.
    left: Duration,
    /// There was a pause within it after which its first half may have been answered.
    is_divided: bool,
    /// Nothing before it delays its answer.
    is_prompt: bool,
    is_answered: bool,
    /// The number of times that the frame was sent again after an error code.
    resent: u8,
    /// The frame is wanted again, with the same bytes.
    is_wanted: bool,
    message: Value,
    /// The missing answer was reported.
    is_missed: bool,
}

impl Shadow for Laser {
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>) {
        match *seen {
            LineEvent::Opened => {
                self.is_busy |= self.asked.take().is_some_and(|asked| asked.is_executed());
                self.opened = Some(report.now);
                self.open = HostBytes::default();
            }
            LineEvent::Closed | LineEvent::Missed { .. } => {
                self.is_busy |= self.asked.take().is_some_and(|asked| asked.is_executed());
                self.opened = None;
                self.open = HostBytes::default();
            }
            LineEvent::Bytes { from: HOST, bytes } => {
                let open = &mut self.open;
                if open.held > 0 {
                    open.pause = open.pause.max(report.now.saturating_sub(open.last));
                }
                open.held += bytes.len() as u64;
                open.last = report.now;
            }
            LineEvent::Corrupt { from: HOST, length, .. } => {
                self.open.held = self.open.held.saturating_sub(length);
                self.open.corrupt += length;
            }
            LineEvent::Message { from: HOST, length, message } => self.ask(length, message, report),
            LineEvent::Message { from: CONTROLLER, message, .. } => self.answer(message, report),
            LineEvent::Bytes { .. } | LineEvent::Corrupt { .. } | LineEvent::Message { .. } => {}
        }
    }

    fn pass(&mut self, report: &mut Report<'_>) {
        let (host, now) = (&self.host, report.now);
        let Some(asked) = self.asked.as_mut().filter(|asked| !asked.is_answered && !asked.is_missed) else {
            return;
        };
        let limit = asked.timeout(host);
        if now > asked.left.saturating_add(limit) {
            asked.is_missed = true;
            match asked.class {
                Some(Class::Interpreted) => {
                    let text = format!("no answer within answer_timeout ({}) of its frame", ms(limit));
                    report.budget(CONTROLLER, "LE-99", text);
                }
                _ => {
                    let text = format!("no answer within execution_timeout ({}) of its frame", ms(limit));
                    report.assumption(CONTROLLER, "LE-72", text);
                }
            }
        }
    }

    fn state(&self) -> String {
        match &self.asked {
            None => "no frame was seen".into(),
            Some(asked) if asked.is_wanted => "the last frame is wanted again".into(),
            Some(asked) if asked.is_answered => "the last frame is answered".into(),
            Some(asked) if asked.is_missed => "the last frame has no answer".into(),
            Some(_) => "a frame waits for its answer".into(),
        }
    }
}

impl HostFrame {
    /// Returns whether the frame has no answer, and its execution may be going on.
    fn is_executed(&self) -> bool {
        !self.is_answered && self.class != Some(Class::Interpreted)
    }

    fn timeout(&self, host: &HostConfig) -> Duration {
        match self.class {
            Some(Class::Interpreted) => host.answer_timeout,
            _ => host.execution_timeout,
        }
    }
}

impl Laser {
    /// Checks a frame of the host.
    fn ask(&mut self, length: u64, message: &Value, report: &mut Report<'_>) {
        let now = report.now;
        if let Some(asked) = self.asked.as_ref().filter(|asked| !asked.is_answered && !asked.is_missed)
            && self.open.corrupt < SHORTEST_FRAME
        {
            let waited = ms(now.saturating_sub(asked.left));
            report.rule(HOST, "LE-45", format!("sent {waited} after a frame that is not answered"));
        }
        let pause = core::mem::take(&mut self.open.pause);
        if pause > self.host.max_pause {
            let text = format!("a pause of {} within a frame: max_pause is wrong", ms(pause));
            report.assumption(HOST, "LE-72", text);
        } else if pause > self.controller.silence {
            let text = format!("a pause of {} within a frame: silence is too short for it", ms(pause));
            report.assumption(HOST, "LE-98", text);
        }
        let word = first_word(message);
        let class = word.and_then(|word| self.controller.words.class(word));
        let batch = self.host.batch.max(self.controller.batch);
        judge(message, &self.controller.words, batch, report);
        let is_over = |asked: &HostFrame| asked.is_answered || (asked.is_prompt && !asked.is_executed());
        let is_idle = self.asked.as_ref().is_none_or(is_over) && !self.is_busy;
        let is_prompt = is_idle && pause.is_zero() && self.open.corrupt == 0 && self.open.held == length;
        self.open.held = self.open.held.saturating_sub(length);
        self.open.corrupt = 0;
        let is_divided = pause > self.controller.silence;
        let line = transmission_time(usize::try_from(length).unwrap_or(usize::MAX), self.host.baud);
        let (left, is_answered, is_missed) = (now.saturating_add(line), false, false);
        let is_again = self.asked.as_ref().filter(|asked| asked.is_wanted);
        let resent = is_again.map_or(0, |asked| asked.resent.saturating_add(1));
        if is_again.is_some_and(|asked| asked.message != *message) {
            report.rule(HOST, "LE-67", "another frame than the one that was to be sent again");
        }
        let (is_wanted, message) = (false, message.clone());
        self.asked = Some(HostFrame {
            resent,
            is_wanted,
            message,
            word,
            class,
            length,
            left,
            is_divided,
            is_prompt,
            is_answered,
            is_missed,
        });
        self.opened = None;
    }

    /// Checks an answer of the controller.
    fn answer(&mut self, message: &Value, report: &mut Report<'_>) {
        let now = report.now;
        let sent = self.open.held + self.open.corrupt;
        let Some(word) = first_word(message) else {
            return report.rule(CONTROLLER, "LE-25", "an answer that does not begin with a word");
        };
        let refusal = self.controller.words.errors().refusal(word);
        let has_values = items(message).count() > 1;
        let Some(asked) = &mut self.asked else {
            // The request was not seen; after this silence none is left.
            if let Some(opened) = self.opened
                && now > opened.saturating_add(drain(&self.host))
                && sent < SHORTEST_FRAME
            {
                report.rule(CONTROLLER, "LE-5", format!("{word:04X}h, unsolicited"));
            }
            return;
        };
        let of_half = matches!(refusal, Some(Refusal::BadFrame | Refusal::BadChecksum));
        if of_half && sent >= SHORTEST_FRAME {
            // It answers bytes that are not a frame.
            self.open.corrupt = 0;
            return;
        }
        if asked.is_answered {
            report.rule(CONTROLLER, "LE-5", format!("{word:04X}h, without a request since the last answer"));
            return;
        }
        let (late, limit) = (now.saturating_sub(asked.left), asked.timeout(&self.host));
        self.is_busy = false;
        if asked.is_missed {
            let settled =
                if late > limit.saturating_add(self.host.settle) { "settle" } else { "the timeout" };
            let text = format!("an answer {} after its frame: {settled} is too short", ms(late));
            report.assumption(CONTROLLER, "LE-72", text);
        }
        let is_interpreted = asked.class == Some(Class::Interpreted);
        let budget = self.controller.tick.saturating_add(line(message, &self.host));
        if is_interpreted && asked.is_prompt && !asked.is_missed && late > budget.saturating_add(JITTER) {
            let text = format!("answered {} after a frame of {} bytes", ms(late), asked.length);
            report.budget(CONTROLLER, "LE-99", text);
        }
        if of_half && !asked.is_missed && late > self.host.max_pause.saturating_add(self.host.reply_time) {
            let text = format!("an error code {} after its frame: reply_time is too short", ms(late));
            report.assumption(CONTROLLER, "LE-72", text);
        }
        match refusal {
            // The rest of the frame may still be answered.
            Some(Refusal::BadFrame) if asked.is_divided => asked.is_divided = false,
            Some(refusal) => {
                asked.is_answered = true;
                asked.is_wanted =
                    refusal == Refusal::BadChecksum && asked.resent < self.host.resends && !asked.is_missed;
                if has_values {
                    report.rule(CONTROLLER, "LE-25", format!("the error code {word:04X}h with values"));
                }
            }
            None => {
                asked.is_answered = true;
                if asked.word != Some(word) {
                    let found =
                        asked.word.map_or("a frame without one".into(), |word| format!("{word:04X}h"));
                    report.rule(CONTROLLER, "LE-25", format!("the word {word:04X}h answers {found}"));
                } else if has_values && matches!(asked.class, Some(Class::Interpreted | Class::Immediate)) {
                    report.rule(CONTROLLER, "LE-25", format!("an echo of {word:04X}h with values"));
                }
            }
        }
        self.open.corrupt = 0;
    }
}

/// Returns the time for which an earlier host's frame may still be answered (LE-64).
fn drain(host: &HostConfig) -> Duration {
    let line = transmission_time(host.longest_frame, host.baud);
    [host.max_pause, host.earlier_execution, host.settle].into_iter().fold(line, Duration::saturating_add)
}
