//! Traffic seen at machines: every file of `reference/field`. Also tests that the check of stories is the same as the
//! reference's own.

use std::fs;
use std::path::{Path, PathBuf};

use cellwire_links::LINKS;
use cellwire_links::reference::field::Field;
use serde_json::Value;

fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference")
}

#[test]
fn every_file_of_the_field_is_what_our_ends_make_of_it() {
    let mut count = 0;
    for entry in fs::read_dir(reference().join("field")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|kind| kind == "json") {
            let field = Field::read(&path).unwrap();
            count += field.check().unwrap_or_else(|error| panic!("{}: {error:#}", path.display()));
        }
    }
    assert!(count > 0, "not even the example is there");
}

#[test]
fn the_check_agrees_with_the_reference_and_sees_a_difference() {
    for link in LINKS {
        let read = |folder: &str| -> Value {
            let path = reference().join(folder).join(format!("{}.json", link.name));
            serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
        };
        let mut all = read("sessions");
        all["source"] = "the reference".into();
        let streams = read("streams")["streams"].take();
        all["streams"] = streams;
        let field: Field = serde_json::from_value(all.clone()).unwrap();
        field.check().unwrap_or_else(|error| panic!("{}: {error:#}", link.name));
        // One digit of the sent bytes, one event, one deadline, one message of a stream.
        let changes: [fn(&mut Value) -> Option<()>; 4] = [
            |all| {
                let steps = all["stories"]
                    .as_array_mut()?
                    .iter_mut()
                    .flat_map(|it| it["steps"].as_array_mut().unwrap());
                let step = steps.into_iter().find(|step| step.get("transmit").is_some())?;
                let sent = step["transmit"][0].as_str()?;
                step["transmit"][0] = format!("{}FF", &sent[2..]).into();
                Some(())
            },
            |all| {
                let steps = all["stories"]
                    .as_array_mut()?
                    .iter_mut()
                    .flat_map(|it| it["steps"].as_array_mut().unwrap());
                let step = steps.into_iter().find(|step| step.get("events").is_some())?;
                step["events"][0]["event"] = "another".into();
                Some(())
            },
            |all| {
                all["stories"][0]["steps"][1]["deadline"] = 7.into();
                Some(())
            },
            |all| {
                all["streams"][0]["items"][0]["length"] = 1_000_000.into();
                Some(())
            },
        ];
        for (number, change) in changes.iter().enumerate() {
            let mut changed = all.clone();
            change(&mut changed).unwrap();
            let field: Field = serde_json::from_value(changed).unwrap();
            assert!(field.check().is_err(), "{}: change {number} is not seen", link.name);
        }
    }
}
