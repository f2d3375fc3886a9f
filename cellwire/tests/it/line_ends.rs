//! Files whose lines end with CR LF, and texts that begin with the mark of an editor, are read as others are: to the line of
//! an error.

use std::fs;
use std::path::Path;
use std::process::Command;

const SVG: &str = "<?xml version=\"1.0\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"50mm\" height=\"20mm\">\n<path d=\"M 0 0\nL 40 20\" stroke=\"red\"/>\n</svg>\n";
const TRAJECTORY: &str =
    "t,j1,j2,j3,j4,j5,j6\n0,0,0,0,0,-90,0\n0.1,1,0,0,0,-90,0\n0.2,2,0,0,0,-90,0\n0.3,2,0,0,0,-90,0\n";
const LS: &str = include_str!("../../../reference/ls/minimal.ls");

/// The command, its file, the contents, and whether it is a text that people write with an editor.
const READ: [(&str, &str, &str, bool); 13] = [
    ("run kawasaki --dry-run", "jobs.csv", "# a remark\nkind,x1,y1,x2,y2\n1,0,0,1,10\n\n1,0,0,2,10\n", true),
    ("run kawasaki --dry-run", "bad.csv", "kind,x1,y1,x2,y2\n1,0,0,1,10\n1,0,0,x,10\n", true),
    ("run laser --dry-run", "a.csv", "# x\nword,x,y,z,a,b,length\ncut,1,2,3,4,5,6\ncut,2,2,3,4,5,6\n", true),
    ("run laser --dry-run", "bad.csv", "cut,1,2\nfold,1,2\n", true),
    ("run laser --dry-run", "a.nc", "%\nG21 G90\nM3\nG1 X20 (c)\nY20 ; end\nM30\n", true),
    ("run laser --dry-run", "bad.nc", "G0 X1\nG41 X2\n", true),
    ("run laser --dry-run", "a.svg", SVG, true),
    ("decode isra-ball --format hex", "a.hex", "# t\n01 02 # c\n03\n", false),
    (
        "decode isra-ball --format trace",
        "a.trace",
        "# ball: x\n10 # 0.001000 s sent\n11 # 0.002000 s received\n",
        false,
    ),
    ("ls check", "A.LS", LS, true),
    ("ls check --format json", "A.LS", LS, true),
    ("ls make --mode dynamic", "path.csv", TRAJECTORY, true),
    ("decode kawasaki-msg --format raw - --settings", "plant.toml", "# c\nnothing = 1\n", true),
];

/// Returns the status and the outputs, with the line ends of Unix.
fn read(folder: &Path, command: &str, name: &str, content: &str) -> (Option<i32>, String, String) {
    fs::write(folder.join(name), content).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(command.split(' '))
        .arg(name)
        .current_dir(folder)
        .stdin(std::process::Stdio::null())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap().replace("\r\n", "\n");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn the_ends_of_lines_make_no_difference() {
    let folder = tempfile::tempdir().unwrap();
    for (command, name, content, is_text) in READ {
        let plain = content.replace("\r\n", "\n");
        let expected = read(folder.path(), command, name, &plain);
        assert!(
            expected.0 != Some(2) || expected.2.contains("line") || expected.2.contains("nothing"),
            "{expected:?}"
        );
        let dos = plain.replace('\n', "\r\n");
        assert_eq!(read(folder.path(), command, name, &dos), expected, "{command} {name}");
        if is_text {
            assert_eq!(
                read(folder.path(), command, name, &format!("\u{feff}{dos}")),
                expected,
                "{command} {name}"
            );
        }
    }
}
