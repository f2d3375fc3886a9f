//! Both machines, as the model sees them.

use val2_alter::machine::{
    Answer, ControllerActions, ControllerInput, ControllerMachine, HostActions, HostInput, HostMachine,
    Outgoing, Taken,
};
use val2_alter::{ControllerConfig, Exception, ExceptionOutcome, HostConfig, MotionPhase};

use crate::model::{Machine, forward};

impl Machine for HostMachine {
    const END: &'static str = "host";
    type Input = HostInput;
    type Action = HostActions;
    type Config = HostConfig;

    forward!();

    fn action_name(actions: &HostActions) -> String {
        let send = actions.send.map(|answer| match answer {
            Answer::Start(code) => format!("{code:?}").to_lowercase(),
            Answer::Reply { exception: Exception::None, .. } => "reply".into(),
            Answer::Reply { .. } => "reply with the exception".into(),
        });
        let outcome = actions.outcome.map(|(_, outcome)| match outcome {
            ExceptionOutcome::Done => "exception done".into(),
            ExceptionOutcome::NotDone => "exception not done".into(),
            ExceptionOutcome::Unknown(_) => "exception unknown".into(),
        });
        let flags = [
            (actions.missed, "missed"),
            (actions.rejected.is_some(), "rejected"),
            (actions.stale, "target stale"),
            (actions.stopped, "stopped"),
            (actions.ended, "ended"),
            (actions.lost.is_some(), "lost"),
        ];
        let flags = flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.into());
        flags.chain(outcome).chain(send).collect::<Vec<String>>().join(", ")
    }
}

impl Machine for ControllerMachine {
    const END: &'static str = "controller";
    type Input = ControllerInput;
    type Action = ControllerActions;
    type Config = ControllerConfig;

    forward!();

    fn action_name(actions: &ControllerActions) -> String {
        let send = actions.send.map(|message| match message {
            Outgoing::Start(_) => "start message",
            Outgoing::Motion(MotionPhase::Running, _) => "standard message",
            Outgoing::Motion(MotionPhase::Interrupted, _) => "standard message, interrupted",
            Outgoing::End(_) => "end message",
        });
        let start = actions.start.map(|outcome| format!("{outcome:?}").to_lowercase());
        let flags = [
            (actions.taken == Some(Taken::Moves), "move"),
            (actions.bad_reply.is_some(), "bad reply"),
            (actions.exception.is_some(), "exception"),
            (actions.stray, "stray"),
            (actions.ended.is_some(), "ended"),
        ];
        let flags = flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.to_string());
        flags.chain(start).chain(send.map(Into::into)).collect::<Vec<_>>().join(", ")
    }
}
