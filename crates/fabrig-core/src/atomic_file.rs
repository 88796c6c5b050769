//! Files that appear whole or not at all.
//!
//! Everything the project writes goes to a temporary file beside its destination and takes
//! its name only once it is complete, so an interrupted or failed write leaves what was there
//! before.

use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Calls `write` with a buffered temporary file in the destination's folder, then renames it
/// to `path`, replacing what stood there.
///
/// # Errors
///
/// Whatever `write` or the file system reports; the temporary file is removed and `path` is
/// left as it was.
pub fn write_atomically<E: From<io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
) -> Result<(), E> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".fabrig-").suffix(".partial");
    #[cfg(unix)]
    {
        // The default is private to the user; an output file follows the umask instead.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = BufWriter::new(builder.tempfile_in(folder)?);
    write(&mut file)?;
    let file = file.into_inner().map_err(|e| e.into_error())?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        write_atomically(&path, |f| f.write_all(b"old")).unwrap();
        let failed: io::Result<()> = write_atomically(&path, |f| {
            f.write_all(b"half")?;
            Err(io::Error::other("stop"))
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no/such/folder/out.txt");
        let failed: io::Result<()> = write_atomically(&path, |f| f.write_all(b"x"));
        assert_eq!(failed.unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
