//! Lines of JSON, beside those of serde_json.

use cellwire_links::json;

#[test]
fn control_characters_are_escaped_and_others_are_as_in_serde_json() {
    for c in '\0'..='\u{FFFF}' {
        let text = format!("a{c}b{c}");
        let line = json::text(&text);
        assert_eq!(serde_json::from_str::<String>(&line).unwrap(), text);
        match c {
            '\u{7F}'..'\u{A0}' => {
                let escaped = format!("\\u{:04x}", u32::from(c));
                assert_eq!(line, format!("\"a{escaped}b{escaped}\""));
            }
            _ => assert_eq!(line, serde_json::to_string(&text).unwrap()),
        }
    }
}
