//! The bodies of the fuzz targets, one module per link: each takes the fuzzer's bytes and panics when an oracle fails.
//!
//! The oracles are not only "no panic": decode(encode(x)) = x, any chunking gives the same frames, an accepted frame encodes to
//! the same bytes, a session keeps its invariants.

pub mod codecs;
pub mod fanuc_hmi_modbus;
pub mod fanuc_ls;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod kawasaki_work;
pub mod laser_eb90;
pub mod mmacell_proto;
pub mod val2_alter;
pub mod val2_viewer;

/// The program of a target: libFuzzer's, in a build with `--cfg fuzzing`.
#[macro_export]
macro_rules! program {
    ($target:path) => {
        #[cfg(fuzzing)]
        libfuzzer_sys::fuzz_target!(|data: &[u8]| $target(data));

        #[cfg(not(fuzzing))]
        fn main() {
            eprintln!("not built for fuzzing: use .ci/fuzz or cargo fuzz run");
            std::process::exit(2);
        }
    };
}

/// A target's body.
pub type Target = fn(&[u8]);

/// Every target by the name of its corpus folder.
pub const TARGETS: &[(&str, Target)] = &[
    ("fanuc_hmi_modbus_assignment", fanuc_hmi_modbus::fanuc_hmi_modbus_assignment),
    ("fanuc_hmi_modbus_client", fanuc_hmi_modbus::fanuc_hmi_modbus_client),
    ("fanuc_hmi_modbus_decoder", fanuc_hmi_modbus::fanuc_hmi_modbus_decoder),
    ("fanuc_hmi_modbus_message", fanuc_hmi_modbus::fanuc_hmi_modbus_message),
    ("fanuc_hmi_modbus_motion", fanuc_hmi_modbus::fanuc_hmi_modbus_motion),
    ("fanuc_hmi_modbus_server", fanuc_hmi_modbus::fanuc_hmi_modbus_server),
    ("fanuc_ls_program", fanuc_ls::fanuc_ls_program),
    ("fanuc_ls_trajectory", fanuc_ls::fanuc_ls_trajectory),
    ("isra_ball_ball", isra_ball::isra_ball_ball),
    ("isra_ball_decoder", isra_ball::isra_ball_decoder),
    ("isra_ball_host", isra_ball::isra_ball_host),
    ("isra_ball_message", isra_ball::isra_ball_message),
    ("kawasaki_msg_decoder", kawasaki_msg::kawasaki_msg_decoder),
    ("kawasaki_msg_message", kawasaki_msg::kawasaki_msg_message),
    ("kawasaki_msg_pc", kawasaki_msg::kawasaki_msg_pc),
    ("kawasaki_msg_robot", kawasaki_msg::kawasaki_msg_robot),
    ("kawasaki_msg_work", kawasaki_work::kawasaki_msg_work),
    ("laser_eb90_controller", laser_eb90::laser_eb90_controller),
    ("laser_eb90_decoder", laser_eb90::laser_eb90_decoder),
    ("laser_eb90_host", laser_eb90::laser_eb90_host),
    ("laser_eb90_message", laser_eb90::laser_eb90_message),
    ("mmacell_proto_central", mmacell_proto::mmacell_proto_central),
    ("mmacell_proto_command", mmacell_proto::mmacell_proto_command),
    ("mmacell_proto_device", mmacell_proto::mmacell_proto_device),
    ("mmacell_proto_message", mmacell_proto::mmacell_proto_message),
    ("mmacell_proto_reply", mmacell_proto::mmacell_proto_reply),
    ("mmacell_task", mmacell_proto::mmacell_task),
    ("tokio_codecs", codecs::tokio_codecs),
    ("val2_alter_controller", val2_alter::val2_alter_controller),
    ("val2_alter_decoder", val2_alter::val2_alter_decoder),
    ("val2_alter_host", val2_alter::val2_alter_host),
    ("val2_alter_message", val2_alter::val2_alter_message),
    ("val2_viewer_decoder", val2_viewer::val2_viewer_decoder),
    ("val2_viewer_host", val2_viewer::val2_viewer_host),
    ("val2_viewer_message", val2_viewer::val2_viewer_message),
    ("val2_viewer_workstation", val2_viewer::val2_viewer_workstation),
];

/// What `encode` writes into a buffer of exactly `len` bytes, which it must fill; a shorter buffer is refused.
fn written<E>(len: usize, encode: impl Fn(&mut [u8]) -> Result<usize, E>) -> Result<Vec<u8>, E> {
    let mut out = vec![0; len];
    assert!(encode(&mut out[..len.saturating_sub(1)]).is_err(), "one byte less is not enough");
    let filled = encode(&mut out)?;
    assert_eq!(filled, len, "the encoded length is wrong");
    Ok(out)
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
    fn every_target_has_a_libfuzzer_program() {
        let manifest = include_str!("../Cargo.toml");
        for (name, _) in TARGETS {
            let program =
                Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz_targets").join(format!("{name}.rs"));
            assert!(program.exists(), "{} is missing", program.display());
            assert!(manifest.contains(&format!("name = \"{name}\"")), "{name} is not in the manifest");
        }
    }
}
