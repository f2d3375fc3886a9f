//! What happens to the simulated robot, and when: interruptions, errors, ends and restarts that its host has not caused.

use core::fmt;
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use serde::{Deserialize, Serialize};
use val2_alter::{ErrorCode, Frame, Framing, SegmentStatus};

/// The shape of the setting.
pub(super) const SHAPE: &str = "[texts such as \"2s interrupt 1s\", \"5s misread checksum\"]";

/// The error codes that a reply can be given, by their names (§3.2.2).
const ERRORS: [(&str, ErrorCode); 6] = [
    ("checksum", ErrorCode::Checksum),
    ("format", ErrorCode::Format),
    ("overflow", ErrorCode::Overflow),
    ("incomplete", ErrorCode::Incomplete),
    ("mark", ErrorCode::Mark),
    ("timeout", ErrorCode::Timeout),
];

/// The incidents in the order of their times, which begin with the first ALTER.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct Script(Vec<(Duration, Incident)>);

/// What can happen. It waits until ALTER runs; what happens on the line, until it runs or starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Incident {
    /// The program runs a subroutine that takes so long.
    Interrupt(Duration),
    /// The next reply reaches the controller so that it has this error.
    Misread(ErrorCode),
    /// The next message leaves the controller with a wrong checksum.
    Corrupt,
    /// The messages say this of the motion segment from now on.
    Status(SegmentStatus),
    /// The program ends ALTER.
    Finish,
    /// The controller is switched off and on, and its program started: no message says that ALTER has ended.
    Restart,
}

impl Script {
    /// The next incident, if its time has come.
    pub(super) fn due(&self, time: Duration) -> Option<Incident> {
        self.0.first().filter(|(at, _)| *at <= time).map(|(_, incident)| *incident)
    }

    /// The incident has happened.
    pub(super) fn advance(&mut self) {
        if !self.0.is_empty() {
            self.0.remove(0);
        }
    }
}

impl TryFrom<Vec<String>> for Script {
    type Error = String;

    fn try_from(texts: Vec<String>) -> Result<Self, String> {
        let each = |text: String| parse(&text).map_err(|error| format!("`{text}`: {error:#}"));
        let mut incidents = texts.into_iter().map(each).collect::<Result<Vec<_>, _>>()?;
        incidents.sort_by_key(|(at, _)| *at);
        Ok(Self(incidents))
    }
}

impl From<Script> for Vec<String> {
    fn from(Script(incidents): Script) -> Self {
        let each = |(at, incident)| format!("{}ns {incident}", Duration::as_nanos(&at));
        incidents.into_iter().map(each).collect()
    }
}

fn parse(text: &str) -> Result<(Duration, Incident)> {
    let mut words = text.split_whitespace();
    let mut word = || words.next().unwrap_or_default();
    let time = |word: &str| {
        humantime::parse_duration(word).with_context(|| format!("`{word}` is no time such as 2s or 500ms"))
    };
    let at = time(word())?;
    let incident = match word() {
        "interrupt" => Incident::Interrupt(time(word())?),
        "misread" => {
            let name = word();
            let error = ERRORS.iter().find(|(known, _)| *known == name);
            Incident::Misread(error.with_context(|| format!("misread what: {}", names()))?.1)
        }
        "corrupt" => Incident::Corrupt,
        "status" => match word().parse() {
            Ok(code @ 1..=13) => Incident::Status(SegmentStatus::from(code)),
            _ => bail!("a segment status is 1 to 13"),
        },
        "finish" => Incident::Finish,
        "restart" => Incident::Restart,
        _ => bail!("give a time, then interrupt TIME, misread ERROR, corrupt, status N, finish or restart"),
    };
    match words.next() {
        Some(word) => bail!("`{word}` is one word too many"),
        None => Ok((at, incident)),
    }
}

fn names() -> String {
    ERRORS.map(|(name, _)| name).join(", ")
}

/// As it was written, without its time.
impl fmt::Display for Incident {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interrupt(time) => write!(f, "interrupt {}", humantime::format_duration(*time)),
            Self::Misread(error) => {
                let name = ERRORS.iter().find(|(_, known)| known == error).map_or("", |(name, _)| name);
                write!(f, "misread {name}")
            }
            Self::Corrupt => write!(f, "corrupt"),
            Self::Status(status) => write!(f, "status {}", u8::from(*status)),
            Self::Finish => write!(f, "finish"),
            Self::Restart => write!(f, "restart"),
        }
    }
}

/// What arrives in the place of a reply, so that a controller has this error with it.
pub(super) fn misread(error: ErrorCode, framing: Framing) -> Vec<u8> {
    // An exception byte and a select byte are a whole reply; with X selected a word is missing.
    let data: &[u8] = match error {
        ErrorCode::Format => &[0, 1],
        ErrorCode::Overflow => &[0; 15],
        _ => &[0, 0],
    };
    let mut bytes = [0; Frame::MAX_LEN];
    let encoded = Frame::new(data).and_then(|frame| frame.encode(framing, &mut bytes));
    let mut reply = bytes.get(..encoded.unwrap_or_default()).unwrap_or_default().to_vec();
    match error {
        ErrorCode::Checksum => spoil(&mut reply),
        ErrorCode::Incomplete => reply.truncate(reply.len() / 2),
        ErrorCode::Mark => {
            // DLE ETX, and the sum of zeros.
            if let [.., end, _sum] = reply.as_mut_slice() {
                *end = 0x04;
            }
        }
        ErrorCode::Timeout => reply.clear(),
        _ => {}
    }
    reply
}

/// Makes the checksum of a frame wrong.
pub(super) fn spoil(frame: &mut [u8]) {
    if let Some(sum) = frame.last_mut() {
        *sum ^= 0x55;
    }
}

#[cfg(test)]
mod tests {
    use robot_session::Session as _;
    use val2_alter::{Controller, ControllerConfig, ControllerEvent, LeadingDle};

    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn script(texts: &[&str]) -> Result<Script, String> {
        Script::try_from(texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn incidents_are_read_in_the_order_of_their_times() {
        let texts = [
            "3s corrupt",
            "500ms interrupt 1s",
            "3s restart",
            "2s misread mark",
            "9s status 13",
            "4s finish",
        ];
        let mut script = script(&texts).unwrap();
        assert_eq!(script.due(499 * MS), None);
        let mut seen = Vec::new();
        while let Some(incident) = script.due(Duration::MAX) {
            seen.push(incident.to_string());
            script.advance();
        }
        assert_eq!(seen, ["interrupt 1s", "misread mark", "corrupt", "restart", "finish", "status 13"]);
    }

    #[test]
    fn what_is_no_incident_is_refused_and_what_to_give_is_said() {
        let error = |text| script(&[text]).unwrap_err();
        assert_eq!(
            error("soon restart"),
            "`soon restart`: `soon` is no time such as 2s or 500ms: expected number at 0"
        );
        assert!(error("1s").ends_with(
            "give a time, then interrupt TIME, misread ERROR, corrupt, status N, finish or restart"
        ));
        assert_eq!(
            error("1s misread it"),
            "`1s misread it`: misread what: checksum, format, overflow, incomplete, mark, timeout"
        );
        assert_eq!(error("1s status 14"), "`1s status 14`: a segment status is 1 to 13");
        assert_eq!(error("1s restart now"), "`1s restart now`: `now` is one word too many");
    }

    #[test]
    fn a_controller_has_each_error_with_what_it_is_given() {
        let other = Framing {
            leading_dle: LeadingDle::One,
            negated_sum: true,
            stuffed_checksum: true,
            ignore_spare_select: true,
        };
        for framing in [Framing::DEFAULT, other] {
            for (name, error) in ERRORS {
                let config = ControllerConfig { framing, gap: None, ..ControllerConfig::default() };
                let mut controller = Controller::new(config).unwrap();
                let mut out = [0; Frame::MAX_LEN];
                controller.handle_connected(Duration::ZERO);
                controller.start(Duration::ZERO).unwrap();
                controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
                let mut accept = [0; Frame::MAX_LEN];
                let length = Frame::new(&[0]).unwrap().encode(framing, &mut accept).unwrap();
                controller.handle_input(5 * MS, &accept[..length]);
                controller.poll_transmit(28 * MS, &mut out).unwrap();
                controller.handle_input(40 * MS, &misread(error, framing));
                controller.handle_timeout(56 * MS);
                let mut events = core::iter::from_fn(|| controller.poll_event());
                assert_eq!(events.next(), Some(ControllerEvent::Started));
                assert_eq!(events.next(), Some(ControllerEvent::BadReply(error)), "{name} {framing:?}");
            }
        }
    }
}
