//! Children end with their parent: a diagnosis that `blind` started writes into a folder of its own, and must not go on there where `blind`
//! was killed.

/// By which a child knows whose it is.
const PARENT: &str = "GOVTWIN_PARENT";

#[cfg(feature = "lab")]
/// Tells a child whose it is.
pub fn tell(command: &mut std::process::Command) {
    command.env(PARENT, std::process::id().to_string());
}

/// Ends with the process that started this one, where that said so. Only on Linux.
pub fn follow() -> anyhow::Result<()> {
    #[cfg(target_os = "linux")]
    if let Ok(parent) = std::env::var(PARENT) {
        use anyhow::Context as _;
        use rustix::process::{Signal, getppid, set_parent_process_death_signal};
        set_parent_process_death_signal(Some(Signal::KILL)).context("cannot ask to end with the parent")?;
        // It may have ended before.
        let is_there = getppid().is_some_and(|pid| pid.as_raw_nonzero().to_string() == parent);
        anyhow::ensure!(is_there, "{PARENT}: the process {parent}, which started this one, has ended");
    }
    Ok(())
}
