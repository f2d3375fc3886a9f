//! The configurations of both ends, field by field.

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor, LINE};

use crate::controller::ControllerConfig;
use crate::frame::Frame;
use crate::host::HostConfig;
use crate::profile::{ByteOrder, Flag, Profile, Tail, Width};
use crate::words::{ErrorCodes, Words};

impl Configure for Profile {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { tail, flag, tags, checksum, checksum_negated, checksum_with_flag, byte_order } = self;
        let choices = [("printed", Tail::Printed), ("etx", Tail::Etx), ("either", Tail::Either)];
        let about = "the end mark: 90 82, 90 83, or both are read";
        fields.source("§3(2)").choice("tail", &choices, about, tail);
        let choices = [("separate", Flag::Separate), ("first_tag", Flag::FirstTag)];
        fields.source("§3(2)").choice("flag", &choices, "where the frame flag F0h is", flag);
        let shape = "{f32, i16, u8, char}, four different bytes";
        let source = "§3(2) for f32 and char; ours";
        fields.source(source).parsed("tags", shape, "the tags in front of the values", tags);
        let choices = [("u8", Width::U8), ("u16_le", Width::U16Le), ("u16_be", Width::U16Be)];
        fields.source("§3(2); ours").choice("checksum", &choices, "the width of the checksum", checksum);
        let about = "the checksum is the two's complement of the sum";
        fields.flag("checksum_negated", about, checksum_negated);
        let about = "the sum includes the frame flag";
        fields.flag("checksum_with_flag", about, checksum_with_flag);
        let choices = [("little", ByteOrder::Little), ("big", ByteOrder::Big)];
        fields.choice("byte_order", &choices, "the order of the bytes of a value", byte_order);
    }
}

/// The codes are different, and none is a command word.
impl Configure for ErrorCodes {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { bad_checksum, bad_frame, unknown_command, bad_batch, bad_parameters, queue_full } = self;
        const NAMED: &str = "§3(5); this project's value";
        let all = 0..=u16::MAX;
        let about = "for a wrong checksum; all codes differ, and none is a command word";
        fields.source(NAMED).whole("bad_checksum", all.clone(), "", about, bad_checksum);
        let about = "for a frame without a head, or with another fault";
        fields.source(NAMED).whole("bad_frame", all.clone(), "", about, bad_frame);
        let about = "for an unknown command word";
        fields.whole("unknown_command", all.clone(), "", about, unknown_command);
        let about = "for too many instructions, or a non-interpreted one among others";
        fields.whole("bad_batch", all.clone(), "", about, bad_batch);
        let about = "for invalid parameters, or a failed execution";
        fields.whole("bad_parameters", all.clone(), "", about, bad_parameters);
        let about = "for a frame that does not fit the queue";
        fields.source(NAMED).whole("queue_full", all, "", about, queue_full);
    }
}

/// Visits the fields `words` and `batch`, which both ends have.
fn instructions(fields: &mut impl FieldVisitor, words: &mut Words, batch: &mut u8) {
    let shape = "{commands: [{first, last, class}], errors: {bad_checksum, …}}";
    let about = "command words by class in up to 32 ranges (by default 0100h to 01FFh interpreted, 0200h to 02FFh immediate, 0300h to 03FFh query), and error codes";
    fields.source("§2; this project's values").parsed("words", shape, about, words);
    let about = "the maximum of interpreted instructions in a frame";
    fields.source("§3(6)").whole("batch", 1..=u8::MAX, "instructions", about, batch);
}

/// Visits the field `profile`, which both ends have.
fn profile_of(fields: &mut impl FieldVisitor, profile: &mut Profile) {
    fields.source("§3(2)").inline("profile", "Profile", "how frames are written", profile);
}

impl Configure for ControllerConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            profile,
            words,
            batch,
            tick,
            silence,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        instructions(fields, words, batch);
        let about = "the controller's cycle, at whose end answers are sent";
        fields.source("§4.1").time("tick", ANY_TIME, about, tick);
        let about = "the silence after which corrupt bytes are answered and an incomplete frame is dropped";
        fields.time("silence", ANY_TIME, about, silence);
        fields.echo(echo);
        profile_of(fields, profile);
    }
}

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            profile,
            words,
            baud,
            batch,
            resends,
            resend_on_silence,
            answer_timeout,
            execution_timeout,
            settle,
            max_pause,
            reply_time,
            longest_frame,
            earlier_execution,
            controller_drops_partial,
            backoff,
            full_timeout,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.baud(LINE, baud);
        instructions(fields, words, batch);
        let about = "how often a frame is resent after an error code";
        fields.whole("resends", 0..=u8::MAX, "times", about, resends);
        let about = "resend a frame without an answer: it may be executed several times";
        fields.flag("resend_on_silence", about, resend_on_silence);
        let about = "the timeout for the answer of interpreted instructions; longer below 9600 baud, by the extra time of 11 bytes";
        fields.time("answer_timeout", ANY_TIME, about, answer_timeout);
        let about =
            "assumed: the longest execution of an immediate instruction or a query; longer below 9600 baud";
        fields.time("execution_timeout", ANY_TIME, about, execution_timeout);
        let about = "assumed: the latest answer after its frame; longer below 9600 baud";
        fields.time("settle", ANY_TIME, about, settle);
        let about = "assumed: the longest pause of PC and line within a frame";
        fields.time("max_pause", ANY_TIME, about, max_pause);
        let about = "assumed: the longest from the controller's decision to the end of its answer; longer below 9600 baud";
        fields.time("reply_time", ANY_TIME, about, reply_time);
        let about = "assumed: the longest frame that a host on this line sends";
        fields.whole("longest_frame", 0..=Frame::MAX_LEN, "bytes", about, longest_frame);
        let about = "assumed: how long instructions of an earlier host may still be executed";
        fields.time("earlier_execution", ANY_TIME, about, earlier_execution);
        let about = "the controller drops a partial frame when it answers an error code";
        fields.flag("controller_drops_partial", about, controller_drops_partial);
        fields.time("backoff", ANY_TIME, "the delay when the queue is full", backoff);
        let about = "how long the queue may be full before a frame counts as refused";
        fields.time("full_timeout", ANY_TIME, about, full_timeout);
        fields.echo(echo);
        profile_of(fields, profile);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(ControllerConfig, ControllerConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
