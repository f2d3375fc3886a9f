//! The picture.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Row, Sparkline, Table, Wrap};

use super::board::{BARS, Board, LineBoard};
use cellwire_io::output::counted;

const QUIET: Style = Style::new().fg(Color::DarkGray);
const WRONG: Style = Style::new().fg(Color::Red);
const STRONG: Style = Style::new().add_modifier(Modifier::BOLD);

pub(super) fn draw(frame: &mut Frame<'_>, board: &Board) {
    let ends = u16::try_from(board.ends.len()).unwrap_or(u16::MAX).clamp(2, 6);
    let mut free = frame.area().height.saturating_sub(HEAD + ends + 3 + FOOT);
    let mut left_out = Vec::new();
    // The table of the ends comes first: parts without space below it are named.
    let [wrong, last, times] = PARTS.map(|(name, rows)| {
        let rows = if rows <= free { rows } else { 0 };
        free -= rows;
        if rows == 0 {
            left_out.push(name);
        }
        rows
    });
    let rows = Layout::vertical([
        Constraint::Length(HEAD),
        Constraint::Length(ends + 3),
        Constraint::Length(times),
        Constraint::Length(wrong),
        Constraint::Min(last),
        Constraint::Length(FOOT),
    ]);
    let [head, table, times_area, wrong_area, last_area, foot] = rows.areas(frame.area());
    draw_head(frame, head, board);
    draw_table(frame, table, board);
    if times > 0 {
        draw_times(frame, times_area, board);
    }
    if wrong > 0 {
        draw_wrong(frame, wrong_area, board);
    }
    if last > 0 {
        draw_last(frame, last_area, board);
    }
    // The table itself may not fit.
    let hidden = (ends + 3).saturating_sub(table.height);
    if hidden > 0 {
        left_out.insert(0, "ends");
    }
    let mut text = String::from("q quits");
    if !left_out.is_empty() {
        text = format!("{text}; no rows for: {}", left_out.join(", "));
    }
    frame.render_widget(Line::from(text).style(QUIET), foot);
}

/// The rows of the first lines, and of the last one.
const HEAD: u16 = 3;
const FOOT: u16 = 1;

/// The parts between the table and the last line, the most important first, with the rows that each needs.
const PARTS: [(&str, u16); 3] = [("violations", 3), ("last messages", 4), ("response times", 5)];

fn draw_head(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    let since = board.now.duration_since(board.began).unwrap_or_default().as_secs();
    let time = format!("{:02}:{:02}:{:02}", since / 3600, since / 60 % 60, since % 60);
    let first = Line::from(vec![Span::styled(board.title.clone(), STRONG), format!("   {time}").into()]);
    let second = Line::from(format!("{}; connections so far: {}", board.place, board.open));
    let third = Line::from(board.state.clone());
    frame.render_widget(Paragraph::new(vec![first, second, third]), area);
}

/// The columns of the table: name, width, and whether every terminal shows it.
const COLUMNS: [(&str, u16, bool); 8] = [
    ("", 11, true),
    ("messages", 9, true),
    ("a second", 8, false),
    ("bytes", 10, false),
    ("corrupt", 7, true),
    ("median", 7, true),
    ("99 %", 7, true),
    ("longest", 7, true),
];

fn draw_table(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    // Rates and bytes are left out of a terminal that has no space for them.
    let is_wide = area.width > COLUMNS.iter().map(|(_, width, _)| width + 1).sum::<u16>();
    let shown = |cells: [String; COLUMNS.len()]| {
        let cells = cells.into_iter().zip(COLUMNS).filter(move |(_, (.., stays))| *stays || is_wide);
        Row::new(cells.map(|(cell, _)| cell))
    };
    let rows = board.ends.iter().map(|(name, end)| {
        let time = |quantile: f64| match end.answers.count() {
            0 => String::new(),
            _ => show(end.answers.at(quantile)),
        };
        let row = shown([
            (*name).to_owned(),
            end.messages.to_string(),
            format!("{:.1}", end.rate()),
            end.bytes.to_string(),
            end.corrupt.to_string(),
            time(0.5),
            time(0.99),
            time(1.0),
        ]);
        if end.corrupt > 0 { row.style(WRONG) } else { row }
    });
    let header = shown(COLUMNS.map(|(name, ..)| name.into())).style(QUIET);
    let widths = COLUMNS.iter().filter(|(.., stays)| *stays || is_wide).map(|(_, width, _)| *width);
    let block = Block::bordered().title("Ends, and their response times");
    let table = Table::new(rows, widths.map(Constraint::Length)).header(header).block(block);
    frame.render_widget(table, area);
}

/// Draws the answer times of each end as bars.
fn draw_times(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    let ends: Vec<_> = board.ends.iter().filter(|(_, end)| end.answers.count() > 0).collect();
    if ends.is_empty() {
        let block = Block::bordered().title("Response times");
        return frame.render_widget(block, area);
    }
    let columns = Layout::horizontal(ends.iter().map(|_| Constraint::Fill(1))).split(area);
    for ((name, end), area) in ends.iter().zip(columns.iter()) {
        let block = Block::bordered().title(format!("{name} answers after"));
        let inner = block.inner(*area);
        frame.render_widget(block, *area);
        let [bars, axis] = Layout::vertical([Constraint::Min(1), Constraint::Length(1)]).areas(inner);
        let width = (usize::from(bars.width) / BARS.len()).max(1);
        let data: Vec<u64> = end.bars.iter().flat_map(|count| vec![*count; width]).collect();
        frame.render_widget(Sparkline::default().data(&data), bars);
        frame.render_widget(Line::from(axis_of(width)).style(QUIET), axis);
    }
}

/// Returns the limits under the bars: one for each factor of ten, if there is space for it.
fn axis_of(width: usize) -> String {
    let mut text = String::new();
    for (place, name) in [(0, "0.1ms"), (3, "1"), (6, "10"), (9, "100"), (12, "1s"), (15, "10s")] {
        let at = place * width;
        if at > 0 && text.len() >= at {
            continue;
        }
        text.extend(core::iter::repeat_n(' ', at - text.len()));
        text.push_str(name);
    }
    text
}

/// Draws the complaints of the shadows: the number of each kind, and the last one; or the reason for which nothing is decoded any
/// more.
fn draw_wrong(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    if let Some(failure) = &board.failure {
        return frame
            .render_widget(Paragraph::new(failure.clone()).style(WRONG).wrap(Wrap { trim: true }), area);
    }
    let counts: Vec<String> =
        board.complaints.iter().map(|(name, count)| format!("{name} {count}")).collect();
    let Some(LineBoard { at, end, text, .. }) = &board.complaint else {
        return frame.render_widget(Line::from("shadow ends: no violations").style(QUIET), area);
    };
    let last = Line::from(vec![
        Span::styled(clock(*at), QUIET),
        Span::raw(format!(" {end} ")),
        Span::styled(text.clone(), WRONG),
    ]);
    let first = Line::from(format!("shadow ends: {}", counts.join(", ")));
    frame.render_widget(Paragraph::new(vec![first, last]).wrap(Wrap { trim: true }), area);
}

fn draw_last(frame: &mut Frame<'_>, area: Rect, board: &Board) {
    let errors: Vec<String> = board.errors.iter().map(|(name, count)| format!("{name} {count}")).collect();
    let mut title = String::from("Last messages");
    if !errors.is_empty() {
        title = format!("{title}; wrong: {}", errors.join(", "));
    }
    if board.missed > 0 {
        title = format!("{title}; {} forwarded but not captured", counted(board.missed, "byte"));
    }
    let block = Block::bordered().title(title);
    let inner = block.inner(area);
    let from = board.lines.len().saturating_sub(inner.height.into());
    let width = usize::from(inner.width).saturating_sub("00:00:00.000 workstation ".len());
    let lines = board.lines.iter().skip(from).map(|line| {
        let style = if line.is_wrong { WRONG } else { Style::new() };
        Line::from(vec![
            Span::styled(clock(line.at), QUIET),
            Span::raw(format!(" {:<11} ", line.end)),
            Span::styled(shortened(&line.text, width), style),
        ])
    });
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

/// Returns the text, or its beginning and `…` if it is longer.
fn shortened(text: &str, width: usize) -> String {
    match text.char_indices().nth(width) {
        None => text.into(),
        Some(_) => text.chars().take(width.saturating_sub(1)).chain(['…']).collect(),
    }
}

/// Returns the time of day (UTC).
fn clock(at: SystemTime) -> String {
    let since = at.duration_since(UNIX_EPOCH).unwrap_or_default();
    let seconds = since.as_secs() % 86_400;
    let millis = since.subsec_millis();
    format!("{:02}:{:02}:{:02}.{millis:03}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

/// Returns a time in three digits.
fn show(time: Duration) -> String {
    let (value, unit) = match time.as_secs_f64() {
        seconds if seconds >= 1.0 => (seconds, "s"),
        seconds => (seconds * 1000.0, "ms"),
    };
    let decimals = if value >= 100.0 { 0 } else { 1 + usize::from(value < 10.0) };
    format!("{value:.decimals$} {unit}")
}
