//! The few calls by which a thread asks for real time: absolute sleep, locked memory, priority, a core of its own.

use std::io;
use std::num::NonZeroU64;
use std::time::Duration;

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{ClockId, CpuSet, clock_nanosleep_absolute, sched_setaffinity, set_current_timer_slack};
use rustix::time::{Timespec, clock_gettime};

use govtwin_model::units::NANOS_PER_SECOND;

/// What a thread asks of the system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wishes {
    /// Core to stay on.
    pub cpu: Option<usize>,
    /// `SCHED_FIFO` priority, 1 to 99; 0 asks for none.
    pub priority: u8,
}

/// Nanoseconds of the clock that never jumps.
pub fn monotonic_ns() -> i64 {
    nanos(clock_gettime(ClockId::Monotonic))
}

/// Nanoseconds since the epoch, as the system believes.
pub fn wall_ns() -> i64 {
    nanos(clock_gettime(ClockId::Realtime))
}

/// Sleeps until this time of the monotonic clock; at once where it is past.
pub fn sleep_until(deadline_ns: i64) {
    let request = Timespec {
        tv_sec: deadline_ns.div_euclid(NANOS_PER_SECOND),
        tv_nsec: deadline_ns.rem_euclid(NANOS_PER_SECOND),
    };
    // A signal may end the sleep early: sleep again. Any other error cannot happen with a valid time.
    while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(rustix::io::Errno::INTR) {}
}

/// Sleeps so long.
pub fn pause(duration: Duration) {
    sleep_until(monotonic_ns().saturating_add(whole_ns(duration)));
}

/// A time to come, or never.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Until(Option<i64>);

impl Until {
    /// So long from now; never where there is no duration.
    pub fn after(duration: Option<Duration>) -> Self {
        Self(duration.map(|duration| monotonic_ns().saturating_add(whole_ns(duration))))
    }

    /// Whether it is past.
    pub fn is_past(self) -> bool {
        self.0.is_some_and(|until_ns| monotonic_ns() >= until_ns)
    }

    /// Whether it is past; then it is the same duration later again.
    pub(crate) fn comes_round(&mut self, duration: Duration) -> bool {
        let past = self.is_past();
        if past {
            self.0 = self.0.map(|until_ns| until_ns.saturating_add(whole_ns(duration)).max(monotonic_ns()));
        }
        past
    }
}

/// Keeps all memory of the process, present and future, in RAM.
///
/// # Errors
/// When the limit on locked memory (`ulimit -l`) is too low.
pub fn lock_memory() -> io::Result<()> {
    Ok(mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)?)
}

/// Asks for what this thread wishes and returns what was granted, a plain sentence for each wish.
pub fn claim(wishes: Wishes) -> Vec<Result<String, String>> {
    let mut said = Vec::new();
    // The kernel may otherwise round a wake-up of an ordinary thread by 50 us.
    let _ = set_current_timer_slack(NonZeroU64::new(1));
    if let Some(cpu) = wishes.cpu {
        said.push(match pin_to(cpu) {
            Ok(()) => Ok(format!("pinned to core {cpu}")),
            Err(error) => Err(format!("not pinned to core {cpu}: {error}; any core may run the loop")),
        });
    }
    if wishes.priority > 0 {
        said.push(match set_fifo(THIS_THREAD, wishes.priority) {
            Ok(()) => Ok(format!("SCHED_FIFO priority {}", wishes.priority)),
            Err(error) => Err(format!(
                "no real-time priority: {error}; other programs may delay the loop (allow it with `ulimit -r`, \
                 CAP_SYS_NICE or root)"
            )),
        });
    }
    said
}

/// How far the threads that carry data stand below the integration thread, and discovery below them.
const STEP_DOWN: u8 = 10;

/// Threads of RustDDS as the system shortens their names: the one that moves samples, and the one that finds peers.
const TRANSPORT: &str = "RustDDS Partici";
const DISCOVERY: &str = "RustDDS discove";

/// The priority of a thread that carries data, below an integration thread with `priority`; 0 where that has none.
pub(crate) fn carrier(priority: u8) -> u8 {
    if priority == 0 { 0 } else { priority.saturating_sub(STEP_DOWN).max(1) }
}

/// Raises this thread, which carries data, to its priority; where that is not allowed the integration thread says so.
pub(crate) fn claim_as_carrier(priority: u8) {
    if priority > 0 {
        let _ = set_fifo(THIS_THREAD, carrier(priority));
    }
}

/// Raises the threads of the transport: those that move samples to [`carrier`], discovery below them. Returns how many
/// there are and how many were raised.
pub(crate) fn claim_transport(priority: u8) -> (usize, usize) {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return (0, 0) };
    let (mut found, mut raised) = (0, 0);
    for task in tasks.flatten() {
        let Ok(name) = std::fs::read_to_string(task.path().join("comm")) else { continue };
        let wanted = match name.trim_end() {
            TRANSPORT => carrier(priority),
            DISCOVERY => carrier(carrier(priority)),
            _ => continue,
        };
        found += 1;
        let thread = task.file_name().to_str().and_then(|name| name.parse().ok());
        raised += usize::from(wanted > 0 && thread.is_some_and(|thread| set_fifo(thread, wanted).is_ok()));
    }
    (found, raised)
}

/// Resident memory of this process in bytes; 0 where the system does not say.
pub fn resident_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm")
        .ok()
        .and_then(|statm| statm.split_whitespace().nth(1).and_then(|pages| pages.parse::<u64>().ok()));
    pages.unwrap_or(0) * rustix::param::page_size() as u64
}

fn whole_ns(duration: Duration) -> i64 {
    i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)
}

fn nanos(time: Timespec) -> i64 {
    time.tv_sec * NANOS_PER_SECOND + time.tv_nsec
}

fn pin_to(cpu: usize) -> io::Result<()> {
    if cpu >= CpuSet::MAX_CPU {
        return Err(io::Error::other("no such core"));
    }
    let mut set = CpuSet::new();
    set.set(cpu);
    Ok(sched_setaffinity(None, &set)?)
}

/// The calling thread, as the scheduler names it.
const THIS_THREAD: i32 = 0;

#[expect(unsafe_code, reason = "no safe library in use offers the scheduling policy")]
fn set_fifo(thread: i32, priority: u8) -> io::Result<()> {
    // Linux' `sched_param` is this one number. The call goes to the kernel, because musl's own wrapper refuses it.
    let parameter = i32::from(priority);
    // SAFETY: `parameter` is a whole `sched_param` of the kernel that outlives the call, which only reads it; a thread
    // that has gone is an error of the call.
    let outcome =
        unsafe { libc::syscall(libc::SYS_sched_setscheduler, thread, libc::SCHED_FIFO, &raw const parameter) };
    if outcome == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[cfg(test)]
mod tests {
    use super::{Wishes, carrier, claim, monotonic_ns, resident_bytes, sleep_until};

    #[test]
    fn carriers_stand_below_the_loop_and_above_nothing_without_one() {
        assert_eq!([80, 11, 5, 1, 0].map(carrier), [70, 1, 1, 1, 0]);
    }

    #[test]
    fn a_sleep_ends_at_or_after_its_deadline() {
        let deadline_ns = monotonic_ns() + 2_000_000;
        sleep_until(deadline_ns);
        assert!(monotonic_ns() >= deadline_ns);
        sleep_until(deadline_ns - 1_000_000_000);
    }

    #[test]
    fn a_wish_that_cannot_be_granted_is_said_in_words() {
        let said = claim(Wishes { cpu: Some(100_000), priority: 0 });
        assert!(matches!(&said[..], [Err(words)] if words.contains("core 100000")));
    }

    #[test]
    fn resident_memory_is_that_of_a_program() {
        assert!(resident_bytes() > 100_000);
    }
}
