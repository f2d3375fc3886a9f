//! Edits while a person types: the text and the cursor after a key.

use serde_json::{Value, json};

use super::Cell;

/// Returns the text after a key was typed, with `|` for the cursor; empty if nothing is edited.
fn typed(text: &str, key: &str) -> String {
    let cell = Cell::new(&[("A.LS", text)]);
    let options = json!({"ch": key, "options": {"tabSize": 4, "insertSpaces": true}});
    let edits = cell.ask("textDocument/onTypeFormatting", options);
    if edits == Value::Null {
        return String::new();
    }
    let document = cell.folder.get(&super::uri("A.LS")).unwrap();
    let found: Vec<lsp_types::TextEdit> = serde_json::from_value(edits.clone()).unwrap();
    let mut cursor = text.find('|').unwrap();
    let places = found.iter().map(|edit| (document.converter().bytes(edit.range), edit.new_text.len()));
    // An editor puts its cursor after the text that is inserted at the cursor.
    let moved: Vec<_> = places.filter(|(place, _)| place.end <= cursor).collect();
    cursor += moved.iter().map(|(_, length)| length).sum::<usize>();
    cursor -= moved.iter().map(|(place, _)| place.len()).sum::<usize>();
    let mut new = cell.edited("A.LS", &edits);
    new.insert(cursor, '|');
    new
}

/// Returns the lines of `/MN` after Enter in these lines.
fn entered(lines: &str) -> String {
    let typed = typed(&format!("/PROG A\n/MN\n{lines}/END\n"), "\n");
    typed.strip_prefix("/PROG A\n/MN\n").and_then(|rest| rest.strip_suffix("/END\n")).unwrap_or("").to_owned()
}

#[test]
fn a_new_line_gets_its_number_and_typing_goes_on_behind_it() {
    let text = "/PROG A\n/ATTR\nLINE_COUNT = 2;\n/MN\n   1:  ABORT\n|\n   2:  PAUSE ;\n/END\n";
    let new = "/PROG A\n/ATTR\nLINE_COUNT = 3;\n/MN\n   1:  ABORT ;\n   2:  |\n   3:  PAUSE ;\n/END\n";
    assert_eq!(typed(text, "\n"), new);
    // A statement is typed there, and Enter once more.
    let text = new.replace('|', "DO[4]=ON\n   |");
    assert_eq!(
        typed(&text, "\n"),
        "/PROG A\n/ATTR\nLINE_COUNT = 4;\n/MN\n   1:  ABORT ;\n   2:  DO[4]=ON ;\n   3:  |\n   4:  PAUSE ;\n/END\n"
    );
    assert_eq!(typed("/PROG A\r\n/MN\r\n|\r\n/END\r\n", "\n"), "/PROG A\r\n/MN\r\n   1:  |\r\n/END\r\n");
    let text = "/PROG A\r\n/MN\r\n   1:  \r\n     |\r\n/END\r\n";
    assert_eq!(typed(text, "\n"), "/PROG A\r\n/MN\r\n   1:   ;\r\n   2:  |\r\n/END\r\n");
    let text = typed("/PROG A\n/MN\n   7:  ABORT ;|\n   9:  PAUSE ;\n/END\n", ";");
    assert_eq!(text, "/PROG A\n/MN\n   1:  ABORT ;|\n   2:  PAUSE ;\n/END\n");
    // Elsewhere, and in a text that is not a program, nothing is added.
    for text in [
        "/PROG A\n/ATTR\n|\n/MN\n/END\n",
        "/PROG A\n/MN\n/POS\n|\n/END\n",
        "\n|\n",
        "|",
        "/PROG A\n/MN\n   1:  ABORT ;\nx|\n/END\n",
    ] {
        assert_eq!(typed(text, "\n"), "", "{text}");
    }
}

#[test]
fn a_statement_that_goes_on_is_not_closed() {
    let circle = "   1:C P[4:via]    \n    :  P[5] 400mm/sec FINE    ;\n   2:  ABORT ;\n";
    let text = entered(&circle.replace("    \n", "    \n|\n"));
    assert_eq!(text, circle.replace("    \n", "    \n    :  |\n"));
    // It is the program that it was.
    let motions = |lines: &str| {
        let text = format!("/PROG A\n/MN\n{}/END\n", lines.replace('|', ""));
        let program = fanuc_ls::Document::decode(&text).unwrap();
        (program.instruction(0), program.instruction(1))
    };
    assert!(matches!(motions(circle).0, Some(fanuc_ls::Instruction::Motion(_))));
    assert_eq!(motions(&text), motions(circle));
    // While it is typed.
    assert_eq!(entered("   1:C P[4]\n|\n   2:  ABORT ;\n"), "   1:C P[4]\n    :  |\n   2:  ABORT ;\n");
    assert_eq!(entered("   1:C PR[R[4]]\n|;\n"), "   1:C PR[R[4]]\n    :  |;\n");
    assert_eq!(
        entered("   1:C P[4]\n    :  P[5] 40mm/sec FINE\n  |\n   2:  ABORT ;\n"),
        "   1:C P[4]\n    :  P[5] 40mm/sec FINE ;\n   2:  |\n   3:  ABORT ;\n"
    );
    assert_eq!(
        entered("   1:C P[4] P[5] 40mm/sec FINE\n|\n"),
        "   1:C P[4] P[5] 40mm/sec FINE ;\n   2:  |\n"
    );
}

#[test]
fn enter_within_a_line_leaves_a_program() {
    let cases = [
        // Before the `;`, which the new line keeps.
        ("   1:  R[1:a]=0\n| ;\n   2:  ABORT ;\n", "   1:  R[1:a]=0 ;\n   2:  | ;\n   3:  ABORT ;\n"),
        ("   1:  R[1:a]=0\n   |;\n", "   1:  R[1:a]=0 ;\n   2:  |;\n"),
        // In the middle: the statement stays one.
        ("   1:  R[1]=R[2]\n   |+1 ;\n   2:  ABORT ;\n", "   1:  R[1]=R[2]\n    :  |+1 ;\n   2:  ABORT ;\n"),
        // Before a numbered line, and after its number.
        ("   1:  ABORT ;\n\n|   2:  PAUSE ;\n", "   1:  ABORT ;\n   2:   ;\n|   3:  PAUSE ;\n"),
        ("\n|   1:  PAUSE ;\n", "   1:   ;\n|   2:  PAUSE ;\n"),
        ("   1:  \n|PAUSE ;\n", "   1:   ;\n   2:  |PAUSE ;\n"),
        // Between two statements.
        ("   1:  ABORT ;\n|PAUSE\n", "   1:  ABORT ;\n   2:  |PAUSE\n"),
        // Before a line that continues with another.
        ("   1:  R[1]=\n\n|    :  5 ;\n", ""),
    ];
    for (text, new) in cases {
        assert_eq!(entered(text), new, "{text}");
    }
}
