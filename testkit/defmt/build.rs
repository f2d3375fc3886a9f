//! Puts defmt's table of texts into the programs of Linux, as its script does into those of a board.

fn main() {
    let script = std::path::Path::new(&std::env::var("OUT_DIR").unwrap()).join("linux.x");
    std::fs::write(&script, "INCLUDE defmt.x\nINSERT AFTER .bss;\n").unwrap();
    // The table's addresses are the numbers of its texts: they must not move. LLVM's linker has no INSERT after an ASSERT.
    for argument in ["-no-pie", "-fuse-ld=bfd", &format!("-Wl,-T{}", script.display())] {
        println!("cargo::rustc-link-arg-tests={argument}");
    }
}
