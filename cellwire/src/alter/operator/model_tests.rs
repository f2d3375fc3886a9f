use val2_alter::{End, ErrorCode, List};

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::*;
use crate::alter::operator::commands::Command;
use crate::alter::{LIMITS, Order};
use cellwire_io::trace::TraceArgs;

const MS: Duration = Duration::from_millis(1);

pub(crate) fn model() -> Model {
    let port = |path: &str, baud| PortConfig { path: path.into(), baud };
    let trace = |name| TraceArgs::off().start_kept(name);
    let input = InputConfig::Ball(port("/dev/b", 9600));
    let ports = Ports { robot: port("/dev/r", 38_400), input, viewer: None };
    let traces = Traces { robot: trace("r"), ball: trace("b"), viewer: trace("v") };
    Model::new(ports, traces, &HostConfig::default(), Profile::for_limits(LIMITS, 100))
}

fn press(model: &mut Model, code: KeyCode) -> Option<Command> {
    model.key(KeyEvent::new(code, KeyModifiers::NONE), MS)
}

fn last(model: &Model) -> &str {
    model.messages.back().map_or("", |(_, text)| text)
}

#[test]
fn a_answers_v_refuses_and_q_ends() {
    let mut model = model();
    let order = |order| Some(Command::Order(order));
    assert_eq!(press(&mut model, KeyCode::Char('a')), order(Order::Policy(Policy::Accept)));
    assert_eq!(press(&mut model, KeyCode::Char('V')), order(Order::Policy(Policy::Refuse)));
    assert_eq!(model.policy, Policy::Refuse);
    assert_eq!(press(&mut model, KeyCode::Enter), order(Order::Confirm));
    assert_eq!(press(&mut model, KeyCode::Char('q')), order(Order::End));
    assert!(!model.has_ended());
    model.take(2 * MS, Notification::Ended);
    assert!(model.has_ended());
    let mut unfinished = |state| {
        model.take(2 * MS, Notification::State(state));
        model.unfinished().unwrap_or_default()
    };
    assert_eq!(unfinished(HostState::Idle), "");
    assert!(unfinished(HostState::Silent).contains("before the robot reported"));
    assert!(unfinished(HostState::Stopping).contains("before the values were zero"));
}

/// The order itself is given by the thread that reads the keys.
#[test]
fn a_stop_leaves_every_view_and_answers_no_start_any_more() {
    for view in [View::Main, View::Options, View::Keys, View::Debug(1)] {
        for key in [KeyCode::Esc, KeyCode::Char(' ')] {
            let mut model = model();
            press(&mut model, KeyCode::Char('a'));
            model.view = view;
            assert_eq!(press(&mut model, key), None);
            assert_eq!((model.view, model.policy), (View::Main, Policy::Ignore));
            assert_eq!(last(&model), "STOP: coming to rest; A answers the robot again");
        }
    }
}

#[test]
fn a_start_in_another_mode_names_both() {
    let mut model = model();
    press(&mut model, KeyCode::Char('a'));
    model.take(MS, Notification::Start(Start::new(Mode(22), List::EMPTY)));
    assert_eq!(last(&model), "start refused: the robot has mode 22, expected 23");
    assert_eq!(model.refused, Some(Mode(22)));
    model.take(MS, Notification::Start(Start::new(Mode(23), List::EMPTY)));
    assert_eq!((last(&model), model.refused), ("start, mode 23: accepted", None));
}

#[test]
fn a_position_is_old_when_the_next_message_is_missing() {
    let mut model = model();
    model.pass_time(9000 * MS);
    assert_eq!(model.position_age(), None, "there is none");
    let motion = Motion {
        phase: val2_alter::MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: val2_alter::SegmentStatus::Normal,
        segment: 1,
        percent: 0,
        transform: None,
    };
    model.take(9000 * MS, Notification::Motion(motion));
    model.pass_time(9042 * MS);
    assert_eq!(model.position_age(), None);
    model.pass_time(9043 * MS);
    assert_eq!(model.position_age(), Some(43 * MS));
}

#[test]
fn ports_are_tested_only_without_alter() {
    let mut model = model();
    assert_eq!(press(&mut model, KeyCode::Char('t')), Some(Command::Probe));
    model.take(MS, Notification::State(HostState::Running));
    assert_eq!(press(&mut model, KeyCode::Char('t')), None);
    assert_eq!(last(&model), "port test: not while ALTER runs");
}

#[test]
fn the_ball_test_counts_for_three_seconds() {
    let mut model = model();
    model.take(MS, Notification::BallMissed);
    press(&mut model, KeyCode::Char('k'));
    model.take(MS, Notification::BallMissed);
    model.pass_time(3000 * MS);
    assert_eq!(last(&model), "ball test: 3 s");
    model.pass_time(3001 * MS);
    assert_eq!(last(&model), "ball: 0 packets, 1 missed, 0 corrupt");
    press(&mut model, KeyCode::Char('w'));
    assert_eq!(last(&model), "workstation test: there is none; use --viewer PORT");
}

#[test]
fn the_options_do_what_the_source_lists() {
    let mut model = model();
    let mut option = |digit| {
        model.view = View::Main;
        press(&mut model, KeyCode::Char('o'));
        let command = press(&mut model, KeyCode::Char(digit));
        (command, model.view, last(&model).to_owned())
    };
    assert_eq!(option('1'), (None, View::Main, "ball: /dev/b at 9600 baud".into()));
    assert_eq!(option('2').2, "profile: all axes DOM, speed 100 %, dead zone 4 %");
    assert_eq!(option('f').2, "profile: TRA DOM, speed 100 %, dead zone 4 %");
    assert_eq!(option('-').2, "profile: TRA DOM, speed 95 %, dead zone 4 %");
    let (command, view, text) = option('d');
    assert_eq!((view, text.as_str()), (View::Options, "profile: TRA DOM, speed 95 %, dead zone 6 %"));
    let Some(Command::Order(Order::Profile(profile))) = command else { panic!("{command:?}") };
    assert_eq!((profile.speed, profile.dead_zone), (95, 6));
    assert_eq!(option('4').2, "0 pictures, own thread; replies p99 0.00 ms");
    let on = "clamp on: the program must name a subroutine";
    assert_eq!(option('5'), (Some(Command::Order(Order::GripperKeys(true))), View::Main, on.into()));
    assert_eq!(option('5').0, Some(Command::Order(Order::GripperKeys(false))));
    assert_eq!(option('3').1, View::Debug(0));
    press(&mut model, KeyCode::Tab);
    assert_eq!(model.view, View::Debug(1));
    assert_eq!((press(&mut model, KeyCode::Char('m')), model.view), (None, View::Main));
}

#[test]
fn the_end_of_alter_is_reported() {
    let mut model = model();
    model.take(MS, Notification::End(End { error: ErrorCode::Timeout }));
    assert_eq!(last(&model), "the robot ended ALTER: timeout");
    assert_eq!(model.control, ("ended", 0xE6, "timeout"));
}

/// An adapter that delays bytes, and cannot be recognised.
#[test]
fn a_second_timeout_in_a_row_names_the_latency_timer() {
    const ENDED: &str = "the robot ended ALTER: timeout";
    const ADVICE: &str = "the replies leave in time and arrive late: set the adapter's latency timer to 1 ms, see docs/alter.md";
    let end = || Notification::End(End { error: ErrorCode::Timeout });
    let mut model = model();
    let found: Vec<String> = [(); 3]
        .map(|()| {
            model.take(MS, end());
            last(&model).to_owned()
        })
        .into();
    assert_eq!(found, [ENDED, ADVICE, ENDED]);
    // Replies that left late have another cause, and so has a timeout after some time of work.
    for cause in [Notification::Missed, Notification::End(End { error: ErrorCode::Format })] {
        model.take(MS, cause);
        model.take(MS, end());
        assert_eq!(last(&model), ENDED);
    }
    model.take(MS, end());
    assert_eq!(last(&model), ADVICE);
    model.counts.cycles += 1000;
    model.take(MS, end());
    assert_eq!(last(&model), ENDED);
}

/// The screen shows the robot's messages about its arm, and bytes that reach the host in pieces or late.
#[test]
fn what_stops_the_arm_and_what_is_corrupt_or_late_is_shown() {
    use crate::alter::operator::screen::tests::{drawn, rows};
    let mut model = model();
    let head = |model: &Model| rows(&drawn(model))[..2].join("\n");
    let status = |segment_status| Motion {
        phase: val2_alter::MotionPhase::Running,
        error: ErrorCode::None,
        segment_status,
        segment: 1,
        percent: 0,
        transform: None,
    };
    assert!(!head(&model).contains("corrupt"));
    for _ in 0..29 {
        let error = val2_alter::DecodeError::StartMark { offset: 0, length: 1 };
        model.take(2000 * MS, Notification::Corrupt(error));
    }
    assert!(head(&model).contains("missed 0  corrupt 29  held 0"), "{}", head(&model));
    model.take(2050 * MS, Notification::Delayed);
    assert!(head(&model).contains("missed 0  corrupt 29  delayed 1  held 0"), "{}", head(&model));
    model.take(2100 * MS, Notification::Motion(status(SegmentStatus::StoppedForFault)));
    model.take(2100 * MS, Notification::Latch(Latch::Halted));
    assert!(head(&model).contains(" ROBOT STOPPED  segment status 10, stop: fault"), "{}", head(&model));
    assert_eq!(last(&model), "the robot has stopped the arm: segment status 10, stop: fault");
    model.take(2200 * MS, Notification::Latch(Latch::Disarmed(Cause::Halt)));
    assert!(head(&model).contains("the robot has stopped the arm: release for 0.3 s"), "{}", head(&model));
    model.take(3500 * MS, Notification::BallLate);
    assert!(head(&model).contains("the ball answers late"), "{}", head(&model));
    assert_eq!((last(&model), model.counts.ball_late), ("ball: it answers late, and no packet counts", 1));
    model.pass_time(4500 * MS);
    assert!(!head(&model).contains("late"), "{}", head(&model));
}

#[test]
fn a_question_mark_shows_the_keys_until_another_key() {
    let mut model = model();
    assert_eq!((press(&mut model, KeyCode::Char('?')), model.view), (None, View::Keys));
    assert_eq!((press(&mut model, KeyCode::Char('a')), model.view), (None, View::Main));
}

#[test]
fn a_line_that_returns_what_is_sent_is_named_with_the_setting() {
    let mut model = model();
    model.take(MS, Notification::Echo("ball", EchoError::NotSet { length: 1 }));
    assert_eq!(last(&model), "ball: the line returns what is sent: set ball.echo=true");
    model.take(MS, Notification::Echo("robot", EchoError::NotSet { length: 1 }));
    assert!(last(&model).starts_with("robot: the line returns what is sent: ALTER needs four wires"));
    let collision = EchoError::Collision { offset: 0, expected: 5, found: 8 };
    model.take(2000 * MS, Notification::Echo("ball", collision));
    assert!(
        last(&model).starts_with("ball: byte 0 of what was sent, 0x05, came back as 0x08"),
        "{}",
        last(&model)
    );
}
