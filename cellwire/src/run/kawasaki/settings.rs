//! The settings of a run.

use kawasaki_msg::PcConfig;

use crate::io::drawing::Point;
use cellwire_links::kawasaki_msg::pc_settings;
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings::{Configure, FieldVisitor};

/// The PC's end, and the board that is drawn on.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The messages and limits that both ends of the plant have agreed on.
    pub plant: Plant,
    /// The configuration of the PC's session.
    pub config: PcConfig,
    /// The number of the next order; `None`: a random number that the journal does not have.
    pub order: Option<u16>,
    board: [u32; 2],
}

impl Settings {
    /// Returns the board's size in hundredths of a millimetre.
    pub fn sheet(&self) -> Point {
        let [x, y] = self.board.map(|mm| i32::try_from(mm * 100).unwrap_or(i32::MAX));
        Point { x, y }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { plant: Plant::default(), config: PcConfig::tcp(), order: None, board: [420, 297] }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { plant, config, order, board } = self;
        let about = "the number of the next order; over UDP never used before";
        fields.whole_or("order", 1..=u16::MAX, "", "any", about, order);
        fields.wholes(
            "board",
            1..=10_000,
            "mm",
            "the sheet that a picture is scaled to: width and height",
            board,
        );
        plant.configure(fields);
        pc_settings(fields, config);
    }
}
