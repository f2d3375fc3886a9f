//! The options of a demo.

use std::path::PathBuf;
use std::time::Duration;

use indicatif::ProgressBar;
use serde_json::{Map, Value};

use crate::io::line::Lines;
use cellwire_io::trace::TraceArgs;

/// The options of a link's demo.
#[derive(Debug)]
pub struct DemoOptions {
    /// The time to run; `None`: the link's own short run.
    pub seconds: Option<Duration>,
    /// Whether the transport has faults.
    pub faults: bool,
    /// The seed of the faults.
    pub seed: u64,
    /// The path of the result.
    pub out: Option<PathBuf>,
    /// The change of the run's record before it is judged.
    pub must_fail: Option<MustFail>,
    /// The SVG file to draw; `None`: a built-in picture.
    pub drawing: Option<PathBuf>,
    /// The options of traces: where the bytes of a session that ended are kept, for links that keep them.
    pub trace: TraceArgs,
    /// Settings other than the demo's defaults.
    pub settings: Map<String, Value>,
    /// The transport in place of serial lines.
    pub lines: Lines,
    /// The progress line, on standard error.
    pub progress: ProgressBar,
}

/// The change of a run's record before it is judged, to show that the verdict finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum MustFail {
    /// Remove one entry that must be there
    Lost,
    /// Enter one entry twice
    Repeated,
    /// Put one value beyond its limit
    Limit,
    /// Set every time budget to zero
    Late,
}

impl MustFail {
    /// Returns the word after `--must-fail`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lost => "lost",
            Self::Repeated => "repeated",
            Self::Limit => "limit",
            Self::Late => "late",
        }
    }
}

impl DemoOptions {
    /// Returns the options of a run without options, which shows no progress.
    pub fn quiet() -> Self {
        Self {
            seconds: None,
            faults: false,
            seed: 1,
            out: None,
            must_fail: None,
            drawing: None,
            trace: TraceArgs::off(),
            settings: Map::new(),
            lines: Lines::HERE,
            progress: ProgressBar::hidden(),
        }
    }

    /// Returns whether the record is to be damaged in this way.
    pub fn spoils(&self, how: MustFail) -> bool {
        self.must_fail == Some(how)
    }

    /// Damages a record of the run: the entry nearest to its middle of those that must be in it.
    pub fn spoil<T: Clone>(&self, record: &mut Vec<T>, must_be: impl Fn(&T) -> bool) {
        let middle = record.len() / 2;
        let places = record.iter().enumerate().filter(|(_, entry)| must_be(entry)).map(|(place, _)| place);
        let Some(place) = places.min_by_key(|place| place.abs_diff(middle)) else { return };
        match (self.must_fail, record.get(place).cloned()) {
            (Some(MustFail::Lost), _) => drop(record.remove(place)),
            (Some(MustFail::Repeated), Some(entry)) => record.insert(place, entry),
            _ => {}
        }
    }
}
