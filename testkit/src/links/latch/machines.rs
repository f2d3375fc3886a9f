use cellwire_motion::latch::Latch;

use crate::model::adapt;

adapt!(Latch);
