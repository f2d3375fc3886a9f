//! `cellwire run kawasaki`: tables and plants that are refused, each with its lines.

use std::fs;
use std::process::Command;

/// Returns the exit status and the remarks of a dry run.
fn dry_run(table: &str, plant: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let (file, settings) = (folder.path().join("jobs.csv"), folder.path().join("plant.toml"));
    fs::write(&file, table).unwrap();
    fs::write(&settings, plant).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args([
            "run",
            "kawasaki",
            file.to_str().unwrap(),
            "--dry-run",
            "--settings",
            settings.to_str().unwrap(),
        ])
        .output()
        .unwrap();
    assert!(!folder.path().join("jobs.csv.journal").exists());
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

const SPEEDS: &str = r#"[[job]]
name = "way"
kind = "decimal"
places = 2
range = [-1.5, 9.75]

[[job]]
name = "tool"
kind = "text"
length = [1, 4]
default = "pen"
"#;

#[test]
fn every_bad_line_of_a_table_is_named() {
    let table = "way,tool\n1.5,pen\n9.76,pen\n-1.5,\n# a remark\n1.255,x\nfast,x\n,x\n1,pencil\n1,a$b\n1,x,2\n-.5,ä\n";
    let (code, said) = dry_run(table, SPEEDS);
    assert_eq!(code, Some(2));
    let lines: Vec<&str> = said.lines().skip(1).map(str::trim).collect();
    assert_eq!(
        lines,
        [
            "line 3: field 'way' is 9.76, not from -1.50 to 9.75",
            "line 6: field 'way' has more than 2 decimals",
            "line 7: field 'way' is not a number from -1.50 to 9.75",
            "line 8: field 'way' is missing, and has no default",
            "line 9: field 'tool' has 6 characters, not from 1 to 4",
            "line 10: field 'tool' holds '$', which is a mark",
            "line 11: 3 cells, but 2 fields are named",
            "line 12: field 'tool' holds 'ä', which is not in the character set",
        ],
        "{said}"
    );
    assert_eq!(dry_run("tool,way\npen,1.5\n,-.5\n", SPEEDS), (Some(0), String::new()));
    for (table, why) in [
        ("", "it has no jobs"),
        ("way\n", "it has no jobs"),
        ("way,speed\n1,2\n", "`speed` in the first line is not a field of a job; a job has way, tool"),
        ("1,2\n1,2\n", "`1` in the first line is not a field of a job"),
        ("tool\npen\n", "the field `way` is missing in the first line and has no default"),
        ("way,way\n1,2\n", "the first line names `way` twice"),
    ] {
        let (code, said) = dry_run(table, SPEEDS);
        assert_eq!(code, Some(2), "{table}");
        assert!(said.contains(why), "{table}: {said}");
    }
    let many: String = (0..50).map(|_| "10\n").collect();
    let (_, said) = dry_run(&format!("way\n{many}"), SPEEDS);
    assert!(said.lines().count() == 22 && said.contains("and 30 lines more"), "{said}");
}

#[test]
fn a_plant_that_contradicts_itself_is_refused_with_its_line() {
    let field = |text: &str| format!("{SPEEDS}\n[[job]]\nname = \"speed\"\nkind = \"whole\"\n{text}\n");
    for (plant, line, why) in [
        (field("range = [5, 1]"), 16, "the range is empty"),
        (field("range = [1, 100]\ndefault = 101"), 17, "its default 101 is 101, not from 1 to 100"),
        (field("places = 2"), 16, "`places` is of a field of the kind decimal"),
        (field("length = [1, 2]"), 16, "`length` is of a field of the kind text"),
        (field("range = [1.5, 2]"), 16, "its end 1.5 "),
        (field("speed = 2"), 16, "unknown field `speed`"),
        (SPEEDS.replace("tool", "way"), 8, "there are two of this name"),
        (SPEEDS.replace("tool", "to ol"), 8, "a name has 1 to 15 letters"),
        (SPEEDS.replace("pen", "pencil"), 11, "its default pencil has 6 characters, not from 1 to 4"),
        (SPEEDS.replace("pen", "p$"), 11, "its default p$ holds '$', which is a mark"),
        (SPEEDS.replace("[1, 4]", "[1, 400]"), 10, "give [LEAST, MOST] characters, of 0 to 32"),
        (SPEEDS.replace("places = 2\n", ""), 3, "a decimal has `places`"),
        (SPEEDS.replace("places = 2", "places = 10"), 4, "give 1 to 9"),
        (SPEEDS.replace("\"text\"", "\"string\""), 7, "unknown variant `string`"),
        (
            "udp = true\n\n[messages.job_ack]\nfields = [\"number\"]\n".into(),
            3,
            "over datagrams the message of the role JobAck needs",
        ),
        ("acks = \"individual\"\n[messages.job_ack]\nsent = false\n".into(), 2, "lacks the role JobAck"),
        ("[limits]\npacket = 60\n".into(), 1, "cannot carry the messages of the table"),
        (
            "takeover = \"interrupt\"\n[messages.order_interrupt]\nsent = false\n".into(),
            2,
            "with takeover=end or never it does not",
        ),
        ("max_number = 1\n".into(), 1, "out of range, give 2 to 9999"),
        ("job = []\n".into(), 1, "a job has 1 to 24 fields, not 0"),
        ("job = [1]\n".into(), 1, "field 1 of a job"),
    ] {
        let (code, said) = dry_run("way,kind,x1,y1,x2,y2\n", &plant);
        assert_eq!(code, Some(2), "{plant}: {said}");
        let place = format!("plant.toml, line {line}: ");
        assert!(said.contains(&place) && said.contains(why), "{plant}\n{said}");
    }
}
