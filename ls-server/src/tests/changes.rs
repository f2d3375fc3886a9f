//! Requests whose answers are edits.

use serde_json::{Value, json};

use super::{Cell, places, program};

fn rename(cell: &Cell, new: &str) -> Result<Value, String> {
    cell.try_ask("textDocument/rename", json!({"newName": new}))
}

#[test]
fn a_comment_is_renamed_in_every_program_of_the_controller() {
    let (a, b) = (program("A", "  R[|1:old]=R[2]\n  LBL[1]"), program("B", "  R[1]=5"));
    let cell = Cell::new(&[("A.LS", &a), ("B.LS", &b)]);
    let edit = rename(&cell, "parts").unwrap();
    assert_eq!(cell.changed("A.LS", &edit), a.replace("|1:old", "1:parts"));
    assert_eq!(cell.changed("B.LS", &edit), b.replace("R[1]", "R[1:parts]"));
    let edit = rename(&cell, "9").unwrap();
    assert_eq!(cell.changed("A.LS", &edit), a.replace("|1:old", "9:old"));
    assert_eq!(cell.changed("B.LS", &edit), b.replace("R[1]", "R[9]"));
    assert_eq!(rename(&cell, "R[9]"), Ok(edit));
    assert_eq!(rename(&cell, "2"), Err("R[2] is used in A".to_owned()));
    assert_eq!(rename(&cell, "0"), Err("there is no R[0]: the numbers are 1 to 32767".to_owned()));
    assert_eq!(rename(&cell, "a]"), Err("a name must not have brackets, quotes or line ends".to_owned()));
    assert_eq!(rename(&cell, "-1"), Err("there is no R[-1]".to_owned()));
    assert_eq!(rename(&cell, "R[99999999999]"), Err("there is no R[99999999999]".to_owned()));
    // While another program is typed, its end is missing; a wrong name is refused as such.
    let typed = Cell::new(&[("A.LS", "/PROG A\n/MN\n1:  R[1]=5 ;\n"), ("B.LS", &a)]);
    assert_eq!(rename(&typed, "a]"), Err("a name must not have brackets, quotes or line ends".to_owned()));
    assert!(rename(&typed, "a").unwrap_err().starts_with("/w/A.LS: line 4, column 1: "));
    let prepared = cell.ask("textDocument/prepareRename", json!({}));
    assert_eq!(
        (&prepared["placeholder"], places(&json!([prepared]))),
        (&json!("old"), vec![":3:7-10".to_owned()])
    );
}

#[test]
fn a_label_is_renamed_in_its_program() {
    let (a, b) = (program("A", "  LBL[1:x]\n  JMP LBL[|1]\n  LBL[2]"), program("B", "  LBL[1:x]"));
    let cell = Cell::new(&[("A.LS", &a), ("B.LS", &b)]);
    let whole = a.replace('|', "");
    let edit = rename(&cell, "10").unwrap();
    assert_eq!(cell.changed("A.LS", &edit), whole.replace("LBL[1", "LBL[10"));
    assert_eq!(cell.changed("B.LS", &edit), b);
    let edit = rename(&cell, "retry").unwrap();
    assert_eq!(cell.changed("A.LS", &edit), whole.replace(":x", ":retry"));
    assert_eq!(rename(&cell, "2"), Err("LBL[2] is already defined".to_owned()));
    assert_eq!(rename(&Cell::of("  ABO|RT"), "x"), Err("there is nothing here that has a name".to_owned()));
}

#[test]
fn a_program_is_renamed_with_its_calls_and_its_file() {
    let (a, b) = (program("A", "  CALL |b(1)\n  RUN B"), program("B", "  CALL A"));
    let mut cell = Cell::new(&[("A.LS", &a), ("b.ls", &b)]);
    let edit = rename(&cell, "NEW_1").unwrap();
    assert_eq!(cell.changed("A.LS", &edit), a.replace("|b(1)", "NEW_1(1)").replace("RUN B", "RUN NEW_1"));
    assert_eq!(cell.changed("b.ls", &edit), b.replace("/PROG B", "/PROG NEW_1"));
    cell.folder.client = crate::folder::Client { versions: true, renames: true };
    let edit = rename(&cell, "NEW_1").unwrap();
    let operations = edit["documentChanges"].as_array().unwrap();
    assert_eq!(operations[0]["textDocument"], json!({"uri": "file:///w/A.LS", "version": 1}));
    assert_eq!(
        operations[2],
        json!({"kind": "rename", "oldUri": "file:///w/b.ls", "newUri": "file:///w/new_1.ls"})
    );
    assert_eq!(rename(&cell, "A"), Err("a program is already named A".to_owned()));
    assert_eq!(
        rename(&cell, "1A"),
        Err("the program's name must be letters, digits and `_`, and not begin with a digit".to_owned())
    );
    assert_eq!(
        rename(&cell, &"X".repeat(37)),
        Err("the program's name has 37 characters, the limit is 36".to_owned())
    );
}

#[test]
fn the_layout_is_that_of_ls_fmt() {
    let cell = Cell::new(&[("A.LS", "/PROG A\n/MN\n1:J P[1]  .6sec FINE ;\n 7: WAIT 0.5(sec);\n/END\n")]);
    let edits = cell.ask("textDocument/formatting", json!({"options": {"tabSize": 4, "insertSpaces": true}}));
    assert_eq!(
        cell.edited("A.LS", &edits),
        "/PROG A\n/MN\n   1:J P[1] 0.6sec FINE    ;\n   2:  WAIT    .50(sec) ;\n/END\n"
    );
    let broken = Cell::new(&[("A.LS", "/PROG A\n")]);
    let options = json!({"options": {"tabSize": 4, "insertSpaces": true}});
    assert_eq!(
        broken.try_ask("textDocument/formatting", options),
        Err("/w/A.LS: line 2, column 1: expected the section `/MN`".to_owned())
    );
}

/// Returns the titles of the corrections at the cursor, and the text with the first of them.
fn fixed(cell: &Cell) -> (Vec<String>, String) {
    let answer =
        cell.ask("textDocument/codeAction", json!({"context": {"diagnostics": [], "only": ["quickfix"]}}));
    let actions = answer.as_array().unwrap();
    let titles = actions.iter().map(|action| action["title"].as_str().unwrap().to_owned()).collect();
    (titles, actions.first().map_or_else(String::new, |action| cell.changed("A.LS", &action["edit"])))
}

#[test]
fn findings_are_corrected() {
    let cases = [
        ("  |FRO R[1]=1 TO 2\n  ENDFOR", "Replace by FOR", "  FOR R[1]=1 TO 2\n  ENDFOR"),
        ("  |abort", "Replace by ABORT", "  ABORT"),
        ("L P[1] 5mm/sec FINE |Ofset,PR[1]", "Replace by Offset", "L P[1] 5mm/sec FINE Offset,PR[1]"),
        ("  |IF (R[1]=1) THEN\n  ABORT", "Add ENDIF at the end", "  IF (R[1]=1) THEN\n  ABORT\n  ENDIF"),
        (
            "  FOR R[1]=1 TO 2\n  IF (R[1]=1) THEN\n  |ENDFOR",
            "Add ENDIF before this line",
            "  FOR R[1]=1 TO 2\n  IF (R[1]=1) THEN\n  ENDIF\n  ENDFOR",
        ),
        ("  |JMP LBL[5]", "Add LBL[5] at the end", "  JMP LBL[5]\n  LBL[5]"),
        (
            "  UFRAME_NUM=3\n|J P[1] 5% FINE",
            "Add UFRAME_NUM=0 before this line",
            "  UFRAME_NUM=3\n  UFRAME_NUM=0\nJ P[1] 5% FINE",
        ),
        (
            "  UTOOL_NUM=3\n|J P[1] 5% FINE",
            "Add UTOOL_NUM=1 before this line",
            "  UTOOL_NUM=3\n  UTOOL_NUM=1\nJ P[1] 5% FINE",
        ),
        ("|J P[1] 5%", "Add FINE", "J P[1] 5% FINE"),
    ];
    for (statements, title, expected) in cases {
        let (titles, text) = fixed(&Cell::of(statements));
        assert_eq!(titles.first().map(String::as_str), Some(title), "{statements}: {titles:?}");
        assert_eq!(text, program("A", expected), "{statements}");
    }
}

#[test]
fn a_file_is_corrected() {
    let cases = [
        ("/PROG |B\n/MN\n/END\n", "Name the program A", "/PROG A\n/MN\n/END\n"),
        (
            "/PROG A\n/MN\n1: ABORT|\n/END\n",
            "Close the instruction with ;",
            "/PROG A\n/MN\n1: ABORT ;\n/END\n",
        ),
        ("/PROG A\n/MN\n|", "Add /END", "/PROG A\n/MN\n/END\n"),
        (
            "/PROG A\n/MN\n1: ABORT;\n|3: PAUSE;\n/END\n",
            "Number the lines from 1",
            "/PROG A\n/MN\n1: ABORT;\n   2: PAUSE;\n/END\n",
        ),
        (
            "/PROG A\n/ATTR\nCOMMENT = |\"12345678901234567\";\n/MN\n/END\n",
            "Shorten COMMENT to 16 characters",
            "/PROG A\n/ATTR\nCOMMENT = \"1234567890123456\";\n/MN\n/END\n",
        ),
    ];
    for (text, title, expected) in cases {
        let (titles, fixed) = fixed(&Cell::new(&[("A.LS", text)]));
        assert_eq!((titles.first().map(String::as_str), fixed.as_str()), (Some(title), expected), "{text}");
    }
}

#[test]
fn a_position_is_made_and_deleted() {
    let cell = Cell::of("J P[|7] 5% FINE\nJ P[1] 5% FINE");
    let (titles, text) = fixed(&cell);
    assert_eq!(titles, ["Add P[7] to /POS, to be taught"]);
    let position = "P[7]{\n   GP1:\n\tUF : 0, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX =  ********  mm,\tY =  ********  mm,\tZ =  ********  mm,\n\
                    \tW =  ******** deg,\tP =  ******** deg,\tR =  ******** deg\n};\n/END\n";
    assert!(text.ends_with(position), "{text}");
    let unused = Cell::new(&[("A.LS", &program("A", "  ABORT").replace("P[1:", "P[|1:"))]);
    let (titles, text) = fixed(&unused);
    assert_eq!(titles[0], "Delete P[1]");
    assert_eq!(text, "/PROG A\n/MN\n   1:  ABORT ;\n/POS\n/END\n");
}

#[test]
fn lines_are_numbered_on_demand() {
    let cell = Cell::new(&[("A.LS", "/PROG A\n/MN\n   5:  ABORT ;\n/END\n")]);
    let answer = cell
        .ask("textDocument/codeAction", json!({"context": {"diagnostics": [], "only": ["source.renumber"]}}));
    assert_eq!(answer.as_array().unwrap().len(), 1);
    assert_eq!(cell.changed("A.LS", &answer[0]["edit"]), "/PROG A\n/MN\n   1:  ABORT ;\n/END\n");
    let none = Cell::of("  ABORT")
        .ask("textDocument/codeAction", json!({"context": {"diagnostics": [], "only": ["source"]}}));
    assert_eq!(none, json!([]));
}

#[test]
fn a_text_is_checked_once() {
    let mut cell = Cell::of("  |CALL B");
    let quickfix = json!({"context": {"diagnostics": [], "only": ["quickfix"]}});
    cell.ask("textDocument/codeAction", quickfix.clone());
    cell.ask("textDocument/codeAction", json!({"context": {"diagnostics": []}}));
    let count = |cell: &Cell| {
        let document = cell.folder.get(&super::uri("A.LS")).unwrap();
        document.numbering(|| panic!("the lines are numbered again"));
        document.found(cell.folder.changes(), || panic!("the text is checked again")).len()
    };
    // `CALL B`, P[1] that is not used and not taught.
    let missing = count(&cell);
    // Another program, and another text, are seen.
    cell.folder.open(super::uri("B.LS"), 1, program("B", "  ABORT"));
    cell.ask("textDocument/codeAction", quickfix.clone());
    assert_eq!(count(&cell), missing - 1);
    cell.folder.close(&super::uri("B.LS"));
    cell.ask("textDocument/codeAction", quickfix);
    assert_eq!(count(&cell), missing);
    let text = "/PROG A\n/MN\n   2:  ABORT ;\n/END\n".to_owned();
    let change = lsp_types::TextDocumentContentChangeEvent { range: None, range_length: None, text };
    cell.folder.get_mut(&super::uri("A.LS")).unwrap().change(2, vec![change]);
    let answer = cell.ask("textDocument/codeAction", json!({"context": {"diagnostics": []}}));
    assert_eq!(cell.changed("A.LS", &answer[0]["edit"]), "/PROG A\n/MN\n   1:  ABORT ;\n/END\n");
}
