//! Every vector without a decoder.

use cellwire_links::vectors::{includes, vectors};
use laser_eb90::{DecodeError, Frame, MAX_PAYLOAD, Profile};
use serde_json::Value;

/// The first result of a decoder equals the decoded frame alone, once its items are checked too.
#[test]
fn a_frame_by_itself_is_what_a_decoder_finds_first() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../reference/vectors/laser-eb90.json");
    for v in vectors(path).unwrap() {
        let profile: Profile = serde_json::from_value(Value::Object(v.options)).unwrap();
        let mut payload = [0; MAX_PAYLOAD];
        let found = Frame::decode(&v.bytes, &mut payload, &profile);
        let found =
            found.and_then(|frame| frame.map(|(f, used)| f.items().check().map(|()| (f, used))).transpose());
        match (found, &v.message, &v.error) {
            (Ok(Some((frame, used))), Some(message), _) => {
                // Through text, as a reader of JSON lines sees it.
                let object: Value = serde_json::from_str(&serde_json::to_string(&frame).unwrap()).unwrap();
                assert_eq!((&object, used), (message, v.bytes.len()));
            }
            (Ok(None), _, Some(error)) => assert_eq!(error["kind"], "incomplete", "{}", v.id),
            // Without a decoder no bytes are skipped: none of them is a frame.
            (Err(DecodeError::NoHead { skipped }), _, Some(error)) => {
                assert_eq!((&error["kind"], skipped), (&"no_head".into(), v.bytes.len()), "{}", v.id);
            }
            (Err(found), _, Some(error)) => {
                assert!(includes(&serde_json::to_value(found).unwrap(), error), "{}: {found}", v.id);
            }
            (found, ..) => panic!("{}: {found:?}", v.id),
        }
    }
}
