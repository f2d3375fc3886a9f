//! Files that are written whole or not at all, and files that never take another's place.

use std::borrow::Cow;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

/// A file could not be written: its name, or the state that remains.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct FileWriteError(pub Cow<'static, str>);

/// Writes a file through a temporary one beside it, which takes its name when it is whole: if that fails, the earlier file is
/// unchanged. A target that is not a regular file, such as a pipe, is written directly.
///
/// # Errors
/// If the disk is full, or the user may not write there.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, bytes).with_context(|| FileWriteError(format!("cannot write {}", path.display()).into()))
}

fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    // A link stays one: the file that it leads to is written.
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let earlier = fs::metadata(&path).ok();
    if earlier.as_ref().is_some_and(|file| !file.is_file()) {
        return Ok(OpenOptions::new().write(true).open(path)?.write_all(bytes)?);
    }
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    ensure!(folder.is_dir(), "there is no folder {}", folder.display());
    let mut builder = tempfile::Builder::new();
    builder.prefix(".cellwire-");
    let mut write = || {
        let mut file = match &earlier {
            Some(_) => builder.tempfile_in(folder)?, // for this user alone, until it is whole
            None => ordinary(&mut builder).tempfile_in(folder)?,
        };
        file.write_all(bytes)?;
        if let Some(earlier) = &earlier {
            file.as_file().set_permissions(earlier.permissions())?;
        }
        file.as_file().sync_all()?;
        file.persist(&path)?;
        Ok(())
    };
    // Report only the kind of the error: its text names the temporary file.
    Ok(write().map_err(|error: io::Error| io::Error::from(error.kind()))?)
}

/// Gives a file the rights of ordinary files, less the user's mask; on other systems than Unix those of its folder.
#[cfg(unix)]
fn ordinary<'a, 'b>(
    builder: &'a mut tempfile::Builder<'b, 'static>,
) -> &'a mut tempfile::Builder<'b, 'static> {
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666))
}

#[cfg(not(unix))]
fn ordinary<'a, 'b>(
    builder: &'a mut tempfile::Builder<'b, 'static>,
) -> &'a mut tempfile::Builder<'b, 'static> {
    builder
}

/// Creates a file with this name, or with a number if a file or folder has that name: `run.csv`, `run-2.csv`. A device is
/// opened for writing.
///
/// # Errors
/// If writing there is not permitted, or the name is `-`.
pub fn create_new(path: &Path) -> Result<(File, PathBuf)> {
    anyhow::ensure!(path != Path::new("-"), "`-` is no name of a file: give one, or /dev/stdout");
    let is_device = path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir());
    if is_device && let Ok(device) = OpenOptions::new().write(true).open(path) {
        return Ok((device, path.to_owned()));
    }
    for number in 1_u32.. {
        let name = if number == 1 { path.to_owned() } else { numbered(path, number) };
        match OpenOptions::new().write(true).create_new(true).open(&name) {
            Ok(file) => return Ok((file, name)),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => {
                return Err(anyhow::Error::new(error).context(format!("cannot write {}", name.display())));
            }
        }
    }
    anyhow::bail!("cannot write {}: all numbered names exist", path.display())
}

fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.file_stem().map(OsString::from).unwrap_or_default();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Returns whether a pipe has lost its reader.
#[cfg(unix)]
pub fn is_unread(pipe: &File) -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};

    let mut polled = [PollFd::new(pipe, PollFlags::empty())];
    let found = poll(&mut polled, Some(&Timespec::default()));
    found.is_ok() && polled.iter().any(|it| it.revents().contains(PollFlags::ERR))
}

/// Always false: the next write shows it.
#[cfg(not(unix))]
pub fn is_unread(_pipe: &File) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_keeps_its_rights_and_its_links() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.txt"), folder.path().join("link"));
        write(&file, b"one").unwrap();
        let mode = |file: &Path| fs::metadata(file).unwrap().permissions().mode() & 0o777;
        let other = tempfile::tempdir().unwrap();
        fs::write(other.path().join("b.txt"), "").unwrap();
        assert_eq!(mode(&file), mode(&other.path().join("b.txt")), "a new file has the usual rights");
        symlink(&file, &link).unwrap();
        // Also those that the mask takes from a new file.
        for rights in [0o640, 0o666] {
            fs::set_permissions(&file, fs::Permissions::from_mode(rights)).unwrap();
            write(&link, b"two").unwrap();
            assert!(link.is_symlink());
            assert_eq!(fs::read(&file).unwrap(), b"two");
            assert_eq!(mode(&file), rights);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "no temporary file remains");
    }

    /// The machine's own devices would be gone if the test failed.
    #[test]
    fn a_pipe_is_written_and_not_replaced() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).unwrap()
        });
        write(&pipe, b"all").unwrap();
        assert!(!fs::metadata(&pipe).unwrap().is_file());
        assert_eq!(reader.join().unwrap(), b"all");
        let error = format!("{:#}", write(folder.path(), b"x").unwrap_err());
        assert_eq!(error, format!("cannot write {}: Is a directory (os error 21)", folder.path().display()));
        let error = format!("{:#}", write(Path::new("/none/a.txt"), b"x").unwrap_err());
        assert_eq!(error, "cannot write /none/a.txt: there is no folder /none");
    }

    #[test]
    fn a_new_file_takes_nobodys_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        std::os::unix::fs::symlink("/nowhere/at/all", &path).unwrap();
        assert_eq!(create_new(&path).unwrap().1, folder.path().join("run-2.csv"));
        assert_eq!(create_new(&path).unwrap().1, folder.path().join("run-3.csv"));
        let error = create_new(&folder.path().join("none/run.csv")).unwrap_err();
        assert!(error.to_string().starts_with("cannot write "), "{error}");
    }
}
