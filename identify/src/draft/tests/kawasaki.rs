//! Plants of unknown messages.

use std::time::Duration;

use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings;
use serde_json::json;

use super::super::{SentMessage, kawasaki};

/// Returns the draft of a conversation. Each line, or the text between two `;`, is a message: `pc Job M 7
///  501 101` has the header `M 7`, and `pc Job 501 101` has no header. `_` is a text without characters.
fn draft(talk: &str) -> anyhow::Result<String> {
    let said = |line: &str| {
        let (line, header) = match line.split_once('|') {
            Some((line, fields)) => (format!("{line} {fields}"), line.split_whitespace().count() - 2),
            None => (line.to_owned(), 0),
        };
        let words: Vec<String> = line.split_whitespace().map(|word| word.replace('_', "")).collect();
        let side = if words[0] == "pc" { "pc" } else { "robot" };
        let (header, fields) = words[2..].split_at(header);
        let message = json!({ "name": words[1], "header": header, "fields": fields });
        SentMessage { side, message, time: Duration::ZERO }
    };
    let lines = talk.split([';', '\n']).filter(|line| !line.trim().is_empty());
    let said = lines.map(said).collect::<Vec<_>>();
    let letters = said.iter().any(|it| !it.message.to_string().is_ascii());
    let text = kawasaki::draft(&said, if letters { "latin1" } else { "ascii" })?;
    let given = toml::from_str(&text).unwrap();
    settings::read("plant", Plant::default(), &given).unwrap().check().unwrap();
    Ok(text)
}

/// A plant with all roles and a header.
const WHOLE: &str = "
    robot Fill M 7 |; pc Fill M 7 |; robot State M 7 | 501 0 100 100 0; pc State M 7 | 501 0 100 100 0
    pc Start M 7 1 | 501 101; robot Taken M 7 2 | 501; robot Ask M 7 | 501 101; pc Job M 7 | 501 101 1 10.5 left
    robot Ask M 7 | 501 102; pc Job M 7 | 501 102 2 -3.25 right; pc State M 7 | 501 2 102 100 0; pc Stop M 7 | 501
    robot Ask M 7 | 501 103; pc Job M 7 | 501 103 1 7 right; robot Ack M 7 | 501 101; robot Ack M 7 | 501 102
    robot Ask M 7 | 501 104; pc Job M 7 | 501 104 1 8.5 left; robot Ask M 7 | 501 105; robot Ack M 7 | 501 103
    robot Hold M 7 | 501 104; robot Ack M 7 | 501 104; robot Fill M 7 |; pc End M 7 | 501; robot Done M 7 | 501 0 104
    robot State M 7 | 0 3 104 104 501
";

/// Jobs with two numbers that count, of which the robot speaks of the second; fields without an order in the status; more
/// messages than roles.
fn other() -> String {
    let mut talk = String::from(
        "robot Hello 9; pc Start 101 B7; pc Setup 0.5; robot Taken B7; pc State 101 102 103 0; robot State 101 102 103 0
        pc Note x 1 1; pc Note x 1; pc Note x 1; pc Note x 1; pc Note x 1",
    );
    for (n, work) in (1..).zip([5, 3, 5, 5, 3, 5]) {
        talk +=
            &format!("; robot Ask 10{n} 3; pc Ty\u{f6} {n} 10{n} up {work} B7 _; pc Note y 1; robot Busy B7");
    }
    talk + "; robot Ack 102 3; robot Ack 104 3; robot Ack 106 3; pc State 102 103 104 0; pc End 106 B7; robot Bye up 106 B7 9"
}

/// The messages from which jobs are just recognized, and two requests.
const LITTLE: &str = "pc Start 7; robot Taken 7; robot Ask 7 11; pc Job 7 11; robot Ask 7 12; pc Job 7 12; pc Job 7 13; pc Job 7 14";

#[test]
fn the_roles_and_fields_of_a_whole_conversation() {
    let expected = r#"# A draft from a capture: correct what has a ?.

charset = "ascii" # ? no other letter is in the capture
acks = 1 # ? most acknowledged jobs have such numbers
# max_number = 9999 # ? the highest in the capture is 104

[[job]]
name = "field_1" # ? its name in your tables
kind = "whole" # ? a text may look like a number
# range = [1, 2] # in the capture; without it any number

[[job]]
name = "field_2" # ? its name in your tables
kind = "decimal" # ? a text may look like a number
places = 2 # ? the most in the capture
# range = [-3.25, 10.5] # in the capture; without it any number

[[job]]
name = "field_3" # ? its name in your tables
kind = "text" # ? it may be a part of the message
# length = [0, 32] # in the capture 4 to 5

[messages.job]
name = "Job" # ? 4 of them: the PC sends most of it, and its number counts
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order", "number", "work"] # ? guessed from few messages

[messages.job_ack]
name = "Ack" # ? 4 of them: its number grows, below that of the jobs: executed
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order", "number"] # ? guessed from few messages

[messages.job_request]
name = "Ask" # ? 5 of them: the job of its number is what the PC sends next
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order", "number"] # ? guessed from few messages

[messages.pause]
name = "Hold" # ? 1 of them: what the robot says beside the others
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order", "queued"] # ? guessed from few messages

[messages.order_start]
name = "Start" # ? 1 of them: the first of the PC that comes before a job
header = ["=M", "=7", "unused"] # ? guessed from few messages
fields = ["order", "number"] # ? guessed from few messages

[messages.order_ack]
name = "Taken" # ? 1 of them: the first of the robot, before a job
header = ["=M", "=7", "unused"] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.order_end]
name = "End" # ? 1 of them: the last of the PC that comes after a job
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.order_interrupt]
name = "Stop" # ? 1 of them: what the PC says beside the others
header = ["=M", "=7"] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.end_ack]
name = "Done" # ? 1 of them: comes after the end of an order
header = ["=M", "=7"] # ? guessed from few messages
fields = ["ended", "order", "executed"] # ? guessed from few messages

[messages.status]
name = "State" # 4 of them from both ends: the most fields of all
header = ["=M", "=7"]
fields = ["order", "phase", "queued", "executed", "ended"] # ? guessed from few messages

[messages.filler]
name = "Fill" # 3 of them from both ends: it has no fields
header = ["=M", "=7"]
fields = []
"#;
    assert_eq!(draft(WHOLE).unwrap(), expected);
    // A length is in characters.
    let latin1 = expected.replace("ascii\" # ? no other letter is in the capture", "latin1\"");
    assert_eq!(draft(&WHOLE.replace("right", "r\u{ef}ght")).unwrap(), latin1);
}

#[test]
fn a_conversation_of_a_plant_with_another_order_of_fields() {
    let expected = r#"# A draft from a capture: correct what has a ?.

charset = "latin1"
acks = 2 # ? most acknowledged jobs have such numbers
# max_number = 9999 # ? the highest in the capture is 106

[[job]]
name = "field_1" # ? its name in your tables
kind = "whole" # ? a text may look like a number
# range = [1, 6] # in the capture; without it any number

[[job]]
name = "field_2" # ? its name in your tables
kind = "whole" # ? a text may look like a number
# range = [3, 5] # in the capture; without it any number

[[job]]
name = "field_3" # ? its name in your tables
kind = "text" # ? it may be a part of the message
# length = [0, 32] # in the capture 0 to 0

[messages.job]
name = "Työ" # ? 6 of them: the PC sends most of it, and its number counts
header = [] # ? guessed from few messages
fields = ["work", "number", "=up", "order"] # ? guessed from few messages

[messages.job_ack]
name = "Ack" # ? 3 of them: its number grows, below that of the jobs: executed
header = [] # ? guessed from few messages
fields = ["number", "unused"] # ? guessed from few messages

[messages.job_request]
name = "Ask" # ? 6 of them: the job of its number is what the PC sends next
header = [] # ? guessed from few messages
fields = ["number", "unused"] # ? guessed from few messages

[messages.pause]
name = "Busy" # ? 6 of them: what the robot says beside the others
header = [] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.order_start]
name = "Start" # ? 1 of them: the first of the PC that comes before a job
header = [] # ? guessed from few messages
fields = ["number", "order"] # ? guessed from few messages

[messages.order_ack]
name = "Hello" # ? 1 of them: the first of the robot, before a job
header = [] # ? guessed from few messages
fields = ["order"] # ? not recognized, and needed: order

[messages.order_end]
name = "End" # ? 1 of them: the last of the PC that comes after a job
header = [] # ? guessed from few messages
fields = ["unused", "order"] # ? guessed from few messages

[messages.order_interrupt]
name = "Setup" # ? 1 of them: what the PC says beside the others
header = [] # ? guessed from few messages
fields = ["=0.5"] # ? guessed from few messages

[messages.end_ack]
name = "Bye" # ? 1 of them: comes after the end of an order
header = [] # ? guessed from few messages
fields = ["=up", "executed", "ended", "order"] # ? guessed from few messages

[messages.status]
name = "State" # 3 of them from both ends: the most fields of all
header = []
fields = ["executed", "queued", "order", "unused"] # ? not recognized, and needed: order

[messages.filler]
name = "filler" # ? not in the capture: fill in its name, header and fields

# ? Taken is sent by the robot, 1 times: it fits no role

# ? Note is sent by the pc, 11 times: it fits no role
"#;
    assert_eq!(draft(&other()).unwrap(), expected);
}

#[test]
fn what_the_capture_lacks_is_said() {
    let expected = r#"# A draft from a capture: correct what has a ?.

charset = "ascii" # ? no other letter is in the capture
# acks = 1 # ? no job is acknowledged in the capture
# max_number = 9999 # ? the highest in the capture is 14

[messages.job]
name = "Job" # ? 4 of them: the PC sends most of it, and its number counts
header = [] # ? guessed from few messages
fields = ["order", "number", "work"] # ? not recognized, and needed: work

[messages.job_ack]
sent = false # ? not in the capture

[messages.job_request]
name = "Ask" # ? 2 of them: the job of its number is what the PC sends next
header = [] # ? guessed from few messages
fields = ["order", "number"] # ? guessed from few messages

[messages.pause]
sent = false # ? not in the capture

[messages.order_start]
name = "Start" # ? 1 of them: the first of the PC that comes before a job
header = [] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.order_ack]
name = "Taken" # ? 1 of them: the first of the robot, before a job
header = [] # ? guessed from few messages
fields = ["order"] # ? guessed from few messages

[messages.order_end]
name = "order_end" # ? not in the capture: fill in its name, header and fields

[messages.order_interrupt]
sent = false # ? not in the capture; without it a PC ends an order after the queued jobs

[messages.end_ack]
name = "end_ack" # ? not in the capture: fill in its name, header and fields

[messages.status]
name = "status" # ? not in the capture: fill in its name, header and fields

[messages.filler]
name = "filler" # ? not in the capture: fill in its name, header and fields
"#;
    assert_eq!(draft(LITTLE).unwrap(), expected);
}

#[test]
fn three_jobs_are_too_few() {
    let error = "no jobs are in the capture: let the robot work through an order, and capture that";
    for talk in ["", "robot Taken 7", "pc Job 7 11; pc Job 7 12; pc Job 7 13"] {
        assert_eq!(draft(talk).unwrap_err().to_string(), error);
    }
    draft("pc Job 7 11; pc Job 7 12; pc Job 7 13; pc Job 7 14").unwrap();
}

/// Returns the fields of a role in a draft; `None` if no message has the role.
fn fields(text: &str, role: &str) -> Option<String> {
    let table = text.split("\n\n").find(|table| table.starts_with(&format!("[messages.{role}]"))).unwrap();
    let (_, fields) = table.split_once("fields = ")?;
    fields.split(" #").next().map(|fields| fields.trim_end().to_owned())
}

/// Jobs, then messages of the robot with these values, one each.
fn acknowledged(numbers: &str) -> String {
    let mut talk = String::from("pc Job 7 101; pc Job 7 102; pc Job 7 103; pc Job 7 104; pc End 7");
    numbers.split_whitespace().for_each(|number| talk += &format!("; robot Ack {number}"));
    draft(&talk).unwrap()
}

#[test]
fn a_number_counts_that_mostly_grows_by_up_to_ten_and_seldom_falls() {
    for (numbers, counts) in [
        ("1 2 3", true),
        ("0 1 2", true),
        ("1 11 21", true),
        ("1 12 23", false),
        ("3 2 1", false),
        ("1 2", false),
        ("1 2 2 3", false),
        ("1 2 2 3 4", true),
        ("1 1 2 2 3 3 4 5 6 7 7", true),
        ("1 2 3 4 1 2 3", true),
        ("1 2 1 2 3 2 3 4 3", false),
        ("1 2 1 2 3 2 3 4 5", true),
    ] {
        assert_eq!(fields(&acknowledged(numbers), "job_ack").is_some(), counts, "{numbers}");
    }
}

#[test]
fn the_interval_of_acknowledgements_is_what_seven_of_ten_are_multiples_of() {
    for (numbers, every) in [
        ("101 102 103", "1"),
        ("102 104 106", "2"),
        ("5 10 15", "5"),
        ("20 21 22 23 24 25", "1"),
        ("3 6 9 12 15 18 21 22 23 25", "3"),
        ("3 6 9 12 15 18 20 22 23 25", "1"),
        ("80 85 90 95 100", "5"),
    ] {
        let text = acknowledged(numbers);
        let acks = text.lines().find_map(|line| line.strip_prefix("acks = ")).unwrap();
        assert_eq!(acks, format!("{every} # ? most acknowledged jobs have such numbers"), "{numbers}");
    }
}

#[test]
fn more_than_a_third_of_the_requests_ask_for_the_next_job() {
    let talk = "robot Ask 11; pc Job 7 11; pc Job 7 12; pc Job 7 13; pc Job 7 14; robot Ask 11";
    assert_eq!(fields(&draft(talk).unwrap(), "job_request").as_deref(), Some(r#"["number"]"#));
    let text = draft(&format!("{talk}; robot Ask 11")).unwrap();
    assert_eq!(fields(&text, "job_request"), None);
    // It comes before a job, then.
    assert_eq!(fields(&text, "order_ack").as_deref(), Some(r#"["order"]"#));
}

#[test]
fn the_number_of_jobs_is_the_one_of_which_the_robot_speaks_as_it_counts() {
    let talk = "robot Hello 1; robot Hello 1; robot Hello 1; robot Hello 1
        pc Job 1 101; pc Job 2 102; pc Job 3 103; pc Job 4 104; robot Ack 101; robot Ack 102; robot Ack 103";
    assert_eq!(fields(&draft(talk).unwrap(), "job").as_deref(), Some(r#"["work", "number"]"#));
}

#[test]
fn what_nothing_is_said_by_is_no_role() {
    // No end was acknowledged.
    let text = draft(&WHOLE.replace("robot Done M 7 | 501 0 104", "")).unwrap();
    let found = ["pause", "end_ack"].map(|role| fields(&text, role));
    assert_eq!(found, [Some(r#"["order", "queued"]"#.into()), None]);
    // Both ends send a message without fields, and none with.
    let text = draft(&format!("{LITTLE}; pc Fill; robot Fill")).unwrap();
    assert_eq!(["status", "filler"].map(|role| fields(&text, role)), [None, Some("[]".into())]);
}

#[test]
fn a_place_is_an_order_in_most_messages_and_a_constant_in_all() {
    let text = draft(&format!("{LITTLE}; robot Hold 7; robot Hold 0; pc End 7; robot Done 7")).unwrap();
    let found = ["pause", "end_ack"].map(|role| fields(&text, role).unwrap());
    assert_eq!(found, [r#"["unused"]"#, r#"["ended", "executed"]"#]);
    // The order is in the header of all but one.
    let text =
        draft("robot Hello 9 | 0; pc Job 7 | 11; pc Job 7 | 12; pc Job 7 | 13; pc Job 7 | 14").unwrap();
    assert!(
        text.contains(
            "name = \"Hello\" # ? 1 of them: the first of the robot, before a job\nheader = [\"unused\"] # ?"
        ),
        "{text}"
    );
}

#[test]
fn what_a_terminal_would_obey_is_escaped() {
    let talk = LITTLE.replace("Job", "Jo\u{7f}b\"").replace("Taken", "Ta\u{1b}k\u{9b}en");
    let talk = format!("{talk}; robot More 1; robot Left\u{7f} 2; robot Ri\u{85}ght 3");
    let text = draft(&talk).unwrap();
    assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{text:?}");
    let read: toml::Table = toml::from_str(&text).unwrap();
    assert_eq!(read["messages"]["job"]["name"].as_str(), Some("Jo\u{7f}b\""));
    assert!(text.contains("# ? Ri\\u{85}ght is sent") || text.contains("# ? Left\\u{7f} is sent"), "{text}");
}
