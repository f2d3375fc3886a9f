//! Both machines, as the model sees them.

use val2_alter::controller::machine::{
    self as controller, ControllerMachine, DueMessage, ExceptionHandling, ReplyEffect,
};
use val2_alter::host::machine::{self as host, HostMachine};
use val2_alter::{Exception, ExceptionOutcome, MotionPhase};

use crate::model::DrawnMachine;

impl DrawnMachine for HostMachine {
    fn action_name(action: &Self::Action) -> String {
        use host::{Action, PreviousReply};
        let judged = |PreviousReply { missed, rejected, outcome, .. }| {
            let outcome = match outcome {
                None => "",
                Some((_, ExceptionOutcome::Done)) => "exception done",
                Some((_, ExceptionOutcome::NotDone)) => "exception not done",
                Some((_, ExceptionOutcome::Unknown(_))) => "exception unknown",
            };
            list(&[
                if missed { "missed" } else { "" },
                if rejected.is_some() { "rejected" } else { "" },
                outcome,
            ])
        };
        let with = |it, other: &str| list(&[&judged(it), other]);
        match *action {
            Action::Nothing | Action::Refuse(_) | Action::EndFrame => String::new(),
            Action::Missed => "missed".into(),
            Action::Stale => "target stale".into(),
            Action::Asked(it) => judged(it),
            Action::Stopped(it) => with(it, "stopped"),
            Action::Exception(exception, outcome) => {
                judged(PreviousReply { outcome: Some((exception, outcome)), ..PreviousReply::default() })
            }
            Action::Ended(outcome) => with(PreviousReply { outcome, ..PreviousReply::default() }, "ended"),
            Action::Lost { missed, outcome, .. } => {
                with(PreviousReply { missed, outcome, ..PreviousReply::default() }, "lost")
            }
            Action::SentStart(code) => format!("{code:?}").to_lowercase(),
            Action::SentReply(Exception::None) => "reply".into(),
            Action::SentReply(_) => "reply with the exception".into(),
        }
    }
}

impl DrawnMachine for ControllerMachine {
    fn action_name(action: &Self::Action) -> String {
        use controller::Action;
        let start = |outcome: Option<controller::StartOutcome>| {
            outcome.map(|outcome| format!("{outcome:?}").to_lowercase()).unwrap_or_default()
        };
        match action {
            Action::Nothing | Action::Refuse(_) | Action::Begin | Action::Rest => String::new(),
            Action::Sent(DueMessage::Start(_)) => "start message".into(),
            Action::Sent(DueMessage::Motion(MotionPhase::Running, _)) => "standard message".into(),
            Action::Sent(DueMessage::Motion(MotionPhase::Interrupted, _)) => {
                "standard message, interrupted".into()
            }
            Action::Sent(DueMessage::End(_)) => "ended, end message".into(),
            Action::Take(taken, handling) => list(&[
                if *taken == ReplyEffect::Moves { "move" } else { "" },
                match handling {
                    None => "",
                    Some(ExceptionHandling::Subroutine(_) | ExceptionHandling::Abort(_)) => "exception",
                },
            ]),
            Action::Start(outcome) => start(Some(*outcome)),
            Action::BadStart(_, outcome) => list(&["bad reply", &start(*outcome)]),
            Action::BadReply(_) | Action::Missing => "bad reply".into(),
            Action::End(_) => "ended".into(),
            Action::Stray => "stray".into(),
        }
    }
}

fn list(names: &[&str]) -> String {
    let names: Vec<&str> = names.iter().copied().filter(|name| !name.is_empty()).collect();
    names.join(", ")
}
