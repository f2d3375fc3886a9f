//! Signals by the names of the teach pendant.

use fanuc_hmi_modbus::Signal;

/// The names, in a sentence.
pub(super) const NAMES: &str = "DI[n], RI[n], UI[n], UO[n], SI[n], SO[n], WI[n], WO[n], WSI[n], WSO[n], DO[n], RO[n], F[n], GI[n], GO[n], AI[n], AO[n] or R[n]";

/// Parses the signal of this name, such as `DI[1]`; its number may be outside its range.
pub(super) fn parse(name: &str) -> Option<Signal> {
    let (letters, number) = name.trim().strip_suffix(']')?.split_once('[')?;
    let number = number.parse().ok()?;
    Some(match letters {
        "DI" => Signal::Di(number),
        "RI" => Signal::Ri(number),
        "UI" => Signal::Ui(number),
        "UO" => Signal::Uo(number),
        "SI" => Signal::Si(number),
        "SO" => Signal::So(number),
        "WI" => Signal::Wi(number),
        "WO" => Signal::Wo(number),
        "WSI" => Signal::Wsi(number),
        "WSO" => Signal::Wso(number),
        "DO" => Signal::Do(number),
        "RO" => Signal::Ro(number),
        "F" => Signal::Flag(number),
        "GI" => Signal::Gi(number),
        "GO" => Signal::Go(number),
        "AI" => Signal::Ai(number),
        "AO" => Signal::Ao(number),
        "R" => Signal::R(number),
        _ => return None,
    })
}
