//! The screen as text in each state, as `screens/` has it.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use isra_ball::{Keys, Packet, Status};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use val2_alter::{ErrorCode, List, LostReason, Motion, MotionPhase, SegmentStatus, Start, Transform};

use super::tests::{drawn, rows};
use super::*;
use crate::alter::Notification;
use crate::alter::input::Sample;
use crate::alter::operator::model::tests::model;

const MS: Duration = Duration::from_millis(1);

/// Returns the screen as text, followed by the columns and rows that are not in the terminal's own colors.
fn picture(model: &Model) -> String {
    let buffer = drawn(model);
    let mut out: String = rows(&buffer).iter().map(|row| format!("{}\n", row.trim_end())).collect();
    out += "\n";
    for (row, cells) in (1..).zip(buffer.content().chunks(80)) {
        let mut column = 1;
        for run in cells.chunk_by(|a, b| (a.fg, a.bg) == (b.fg, b.bg)) {
            let (first, ink) = (column, (run[0].fg, run[0].bg));
            column += run.len();
            if ink != (Color::Reset, Color::Reset) {
                writeln!(out, "row {row}, columns {first} to {}: {} on {}", column - 1, ink.0, ink.1)
                    .unwrap();
            }
        }
    }
    out
}

/// Returns a cell in which ALTER runs and the ball is pushed like this.
fn running(push: i8, values: i16) -> Model {
    let mut model = model();
    model.key(KeyEvent::new(KeyCode::Char('a'), KeyModifiers::NONE), 800 * MS);
    model.take(1000 * MS, Notification::Start(Start::new(Mode(23), List::EMPTY)));
    model.take(1000 * MS, Notification::State(HostState::Running));
    let motion = Motion {
        phase: MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: SegmentStatus::Normal,
        segment: 2,
        percent: 8192,
        transform: Some(Transform([16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16])),
    };
    model.take(1028 * MS, Notification::Motion(motion));
    let force = [push, 0, 0];
    let packet =
        Packet { sensor_type: 0, sensor: 0, status: Status::Fresh, force, moment: [0; 3], keys: Keys(0) };
    model.take(1030 * MS, Notification::Ball(packet, 14 * MS));
    let axes = [i16::from(push) * 8, 0, 0, 0, 0, 0];
    let hand = Sample { axes, buttons: 0, fresh_until: 1100 * MS };
    model.take(1030 * MS, Notification::Hand(hand));
    let [demand, values] = [[values.signum() * 63, 0, 0, 0, 0, 0], [values, 0, 0, 0, 0, 0]];
    model.take(1030 * MS, Notification::Reply { demand, values, thinking: MS / 8, held: false });
    model
}

fn latched(mut model: Model, latch: Latch) -> Model {
    model.take(1031 * MS, Notification::Latch(latch));
    model
}

#[test]
fn the_screen_has_a_picture_in_each_state() {
    let fresh_until = 1100 * MS;
    let mut stopped = running(90, 0);
    stopped.key(KeyEvent::new(KeyCode::Char(' '), KeyModifiers::NONE), 1040 * MS);
    stopped.take(1400 * MS, Notification::Stopped);
    stopped.take(1430 * MS, Notification::State(HostState::Idle));
    stopped.pass_time(1900 * MS);
    let mut input_lost = latched(running(90, 0), Latch::Armed { fresh_until });
    input_lost.take(1031 * MS, Notification::PortLost("ball", "Broken pipe".into()));
    input_lost.take(1031 * MS, Notification::BallStale);
    let mut robot_lost = running(90, 0);
    robot_lost.take(1200 * MS, Notification::Lost(LostReason::Silence));
    robot_lost.take(1200 * MS, Notification::State(HostState::Idle));
    robot_lost.pass_time(3000 * MS);
    let mut refused = model();
    refused.key(KeyEvent::new(KeyCode::Char('a'), KeyModifiers::NONE), 800 * MS);
    refused.take(1000 * MS, Notification::Start(Start::new(Mode(22), List::EMPTY)));
    let pictures = [
        ("disarmed", latched(running(90, 0), Latch::Disarmed(Cause::Start))),
        ("armed", latched(running(0, 0), Latch::Armed { fresh_until })),
        ("moving", latched(running(90, 56), Latch::Armed { fresh_until })),
        ("stopped", latched(stopped, Latch::Off(Cause::Stop))),
        ("input-lost", latched(input_lost, Latch::Disarmed(Cause::InputLost))),
        ("robot-lost", latched(robot_lost, Latch::Off(Cause::NoAlter))),
        ("start-refused", refused),
    ];
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("screens");
    for (state, model) in pictures {
        let (drawn, file) = (picture(&model), folder.join(format!("{state}.txt")));
        // `DRAW_SCREENS=1 cargo test -p cellwire pictures` draws them again.
        if std::env::var_os("DRAW_SCREENS").is_some() {
            std::fs::write(&file, &drawn).unwrap();
        }
        assert!(std::fs::read_to_string(&file).unwrap() == drawn, "{} is another picture", file.display());
    }
}

#[test]
fn a_small_terminal_keeps_the_state_the_messages_and_how_to_quit() {
    let mut model = model();
    model.take(Duration::from_millis(31), Notification::PortLost("viewer", "the port is gone".into()));
    let shown = |model: &Model| {
        let mut terminal = Terminal::new(TestBackend::new(60, 15)).unwrap();
        terminal.draw(|frame| draw(frame, model)).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let cells: Vec<_> = buffer.content().iter().map(|cell| cell.symbol()).collect();
        cells.chunks(60).map(|row| row.concat()).collect::<Vec<_>>()
    };
    let rows = shown(&model);
    assert!(rows[2].starts_with("┌Messages──"), "{rows:#?}");
    assert!(rows.iter().any(|row| row.contains("viewer: the port is gone")), "{rows:#?}");
    assert!(rows[6].starts_with("┌Input: deflection in ‰; asked → sent in 1/32 mm and 1/182°┐"), "{rows:#?}");
    assert!(rows[13].starts_with("│Space/Esc STOP (A)lter (V)refuse (?)keys (Q)uit "), "{rows:#?}");
    model.view = View::Keys;
    let rows = shown(&model);
    for key in ["STOP", "A  answer", "Q  come to rest and quit", "any other key: back"] {
        assert!(rows.iter().any(|row| row.contains(key)), "{key} {rows:#?}");
    }
}
