//! Every step that the file system may refuse passes here, so that tests can refuse each of them once.

use std::io;

/// Lets a step through.
///
/// # Errors
/// Never but under test.
#[cfg(not(any(test, feature = "faults")))]
#[expect(clippy::inline_always, reason = "it is nothing")]
#[inline(always)]
pub fn step() -> io::Result<()> {
    Ok(())
}

#[cfg(any(test, feature = "faults"))]
thread_local! {
    /// Steps that this thread may still take before one is refused; none where all may be taken.
    static LEFT: std::cell::Cell<Option<usize>> = const { std::cell::Cell::new(None) };
    /// The refused step ends the process instead.
    static DIES: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// Lets so many steps through, and ends the process at the next one, as a kill would.
#[cfg(test)]
pub(crate) fn die_at(steps: usize) {
    LEFT.set(Some(steps));
    DIES.set(true);
}

/// Lets a step through, unless it is the one to be refused.
#[cfg(any(test, feature = "faults"))]
pub fn step() -> io::Result<()> {
    let left = LEFT.get();
    LEFT.set(left.and_then(|left| left.checked_sub(1)));
    if left == Some(0) && DIES.get() {
        std::process::abort();
    }
    if left == Some(0) { Err(io::Error::from(io::ErrorKind::StorageFull)) } else { Ok(()) }
}

/// Runs `attempt` again and again, its first step refused, then its second and so on, each time followed by `check` on whether it
/// went well, until none is left to be refused; gives how many were.
#[cfg(any(test, feature = "faults"))]
pub fn refuse_each(mut attempt: impl FnMut() -> bool, mut check: impl FnMut(bool)) -> usize {
    for refused in 0.. {
        LEFT.set(Some(refused));
        let went_well = attempt();
        let all_taken = LEFT.take().is_some();
        check(went_well);
        if all_taken {
            assert!(went_well, "nothing was refused");
            return refused;
        }
    }
    0
}
