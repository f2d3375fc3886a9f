//! The script of the simulated robot: interruptions, errors, ends and restarts that its host has not caused, and their times.

use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use cellwire_sim::puma::Incident;
use serde::{Deserialize, Serialize};
use val2_alter::{ErrorCode, SegmentStatus};

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
pub struct Script(pub Vec<(Duration, Incident)>);

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
        let each = |(at, incident)| format!("{}ns {}", Duration::as_nanos(&at), text(incident));
        incidents.into_iter().map(each).collect()
    }
}

fn parse(text: &str) -> Result<(Duration, Incident)> {
    let (at, text) = text.trim_start().split_once(char::is_whitespace).unwrap_or((text, ""));
    Ok((time(at)?, incident(text)?))
}

fn time(word: &str) -> Result<Duration> {
    humantime::parse_duration(word).with_context(|| format!("`{word}` is not a time such as 2s or 500ms"))
}

/// Parses an incident without its time.
pub(super) fn incident(text: &str) -> Result<Incident> {
    let mut words = text.split_whitespace();
    let mut word = || words.next().unwrap_or_default();
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
        _ => bail!("an incident is interrupt TIME, misread ERROR, corrupt, status N, finish or restart"),
    };
    match words.next() {
        Some(word) => bail!("unexpected word `{word}`"),
        None => Ok(incident),
    }
}

fn names() -> String {
    ERRORS.map(|(name, _)| name).join(", ")
}

/// Returns an incident in its written form, without its time.
pub fn text(incident: Incident) -> String {
    match incident {
        Incident::Interrupt(time) => format!("interrupt {}", humantime::format_duration(time)),
        Incident::Misread(error) => {
            let name = ERRORS.iter().find(|(_, known)| *known == error).map_or("", |(name, _)| name);
            format!("misread {name}")
        }
        Incident::Corrupt => "corrupt".into(),
        Incident::Status(status) => format!("status {}", u8::from(status)),
        Incident::Finish => "finish".into(),
        Incident::Restart => "restart".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let Script(incidents) = script(&texts).unwrap();
        assert_eq!(incidents[0].0, Duration::from_millis(500));
        let seen: Vec<_> = incidents.into_iter().map(|(_, incident)| text(incident)).collect();
        assert_eq!(seen, ["interrupt 1s", "misread mark", "corrupt", "restart", "finish", "status 13"]);
    }

    #[test]
    fn what_is_no_incident_is_refused_and_what_to_give_is_said() {
        let error = |text| script(&[text]).unwrap_err();
        assert_eq!(
            error("soon restart"),
            "`soon restart`: `soon` is not a time such as 2s or 500ms: expected number at 0"
        );
        assert!(
            error("1s").ends_with(
                "an incident is interrupt TIME, misread ERROR, corrupt, status N, finish or restart"
            )
        );
        assert_eq!(
            error("1s misread it"),
            "`1s misread it`: misread what: checksum, format, overflow, incomplete, mark, timeout"
        );
        assert_eq!(error("1s status 14"), "`1s status 14`: a segment status is 1 to 13");
        assert_eq!(error("1s restart now"), "`1s restart now`: unexpected word `now`");
    }
}
