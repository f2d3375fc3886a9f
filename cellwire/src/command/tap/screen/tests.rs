//! The screen as text.

use std::time::{Duration, UNIX_EPOCH};

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use serde_json::json;

use super::super::decoding::{DecodedEvent, Entry};
use super::board::Board;
use super::draw::draw;
use crate::io::tap::ConnectionTransport;
use cellwire_links::shadow::{Complaint, Kind};

const MS: Duration = Duration::from_millis(1);

fn rows(board: &Board) -> Vec<String> {
    rows_of(board, 100)
}

fn rows_of(board: &Board, width: u16) -> Vec<String> {
    rows_in(board, width, 24)
}

fn rows_in(board: &Board, width: u16, height: u16) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, board)).unwrap();
    let buffer = terminal.backend().buffer().clone();
    let text = |cells: &[ratatui::buffer::Cell]| cells.iter().map(|cell| cell.symbol()).collect::<String>();
    buffer.content().chunks(width.into()).map(|cells| text(cells).trim_end().to_owned()).collect()
}

#[test]
fn a_low_screen_shows_every_end_first_and_names_what_it_has_no_rows_for() {
    let mut board = Board::new("fanuc", UNIX_EPOCH);
    for end in ["client", "server"] {
        let what = DecodedEvent::Message { offset: 0, length: 12, content: json!({"unit": 1}) };
        board.take(&Entry { at: UNIX_EPOCH, connection: 1, end, what });
    }
    for (height, foot) in [
        (21, "q quits"),
        (20, "q quits; no rows for: response times"),
        (15, "q quits; no rows for: last messages, response times"),
        (11, "q quits; no rows for: violations, last messages, response times"),
    ] {
        let rows = rows_in(&board, 100, height);
        let has = |end: &str| rows.iter().any(|row| row.contains(&format!("│{end} ")));
        assert!(has("client") && has("server"), "{height}: {rows:#?}");
        assert_eq!(rows.last().unwrap(), foot);
    }
    let rows = rows_in(&board, 100, 7);
    assert!(rows.last().unwrap().starts_with("q quits; no rows for: ends, "), "{rows:#?}");
}

#[test]
fn the_screen_shows_both_ends_and_what_is_wrong() {
    let began = UNIX_EPOCH + Duration::from_secs(3600);
    let mut board = Board::new("laser-eb90", began);
    let entry = |at: Duration, end, what| Entry { at: began + at, connection: 1, end, what };
    let place = ConnectionTransport::Tcp("10.0.0.1:4000".parse().unwrap(), "10.0.0.2:9100".parse().unwrap());
    board.take(&entry(MS, "unknown", DecodedEvent::Opened(place)));
    for n in 0..10 {
        let at = MS * (100 * n + 10);
        let message = |length| DecodedEvent::Message { offset: 0, length, content: json!({"items": [n]}) };
        board.take(&entry(at, "host", message(20)));
        board.take(&entry(at + MS * 12, "controller", message(11)));
    }
    let (error, bytes) = (json!({"kind": "checksum"}), vec![0xEB, 0x90]);
    board.take(&entry(
        MS * 1000,
        "controller",
        DecodedEvent::Corrupt { offset: 9, error, clause: Some("LE-13"), bytes },
    ));
    board.take(&entry(MS * 1001, "controller", DecodedEvent::Missed(7)));
    for second in 1..=2 {
        board.pass_time(began + Duration::from_secs(second));
    }
    board.state = "the last frame is answered".into();
    let rows = rows(&board);
    let text = rows.join("\n");
    assert_eq!(rows[0], "laser-eb90   00:00:02");
    assert_eq!(rows[2], "the last frame is answered");
    assert_eq!(rows[1], "10.0.0.1:4000 to 10.0.0.2:9100; connections so far: 1");
    let columns = |name: &str| {
        let row = rows.iter().find(|row| row.contains(&format!("│{name} "))).unwrap();
        row.trim_matches('│').split_whitespace().map(str::to_owned).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(columns("host"), "host 10 5.0 200 0 88.1 ms 88.1 ms 88.1 ms");
    assert_eq!(columns("controller"), "controller 10 5.0 112 1 12.0 ms 12.0 ms 12.0 ms");
    assert!(
        text.contains("wrong: controller: checksum (LE-13) 1; 7 bytes forwarded but not captured"),
        "{text}"
    );
    assert!(text.contains("01:00:01.000 controller  checksum (LE-13) eb90"), "{text}");
}

#[test]
fn the_screen_counts_what_shadows_say_and_shows_the_last_of_it() {
    let mut board = Board::new("laser-eb90", UNIX_EPOCH);
    let row = |board: &Board, text: &str| rows(board).into_iter().find(|row| row.contains(text));
    assert!(row(&board, "shadow ends: no violations").is_some());
    for (kind, clause) in [(Kind::Rule, "LE-5"), (Kind::Budget, "LE-99"), (Kind::Rule, "LE-25")] {
        let text = "the word 0102h answers 0101h".into();
        let complaint = Complaint { at: MS, end: "controller", kind, clause, text };
        let (at, end) = (UNIX_EPOCH + MS, "controller");
        board.take(&Entry { at, connection: 1, end, what: DecodedEvent::Wrong(complaint) });
    }
    assert!(row(&board, "shadow ends: budgets missed 1, rules broken 2").is_some(), "{:#?}", rows(&board));
    let last = "00:00:00.001 controller the word 0102h answers 0101h (LE-25)";
    assert!(row(&board, last).is_some(), "{:#?}", rows(&board));
    board.remark("connection 1: cannot connect to 10.0.0.2:9100".into());
    assert!(row(&board, "cannot connect to 10.0.0.2:9100").is_some());
    board.fail("the decoder makes no progress");
    assert!(row(&board, "no progress: decoding stopped; bytes are still forwarded").is_some());
}

#[test]
fn numbers_have_their_units_on_a_narrow_terminal() {
    let began = UNIX_EPOCH + Duration::from_secs(3600);
    let mut board = Board::new("viewer", began);
    for n in 0..10 {
        let at = began + MS * (200 * n);
        let message = || DecodedEvent::Message { offset: 0, length: 10, content: json!({}) };
        board.take(&Entry { at, connection: 1, end: "host", what: message() });
        board.take(&Entry { at: at + MS * 123, connection: 1, end: "workstation", what: message() });
    }
    let text = "no packet within stale_after (1000 ms) of its request".into();
    let complaint = Complaint { at: MS, end: "host", kind: Kind::Assumption, clause: "VV-40", text };
    board.take(&Entry { at: began, connection: 1, end: "host", what: DecodedEvent::Wrong(complaint) });
    board.pass_time(began + Duration::from_secs(2));
    let columns = |width, name: &str| {
        let rows = rows_of(&board, width);
        let row = rows.iter().find(|row| row.contains(&format!("│{name} "))).unwrap();
        row.trim_matches('│').split_whitespace().map(str::to_owned).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(columns(80, "host"), "host 10 5.0 100 0 77.1 ms 77.1 ms 77.1 ms");
    assert_eq!(columns(60, "host"), "host 10 0 77.1 ms 77.1 ms 77.1 ms");
    assert_eq!(columns(60, "workstation"), "workstation 10 0 123 ms 123 ms 123 ms");
    let text = rows_of(&board, 60).join("\n");
    assert!(text.contains("│0.1ms 10 100   10s "), "{text}");
    assert!(text.contains("within stale_after (1000 ms) of\nits request (VV-40)"), "{text}");
    assert!(text.contains(" host        no packet within stale_after (10…│"), "{text}");
}

#[test]
fn a_terminal_of_any_size_is_drawn() {
    let board = Board::new("laser-eb90", UNIX_EPOCH);
    for (width, height) in [(1, 1), (10, 5), (80, 24), (300, 100)] {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, &board)).unwrap();
    }
}
