//! The settings of the link: of both ends, and of the simulated surroundings.

use std::path::PathBuf;
use std::time::Duration;

use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::kawasaki_msg::{pc_settings, robot_settings};
use cellwire_links::settings::{Configure, FieldVisitor};
use kawasaki_msg::{PcConfig, RobotConfig};

/// The simulated robot.
#[derive(Debug, Clone)]
pub struct RobotSettings {
    /// The messages and limits that both ends of the plant have agreed on.
    pub plant: Plant,
    /// The configuration of the session.
    pub config: RobotConfig,
    /// The number of jobs that the robot's queue holds.
    pub queue: usize,
    /// The speed of the pen, in mm/s.
    pub speed: u32,
    /// The time of a job that is not a line.
    pub job_time: Duration,
    /// The path of the drawn picture; `None` without.
    pub out: Option<String>,
    /// The path of the executed jobs; `None` without.
    pub record: Option<String>,
}

impl Default for RobotSettings {
    fn default() -> Self {
        let (config, job_time) = (RobotConfig::tcp(), Duration::from_secs(1));
        Self { plant: Plant::default(), config, queue: 256, speed: 250, job_time, out: None, record: None }
    }
}

impl Configure for RobotSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { plant, config, queue, speed, job_time, out, record } = self;
        fields.whole("speed", 1..=u32::MAX, "mm/s", "the speed of the pen", speed);
        let about = "the duration of a job that is not a line";
        fields.time("job_time", Duration::ZERO..=Duration::from_secs(86_400), about, job_time);
        fields.whole("queue", 1..=9998, "jobs", "how many jobs the queue holds: less than max_number", queue);
        let about = "an SVG file of the sheet with all orders since the start, written after each";
        fields.text("out", "a file", "none is written", about, out);
        let about = "a CSV file to which executed jobs are appended: order, number, fields";
        fields.text("record", "a file", "none is written", about, record);
        plant.configure(fields);
        robot_settings(fields, config);
    }
}

/// The simulated PC.
#[derive(Debug, Clone)]
pub struct PcSettings {
    /// The messages and limits that both ends of the plant have agreed on.
    pub plant: Plant,
    /// The configuration of the session.
    pub config: PcConfig,
    /// The path of the picture, an SVG file; `None` without.
    pub drawing: Option<String>,
    /// The number of the first order.
    pub order: u16,
    /// Whether the next order begins when one is over.
    pub repeat: bool,
}

impl Default for PcSettings {
    fn default() -> Self {
        let plant = Plant::default();
        Self { plant, config: PcConfig::tcp(), drawing: None, order: 50, repeat: false }
    }
}

impl PcSettings {
    /// Returns the file of the picture.
    pub fn drawing(&self) -> Option<PathBuf> {
        self.drawing.as_ref().map(PathBuf::from)
    }
}

impl Configure for PcSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { plant, config, drawing, order, repeat } = self;
        let about = "the SVG file whose outlines are drawn on an A3 sheet";
        fields.text("drawing", "a file", "a built-in picture", about, drawing);
        fields.whole("order", 1..=u16::MAX, "", "the number of the first order", order);
        fields.flag("repeat", "begin the next order when one has ended", repeat);
        plant.configure(fields);
        pc_settings(fields, config);
    }
}
