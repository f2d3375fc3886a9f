//! The instructions as data: their words, the form of the text after these, and their context.

use super::Parsed;
use super::operation::{
    assign_to, call, case, count, decide, jump, label, message, monitor, otherwise, run, select, wait, when,
};
use super::outside::{enable, receive, send};
use crate::operation::Operation;

/// An instruction. Controllers set to German write the second spelling.
pub(crate) struct Row {
    pub(crate) words: &'static [&'static str],
    pub(crate) form: Form,
    pub(crate) place: Context,
}

/// The form of the text after the words of an instruction.
pub(crate) enum Form {
    /// Nothing.
    Alone(Operation),
    /// A number in brackets, within a range.
    Index(u32, u32),
    /// The same of a motion group, which may be named.
    IndexOfGroup(u32, u32),
    /// A motion group in brackets or nothing, `=` and a value, within a range if it is a number.
    Set(f64, f64),
    /// A value, within a range if it is a number.
    Value(f64, f64),
    /// ON, OFF, or a condition.
    State,
    /// A condition.
    Condition,
    /// A text whose form only an option's own manual describes.
    Text,
    /// A form of its own.
    Own(fn(&str) -> Parsed<'_, Operation>),
}

/// The context of an instruction.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Context {
    /// On a line of its own.
    Line,
    /// As a line, and after a condition and its comma.
    Anywhere,
}

const fn row(words: &'static [&'static str], form: Form, place: Context) -> Row {
    Row { words, form, place }
}

use Context::{Anywhere, Line};
use Form::{Alone, Condition, Index, IndexOfGroup, Own, Set, State, Text, Value};

/// The instructions that begin with a word. A statement that begins with a register or an output is an assignment.
pub(crate) static ROWS: &[Row] = &[
    row(&["IF", "WENN"], Own(decide), Line),
    row(&["ELSE", "SONST"], Own(otherwise), Line),
    row(&["ENDIF", "ENDWENN"], Alone(Operation::EndIf), Line),
    row(&["SELECT", "IST"], Own(select), Line),
    row(&["CASE", "="], Own(case), Line),
    row(&["FOR"], Own(count), Line),
    row(&["ENDFOR"], Alone(Operation::EndFor), Line),
    row(&["WAIT", "WARTE"], Own(wait), Anywhere),
    row(&["CALL", "AUFRUF"], Own(call), Anywhere),
    row(&["RUN"], Own(run), Anywhere),
    row(&["JMP", "SPRUNG"], Own(jump), Anywhere),
    row(&["LBL", "LABEL"], Own(label), Line),
    row(&["MESSAGE", "MELDUNG"], Own(message), Anywhere),
    row(&["END", "ENDE"], Alone(Operation::End), Anywhere),
    row(&["ABORT", "ABBRUCH"], Alone(Operation::Abort), Anywhere),
    row(&["PAUSE"], Alone(Operation::Pause), Anywhere),
    row(&["UALM", "BALM"], Index(1, 9999), Anywhere),
    row(&["PAYLOAD", "TRAGLST"], IndexOfGroup(1, 10), Anywhere),
    row(&["RSR"], Own(enable), Anywhere),
    row(&["UFRAME_NUM", "BENUTZER_NUM"], Own(|input| assign_to(input, 0)), Anywhere),
    row(&["UTOOL_NUM", "WKZ_NUM"], Own(|input| assign_to(input, 1)), Anywhere),
    row(&["OVERRIDE"], Own(|input| assign_to(input, 2)), Anywhere),
    // The other instructions of the handling tool.
    row(&["SKIP CONDITION", "IRQ BEDINGUNG"], Condition, Line),
    row(&["OFFSET CONDITION"], Text, Line),
    row(&["TOOL_OFFSET CONDITION"], Text, Line),
    row(&["VOFFSET CONDITION"], Text, Line),
    row(&["JOINT_MAX_SPEED"], Set(0.0, 10_000.0), Anywhere),
    row(&["LINEAR_MAX_SPEED"], Set(0.0, 10_000.0), Anywhere),
    row(&["LOCK PREG", "SPERRE PREG"], Alone(Operation::Lock), Anywhere),
    row(&["UNLOCK PREG", "FREIG. PREG"], Alone(Operation::Unlock), Anywhere),
    row(&["SPERRE PR"], Alone(Operation::Lock), Anywhere),
    row(&["LOCK VREG"], Text, Anywhere),
    row(&["UNLOCK VREG"], Text, Anywhere),
    row(&["MONITOR END"], Text, Line),
    row(&["MONITOR"], Own(monitor), Line),
    row(&["WHEN"], Own(when), Line),
    row(&["SOFTFLOAT END"], Text, Line),
    row(&["SOFTFLOAT"], Index(1, 10), Line),
    row(&["FOLLOW UP"], Text, Line),
    row(&["COL GUARD ADJUST"], Value(0.0, 200.0), Line),
    row(&["COL GUARD"], Text, Line),
    row(&["COL DETECT"], State, Line),
    row(&["VISION RUN_FIND"], Text, Line),
    row(&["VISION GET_OFFSET"], Text, Line),
    row(&["VISION GET_NFOUND"], Text, Line),
    row(&["VISION GET_PASSFAIL"], Text, Line),
    row(&["VISION GET_READING"], Text, Line),
    row(&["VISION SET_REFERENCE"], Text, Line),
    row(&["VISION OVERRIDE"], Text, Line),
    row(&["VISION CAMERA_CALIB"], Text, Line),
    row(&["VISION"], Text, Line),
    row(&["FORCE CTRL"], Text, Line),
    row(&["FORCE SENSOR"], Text, Line),
    row(&["SET PATH"], Text, Line),
    row(&["TC_ONLINE"], State, Anywhere),
    row(&["DIAG_REC"], Text, Anywhere),
    row(&["POINT_LOGIC"], Text, Anywhere),
    row(&["STITCH"], Text, Anywhere),
    row(&["ERROR_PROG"], Text, Line),
    row(&["RESUME_PROG"], Text, Line),
    row(&["RETURN_PATH_DSBL"], Text, Line),
    row(&["MAINT_PROG"], Text, Line),
    row(&["CLEAR_RESUME_PROG"], Text, Line),
    row(&["SEND"], Own(send), Line),
    row(&["RCV"], Own(receive), Line),
    row(&["SENSOR_ON"], Text, Line),
    row(&["SENSOR_OFF"], Text, Line),
    row(&["TORQ_LIMIT"], Text, Line),
    row(&["CLEAR SEMAPHORE"], Index(1, 32), Anywhere),
    row(&["POST SEMAPHORE"], Index(1, 32), Anywhere),
    row(&["Rec Path"], Text, Line),
    row(&["STICK DETECT"], Text, Line),
    row(&["REPLACE"], Text, Line),
    row(&["INDEPENDENT GP"], Text, Line),
    row(&["SIMULTANEOUS GP"], Text, Line),
    row(&["GET_VAR"], Text, Line),
    row(&["SET_VAR"], Text, Line),
    row(&["LINE TRACK"], Text, Line),
    row(&["LINE"], Text, Line),
    row(&["LINECOUNT"], Text, Line),
    row(&["SETLINE"], Text, Line),
    row(&["SELECT_CONVEYOR"], Text, Line),
    row(&["DEFENC"], Text, Line),
    row(&["STOP_TRACKING"], Text, Line),
    row(&["STVS1"], Text, Line),
    row(&["ACCUTRIG"], Text, Line),
    row(&["LINESIM"], Text, Line),
    row(&["SKIP"], Text, Line),
    row(&["PALLETIZING"], Text, Line),
    row(&["PALLETIZING-END"], Text, Line),
    // Applications.
    row(&["Arc Start"], Text, Anywhere),
    row(&["Arc End"], Text, Anywhere),
    row(&["Weave"], Text, Anywhere),
    row(&["Weld Start"], Text, Anywhere),
    row(&["Weld End"], Text, Anywhere),
    row(&["Track"], Text, Anywhere),
    row(&["Touch"], Text, Anywhere),
    row(&["Search"], Text, Anywhere),
    row(&["MP Offset"], Text, Anywhere),
    row(&["SPOT"], Text, Anywhere),
    row(&["BACKUP"], Text, Anywhere),
    row(&["GUN"], Text, Anywhere),
    row(&["PRESSURE"], Text, Anywhere),
    row(&["PRESS_MOTN"], Text, Anywhere),
    row(&["TIPDRESS"], Text, Anywhere),
    row(&["FB-PSPS"], Condition, Anywhere),
    row(&["P-SPS"], Text, Anywhere),
    row(&["PS"], Text, Line),
    row(&["Sensor"], Text, Anywhere),
    row(&["Laser"], Text, Anywhere),
    row(&["SS"], Text, Anywhere),
    row(&["SE"], Text, Anywhere),
    row(&["DISPENSE"], Text, Anywhere),
];
