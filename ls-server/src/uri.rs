//! Paths as URIs, and back.

use std::path::{Path, PathBuf};

/// Returns a path as a URI with the scheme `file`; a relative path as a relative reference.
pub fn of_path(path: &Path) -> String {
    let text = path.to_string_lossy().replace('\\', if cfg!(windows) { "/" } else { "\\" });
    let mut uri = String::new();
    if path.is_absolute() {
        uri.push_str(if text.starts_with('/') { "file://" } else { "file:///" });
    }
    for byte in text.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                uri.push(byte.into())
            }
            byte => uri += &format!("%{byte:02X}"),
        }
    }
    uri
}

/// Returns the path of a URI with the scheme `file`. `None` for another scheme, and for a path that is not UTF-8.
pub(crate) fn to_path(uri: &str) -> Option<PathBuf> {
    let rest = uri.strip_prefix("file://")?;
    let rest = rest.strip_prefix("localhost").unwrap_or(rest);
    let text = String::from_utf8(decoded(rest)?).ok()?;
    if text.contains('\0') {
        return None;
    }
    let is_drive = |text: &str| text.as_bytes().get(2) == Some(&b':');
    Some(match text.strip_prefix('/') {
        Some(drive) if cfg!(windows) && is_drive(&text) => PathBuf::from(drive.replace('/', "\\")),
        Some(_) => PathBuf::from(text),
        None if cfg!(windows) => PathBuf::from(format!("\\\\{}", text.replace('/', "\\"))),
        None => return None,
    })
}

/// Returns a name that is the same for every spelling of a file's URI.
pub(crate) fn key(uri: &str) -> String {
    match to_path(uri) {
        Some(path) => key_of_path(&path),
        None => uri.to_owned(),
    }
}

/// Returns the [`key`] of a file.
pub(crate) fn key_of_path(path: &Path) -> String {
    let text = path.to_string_lossy().into_owned();
    if cfg!(windows) { text.to_lowercase() } else { text }
}

fn decoded(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte == b'%' {
            let digits = [rest.next()?, rest.next()?];
            bytes.push(u8::from_str_radix(core::str::from_utf8(&digits).ok()?, 16).ok()?);
        } else {
            bytes.push(byte);
        }
    }
    Some(bytes)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_path_comes_back_from_its_uri() {
        for path in ["/a/B C.LS", "/\u{e9}/100%.ls", "/c:/x", "/a+b&c"] {
            assert_eq!(to_path(&of_path(Path::new(path))), Some(PathBuf::from(path)));
        }
        assert_eq!(of_path(Path::new("/a/B C.LS")), "file:///a/B%20C.LS");
        assert_eq!(of_path(Path::new("a/b.ls")), "a/b.ls");
        assert_eq!(key("file:///a/%42.LS"), "/a/B.LS");
        assert_eq!(key("untitled:Untitled-1"), "untitled:Untitled-1");
        for bad in
            ["file:///%", "file:///%4", "file:///%ff", "file:///%00", "file://host/a", "http://a/b", ""]
        {
            assert_eq!(to_path(bad), None, "{bad}");
        }
    }
}
