//! Names that change in one step: what is moved replaces nothing, and two change places at once.

use std::io;
use std::path::Path;

use super::fault::step;

/// Moves a file or folder to a name that is free; an empty folder there counts as free.
///
/// # Errors
/// `AlreadyExists` or `DirectoryNotEmpty` if the name is taken, or the file system's error.
#[cfg(target_os = "linux")]
pub fn move_new(from: &Path, to: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    step()?;
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => move_checked(from, to),
        other => other.map_err(io::Error::from),
    }
}

/// Moves a file or folder to a name that is free.
///
/// # Errors
/// `AlreadyExists` if the name is taken, or the file system's error.
#[cfg(not(target_os = "linux"))]
pub fn move_new(from: &Path, to: &Path) -> io::Result<()> {
    step()?;
    move_checked(from, to)
}

/// Lets two files or folders change names.
///
/// # Errors
/// The file system's error; then both have the names that they had.
#[cfg(target_os = "linux")]
pub fn exchange(one: &Path, other: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    step()?;
    match renameat_with(CWD, one, CWD, other, RenameFlags::EXCHANGE) {
        Err(rustix::io::Errno::INVAL | rustix::io::Errno::NOSYS) => exchange_in_steps(one, other),
        result => result.map_err(io::Error::from),
    }
}

/// Lets two files or folders change names.
///
/// # Errors
/// The file system's error; then both have the names that they had, unless that fails, too.
#[cfg(not(target_os = "linux"))]
pub fn exchange(one: &Path, other: &Path) -> io::Result<()> {
    step()?;
    exchange_in_steps(one, other)
}

/// For file systems that cannot do it in one step.
fn move_checked(from: &Path, to: &Path) -> io::Result<()> {
    if std::fs::symlink_metadata(to).is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    std::fs::rename(from, to)
}

/// The same for two names; `one` is that of something in the making, beside which a third is free.
fn exchange_in_steps(one: &Path, other: &Path) -> io::Result<()> {
    let mut third = one.as_os_str().to_owned();
    third.push(".old");
    std::fs::rename(other, &third)?;
    if let Err(error) = std::fs::rename(one, other) {
        // The older file goes back; should even that fail, it keeps the third name.
        let _ = std::fs::rename(&third, other);
        return Err(error);
    }
    std::fs::rename(&third, one)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_replaced_and_two_change_places() {
        type Exchange = fn(&Path, &Path) -> io::Result<()>;
        for (move_to, change) in [(move_new as Exchange, exchange as Exchange), (move_checked, exchange_in_steps)] {
            let dir = tempfile::tempdir().unwrap();
            let [a, b] = ["a", "b"].map(|name| dir.path().join(name));
            for folder in [&a, &b] {
                std::fs::create_dir(folder).unwrap();
                std::fs::write(folder.join(folder.file_name().unwrap()), "").unwrap();
            }
            assert!(move_to(&a, &b).is_err() && a.join("a").exists() && b.join("b").exists());
            change(&a, &b).unwrap();
            assert!(a.join("b").exists() && b.join("a").exists());
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
            assert!(change(&a, &dir.path().join("nowhere")).is_err() && a.exists());
            move_to(&a, &dir.path().join("c")).unwrap();
            assert!(!a.exists());
        }
    }
}
