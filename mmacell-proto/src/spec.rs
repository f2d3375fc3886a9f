//! The configurations of both ends, field by field.

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor, SOME_TIME};

use crate::central::CentralConfig;
use crate::device::DeviceConfig;
use crate::dialect::Dialect;
use crate::message::ErrorCode;

impl Configure for Dialect {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { itr, ovrd, clos, off, lone_lf, blank, wide_integers } = self;
        fields.source("§6 steps 17 and 20").flag("itr", "ITR in place of STP", itr);
        fields.source("§6 step 4").flag("ovrd", "OVRD in place of OVR", ovrd);
        fields.source("§4.10").flag("clos", "HND…CLOS in place of HND…CLOSE", clos);
        fields.flag("off", "SRVOFF in place of SRVOF", off);
        fields.source("§4").flag("lone_lf", "a line ends with a line feed alone", lone_lf);
        fields.source("§4").flag("blank", "a blank follows the sign of an integer", blank);
        let about = "all five digits of an integer count, also above 32767";
        fields.source("§4").flag("wide_integers", about, wide_integers);
    }
}

/// Visits the fields `accepts` and `writes`, which both ends have.
fn dialects(fields: &mut impl FieldVisitor, accepts: &mut Dialect, writes: &mut Dialect) {
    fields.source("§4").part("accepts", "Dialect", "variants that are read beside the source's", accepts);
    fields.source("§4").part(
        "writes",
        "Dialect",
        "variants that are written instead of the source's",
        writes,
    );
}

impl Configure for DeviceConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            accepts,
            writes,
            refusal,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        dialects(fields, accepts, writes);
        let mut number = i32::from(*refusal);
        let about = "the error number for refusals by the protocol; not 0";
        let range = if writes.wide_integers { -99_999..=99_999 } else { -32768..=32767 };
        fields.source("§5").whole("refusal", range, "", about, &mut number);
        *refusal = ErrorCode::from(number);
    }
}

impl Configure for CentralConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            accepts,
            writes,
            timeout,
            settle,
            tolerance,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.time("timeout", SOME_TIME, "how long a reply may take", timeout);
        let about = "how long after a motion starts a status may still predate it";
        fields.time("settle", ANY_TIME, about, settle);
        let about = "the distance from the target that counts as arrived: 1 µm, 0.1 mrad";
        fields.whole("tolerance", 0..=u32::MAX, "units", about, tolerance);
        dialects(fields, accepts, writes);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(DeviceConfig, DeviceConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(CentralConfig, CentralConfig::default());
