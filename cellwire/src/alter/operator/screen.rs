//! The windows of the operator's screen (§10.6).

use cellwire_motion::latch::{Cause, Latch};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph};
use val2_alter::{Accumulation, CoordinateFrame, HostState, Mode, Polarity, Policy};

use super::model::{Model, View, cause_text, segment_words};
use crate::alter::input::FULL;
use cellwire_sim::puma::Layout as Words;

const AXES: [&str; 6] = ["X ", "Y ", "Z ", "RX", "RY", "RZ"];
/// The style of values that are not live.
const OLD: Style = Style::new().fg(Color::DarkGray);
/// The reasons why the robot could not read a reply, from error code 1 on: three fit the line.
const REASONS: [&str; 7] = ["checksum", "format", "overflow", "incomplete", "marks", "timeout", "code 7"];

/// The least terminal that has room for every window of the source.
const WHOLE: (u16, u16) = (80, 24);
/// The meaning of the keys, the most important first.
const KEYS: [&str; 8] = [
    "Space, Esc  STOP: the arm comes to rest",
    "A  answer the robot's ALTER    V  refuse it",
    "Enter  arm, where --confirm asks for it",
    "Q  come to rest and quit; Ctrl-C too, twice at once",
    "K  test the ball    W  test the workstation",
    "T  test the ports at several baud rates",
    "O  options: ports, input, bytes of a line, gripper",
    "Keyboard: arrows X Y, page Z, Home End RZ, Shift turns",
];

pub(super) fn draw(frame: &mut Frame<'_>, model: &Model) {
    let area = frame.area();
    if model.view == View::Keys || area.width < WHOLE.0 || area.height < WHOLE.1 {
        return draw_small(frame, area, model);
    }
    let rows = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(7),
        Constraint::Length(6),
        Constraint::Min(6),
        Constraint::Length(3),
    ]);
    let [head, top, middle, lower, command] = rows.areas(area);
    draw_head(frame, head, model);
    let columns = Layout::horizontal([Constraint::Length(24), Constraint::Length(14), Constraint::Min(30)]);
    let [mode, initial, messages] = columns.areas(top);
    window(frame, mode, "ALTER mode", mode_lines(model));
    window(frame, initial, "Initial data", initial_lines(model));
    draw_messages(frame, messages, model);
    let columns = Layout::horizontal([
        Constraint::Length(13),
        Constraint::Length(19),
        Constraint::Length(14),
        Constraint::Min(33),
    ]);
    let [alter, control, segment, transform] = columns.areas(middle);
    // A value that no recent message confirms is dimmed.
    let age = model.position_age();
    let dim = |lines: Vec<Line<'static>>| match age {
        None => lines,
        Some(_) => lines.into_iter().map(|line| line.style(OLD)).collect(),
    };
    window(frame, alter, "Alter byte", dim(alter_lines(model)));
    window(frame, control, "Control byte", dim(control_lines(model)));
    window(frame, segment, "Segment", dim(segment_lines(model)));
    let title = match age {
        Some(age) => format!("Transformation, OLD: {:.1} s", age.as_secs_f64()),
        None if model.viewer_holds => "Transformation, viewer: XOFF".into(),
        None => "Transformation".into(),
    };
    window(frame, transform, &title, dim(transform_lines(model)));
    draw_input(frame, lower, model);
    let text = match model.view {
        View::Keys => "Space/Esc STOP",
        View::Options => "Space/Esc STOP (1)Port (2)DOM (F)ilt (D)ead +-Speed (3)IO (4)ms (5)Grip (M)ain",
        View::Debug(_) => "Space/Esc STOP (Tab)next line (A)lter (V)refuse (M)ain (Q)uit",
        View::Main => "Space/Esc STOP (A)lter (V)refuse (K)Ball (W)ork (T)Port (O)pt. (?)keys (Q)uit",
    };
    window(frame, command, "Command", vec![Line::from(text)]);
}

/// Draws a terminal that is too small for all windows: the state, the messages, the input and how to stop and quit; or the keys.
fn draw_small(frame: &mut Frame<'_>, area: Rect, model: &Model) {
    let input = if area.height >= 15 { 6 } else { 0 };
    let rows = Layout::vertical([
        Constraint::Length(2),
        Constraint::Min(3),
        Constraint::Length(if model.view == View::Keys { 0 } else { input }),
        Constraint::Length(3),
    ]);
    let [head, messages, lower, command] = rows.areas(area);
    draw_head(frame, head, model);
    if model.view == View::Keys {
        window(frame, messages, "Keys", KEYS.map(Line::from).into());
    } else {
        draw_messages(frame, messages, model);
        draw_input(frame, lower, model);
    }
    let text = match model.view {
        View::Options => "Space/Esc STOP (1)-(5) (F)ilt (D)ead +- (M)ain",
        View::Keys => "Space/Esc STOP, any other key: back",
        _ => "Space/Esc STOP (A)lter (V)refuse (?)keys (Q)uit",
    };
    window(frame, command, "Command", vec![Line::from(text)]);
}

fn draw_input(frame: &mut Frame<'_>, area: Rect, model: &Model) {
    if let View::Debug(line) = model.view {
        return draw_debug(frame, area, model, line);
    }
    let lines = ball_lines(model);
    match model.input_age() {
        // For the source's robot: a word of ALTER is 1/32 mm, or 360/65536 degrees.
        None => window(frame, area, "Input: deflection in ‰; asked → sent in 1/32 mm and 1/182°", lines),
        Some(what) => {
            let lines = lines.into_iter().map(|line| line.style(OLD)).collect();
            window(frame, area, &format!("Input, {what}: the last values are shown"), lines);
        }
    }
}

/// Draws the state of the arm, in the first line, and the counts.
fn draw_head(frame: &mut Frame<'_>, area: Rect, model: &Model) {
    let (word, why, color) = state(model);
    let counts = &model.counts;
    let reasons: Vec<String> = REASONS
        .iter()
        .zip(counts.rejected.iter().skip(1))
        .filter(|(_, count)| **count > 0)
        .map(|(reason, count)| format!("{reason} {count}"))
        .collect();
    let colon = if reasons.is_empty() { "" } else { ": " };
    // There is room for it when it is needed.
    let seen = |name, count: u64| if count > 0 { format!("{name} {count}  ") } else { String::new() };
    let damage = seen("corrupt", counts.corrupt) + &seen("delayed", counts.delayed);
    let limit = match model.axes {
        val2_alter::AXES => String::new(),
        axes => format!("{axes} of {} axes fit, ", val2_alter::AXES),
    };
    let lines = vec![
        Line::from(vec![
            Span::styled(
                format!(" {word} "),
                Style::new().fg(Color::Black).bg(color).add_modifier(Modifier::BOLD),
            ),
            Span::raw(format!(" {why}")),
        ]),
        Line::from(format!(
            "cycles {}  missed {}  {damage}{limit}held {}  rejected {}{colon}{}  p99 {:.2} ms",
            counts.cycles,
            counts.missed,
            counts.held,
            counts.rejected.iter().sum::<u64>(),
            reasons.join(", "),
            model.thinking.at(0.99).as_secs_f64() * 1e3,
        )),
    ];
    frame.render_widget(Paragraph::new(lines), area);
}

/// Returns the state in a word, the reason, and the operator's possible action.
fn state(model: &Model) -> (&'static str, String, Color) {
    if let (Some(mode), true) = (model.refused, model.state == HostState::Idle) {
        let (mode, expected) = (mode.0, model.mode.0);
        let why = format!("the robot has mode {mode}, expected {expected}: change it, or --set mode={mode}");
        return ("START REFUSED", why, Color::Red);
    }
    if let Some(why) = model.lost.filter(|_| matches!(model.latch, Latch::Off(_))) {
        let answered = match model.policy {
            Policy::Accept => "its next start is answered",
            Policy::Refuse | Policy::Ignore => "A answers it again",
        };
        return ("ROBOT LOST", format!("{why}; {answered}"), Color::Red);
    }
    let rest = |cause| format!("{}: release for 0.3 s", cause_text(cause));
    match model.latch {
        Latch::Off(_) => match (model.state, model.policy) {
            (HostState::Starting, _) => ("STARTING", "the robot begins ALTER".into(), Color::Yellow),
            (HostState::Silent, _) => ("STOPPED", "at rest, ALTER ends".into(), Color::Yellow),
            (HostState::Disconnected, _) => ("ROBOT LOST", "its port is not open".into(), Color::Red),
            (_, Policy::Accept) => ("WAITING", "for the robot to begin ALTER".into(), Color::Yellow),
            (_, Policy::Refuse) => ("REFUSING", "every ALTER, as asked for".into(), Color::Yellow),
            (_, Policy::Ignore) if model.latch == Latch::Off(Cause::Stop) => {
                ("STOPPED", "A answers the robot again".into(), Color::Yellow)
            }
            (_, Policy::Ignore) => ("OFF", "A answers the robot".into(), Color::Gray),
        },
        Latch::Halted => ("ROBOT STOPPED", model.segment_text(), Color::Red),
        Latch::Interrupted => ("INTERRUPTED", "the robot's subroutine runs".into(), Color::Yellow),
        Latch::Disarmed(Cause::InputLost) => {
            ("INPUT LOST", "reconnecting; then release for 0.3 s".into(), Color::Red)
        }
        Latch::Disarmed(_) if model.ball_is_late() => {
            ("DISARMED", "the ball answers late: its adapter, docs/alter.md".into(), Color::Yellow)
        }
        Latch::Disarmed(cause) | Latch::Resting { cause, .. } => ("DISARMED", rest(cause), Color::Yellow),
        Latch::Ready { .. } => ("READY", "Enter arms".into(), Color::Yellow),
        Latch::Armed { .. } if model.values == [0; val2_alter::AXES] => {
            ("ARMED", "the input moves the arm".into(), Color::Green)
        }
        Latch::Armed { .. } => ("MOVING", "Space or Esc stops".into(), Color::LightGreen),
        Latch::Stopping | Latch::Ending { .. } | Latch::Ended => {
            ("STOPPING", "coming to rest".into(), Color::Yellow)
        }
    }
}

fn window(frame: &mut Frame<'_>, area: Rect, title: &str, lines: Vec<Line<'_>>) {
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), area);
}

/// Draws the last messages, each on as many lines as it needs.
fn draw_messages(frame: &mut Frame<'_>, area: Rect, model: &Model) {
    const TIME: usize = 8;
    let [width, room] = [area.width, area.height].map(|cells| usize::from(cells.saturating_sub(2)));
    let mut lines = Vec::new();
    for (at, text) in model.messages.iter().rev().take(room).rev() {
        let mut line = format!("{:1$.2} ", at.as_secs_f64(), TIME - 1);
        let mut used = TIME;
        for word in text.split(' ') {
            let length = word.chars().count();
            if used > TIME && used + 1 + length > width {
                lines.push(Line::from(core::mem::replace(&mut line, " ".repeat(TIME))));
                used = TIME;
            }
            if used > TIME {
                line.push(' ');
                used += 1;
            }
            line.push_str(word);
            used += length;
        }
        lines.push(Line::from(line));
    }
    lines.drain(..lines.len().saturating_sub(room));
    window(frame, area, "Messages", lines);
}

fn draw_debug(frame: &mut Frame<'_>, area: Rect, model: &Model, line: usize) {
    let (name, trace) = model.debugged(line);
    let lines = trace.lines();
    let room = usize::from(area.height.saturating_sub(2));
    let first = lines.len().saturating_sub(room);
    let shown = lines.into_iter().skip(first).map(Line::from).collect();
    window(frame, area, &format!("IO debug: the last bytes of the {name}'s line"), shown);
}

fn mode_lines(model: &Model) -> Vec<Line<'static>> {
    let Some(start) = &model.start else { return vec![Line::from("no start message yet")] };
    let mode = start.mode;
    let words = [
        format!("{} = {:05b}b", mode.0, mode.0),
        match mode.accumulation() {
            Accumulation::Cumulative => "cumulative".into(),
            Accumulation::NonCumulative => "non-cumulative".into(),
        },
        match mode.frame(Polarity::default()) {
            CoordinateFrame::World => "world coordinates".into(),
            CoordinateFrame::Tool => "tool coordinates".into(),
        },
        transform_words(mode).into(),
        if mode.uses_inputs() { "values are used".into() } else { "values are ignored".into() },
    ];
    words.map(Line::from).into()
}

fn transform_words(mode: Mode) -> &'static str {
    match (mode.has_transform(), mode.transform_from_joints()) {
        (false, _) => "no transformation",
        (true, false) => "transf. of set point",
        (true, true) => "transf. from joints",
    }
}

fn initial_lines(model: &Model) -> Vec<Line<'static>> {
    match &model.start {
        None => vec![Line::from("–")],
        Some(start) if start.data.words().is_empty() => vec![Line::from("none")],
        Some(start) => start.data.words().iter().map(|word| Line::from(word.to_string())).collect(),
    }
}

fn alter_lines(model: &Model) -> Vec<Line<'static>> {
    let (phase, control, _) = model.control;
    vec![Line::from(format!("{:02b}", control >> 5 & 3)), Line::from(phase)]
}

fn control_lines(model: &Model) -> Vec<Line<'static>> {
    let (_, control, error) = model.control;
    let style = if control & 7 == 0 { Style::new() } else { Style::new().fg(Color::Red) };
    vec![
        Line::from(format!("{control:08b} = {control:02X}h")),
        Line::styled(format!("error {}", control & 7), style),
        Line::styled(error, style),
    ]
}

fn segment_lines(model: &Model) -> Vec<Line<'static>> {
    let Some(motion) = &model.motion else { return vec![Line::from("–")] };
    vec![
        Line::from(format!("status {}", u8::from(motion.segment_status))),
        Line::from(segment_words(motion.segment_status)),
        Line::from(format!("number {}", motion.segment)),
        Line::from(format!("move   {:.0} %", motion.fraction() * 100.0)),
    ]
}

fn transform_lines(model: &Model) -> Vec<Line<'static>> {
    let Some(transform) = model.motion.as_ref().and_then(|motion| motion.transform) else {
        return vec![Line::from("not transmitted")];
    };
    let pose = Words::COLUMNS.pose(&transform);
    let mut lines = vec![Line::from("    n      o      a        p, mm")];
    for row in 0..3 {
        let at = |v: [f64; 3]| v.get(row).copied().unwrap_or_default();
        lines.push(Line::from(format!(
            "{:6.3} {:6.3} {:6.3}  {:9.2}",
            at(pose.n),
            at(pose.o),
            at(pose.a),
            at(pose.p)
        )));
    }
    lines
}

fn ball_lines(model: &Model) -> Vec<Line<'static>> {
    let Some(hand) = &model.hand else { return vec![Line::from("no values yet")] };
    let keys: String = (0..8).map(|key| if hand.buttons >> key & 1 != 0 { '●' } else { '·' }).collect();
    let head = match &model.ball {
        Some(packet) => format!(
            "type {} sensor {} {:?}  keys {keys}  {:.1} ms  missed {} corrupt {} late {}",
            packet.sensor_type,
            packet.sensor,
            packet.status,
            model.exchange.as_secs_f64() * 1e3,
            model.counts.ball_missed,
            model.counts.ball_corrupt,
            model.counts.ball_late,
        ),
        None => format!("{}  buttons {keys}", model.ports.input.name()),
    };
    let mut lines = vec![Line::from(head)];
    let axes = hand.axes;
    let row = |axis: usize| {
        let (Some(name), Some(force)) = (AXES.get(axis), axes.get(axis)) else { return String::new() };
        let [demand, value] = [model.demand, model.values].map(|v| v.get(axis).copied().unwrap_or_default());
        format!("{name} {force:5} {} {demand:4} →{value:5}", bar(*force))
    };
    lines.extend((0..3).map(|axis| Line::from(format!("{}   {}", row(axis), row(axis + 3)))));
    lines
}

/// Returns a force as a bar around its middle.
fn bar(force: i16) -> String {
    const HALF: i16 = 7;
    let length = (force * HALF + force.signum() * FULL / 2) / FULL;
    (-HALF..=HALF)
        .map(|at| match at {
            0 => '│',
            _ if length > 0 && (1..=length).contains(&at) => '█',
            _ if length < 0 && (length..0).contains(&at) => '█',
            _ => '·',
        })
        .collect()
}

#[cfg(test)]
#[path = "pictures.rs"]
mod pictures;

#[cfg(test)]
pub(super) mod tests {
    use std::time::Duration;

    use isra_ball::{Keys, Packet, Status};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use ratatui::buffer::Buffer;
    use val2_alter::{ErrorCode, List, Motion, MotionPhase, SegmentStatus, Start, Transform};

    use super::*;
    use crate::alter::Notification;
    use crate::alter::input::Sample;
    use crate::alter::operator::model::tests::model;

    pub(in crate::alter::operator) fn drawn(model: &Model) -> Buffer {
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        terminal.draw(|frame| draw(frame, model)).unwrap();
        terminal.backend().buffer().clone()
    }

    pub(in crate::alter::operator) fn rows(buffer: &Buffer) -> Vec<String> {
        let cells: Vec<_> = buffer.content().iter().map(|cell| cell.symbol()).collect();
        cells.chunks(80).map(|row| row.concat()).collect()
    }

    #[test]
    fn every_window_of_the_source_fits_a_terminal_of_80_by_24() {
        let mut model = model();
        let ms = Duration::from_millis;
        model.take(ms(1), Notification::Start(Start::new(Mode(23), List::new(&[5, -1]).unwrap())));
        model.take(ms(2), Notification::State(HostState::Running));
        model.take(ms(2), Notification::Latch(Latch::Armed { fresh_until: ms(100) }));
        model.take(
            ms(30),
            Notification::Motion(Motion {
                phase: MotionPhase::Running,
                error: ErrorCode::Checksum,
                segment_status: SegmentStatus::NearTarget,
                segment: 16,
                percent: 8192,
                transform: Some(Transform([16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16])),
            }),
        );
        let packet = Packet {
            sensor_type: 2,
            sensor: 1,
            status: Status::Old,
            force: [127, -128, 0],
            moment: [1, -64, 9],
            keys: Keys(0x81),
        };
        model.take(ms(31), Notification::Ball(packet, ms(14)));
        let axes = [1000, -1008, 0, 8, -504, 71];
        model.take(ms(31), Notification::Hand(Sample { axes, buttons: 0x81, fresh_until: ms(99) }));
        model.take(ms(31), Notification::PortLost("viewer", "the port is gone, and is tried again".into()));
        model.messages.retain(|(_, text)| text.starts_with("viewer"));
        let demand = [90, -90, 0, 0, -75, 10];
        model.take(
            ms(32),
            Notification::Reply { demand, values: [8, -8, 0, 0, -13, 10], thinking: ms(1), held: false },
        );
        assert_eq!(
            rows(&drawn(&model)),
            [
                " MOVING  Space or Esc stops                                                     ",
                "cycles 1  missed 0  held 0  rejected 0  p99 1.00 ms                             ",
                "┌ALTER mode────────────┐┌Initial data┐┌Messages────────────────────────────────┐",
                "│23 = 10111b           ││5           ││   0.03 viewer: the port is gone, and is│",
                "│cumulative            ││-1          ││        tried again                     │",
                "│tool coordinates      ││            ││                                        │",
                "│transf. of set point  ││            ││                                        │",
                "│values are used       ││            ││                                        │",
                "└──────────────────────┘└────────────┘└────────────────────────────────────────┘",
                "┌Alter byte─┐┌Control byte─────┐┌Segment─────┐┌Transformation──────────────────┐",
                "│00         ││10000001 = 81h   ││status 13   ││    n      o      a        p, mm│",
                "│running    ││error 1          ││near target ││ 1.000  0.000  0.000     400.00 │",
                "│           ││checksum error   ││number 16   ││ 0.000 -1.000  0.000    -150.50 │",
                "│           ││                 ││move   50 % ││ 0.000  0.000 -1.000       0.50 │",
                "└───────────┘└─────────────────┘└────────────┘└────────────────────────────────┘",
                "┌Input: deflection in ‰; asked → sent in 1/32 mm and 1/182°────────────────────┐",
                "│type 2 sensor 1 Old  keys ●······●  14.0 ms  missed 0 corrupt 0 late 0        │",
                "│X   1000 ·······│███████   90 →    8   RX     8 ·······│·······    0 →    0   │",
                "│Y  -1008 ███████│·······  -90 →   -8   RY  -504 ···████│·······  -75 →  -13   │",
                "│Z      0 ·······│·······    0 →    0   RZ    71 ·······│·······   10 →   10   │",
                "└──────────────────────────────────────────────────────────────────────────────┘",
                "┌Command───────────────────────────────────────────────────────────────────────┐",
                "│Space/Esc STOP (A)lter (V)refuse (K)Ball (W)ork (T)Port (O)pt. (?)keys (Q)uit │",
                "└──────────────────────────────────────────────────────────────────────────────┘",
            ]
        );
    }

    #[test]
    fn the_debug_view_shows_the_last_bytes() {
        let mut model = model();
        model.traces.robot.add(
            Duration::from_millis(5),
            cellwire_io::trace::TraceDirection::Sent,
            &[0x10, 0x02],
        );
        model.view = View::Debug(0);
        let rows = rows(&drawn(&model));
        assert!(rows.iter().any(|row| row.starts_with("│10 02 # 0.005000 s sent")), "{rows:#?}");
    }
}
