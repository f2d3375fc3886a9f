//! The recording of a logger: the blocks as a table, and the motion in them.

use std::io::{self, Write};
use std::time::Duration;

use anyhow::{Context, Result};
use fanuc_hmi_modbus::TelemetryBlock;

use crate::report::Report;
use cellwire_links::json::value as json;
use cellwire_motion::{
    self, Bounds, Confidence, Counts, Delay, Deviation, Figures, JointSample, Kinematics, MotionSample,
    Observation, Pose, Quaternion, State, Summary, Tracker, Trajectory,
};

/// The columns of the table: time by the life counter; the controller's values; the values that are computed here; in a row that
/// is not a sample of the motion, its meaning.
pub const HEADER: &str = "time_s,life_counter,missed,override_percent,x_mm,y_mm,z_mm,w_deg,p_deg,r_deg,q1,q2,q3,q4,\
controller_vx,controller_vy,controller_vz,controller_dq1,controller_dq2,controller_dq3,controller_dq4,\
vx_mm_s,vy_mm_s,vz_mm_s,dq1_s,dq2_s,dq3_s,dq4_s,wx_deg_s,wy_deg_s,wz_deg_s,note";

/// Blocks, as they were read.
#[derive(Debug)]
pub struct Recording {
    tracker: Tracker,
    first: Option<u32>,
    samples: Vec<(TelemetryBlock, MotionSample)>,
}

impl Recording {
    /// Creates an empty recording of a background task with this period whose blocks are read at this interval.
    pub fn new(period: Duration, poll: Duration) -> Self {
        Self { tracker: Tracker::with_polls(period, poll), first: None, samples: Vec::new() }
    }

    /// Takes a block; the sample, if it is one.
    pub fn push(&mut self, block: &TelemetryBlock) -> Option<MotionSample> {
        match self.tracker.push(block) {
            Observation::Sample(sample) => {
                self.samples.push((*block, sample));
                Some(sample)
            }
            Observation::First | Observation::Restarted => {
                // Times restart at 0: earlier samples belong to another run.
                self.first = Some(block.life_counter);
                self.samples.clear();
                None
            }
            _ => None,
        }
    }

    /// Returns the counts that show how regularly the blocks came.
    pub fn counts(&self) -> Counts {
        self.tracker.counts()
    }

    /// Returns the life counter at time zero.
    pub fn first(&self) -> Option<u32> {
        self.first
    }

    /// Returns the samples with their blocks.
    pub fn samples(&self) -> &[(TelemetryBlock, MotionSample)] {
        &self.samples
    }

    /// Drops the samples that were kept so far; the next one follows them all the same.
    pub fn forget(&mut self) {
        self.samples.clear();
    }

    /// Returns the motion, its speeds taken from both neighbours.
    pub fn states(&self) -> Vec<State> {
        let mut states: Vec<State> = self.samples.iter().map(|(_, sample)| sample.into()).collect();
        cellwire_motion::differentiate(&mut states);
        states
    }
}

/// Writes a line of the table.
///
/// # Errors
/// If it cannot be written.
pub fn write_row(out: &mut impl Write, block: &TelemetryBlock, sample: &MotionSample) -> io::Result<()> {
    write!(
        out,
        "{:.3},{},{},{}",
        sample.time.as_secs_f64(),
        block.life_counter,
        sample.missed,
        block.override_percent
    )?;
    let shown = block.position.iter().chain(&block.wpr).chain(&block.quaternion);
    for value in shown.chain(&block.velocity).chain(&block.quaternion_rate) {
        write!(out, ",{value}")?;
    }
    let rates = sample.quaternion_rate.iter().chain(&sample.angular_velocity_world);
    for value in sample.velocity.iter().chain(rates) {
        write!(out, ",{value:.5}")?;
    }
    writeln!(out, ",")
}

/// Writes a line for an implausible block: the reported values, and the reason that it is not a sample.
///
/// # Errors
/// If it cannot be written.
pub fn write_marked(out: &mut impl Write, block: &TelemetryBlock, note: &str) -> io::Result<()> {
    write!(out, ",{},,{}", block.life_counter, block.override_percent)?;
    let shown = block.position.iter().chain(&block.wpr).chain(&block.quaternion);
    for value in shown.chain(&block.velocity).chain(&block.quaternion_rate) {
        write!(out, ",{value:e}")?;
    }
    writeln!(out, "{},{note}", ",".repeat(COMPUTED))
}

/// Writes a line for an event between two blocks.
///
/// # Errors
/// If it cannot be written.
pub fn write_event(out: &mut impl Write, note: &str) -> io::Result<()> {
    writeln!(out, "{}{note}", ",".repeat(COLUMNS - 1))
}

/// The columns of the table, including the computed ones.
const COLUMNS: usize = 32;
const COMPUTED: usize = 10;

/// Reads a table back: the columns that a comparison needs, by their names.
///
/// # Errors
/// If a column is missing, or has a value that is not a number.
pub fn read_states(text: &str) -> Result<Vec<State>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let names = ["time_s", "x_mm", "y_mm", "z_mm", "q1", "q2", "q3", "q4"];
    let note = header.iter().position(|column| *column == "note");
    let mut columns = [0; 8];
    for (column, name) in columns.iter_mut().zip(names) {
        let found = header.iter().position(|column| column == &name);
        *column = found
            .with_context(|| format!("the first line has no column {name}: is this a log of `fanuc log`?"))?;
    }
    let mut states: Vec<State> = Vec::new();
    for (number, line) in (2..).zip(lines).filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        if note.and_then(|note| fields.get(note)).is_some_and(|note| !note.trim().is_empty()) {
            continue; // no sample of the motion
        }
        let mut values = [0.0; 8];
        for ((value, column), name) in values.iter_mut().zip(columns).zip(names) {
            let field = fields.get(column).and_then(|field| field.trim().parse::<f64>().ok());
            *value = field
                .filter(|v| v.is_finite())
                .with_context(|| format!("line {number}: {name} is not a number"))?;
        }
        let [time, x, y, z, quaternion @ ..] = values;
        anyhow::ensure!(
            states.last().is_none_or(|last| time > last.time),
            "line {number}: the time does not increase (was the controller restarted?)"
        );
        states.push(State::at(time, [x, y, z], Quaternion::normalised(quaternion)));
    }
    anyhow::ensure!(states.len() > 2, "too few samples: {}", states.len());
    cellwire_motion::differentiate(&mut states);
    Ok(states)
}

/// Returns the motion that a trajectory describes.
pub fn reference(trajectory: &Trajectory, arm: &impl Kinematics) -> Vec<State> {
    let state = |sample: &JointSample| {
        let Pose { position, orientation } = arm.forward(&sample.joints);
        State::at(sample.time, position, Quaternion::normalised(orientation))
    };
    let mut states: Vec<State> = trajectory.samples().iter().map(state).collect();
    cellwire_motion::differentiate(&mut states);
    states
}

/// A recording beside its reference, on the reference's clock.
#[derive(Debug)]
pub struct Comparison {
    /// The commanded states.
    pub reference: Vec<State>,
    /// The recorded states; the delay is subtracted from their times.
    pub recording: Vec<State>,
    /// The time by which the recording is later than its reference, in s.
    pub delay: f64,
    /// The errors while either of the two moves, on the reference's clock.
    pub deviations: Vec<Deviation>,
    /// The greatest and the root mean square of the deviations.
    pub summary: Summary,
    /// The number of states that were recorded while both were idle.
    pub idle: u64,
    /// The certainty of the delay and of the means; `None` if the motion is too short.
    pub confidence: Option<Confidence>,
}

/// The reason why two motions cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ComparisonError {
    /// One has no states, or the recorded robot is at rest all the time.
    #[error("nothing to compare: the recorded robot does not move")]
    Nothing,
    /// The search for the delay ended at its border.
    #[error(
        "no delay found: the best fit within ±{latest} s is at the border, {at:+.3} s; check the motion, or give a longer --within"
    )]
    DelayNotFound {
        /// The delay at which the search ended, in s.
        at: f64,
        /// The greatest delay that was tried in either direction, in s.
        latest: f64,
    },
}

impl Comparison {
    /// Fits the delay within `latest` seconds either way and compares.
    ///
    /// # Errors
    /// If there is nothing to compare, or no delay is found.
    pub fn new(
        reference: Vec<State>,
        mut recording: Vec<State>,
        latest: f64,
    ) -> Result<Self, ComparisonError> {
        let delay = match cellwire_motion::fit_delay(&reference, &recording, -latest..=latest, 0.02) {
            Some(Delay::Found(delay)) => delay,
            Some(Delay::AtBorder(at)) => return Err(ComparisonError::DelayNotFound { at, latest }),
            None => return Err(ComparisonError::Nothing),
        };
        recording.iter_mut().for_each(|state| state.time -= delay);
        let (compared, idle) = cellwire_motion::compare(&reference, &recording);
        let confidence = Confidence::of(&compared);
        let deviations: Vec<Deviation> = compared.into_iter().map(|(deviation, _)| deviation).collect();
        let summary = deviations.iter().copied().collect();
        Ok(Self { reference, recording, delay, deviations, summary, idle, confidence })
    }

    /// Adds the delay and the errors to a report, next to the source's.
    pub fn report(&self, report: &mut Report, delay: f64) {
        let confidence = self.confidence;
        let millis = |Bounds { low, high }| Bounds { low: (delay + low) * 1e3, high: (delay + high) * 1e3 };
        let certain = within(confidence.map(|it| millis(it.delay)), 1);
        report.fact("delay_ms", "best-fit delay", format!("{:.1} ms{certain}", delay * 1e3));
        report.fact("compared", "samples compared", self.summary.count);
        report.fact("idle", "samples left out: at rest, or before or after the motion", self.idle);
        let bounds = confidence.map(|it| [it.position, it.rotation, it.velocity, it.angular_velocity]);
        for (index, (key, label, figures, (measured, unit))) in self.figures().into_iter().enumerate() {
            let certain = within(bounds.and_then(|bounds| bounds.get(index).copied()), 3);
            let label = format!("error of the {label}, rms and maximum (source: {measured} {unit})");
            let text = format!("{:.3} {unit}{certain}   {:.3} {unit}", figures.rms, figures.max);
            report.fact(key, &label, text);
        }
        if let Some(confidence) = confidence {
            report.fact("confidence", "the brackets", "95 % interval over parts of this motion");
            report.field("bounds", json(confidence));
        }
    }

    /// Returns each error's key, name, figures, and the source's measurement on a real robot ("Zhodnocení").
    pub fn figures(&self) -> [(&'static str, &'static str, Figures, (f64, &'static str)); 4] {
        let Summary { position, rotation, velocity, angular_velocity, .. } = self.summary;
        [
            ("position_error", "position", position, (4.0, "mm")),
            ("rotation_error", "orientation", rotation, (0.5, "°")),
            ("velocity_error", "velocity", velocity, (8.0, "mm/s")),
            ("angular_velocity_error", "angular velocity", angular_velocity, (1.5, "°/s")),
        ]
    }
}

/// Bounds, in brackets.
fn within(bounds: Option<Bounds>, digits: usize) -> String {
    bounds.map_or_else(String::new, |Bounds { low, high }| format!(" [{low:.digits$} .. {high:.digits$}]"))
}
