//! `reference/defaults.json`: every field of every configuration, with the values that the code has.

use core::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::{ClientConfig, Framing as ModbusFraming, ServerConfig};
use fanuc_ls::{CommentRule, Rules};
use isra_ball::{BallConfig, HostConfig as BallHostConfig};
use kawasaki_msg::{Acks, Limits as PacketLimits, PcConfig, RecoveryLimits, RobotConfig, Takeover};
use laser_eb90::{
    ControllerConfig as LaserControllerConfig, ErrorCodes, HostConfig as LaserHostConfig, Profile, Words,
};
use mmacell_proto::{CentralConfig, DeviceConfig, Dialect as LineDialect};
use serde::Serialize;
use val2_alter::{
    ControllerConfig as AlterControllerConfig, Framing, HostConfig as AlterHostConfig, LeadingDle, Limits,
    Policy, Unselected,
};
use val2_viewer::{HostConfig as ViewerHostConfig, WorkstationConfig};

use crate::json::{self, Object};

/// Takes a configuration apart, so that a field without a row does not compile: the value as JSON, the unit, the range, the source.
macro_rules! rows {
    ($rows:ident, $link:literal, $name:literal, $type:ident = $value:expr; $hidden:tt
     $($field:ident: $json:expr, $unit:literal, $range:literal, $source:literal;)*) => {{
        rows!(@$hidden $type, $value, $($field)*);
        $($rows.push(row($link, $name, stringify!($field), &$json, [$unit, $range, $source])?);)*
    }};
    (@model $type:ident, $value:expr, $($field:ident)*) => { let $type { $($field,)* without: _ } = $value; };
    (@rules $type:ident, $value:expr, $($field:ident)*) => { let $type { $($field,)* rules: _ } = $value; };
    // The model counts transactions too.
    (@counted $type:ident, $value:expr, $($field:ident)*) => {
        let $type { $($field,)* transactions: _, rules: _ } = $value;
    };
    // Its fields may become more.
    (@open $type:ident, $value:expr, $($field:ident)*) => { let $type { $($field,)* .. } = $value; };
    (@plain $type:ident, $value:expr, $($field:ident)*) => { let $type { $($field,)* } = $value; };
}

fn row(link: &str, config: &str, field: &str, value: &impl Serialize, about: [&str; 3]) -> Result<String> {
    let [unit, range, source] = about;
    Ok(Object::new()
        .value("link", link)?
        .value("config", config)?
        .value("field", field)?
        .value("unit", unit)?
        .value("range", range)?
        .value("default", value)?
        .value("source", source)?
        .end())
}

/// Nanoseconds; for ever is `null`.
fn time(time: Duration) -> Option<u64> {
    u64::try_from(time.as_nanos()).ok().filter(|_| time != Duration::MAX)
}

/// The text of the file.
pub(crate) fn file() -> Result<String> {
    let mut rows = Vec::new();
    alter(&mut rows)?;
    others(&mut rows)?;
    laser(&mut rows)?;
    mma(&mut rows)?;
    modbus(&mut rows)?;
    kawasaki(&mut rows)?;
    programs(&mut rows)?;
    Ok(json::file("defaults.schema.json", &[], "fields", &rows).replacen("../", "", 1))
}

fn alter(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "val2-alter", "Framing", Framing = Framing::DEFAULT; plain
        leading_dle: if leading_dle == LeadingDle::One { 1 } else { 2 }, "bytes", "1 or 2", "§3.2";
        negated_sum: negated_sum, "bool", "true or false", "§3.2";
        stuffed_checksum: stuffed_checksum, "bool", "true or false", "§3.2";
        ignore_spare_select: ignore_spare_select, "bool", "true or false", "ours";
    }
    rows! { rows, "val2-alter", "Limits", Limits = Limits::default(); plain
        velocity: velocity, "units of a word in a cycle, for each axis", "0 to 65535; above 32767 counts as 32767", "ours";
        acceleration: acceleration, "units of a word in a cycle, per cycle, for each axis", "0 to 65535; above 32767 counts as 32767", "ours";
    }
    rows! { rows, "val2-alter", "HostConfig", AlterHostConfig = AlterHostConfig::default(); rules
        framing: framing, "object", "Framing", "§3.2";
        baud: baud, "baud", "0 counts as 1; from what one value in the window needs", "§3.2";
        mode: mode, "number", "0 to 255", "§10.4";
        limits: serde_json::json!({"velocity": limits.velocity, "acceleration": limits.acceleration}), "object", "Limits", "ours";
        subroutine: subroutine, "bool", "true or false", "§10.4";
        policy: match policy { Policy::Accept => "accept", Policy::Refuse => "refuse", Policy::Ignore => "ignore" }, "word", "accept, refuse, ignore", "§10.6";
        repeats: repeats, "number", "0 to 255", "§3.2";
        silence_cycles: silence_cycles, "cycles of 28 ms", "2 to 4294967295", "ours";
        gap: gap.and_then(time), "ns", "from 0; null: a silence ends no frame", "ours";
        target_timeout: time(target_timeout), "ns", "from 0; null: for ever", "ours";
        reserve: time(reserve), "ns", "from 0 to what one value in the window leaves", "ours";
        max_delay: time(max_delay), "ns", "from 0", "ours";
    }
    rows! { rows, "val2-alter", "ControllerConfig", AlterControllerConfig = AlterControllerConfig::default(); rules
        framing: framing, "object", "Framing", "§3.2";
        baud: baud, "baud", "0 counts as 1; from what one value in the window needs", "§3.2";
        mode: mode, "number", "0 to 255", "§10.4";
        data: data, "words", "0 to 14 of them, -32768 to 32767", "§3";
        subroutine: subroutine, "bool", "true or false", "§10.4";
        attempts: attempts, "number", "1 to 255", "§3.2";
        unselected: match unselected { Unselected::ByMode => "by_mode", Unselected::Hold => "hold", Unselected::Zero => "zero" }, "word", "by_mode, hold, zero", "§3.3.2";
        gap: gap.and_then(time), "ns", "from 0; null: a silence ends no frame", "ours";
    }
    Ok(())
}

fn others(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "isra-ball", "HostConfig", BallHostConfig = BallHostConfig::default(); rules
        baud: baud, "baud", "from 1", "§4.1";
        period: time(period), "ns", "from an exchange, rounded up to a millisecond", "§3.4";
        max_delay: time(max_delay), "ns", "from 0", "ours";
        max_age: time(max_age), "ns", "above 2 · max(period, window) + window; null: for ever", "ours";
    }
    rows! { rows, "isra-ball", "BallConfig", BallConfig = BallConfig::default(); rules
        sensor_type: sensor_type, "number", "0 to 7", "§4.2";
        sensor: sensor, "number", "0 to 7", "§4.2";
    }
    rows! { rows, "val2-viewer", "HostConfig", ViewerHostConfig = ViewerHostConfig::default(); rules
        interval: time(interval), "ns", "above 0; null: for ever", "ours";
        max_age: time(max_age), "ns", "above 0; null: for ever", "ours";
        format: { let _ = format; "pose" }, "word", "pose, or a format of the caller's", "§5";
    }
    rows! { rows, "val2-viewer", "WorkstationConfig", WorkstationConfig = WorkstationConfig::default(); rules
        pause: time(pause), "ns", "above 200 ms; null: for ever", "ours";
        stale_after: time(stale_after), "ns", "above 200 ms; null: for ever", "ours";
    }
    Ok(())
}

fn laser(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "laser-eb90", "Profile", Profile = Profile::default(); plain
        tail: tail, "word", "printed, etx, either", "§3(2)";
        flag: flag, "word", "separate, first_tag", "§3(2)";
        tags: tags, "object", "four different bytes: f32, i16, u8, char", "§3(2) for f32 and char; ours";
        checksum: checksum, "word", "u8, u16_le, u16_be", "§3(2); ours";
        checksum_negated: checksum_negated, "bool", "true or false", "ours";
        checksum_with_flag: checksum_with_flag, "bool", "true or false", "ours";
        byte_order: byte_order, "word", "little, big", "ours";
    }
    rows! { rows, "laser-eb90", "ErrorCodes", ErrorCodes = ErrorCodes::default(); plain
        bad_checksum: bad_checksum, "word", "0 to 65535, all different, no command word", "§3(5); the number ours";
        bad_frame: bad_frame, "word", "as bad_checksum", "§3(5); the number ours";
        unknown_command: unknown_command, "word", "as bad_checksum", "ours";
        bad_batch: bad_batch, "word", "as bad_checksum", "ours";
        bad_parameters: bad_parameters, "word", "as bad_checksum", "ours";
        queue_full: queue_full, "word", "as bad_checksum", "§3(5); the number ours";
    }
    let words = Words::default();
    rows.push(row(
        "laser-eb90",
        "Words",
        "words",
        &words,
        [
            "object",
            "up to 32 ranges of command words, by default 0100h to 01FFh interpreted, 0200h to 02FFh immediate, 0300h to 03FFh query; \
             and the error codes",
            "§2; the numbers ours",
        ],
    )?);
    rows! { rows, "laser-eb90", "HostConfig", LaserHostConfig = LaserHostConfig::default(); rules
        profile: profile, "object", "Profile", "§3(2)";
        words: words, "object", "Words", "§2; the numbers ours";
        baud: baud, "baud", "from 1; below 9600 the defaults of answer_timeout, execution_timeout, settle and reply_time are longer by what 11 bytes take longer", "ours";
        batch: batch, "instructions", "1 to 255", "§3(6)";
        resends: resends, "number", "0 to 255", "ours";
        resend_on_silence: resend_on_silence, "bool", "true or false", "ours";
        answer_timeout: time(answer_timeout), "ns", "from 0; null: for ever", "ours";
        execution_timeout: time(execution_timeout), "ns", "from 0; null: for ever", "ours";
        settle: time(settle), "ns", "from 0", "ours";
        max_pause: time(max_pause), "ns", "from 0", "ours";
        reply_time: time(reply_time), "ns", "from 0", "ours";
        longest_frame: longest_frame, "bytes", "from 0", "ours";
        earlier_execution: time(earlier_execution), "ns", "from 0", "ours";
        controller_drops_partial: controller_drops_partial, "bool", "true or false", "ours";
        backoff: time(backoff), "ns", "from 0", "ours";
        full_timeout: time(full_timeout), "ns", "from 0; null: for ever", "ours";
    }
    rows! { rows, "laser-eb90", "ControllerConfig", LaserControllerConfig = LaserControllerConfig::default(); rules
        profile: profile, "object", "Profile", "§3(2)";
        words: words, "object", "Words", "§2; the numbers ours";
        batch: batch, "instructions", "1 to 255", "§3(6)";
        tick: time(tick), "ns", "from 0", "§4.1";
        silence: time(silence), "ns", "from 0", "ours";
    }
    Ok(())
}

fn mma(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "mmacell-proto", "Dialect", LineDialect = LineDialect::STRICT; plain
        itr: itr, "bool", "true or false", "§6 steps 17 and 20";
        ovrd: ovrd, "bool", "true or false", "§6 step 4";
        clos: clos, "bool", "true or false", "§4.10";
        off: off, "bool", "true or false", "ours";
        lone_lf: lone_lf, "bool", "true or false", "§4";
        blank: blank, "bool", "true or false", "§4";
        wide_integers: wide_integers, "bool", "true or false", "§4";
    }
    rows! { rows, "mmacell-proto", "CentralConfig", CentralConfig = CentralConfig::DEFAULT; rules
        accepts: accepts, "object", "Dialect", "§4";
        writes: writes, "object", "Dialect", "§4";
        timeout: time(timeout), "ns", "above 0; null: for ever", "ours";
        settle: time(settle), "ns", "from 0", "ours";
        tolerance: tolerance, "units of the last digit: 1 µm, 0.1 mrad", "0 to 4294967295", "ours";
    }
    rows! { rows, "mmacell-proto", "DeviceConfig", DeviceConfig = DeviceConfig::DEFAULT; rules
        accepts: accepts, "object", "Dialect", "§4";
        writes: writes, "object", "Dialect", "§4";
        refusal: refusal, "error number", "other than 0, in the range of an integer of `writes`", "§5";
    }
    Ok(())
}

fn modbus(rows: &mut Vec<String>) -> Result<()> {
    let word = |framing| match framing {
        ModbusFraming::Tcp => "tcp",
        ModbusFraming::Rtu { .. } => "rtu",
        ModbusFraming::RtuOverTcp { .. } => "rtu_over_tcp",
    };
    rows! { rows, "fanuc-hmi-modbus", "ClientConfig", ClientConfig = ClientConfig::default(); counted
        framing: word(framing), "word", "tcp, rtu (with its silence), rtu_over_tcp (with its stall)", "TCP, SL";
        timeout: time(timeout), "ns", "above 0; null: for ever", "ours";
        in_flight: in_flight, "requests", "1 to 16, and to the places of the client; on a serial line 1", "ours";
        any_unit: any_unit, "bool", "true or false", "ours";
        broadcast: broadcast, "bool", "true or false", "SL §2.2";
        turnaround: time(turnaround), "ns", "from 0", "SL §2.4.1";
        settle: time(settle), "ns", "from 0", "ours";
    }
    rows! { rows, "fanuc-hmi-modbus", "ServerConfig", ServerConfig = ServerConfig::default(); rules
        framing: word(framing), "word", "tcp, rtu (with its silence), rtu_over_tcp (with its stall)", "TCP, SL";
        unit: unit, "number", "0 to 255; null: every unit", "SL §2.2";
        broadcast: broadcast, "bool", "true or false", "SL §2.2";
    }
    Ok(())
}

fn kawasaki(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "kawasaki-msg", "Limits", PacketLimits = PacketLimits::TCP; plain
        element: element, "bytes", "1 to 4096", "§7.4";
        packet: packet, "bytes", "1 to 4096; over UDP 1472", "§9.5";
    }
    rows! { rows, "kawasaki-msg", "RecoveryLimits", RecoveryLimits = RecoveryLimits::default(); plain
        resends: resends, "number", "0 to 65535", "§6.3; the number ours";
        pauses: pauses, "number", "0 to 65535", "§6.3; the number ours";
        clears: clears, "number", "0 to 65535", "§6.3; the number ours";
    }
    rows! { rows, "kawasaki-msg", "RobotConfig", RobotConfig = RobotConfig::TCP; rules
        dialect: { let _ = dialect; "the table of messages" }, "table", "a table that `Dialect::new` takes (KM-27, KM-28)", "§10.1; ours";
        limits: limits, "object", "Limits", "§9.5";
        datagrams: datagrams, "bool", "true or false", "ours";
        max_number: max_number, "number", "2 to 9999", "ours";
        acks: if let Acks::Cumulative { every } = acks { every.get().into() } else { serde_json::Value::from("individual") }, "jobs", "1 to 65535: every so many-th job, for all before it; or individual", "§11.2";
        low_water: low_water, "jobs", "null: half of the queue", "§7";
        recovery: serde_json::json!({"resends": recovery.resends, "pauses": recovery.pauses, "clears": recovery.clears}), "object", "RecoveryLimits", "§6.3";
        patience: time(patience), "ns", "from 0; null: for ever", "ours";
        pause: time(pause), "ns", "from 0", "ours";
        reply_timeout: time(reply_timeout), "ns", "from 0", "ours";
        exchange: time(exchange), "ns", "from 0", "§9.4";
        silent_cycles: silent_cycles, "cycles", "0 to 65535; 0: never", "ours";
        reconnect_delay: time(reconnect_delay), "ns", "from 0", "ours";
        status_period: time(status_period), "ns", "from 0; null: for ever", "ours";
        refuse_repeated_start: refuse_repeated_start, "bool", "true or false", "ours";
        end_foreign_order: end_foreign_order, "bool", "true or false", "ours";
    }
    rows! { rows, "kawasaki-msg", "PcConfig", PcConfig = PcConfig::TCP; rules
        dialect: { let _ = dialect; "the table of messages" }, "table", "a table that `Dialect::new` takes (KM-27, KM-28)", "§10.1; ours";
        limits: limits, "object", "Limits", "§9.5";
        datagrams: datagrams, "bool", "true or false", "ours";
        max_number: max_number, "number", "2 to 9999", "ours";
        cumulative_acks: cumulative_acks, "bool", "true or false", "§11.2";
        reply_delay: time(reply_delay), "ns", "from 0", "§7.1";
        silence: time(silence), "ns", "from 0; null: for ever", "ours";
        takeover: match takeover { Takeover::Never => "never", Takeover::End => "end", Takeover::Interrupt => "interrupt" }, "word", "never, end, interrupt", "ours";
        start_retries: start_retries, "number", "0 to 65535", "ours";
        end_when_done: end_when_done, "bool", "true or false", "ours";
    }
    Ok(())
}

fn programs(rows: &mut Vec<String>) -> Result<()> {
    rows! { rows, "fanuc-ls", "Rules", Rules = Rules::default(); open
        name_limit: name_limit, "characters", "from 0; 8 on old controllers", "ours";
        comment: match comment { CommentRule::Refuse => "refuse", CommentRule::Truncate => "truncate" }, "word", "refuse, truncate", "ours";
    }
    Ok(())
}
