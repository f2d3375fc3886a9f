//! The bodies of the fuzz targets, one module per link: each takes the fuzzer's bytes and panics when an oracle fails.
//!
//! The oracles are not only "no panic": decode(encode(x)) = x, any chunking gives the same frames, an accepted frame encodes to
//! the same bytes, a session keeps its invariants.

mod codecs;
mod fanuc_hmi_modbus;
mod fanuc_ls;
mod isra_ball;
mod kawasaki_msg;
mod kawasaki_work;
mod laser_eb90;
mod mmacell_proto;
mod val2_alter;
mod val2_viewer;

/// A target's body.
pub type Target = fn(&[u8]);

macro_rules! targets {
    ($($module:ident: $($target:ident)+;)+) => { &[$($((stringify!($target), $module::$target)),+),+] };
}

/// Every target by the name of its corpus folder.
const TARGETS: &[(&str, Target)] = targets! {
    codecs: tokio_codecs;
    fanuc_hmi_modbus: fanuc_hmi_modbus_assignment fanuc_hmi_modbus_client fanuc_hmi_modbus_decoder
        fanuc_hmi_modbus_message fanuc_hmi_modbus_motion fanuc_hmi_modbus_server;
    fanuc_ls: fanuc_ls_program fanuc_ls_trajectory;
    isra_ball: isra_ball_ball isra_ball_decoder isra_ball_host isra_ball_message;
    kawasaki_msg: kawasaki_msg_decoder kawasaki_msg_message kawasaki_msg_pc kawasaki_msg_robot;
    kawasaki_work: kawasaki_msg_work;
    laser_eb90: laser_eb90_controller laser_eb90_decoder laser_eb90_host laser_eb90_message;
    mmacell_proto: mmacell_proto_central mmacell_proto_command mmacell_proto_device mmacell_proto_message
        mmacell_proto_reply mmacell_task;
    val2_alter: val2_alter_controller val2_alter_decoder val2_alter_host val2_alter_message;
    val2_viewer: val2_viewer_decoder val2_viewer_host val2_viewer_message val2_viewer_workstation;
};

/// The target of a name, for a program that holds no other.
pub const fn target(name: &str) -> Target {
    let mut targets = TARGETS;
    while let [(first, target), rest @ ..] = targets {
        if is_same(first.as_bytes(), name.as_bytes()) {
            return *target;
        }
        targets = rest;
    }
    panic!("there is no such target")
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    match (a, b) {
        ([], []) => true,
        ([first, a @ ..], [other, b @ ..]) => *first == *other && is_same(a, b),
        _ => false,
    }
}

/// What `encode` writes into a buffer of exactly `len` bytes, which it must fill; a shorter buffer is refused.
fn written<E>(len: usize, encode: impl Fn(&mut [u8]) -> Result<usize, E>) -> Result<Vec<u8>, E> {
    let mut out = vec![0; len];
    assert!(encode(&mut out[..len.saturating_sub(1)]).is_err(), "one byte less is not enough");
    let filled = encode(&mut out)?;
    assert_eq!(filled, len, "the encoded length is wrong");
    Ok(out)
}

/// The next step of a script: `N` bytes, of which the last says how many more there are, and these.
fn step<'a, const N: usize>(script: &mut &'a [u8]) -> Option<([u8; N], &'a [u8])> {
    let (step, rest) = script.split_first_chunk::<N>()?;
    let bytes;
    (bytes, *script) = rest.split_at(usize::from(step[N - 1]).min(rest.len()));
    Some((*step, bytes))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::TARGETS;

    #[test]
    fn every_target_holds_over_its_corpus() {
        for (name, target) in TARGETS {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
            let inputs = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
            let mut replayed = 0;
            for input in inputs {
                let path = input.unwrap().path();
                println!("{}", path.display()); // shown when the target panics
                target(&std::fs::read(&path).unwrap());
                replayed += 1;
            }
            assert!(replayed > 0, "{name} has no corpus");
        }
    }

    #[test]
    fn every_corpus_has_a_target() {
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
        for folder in std::fs::read_dir(corpus).unwrap() {
            let name = folder.unwrap().file_name();
            assert!(TARGETS.iter().any(|(target, _)| *target == name), "{} is no target", name.display());
        }
    }
}
