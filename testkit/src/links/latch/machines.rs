use cellwire_motion::latch::Latch;

use crate::model::Drawn;

impl Drawn for Latch {}
