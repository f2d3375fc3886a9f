//! The configurations of both ends, field by field.

use core::mem::discriminant;

use robot_session::spec::{ANY_TIME, Configure, FieldVisitor, SOME_TIME};

use crate::client::ClientConfig;
use crate::framing::Framing;
use crate::server::ServerConfig;
use crate::timing;

/// Visits the field `framing`, and the time of a framing that has one.
fn framing_of(fields: &mut impl FieldVisitor, framing: &mut Framing) {
    // A framing that is chosen already keeps its time.
    let before = *framing;
    let or_before = |it: Framing| if discriminant(&it) == discriminant(&before) { before } else { it };
    let rtu = or_before(Framing::Rtu { silence: timing::silence(19_200) });
    let choices = [("tcp", Framing::Tcp), ("rtu", rtu), ("rtu_over_tcp", or_before(Framing::RTU_OVER_TCP))];
    let about = "the transport; rtu has its silence, rtu_over_tcp its stall";
    fields.source("TCP, SL").choice("framing", &choices, about, framing);
    match framing {
        Framing::Tcp => {}
        Framing::Rtu { silence } => {
            let about = "on a serial line, the silence between frames";
            fields.source("SL §2.5.1.1").time("silence", SOME_TIME, about, silence);
        }
        Framing::RtuOverTcp { stall } => {
            let about =
                "in RTU over TCP, the silence that ends an incomplete reply, or bytes that are no frame";
            fields.time("stall", SOME_TIME, about, stall);
        }
    }
}

impl Configure for ClientConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            framing,
            timeout,
            in_flight,
            any_unit,
            broadcast,
            turnaround,
            settle,
            pause,
            echo,
            #[cfg(feature = "model")]
                transactions: _,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.time("timeout", SOME_TIME, "from a request to its reply", timeout);
        let about = "requests in flight at once; at most the client's slots, on a serial line 1";
        fields.whole("in_flight", 1..=16, "requests", about, in_flight);
        fields.flag("any_unit", "accept a reply from another unit", any_unit);
        let about = "unit 0 is a broadcast without replies; default true in RTU frames";
        fields.source("SL §2.2").flag("broadcast", about, broadcast);
        let about = "the time for units to execute a broadcast; on a serial line the longest frame is added";
        fields.source("SL §2.4.1").time("turnaround", ANY_TIME, about, turnaround);
        let about = "assumed: in RTU frames, the latest reply after its request has timed out";
        fields.time("settle", ANY_TIME, about, settle);
        fields.time("pause", ANY_TIME, "from the end of a request to the next one", pause);
        fields.echo(echo);
        framing_of(fields, framing);
    }
}

impl Configure for ServerConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            framing,
            unit,
            broadcast,
            frame_timeout,
            echo,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        let about = "its unit number; any: all";
        fields.source("SL §2.2").whole_or("unit", 0..=u8::MAX, "", "any", about, unit);
        let about = "unit 0 is a broadcast, executed without a reply";
        fields.source("SL §2.2").flag("broadcast", about, broadcast);
        let about = "on a serial line, how long the rest of an incomplete request is waited for";
        fields.time("frame_timeout", SOME_TIME, about, frame_timeout);
        fields.echo(echo);
        framing_of(fields, framing);
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(ClientConfig, ClientConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(ServerConfig, ServerConfig::default());
