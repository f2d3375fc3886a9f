//! `cellwire ls edit` and `cellwire ls fmt`: their output, files and errors.

use crate::fanuc_cell::{Folder, err, out};

const TEXT: &str = "/PROG  A\r\n/MN\r\n   1:  LBL[1] ;\r\n   2:J P[1] 100% FINE    ;\r\n   3:L P[2] 100mm/sec CNT50    ;\r\n   \
4:  R[5]=R[6]+1 ;\r\n   5:  JMP LBL[1] ;\r\n/POS\r\nP[1]{\r\n   GP1:\r\n\tUF : 1, UT : 1,\t\r\n\tJ1=     0.000 deg\r\n};\r\n\
P[2]{\r\n   GP1:\r\n\tUF : 1, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX =     1.000  mm,\tY =     2.000  mm,\tZ =     3.000  mm,\r\n\
\tW =     0.000 deg,\tP =     0.000 deg,\tR =     0.000 deg\r\n};\r\n/END\r\n";

#[test]
fn an_edit_is_shown_and_written_when_asked_to() {
    let folder = Folder::new("ls-edit");
    folder.write("A.LS", TEXT);
    let arguments = ["ls", "edit", "A.LS", "--speed", "L:100mm/sec=80mm/sec", "--replace", "R[5]=R[105]"];
    let shown = folder.command(&arguments).output().unwrap();
    let expected = "--- A.LS\n+++ A.LS\n@@ -4,5 +4,5 @@\n    2:J P[1] 100% FINE    ;\n-   3:L P[2] 100mm/sec CNT50    ;\n\
-   4:  R[5]=R[6]+1 ;\n+   3:L P[2] 80mm/sec CNT50    ;\n+   4:  R[105]=R[6]+1 ;\n    5:  JMP LBL[1] ;\n";
    assert!(out(&shown).starts_with("--- A.LS\n+++ A.LS\n"), "{}", out(&shown));
    for line in expected.lines().filter(|line| line.starts_with(['-', '+'])) {
        assert!(out(&shown).lines().any(|shown| shown == line), "{line}\n{}", out(&shown));
    }
    assert_eq!(err(&shown), "1 of 1 file would change; --write applies the changes\n");
    assert_eq!((folder.read("A.LS").as_str(), shown.status.code()), (TEXT, Some(0)));
    let written = folder.command(&[&arguments[..], &["--write"]].concat()).output().unwrap();
    assert_eq!(out(&written), out(&shown));
    assert_eq!(err(&written), "1 of 1 file written\n");
    let after = TEXT.replace("100mm", "80mm").replace("R[5]", "R[105]");
    assert_eq!(folder.read("A.LS"), after);
}

#[test]
fn what_would_make_an_error_is_refused_for_all_files() {
    let folder = Folder::new("ls-edit-refused");
    folder.write("A.LS", TEXT);
    folder.write("B.LS", &TEXT.replace("P[2]", "P[7]"));
    for (change, why) in [
        (["--replace", "P[1]=P[2]"], "error: A.LS: P[2] is already defined\n"),
        (
            ["--line", "4=IF R[5]=1"],
            "error: A.LS: this would be an error: expected `,` and an instruction, or `THEN`, in `4:  IF R[5]=1 ;`",
        ),
        (["--line", "40=END"], "error: A.LS: there is no line 40\n"),
        (
            ["--speed", "100mm/sec=80%"],
            "error: A.LS: the speed of instruction 3 has a unit that its motion does not take\n",
        ),
        (["--replace", "P[1]=P[40000]"], "error: A.LS: there is no P[40000]: the numbers are 1 to 32767\n"),
    ] {
        let refused = folder.command(&[&["ls", "edit", "A.LS", "B.LS", "--write"], &change[..]].concat());
        let refused = { refused }.output().unwrap();
        assert!(err(&refused).contains(why), "{}", err(&refused));
        assert!(err(&refused).contains("nothing was written: "), "{}", err(&refused));
        assert_eq!((folder.read("A.LS").as_str(), refused.status.code()), (TEXT, Some(1)));
    }
    let nothing = folder.run("ls edit A.LS");
    assert!(err(&nothing).starts_with("error: give at least one of --speed, "), "{}", err(&nothing));
    let unclear = folder.run("ls edit A.LS --speed 5=3");
    assert!(err(&unclear).contains("5 is not a speed such as 100mm/sec, 20%, 0.5sec or R[1]mm/sec"));
}

#[test]
fn positions_names_and_numbers_of_many_files_change_at_once() {
    let folder = Folder::new("ls-edit-many");
    folder.write("A.LS", TEXT);
    folder.write("B.LS", &TEXT.replace("   5:", "  50:"));
    let arguments = "ls edit . --write --shift 0,0,-2.5 --name LBL[1]=again --replace UFRAME[1]=UFRAME[2] --renumber --speed *=*0.5";
    let edited = folder.run(arguments);
    assert_eq!(edited.status.code(), Some(0), "{}", err(&edited));
    let after = TEXT
        .replace("  1:  LBL[1]", "  1:  LBL[1:again]")
        .replace("UF : 1", "UF : 2")
        .replace("Z =     3.000", "Z =      .500")
        .replace("100%", "50%")
        .replace("100mm", "50mm");
    assert_eq!(folder.read("A.LS"), after);
    assert_eq!(folder.read("B.LS"), after);
    assert!(err(&edited).contains("warning: A: not shifted, without X, Y and Z: P[1]\n"), "{}", err(&edited));
}

#[test]
fn the_layout_is_checked_shown_and_written() {
    let folder = Folder::new("ls-fmt");
    folder.write("A.LS", TEXT);
    folder.write("B.LS", "/PROG B\n/MN\n1:J P[1] .6sec FINE;\n/POS\n/END");
    let checked = folder.run("ls fmt . --check");
    assert_eq!((out(&checked), checked.status.code()), ("./B.LS\n", Some(1)));
    assert_eq!(err(&checked), "1 of 2 files not formatted\n");
    let shown = folder.run("ls fmt B.LS");
    assert!(
        out(&shown).contains("-1:J P[1] .6sec FINE;\n+   1:J P[1] 0.6sec FINE    ;\n"),
        "{}",
        out(&shown)
    );
    assert_eq!(folder.run("ls fmt . --write").status.code(), Some(0));
    assert_eq!(folder.read("B.LS"), "/PROG B\n/MN\n   1:J P[1] 0.6sec FINE    ;\n/POS\n/END");
    assert_eq!(folder.read("A.LS"), TEXT);
    assert_eq!(folder.run("ls fmt . --check").status.code(), Some(0));
}
