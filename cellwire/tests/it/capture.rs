//! `cellwire capture`: tests made of what was recorded.

use std::fs;
use std::path::{Path, PathBuf};

use crate::tool::{cellwire, run};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Three requests of a Modbus client, and the replies of a server, a second apart; the last reply is corrupt.
const DUMP: &str = "\
O 10:00:00.0
0000 00 01 00 00 00 06 01 03 00 00 00 02
I 10:00:00.1
0000 00 01 00 00 00 07 01 03 04 04 57 0b b8
O 10:00:01.0
0000 00 02 00 00 00 06 01 06 00 01 00 03
I 10:00:01.1
0000 00 02 00 00 00 06 01 06 00 01 00 03
O 10:00:02.0
0000 00 03 00 00 00 06 01 03 00 00 00 02
I 10:00:02.1
0000 00 03 00 07 00 07 01 03 04 04 57 0b b8
";

struct Captured {
    folder: TempDir,
    dump: PathBuf,
}

impl Captured {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let dump = folder.path().join("dump.txt");
        fs::write(&dump, DUMP).unwrap();
        Self { folder, dump }
    }

    /// Returns the made file, the output, the status and the remarks.
    fn make(&self, how: &str) -> (Value, String, Option<i32>, String) {
        let out = self.folder.path().join("made.json");
        let _ = fs::remove_file(&out);
        let (status, printed, said) = run(cellwire(&format!(
            "capture {how} --format hexdump --source a-test --out {} {}",
            out.display(),
            self.dump.display()
        )));
        let made = fs::read_to_string(&out).map_or(Value::Null, |text| serde_json::from_str(&text).unwrap());
        if made != Value::Null {
            check(&out);
        }
        (made, printed, status, said)
    }
}

/// Asserts that the tool reads its own output.
fn check(file: &Path) {
    let folder = file.parent().unwrap().join("checked");
    fs::create_dir_all(&folder).unwrap();
    fs::copy(file, folder.join("made.json")).unwrap();
    let (status, printed, said) = run(cellwire(&format!("vectors check {}", folder.display())));
    assert_eq!(status, Some(0), "{printed} {said}");
}

#[test]
fn messages_become_vectors_and_streams() {
    let captured = Captured::new();
    let (made, _, status, said) = captured.make("to-vectors fanuc-hmi-modbus");
    assert_eq!(status, Some(0), "{said}");
    assert_eq!((&made["link"], &made["source"]), (&json!("fanuc-hmi-modbus"), &json!("a-test")));
    let vectors = made["vectors"].as_array().unwrap();
    // The request and the reply of a write are the same bytes.
    let froms: Vec<&str> = vectors.iter().map(|vector| vector["from"].as_str().unwrap()).collect();
    assert_eq!(froms, ["client", "server", "client", "client"]);
    assert_eq!(vectors[1]["hex"], "00010000000701030404570BB8");
    assert_eq!(vectors[1]["message"]["registers"], json!([1111, 3000]));
    let streams = made["streams"].as_array().unwrap();
    assert_eq!(streams.len(), 2);
    let last = streams[1]["items"].as_array().unwrap().last().unwrap();
    assert!(last.get("error").is_some(), "{last}");
    // A stretch, by number and by time.
    let hexes = |how: &str| {
        let (made, ..) = captured.make(&format!("to-vectors fanuc-hmi-modbus {how}"));
        let ids = made["vectors"].as_array().unwrap().iter();
        ids.map(|it| it["comment"].as_str().unwrap().split(',').next().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(hexes("--from 2 --to 3"), ["Message 2", "Message 3"]);
    assert_eq!(hexes("--from 0.5s --to 1.05s"), ["Message 3"]);
    let (_, _, status, said) = captured.make("to-vectors fanuc-hmi-modbus --from 50");
    assert!(status == Some(2) && said.contains("the range has none of the"), "{said}");
}

#[test]
fn what_is_replaced_is_said() {
    let captured = Captured::new();
    let (made, _, status, said) = captured.make("to-vectors fanuc-hmi-modbus --anonymous");
    assert_eq!(status, Some(0));
    assert_eq!(made["vectors"][1]["message"]["registers"], json!([0, 1]));
    assert_eq!(made["vectors"][1]["hex"], "00010000000701030400000001");
    assert!(!made.to_string().contains("0457"), "{made}");
    assert!(said.contains("replaced: 2 in `registers`; not replaced: message names"), "{said}");
    assert!(said.contains("left out: "), "{said}");
}

#[test]
fn what_an_end_was_given_becomes_a_story() {
    let captured = Captured::new();
    let (made, printed, status, said) = captured.make("to-story fanuc-hmi-modbus --as server --to 4");
    assert_eq!(status, Some(0), "{printed} {said}");
    // Our server has other values in its tables.
    assert!(printed.contains("\"departure\":\"values\",\"number\":1,"), "{printed}");
    assert!(printed.contains("\"expected\":2,\"same\":1,\"values\":1,\"departures\":0"), "{printed}");
    let story = &made["stories"][0];
    assert_eq!((&story["end"], &story["id"]), (&json!("server"), &json!(1)));
    let steps = story["steps"].as_array().unwrap();
    assert_eq!(steps[0]["do"], json!({"connected": true}));
    let input = steps.iter().find(|step| step["at"] == 1_000_000_000).unwrap();
    assert_eq!(input["do"], json!({"input": "000200000006010600010003"}));
    assert_eq!(input["transmit"], json!(["000200000006010600010003"]));

    // The client asks when its user does.
    let (_, printed, status, _) = captured.make("to-story fanuc-hmi-modbus --as client --to 2");
    assert_eq!(status, Some(1));
    assert!(printed.contains("\"departure\":\"missing\",\"number\":1,"), "{printed}");
}
