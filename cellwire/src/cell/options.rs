//! What a demo is to do.

use std::path::PathBuf;
use std::time::Duration;

use indicatif::ProgressBar;
use serde_json::{Map, Value};

use crate::io::trace::TraceArgs;

/// The options of a link's demo.
#[derive(Debug)]
pub struct DemoOptions {
    /// How long to run; `None`: the link's own short run.
    pub seconds: Option<Duration>,
    /// Whether the transport has faults.
    pub faults: bool,
    /// The seed of the faults.
    pub seed: u64,
    /// Where to write the result.
    pub out: Option<PathBuf>,
    /// The SVG file to draw; `None`: a built-in picture.
    pub drawing: Option<PathBuf>,
    /// What to do with the bytes of a session that ended, for links that keep them.
    pub trace: TraceArgs,
    /// Settings other than the demo's defaults.
    pub settings: Map<String, Value>,
    /// The progress line, on standard error.
    pub progress: ProgressBar,
}
