//! The program for the controller.

/// The files of the program with their contents, as they are loaded.
pub const FILES: [(&str, &str); 7] = [
    ("settings.as", include_str!("../../../kawasaki-msg/controller/settings.as")),
    ("comm.as", include_str!("../../../kawasaki-msg/controller/comm.as")),
    ("queue.as", include_str!("../../../kawasaki-msg/controller/queue.as")),
    ("read.as", include_str!("../../../kawasaki-msg/controller/read.as")),
    ("orders.as", include_str!("../../../kawasaki-msg/controller/orders.as")),
    ("send.as", include_str!("../../../kawasaki-msg/controller/send.as")),
    ("motion.as", include_str!("../../../kawasaki-msg/controller/motion.as")),
];

/// Returns all files, with other values of some settings: as a user edits `settings.as`. The error is the name of a setting
/// that does not occur exactly once.
///
/// # Errors
/// See above.
pub fn source(settings: &[(&str, f64)]) -> Result<String, String> {
    let mut source: String = FILES.iter().map(|(_, text)| *text).collect();
    for (name, value) in settings {
        let begin = format!("\n  {name} = ");
        let (before, after) = source.split_once(&begin).ok_or(*name)?;
        let (_, rest) = after.split_once('\n').ok_or(*name)?;
        if rest.contains(&begin) {
            return Err((*name).into());
        }
        source = format!("{before}{begin}{value}\n{rest}");
    }
    Ok(source)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Program;

    /// The files keep the language's limits that the interpreter does not check.
    #[test]
    fn programs_and_lines_are_short() {
        let size = Program::parse(&source(&[]).unwrap()).unwrap().size();
        assert!(size.0 > 60 && size.1 < 1500, "{size:?}");
        for (file, source) in FILES {
            assert!(source.is_ascii() && source.lines().all(|line| line.len() <= 127), "{file}");
            for program in source.split(".PROGRAM ").skip(1) {
                let body = program.split(".END").next().unwrap();
                let lines = body.lines().filter(|line| !line.trim_start().starts_with(';')).count();
                assert!(lines <= 40, "{file}: {} has {lines} lines", body.split(' ').next().unwrap());
            }
        }
    }

    #[test]
    fn a_setting_is_replaced_once() {
        let changed = source(&[("cw.size", 7.0), ("cw.ip[1]", 10.0)]).unwrap();
        assert!(changed.contains("\n  cw.size = 7\n") && changed.contains("\n  cw.ip[1] = 10\n"));
        assert_eq!(source(&[("cw.none", 7.0)]), Err("cw.none".into()));
    }
}
