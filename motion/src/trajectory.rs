//! A table of joints over time.

/// The angles of the six joints over time.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Trajectory {
    samples: Vec<JointSample>,
}

/// The angles of the six joints at a time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct JointSample {
    /// In seconds, from any beginning.
    pub time: f64,
    /// J1 to J6 in degrees, J3 from the horizontal.
    pub joints: [f64; 6],
}

/// The longest trajectory, in s: a day.
const MAX_SPAN: f64 = 86_400.0;

impl Trajectory {
    /// Creates a trajectory of at least two samples, in the order of their times.
    ///
    /// # Errors
    /// If there are fewer, a number is not finite, a time is not later than the previous one, or more than a day
    /// after the first.
    pub fn new(samples: Vec<JointSample>) -> Result<Self, TrajectoryError> {
        for (line, sample) in (1..).zip(&samples) {
            let finite = sample.time.is_finite() && sample.joints.iter().all(|joint| joint.is_finite());
            if !finite {
                return Err(TrajectoryError { line, column: 1, reason: TrajectoryReason::Number });
            }
            check_time(samples.get(..line - 1).unwrap_or_default(), line, sample.time)?;
        }
        if samples.len() < 2 {
            let line = samples.len() + 1;
            return Err(TrajectoryError { line, column: 1, reason: TrajectoryReason::Short });
        }
        Ok(Self { samples })
    }

    /// Reads lines of seven numbers: the time in seconds, J1 to J6 in degrees. Between them stands a comma, a semicolon
    /// or a tab; a decimal point is a point. A first line of names is passed over, as are empty lines and those that begin
    /// with `#`.
    ///
    /// # Errors
    /// The first line that is not seven numbers, or whose time is not later than the previous one, or more than a day after
    /// the first.
    pub fn from_csv(text: &str) -> Result<Self, TrajectoryError> {
        let mut samples = Vec::new();
        let mut has_names = false;
        for (line, row) in (1..).zip(text.strip_prefix('\u{feff}').unwrap_or(text).lines()) {
            let content = row.trim();
            if content.is_empty() || content.starts_with('#') {
                continue;
            }
            if samples.is_empty() && !has_names && content.starts_with(char::is_alphabetic) {
                has_names = true;
                continue;
            }
            let sample =
                decode_row(row).map_err(|(column, reason)| TrajectoryError { line, column, reason })?;
            check_time(&samples, line, sample.time)?;
            samples.push(sample);
        }
        if samples.len() < 2 {
            let line = text.lines().count() + 1;
            return Err(TrajectoryError { line, column: 1, reason: TrajectoryReason::Short });
        }
        Ok(Self { samples })
    }

    /// Converts a trajectory whose J3 counts from the upper arm: J3 - J2 counts from the horizontal.
    #[must_use]
    pub fn from_upper_arm(mut self) -> Self {
        for JointSample { joints: [_, j2, j3, ..], .. } in &mut self.samples {
            *j3 -= *j2;
        }
        self
    }

    /// Returns the samples, in the order of their times.
    pub fn samples(&self) -> &[JointSample] {
        &self.samples
    }

    /// Returns the time of the first and of the last sample, in seconds.
    pub fn span(&self) -> (f64, f64) {
        let time = |sample: Option<&JointSample>| sample.map_or(0.0, |sample| sample.time);
        (time(self.samples.first()), time(self.samples.last()))
    }

    /// Returns the joints at a time, on the straight line between the samples beside it; the first or the last outside the
    /// span.
    pub fn at(&self, time: f64) -> [f64; 6] {
        let next = self.samples.partition_point(|sample| sample.time <= time);
        let (Some(a), b) = (self.samples.get(next.saturating_sub(1)), self.samples.get(next)) else {
            return [0.0; 6];
        };
        let Some(b) = b.filter(|_| next > 0) else { return a.joints };
        let share = (time - a.time) / (b.time - a.time);
        let mut joints = a.joints;
        for (joint, to) in joints.iter_mut().zip(b.joints) {
            *joint += (to - *joint) * share;
        }
        joints
    }
}

/// The reason that a table is not a trajectory. Lines and columns count from 1, columns in characters; without a
/// text, `line` is the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[error("line {line}, column {column}: {reason}")]
#[non_exhaustive]
pub struct TrajectoryError {
    /// The reason that the line or the sample is invalid.
    #[serde(rename = "kind")]
    pub reason: TrajectoryReason,
    /// The line of the text, from 1; without a text, the sample.
    pub line: usize,
    /// The column of the line in characters, from 1.
    pub column: usize,
}

/// The reason of a [`TrajectoryError`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum TrajectoryReason {
    /// A line without seven columns.
    #[error("expected seven columns: time in s, J1 to J6 in degrees; found {found}")]
    Columns {
        /// The number of columns of the line.
        found: usize,
    },
    /// A value that is not a number.
    #[error("expected a number such as `-108.435`")]
    Number,
    /// A time that is not later than that of the previous sample.
    #[error("expected a time later than the previous one")]
    Time,
    /// More than a day after the first sample.
    #[error("expected a time at most {MAX_SPAN} s after the first")]
    Span,
    /// The table has fewer than two samples.
    #[error("expected at least two samples")]
    Short,
}

/// Compares the time of a sample with those before it.
fn check_time(before: &[JointSample], line: usize, time: f64) -> Result<(), TrajectoryError> {
    let reason = if before.last().is_some_and(|last| time <= last.time) {
        TrajectoryReason::Time
    } else if before.first().is_some_and(|first| time - first.time > MAX_SPAN) {
        TrajectoryReason::Span
    } else {
        return Ok(());
    };
    Err(TrajectoryError { line, column: 1, reason })
}

fn decode_row(row: &str) -> Result<JointSample, (usize, TrajectoryReason)> {
    let mut values = [0.0; 7];
    let mut found = 0;
    let mut column = 1;
    for field in row.split([',', ';', '\t']) {
        let number = number(field.trim());
        if let Some(value) = values.get_mut(found) {
            let blanks = field.chars().take_while(|c| c.is_whitespace()).count();
            *value = number.ok_or((column + blanks, TrajectoryReason::Number))?;
        }
        found += 1;
        column += field.chars().count() + 1;
    }
    let [time, joints @ ..] = values;
    if found == 7 { Ok(JointSample { time, joints }) } else { Err((1, TrajectoryReason::Columns { found })) }
}

/// Parses a number as spreadsheets and MATLAB write it: `1.5`, `.5`, `1.5e-3`.
fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}
