//! The jobs of a file.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use comfy_table::{CellAlignment, Table, presets::UTF8_FULL_CONDENSED};
use kawasaki_msg::{Charset, timing};
use serde_json::{Value, json};

use super::Settings;
use crate::devices::kawasaki_msg::sheet::Lines;
use crate::io::drawing::{self, Picture};
use crate::io::journal::{Fingerprint, Outcome};
use crate::io::{sheet, table};
use crate::run::Bounds;
use cellwire_io::input;
use cellwire_io::output::counted;
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};
use cellwire_links::kawasaki_msg::plant::Plant;

/// The most jobs of a file: the capacity of a journal and a drawing.
const MAX_JOBS: usize = 1_000_000;

/// The number of bad lines that are named.
const MAX_NAMED: usize = 20;

/// Jobs in the order of their execution.
#[derive(Debug)]
pub struct Jobs {
    /// The contents of the jobs.
    pub work: Vec<AnyWork>,
    /// The origin of each job: a line of the table, or an outline of the drawing, from 1.
    pub lines: Vec<u64>,
    /// The unit of `lines`: `line`, or `outline`.
    pub unit: &'static str,
    layout: Layout,
    /// The number of their bytes on the wire, and the fingerprint of these bytes.
    bytes: usize,
    fingerprint: Fingerprint,
}

impl Jobs {
    /// Reads a picture or a table; `allow` omits the parts that a pen cannot follow.
    ///
    /// # Errors
    /// If the file is neither; those of [`from_table`](Self::from_table) and [`from_picture`](Self::from_picture).
    pub fn read(file: &Path, settings: &Settings, allow: bool) -> Result<Self> {
        let kind = input::extension(file);
        match kind.as_str() {
            "csv" => Self::from_table(file, &settings.plant),
            "svg" | "svgz" => Self::from_picture(file, &settings.plant, settings.sheet(), allow),
            _ => bail!("{} is neither a picture (.svg) nor a table of jobs (.csv)", file.display()),
        }
    }

    /// Reads a table. Its first line names fields of a job, in any order; one that has a default may be left out, or be
    /// empty in a line. Lines that begin with `#` are passed over.
    ///
    /// # Errors
    /// If the file cannot be read; the lines and fields that do not fit.
    pub fn from_table(file: &Path, plant: &Plant) -> Result<Self> {
        let (text, layout) = (input::text(file)?, plant.layout()?);
        let rows = rows(&text, &layout, plant.charset).with_context(|| file.display().to_string())?;
        Self::new(rows, "line", plant, layout).with_context(|| file.display().to_string())
    }

    /// Reads the lines of a picture, on a board of this size; with `allow`, parts that a pen cannot draw are omitted.
    ///
    /// # Errors
    /// If the file cannot be read, the plant's jobs are not lines, or a line is out of the robot's reach.
    pub fn from_picture(file: &Path, plant: &Plant, sheet: drawing::Point, allow: bool) -> Result<Self> {
        Self::of(&Picture::from_file(file, sheet, allow)?, plant).with_context(|| file.display().to_string())
    }

    /// Returns the lines of a picture.
    ///
    /// # Errors
    /// If the plant's jobs are not lines, or a line is out of the robot's reach.
    pub fn of(picture: &Picture, plant: &Plant) -> Result<Self> {
        let layout = plant.layout()?;
        let lines = Lines::of(&layout)?;
        let rows = picture.outlines.iter().copied().zip(lines.jobs(picture)).collect();
        Self::new(rows, "outline", plant, layout)
    }

    fn new(rows: Vec<(u64, AnyWork)>, unit: &'static str, plant: &Plant, layout: Layout) -> Result<Self> {
        ensure!(!rows.is_empty(), "it has no jobs");
        ensure!(rows.len() <= MAX_JOBS, "more than {MAX_JOBS} jobs");
        let dialect = plant.dialect()?;
        let (mut bytes, mut fingerprint) = (0, Fingerprint::default());
        let (mut bad, mut wire) = (Vec::new(), [0; 2048]);
        for (line, work) in &rows {
            let job = kawasaki_msg::Job { order: 0, number: 0, work: *work };
            match dialect.write_job(&job, &layout, &mut wire) {
                Ok(length) => {
                    bytes += length;
                    fingerprint.add(wire.get(..length).unwrap_or_default());
                }
                Err(error) => bad.push(format!("{unit} {line}: {error}")),
            }
        }
        refuse(bad)?;
        let (lines, work) = rows.into_iter().unzip();
        Ok(Self { work, lines, unit, layout, bytes, fingerprint })
    }

    /// Returns the layout of a job.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the value by which a journal recognizes these jobs.
    pub fn fingerprint(&self) -> String {
        self.fingerprint.to_string()
    }

    /// Returns the number of the jobs, their size, and their time on the line with packets of at most `packet` bytes; for lines
    /// also their place on the board, which a picture fills as far as it can.
    pub fn summary(&self, packet: usize, board: drawing::Point) -> Value {
        let packets = self.bytes.div_ceil(packet);
        let seconds = timing::EXCHANGE.as_secs_f64() * f64::from(u32::try_from(packets).unwrap_or(u32::MAX));
        let mut summary = json!({
            "jobs": self.work.len(), "bytes": self.bytes, "packets": packets,
            "seconds_on_the_line": (seconds * 10.0).round() / 10.0,
        });
        if let (Some(bounds), Some(summary)) = (self.bounds(), summary.as_object_mut()) {
            summary.insert("mm".into(), json!(bounds));
            summary.insert("board".into(), json!([drawing::mm(board.x), drawing::mm(board.y)]));
        }
        summary
    }

    /// Returns the least and the greatest coordinates that are drawn, in millimetres: `None` if the jobs are not lines, or no
    /// line is drawn.
    fn bounds(&self) -> Option<Bounds> {
        let lines = Lines::of(&self.layout).ok()?;
        let drawn = self.work.iter().map(|work| lines.line(work)).filter(|line| line.draws);
        let points = drawn.flat_map(|line| [line.from, line.to]);
        Bounds::of(points.map(|point| [point.x, point.y].map(drawing::mm)))
    }

    /// Returns every job as a line of a table: its number, its line in the file, and its fields in the sent form.
    pub fn table(&self) -> String {
        let mut table = Table::new();
        table.load_style(UTF8_FULL_CONDENSED);
        let names = self.layout.fields().iter().map(|field| field.name.clone());
        table.set_header(["job".to_owned(), "line".to_owned()].into_iter().chain(names));
        for (number, (work, line)) in (1..).zip(self.work.iter().zip(&self.lines)) {
            let fields = (0..self.layout.fields().len()).map(|place| self.layout.show(place, work));
            table.add_row([number.to_string(), line.to_string()].into_iter().chain(fields));
        }
        for column in table.column_iter_mut() {
            column.set_cell_alignment(CellAlignment::Right);
        }
        table.to_string()
    }

    /// Draws the path of the robot, marked by the outcomes of the jobs if there are any.
    ///
    /// # Errors
    /// If the plant's jobs are not lines, or the file cannot be written.
    pub fn draw(&self, file: &Path, size: drawing::Point, outcomes: &[Outcome]) -> Result<()> {
        let lines = Lines::of(&self.layout)?;
        let drawn: Vec<_> = self.work.iter().map(|work| lines.line(work)).collect();
        sheet::write(file, size, &drawn, outcomes, ["drawn", "pen lifted"])
    }
}

/// Reads the jobs of a table, with their lines.
fn rows(text: &str, layout: &Layout, charset: Charset) -> Result<Vec<(u64, AnyWork)>> {
    let mut table = table::rows(text);
    let (_, header) = table.next().context("it has no jobs")??;
    let columns = columns(&header, layout)?;
    let (mut rows, mut bad) = (Vec::new(), Vec::new());
    let defaults: Vec<Option<String>> = (0..)
        .zip(layout.fields())
        .map(|(place, field)| {
            let mut work = AnyWork::default();
            work.set(place, field.default?);
            Some(layout.show(place, &work))
        })
        .collect();
    for row in table {
        let (line, record) = row?;
        if record.len() > columns.len() {
            bad.push(format!("line {line}: {} cells, but {} fields are named", record.len(), columns.len()));
            continue;
        }
        let mut texts: Vec<Option<&str>> = defaults.iter().map(Option::as_deref).collect();
        for (place, cell) in columns.iter().zip(&record) {
            if let Some(text) = texts.get_mut(*place).filter(|_| !cell.is_empty()) {
                *text = Some(cell);
            }
        }
        let missing = texts.iter().zip(layout.fields()).find(|(text, _)| text.is_none());
        if let Some((_, field)) = missing {
            bad.push(format!("line {line}: field '{}' is missing, and has no default", field.name));
            continue;
        }
        let texts: Vec<&str> = texts.into_iter().flatten().collect();
        match layout.job(&texts, charset) {
            Ok(work) => rows.push((line, work)),
            Err(error) => bad.push(format!("line {line}: {error}")),
        }
    }
    refuse(bad)?;
    Ok(rows)
}

/// Returns the indices in the layout of a table's columns.
fn columns(header: &csv::StringRecord, layout: &Layout) -> Result<Vec<usize>> {
    let names = || layout.fields().iter().map(|field| field.name.as_str()).collect::<Vec<_>>().join(", ");
    let mut columns = Vec::new();
    for name in header {
        let place = layout.place(name).ok_or_else(|| {
            let (name, names) = (name.escape_debug(), names());
            anyhow!("`{name}` in the first line is not a field of a job; a job has {names}")
        })?;
        ensure!(!columns.contains(&place), "the first line names `{name}` twice");
        columns.push(place);
    }
    for (place, field) in layout.fields().iter().enumerate() {
        let given = columns.contains(&place) || field.default.is_some();
        ensure!(
            given,
            "the field `{}` is missing in the first line and has no default; a job has {}",
            field.name,
            names()
        );
    }
    Ok(columns)
}

/// Returns an error with the lines that do not fit, up to a readable number.
fn refuse(bad: Vec<String>) -> Result<()> {
    let Some(more) = bad.len().checked_sub(1) else { return Ok(()) };
    let named = bad.iter().take(MAX_NAMED).cloned().collect::<Vec<_>>().join("\n  ");
    match more.saturating_sub(MAX_NAMED - 1) {
        0 => bail!("nothing is sent:\n  {named}"),
        more => bail!("nothing is sent:\n  {named}\n  and {} more", counted(more, "line")),
    }
}
