//! Runs a program under ptrace, counts what it does to the files below a folder, and refuses one of these steps or kills it there; counts
//! its requests for memory as well, and refuses them from one of them on.
//!
//! It sees every system call of every thread and every child, whichever library makes it, and needs no change of the program. A kill is that of a
//! machine that goes down: the children end with the program.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::{Read as _, Seek as _, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use nix::errno::Errno;
use nix::sys::ptrace::{self, Options};
use nix::sys::signal::Signal;
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;

/// What a step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Look,
    Open,
    Read,
    List,
    Lock,
    Create,
    Folder,
    Write,
    Size,
    Sync,
    Rights,
    Rename,
    Remove,
}

impl Kind {
    /// What the system says where such a step fails.
    pub fn error(self) -> Errno {
        match self {
            Self::Create | Self::Folder | Self::Write | Self::Size => Errno::ENOSPC,
            Self::Lock => Errno::ENOLCK,
            Self::Look | Self::Open | Self::Read | Self::List | Self::Sync | Self::Rights => Errno::EIO,
            Self::Rename | Self::Remove => Errno::EACCES,
        }
    }

    /// Whether a kill before it can leave something else than a kill before the step that went before.
    pub fn changes(self) -> bool {
        self >= Self::Create
    }
}

/// A step: what is done, and to which file or folder.
#[derive(Clone, Debug)]
pub struct Step {
    pub kind: Kind,
    pub path: PathBuf,
}

/// What becomes of one step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Refused,
    Killed,
    /// Not of a step, but of a request for memory: there is no more from here on, as where a limit is reached.
    Starved,
}

/// How a traced program ended.
#[derive(Debug)]
pub struct Traced {
    pub steps: Vec<Step>,
    /// How often memory was asked for.
    pub requests: usize,
    /// None where it ended by a signal.
    pub code: Option<i32>,
    pub stderr: String,
}

/// Whether this machine lets a process trace its children.
pub fn is_allowed() -> bool {
    let mut child = Command::new("sh").args(["-c", "read -r go"]).stdin(Stdio::piped()).spawn().unwrap();
    let allowed = ptrace::seize(Pid::from_raw(child.id().cast_signed()), Options::PTRACE_O_EXITKILL).is_ok();
    child.kill().unwrap();
    child.wait().unwrap();
    allowed
}

/// Runs a program; of the steps below a folder the one with this number has a fault.
#[expect(clippy::zombie_processes, reason = "the tracer waits for it")]
pub fn run(command: &[&str], environment: &[(&str, &str)], below: &Path, fault: Option<(usize, Fault)>) -> Traced {
    let mut said = tempfile::tempfile().unwrap();
    let mut child = Command::new("sh")
        // Waits until it is traced.
        .args(["-c", "read -r go; exec \"$0\" \"$@\""])
        .args(command)
        .envs(environment.iter().copied())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(said.try_clone().unwrap())
        .spawn()
        .unwrap();
    let leader = Pid::from_raw(child.id().cast_signed());
    let mut tracer = Tracer {
        leader,
        below,
        fault,
        steps: vec![],
        requests: 0,
        inside: HashMap::new(),
        seen: BTreeSet::new(),
        begun: false,
    };
    let options = Options::PTRACE_O_TRACESYSGOOD
        | Options::PTRACE_O_TRACECLONE
        | Options::PTRACE_O_TRACEFORK
        | Options::PTRACE_O_TRACEVFORK
        | Options::PTRACE_O_TRACEEXEC
        | Options::PTRACE_O_EXITKILL;
    ptrace::seize(leader, options).expect("this test traces its children by ptrace, which is refused here");
    ptrace::interrupt(leader).unwrap();
    let mut stdin = child.stdin.take();
    let mut code = None;
    // Only what this thread traces: other tests have children, too.
    while let Ok(status) = waitpid(Pid::from_raw(-1), Some(WaitPidFlag::__WALL | WaitPidFlag::__WNOTHREAD)) {
        let (pid, signal) = match status {
            WaitStatus::Exited(pid, exit) if pid == leader => {
                code = Some(exit);
                break;
            }
            WaitStatus::Signaled(pid, ..) if pid == leader => break,
            WaitStatus::PtraceSyscall(pid) => {
                tracer.stopped(pid);
                (pid, None)
            }
            WaitStatus::PtraceEvent(pid, _, event) => {
                tracer.begun |= event == ptrace::Event::PTRACE_EVENT_EXEC as i32;
                (pid, None)
            }
            WaitStatus::Stopped(pid, signal) => (pid, Some(signal)),
            WaitStatus::Exited(pid, _) | WaitStatus::Signaled(pid, ..) => {
                tracer.seen.remove(&pid);
                continue;
            }
            _ => continue,
        };
        // One that was killed meanwhile cannot go on.
        let _ = ptrace::syscall(pid, signal);
        if let Some(mut stdin) = stdin.take() {
            stdin.write_all(b"go\n").unwrap();
        }
    }
    tracer.end_all();
    let mut stderr = String::new();
    said.rewind().unwrap();
    said.read_to_string(&mut stderr).unwrap();
    Traced { steps: tracer.steps, requests: tracer.requests, code, stderr }
}

struct Tracer<'a> {
    leader: Pid,
    below: &'a Path,
    fault: Option<(usize, Fault)>,
    steps: Vec<Step>,
    requests: usize,
    /// Threads inside a system call, and the error that it is to end with.
    inside: HashMap<Pid, Option<Errno>>,
    /// Threads of the program and of its children.
    seen: BTreeSet<Pid>,
    begun: bool,
}

impl Tracer<'_> {
    /// Ends children that are left.
    fn end_all(&self) {
        let end = |pid: Pid| nix::sys::signal::kill(pid, Signal::SIGKILL).unwrap_or_default();
        self.seen.iter().filter(|pid| **pid != self.leader).for_each(|pid| end(*pid));
        // Only what this thread traces, until nothing of it is left; one that has just been born stops once.
        while let Ok(status) = waitpid(Pid::from_raw(-1), Some(WaitPidFlag::__WALL | WaitPidFlag::__WNOTHREAD)) {
            if !matches!(status, WaitStatus::Exited(..) | WaitStatus::Signaled(..)) {
                status.pid().into_iter().for_each(end);
            }
        }
    }

    fn stopped(&mut self, pid: Pid) {
        self.seen.insert(pid);
        let Ok(mut registers) = ptrace::getregs(pid) else { return };
        if let Some(error) = self.inside.remove(&pid) {
            if let Some(error) = error {
                registers.rax = (-i64::from(error as i32)).cast_unsigned();
                ptrace::setregs(pid, registers).unwrap();
            }
            return;
        }
        // A new thread's first stop may be the end of the call that made it.
        if registers.rax.cast_signed() != -i64::from(Errno::ENOSYS as i32) {
            return;
        }
        let mut error = None;
        if self.begun
            && let Some(step) = self.step(pid, &registers)
        {
            let number = self.steps.len();
            match self.fault.filter(|(at, _)| *at == number) {
                Some((_, Fault::Refused)) => {
                    error = Some(step.kind.error());
                    // No such call: the kernel does nothing.
                    registers.orig_rax = u64::MAX;
                    ptrace::setregs(pid, registers).unwrap();
                }
                // Of a child first, so that it does not take the step.
                Some((_, Fault::Killed)) => {
                    let _ = nix::sys::signal::kill(pid, Signal::SIGKILL);
                    let _ = nix::sys::signal::kill(self.leader, Signal::SIGKILL);
                }
                Some((_, Fault::Starved)) | None => {}
            }
            self.steps.push(step);
        } else if self.begun && asks_for_memory(&registers) {
            if self.fault.is_some_and(|(at, fault)| fault == Fault::Starved && at <= self.requests) {
                if registers.orig_rax.cast_signed() == libc::SYS_brk {
                    // It fails by leaving the end where it is, and says where that is.
                    registers.rdi = 0;
                } else {
                    error = Some(Errno::ENOMEM);
                    registers.orig_rax = u64::MAX;
                }
                ptrace::setregs(pid, registers).unwrap();
            }
            self.requests += 1;
        }
        self.inside.insert(pid, error);
    }

    /// What a system call of a thread does to a file below the folder.
    fn step(&self, pid: Pid, registers: &libc::user_regs_struct) -> Option<Step> {
        let [first, second, third] = [registers.rdi, registers.rsi, registers.rdx];
        let (kind, path) = match registers.orig_rax.cast_signed() {
            libc::SYS_open => (opened(second), named(pid, None, first)),
            libc::SYS_openat => (opened(third), named(pid, Some(first), second)),
            libc::SYS_stat | libc::SYS_lstat => (Kind::Look, named(pid, None, first)),
            libc::SYS_newfstatat | libc::SYS_statx => (Kind::Look, named(pid, Some(first), second)),
            libc::SYS_read | libc::SYS_pread64 | libc::SYS_readv => (Kind::Read, open_file(pid, first)),
            libc::SYS_getdents64 => (Kind::List, open_file(pid, first)),
            libc::SYS_flock => (Kind::Lock, open_file(pid, first)),
            libc::SYS_write | libc::SYS_pwrite64 | libc::SYS_writev => (Kind::Write, open_file(pid, first)),
            libc::SYS_copy_file_range => (Kind::Write, open_file(pid, third)),
            libc::SYS_sendfile => (Kind::Write, open_file(pid, first)),
            libc::SYS_ftruncate => (Kind::Size, open_file(pid, first)),
            libc::SYS_fsync | libc::SYS_fdatasync => (Kind::Sync, open_file(pid, first)),
            libc::SYS_fchmod => (Kind::Rights, open_file(pid, first)),
            libc::SYS_chmod => (Kind::Rights, named(pid, None, first)),
            libc::SYS_mkdir => (Kind::Folder, named(pid, None, first)),
            libc::SYS_mkdirat => (Kind::Folder, named(pid, Some(first), second)),
            libc::SYS_rename | libc::SYS_link => (Kind::Rename, named(pid, None, second)),
            libc::SYS_renameat | libc::SYS_renameat2 | libc::SYS_linkat => {
                (Kind::Rename, named(pid, Some(third), registers.r10))
            }
            libc::SYS_unlink | libc::SYS_rmdir => (Kind::Remove, named(pid, None, first)),
            libc::SYS_unlinkat => (Kind::Remove, named(pid, Some(first), second)),
            _ => return None,
        };
        let path = path.filter(|path| path.starts_with(self.below))?;
        Some(Step { kind, path })
    }
}

/// Whether a system call asks for memory that no file backs.
fn asks_for_memory(registers: &libc::user_regs_struct) -> bool {
    match registers.orig_rax.cast_signed() {
        libc::SYS_mmap => registers.r10 as i32 & libc::MAP_ANONYMOUS != 0,
        libc::SYS_brk => registers.rdi != 0,
        libc::SYS_mremap => registers.rdx > registers.rsi,
        _ => false,
    }
}

/// A path in a thread's memory, below an open folder where it is relative.
fn named(pid: Pid, folder: Option<u64>, address: u64) -> Option<PathBuf> {
    let memory = File::open(format!("/proc/{pid}/mem")).ok()?;
    let mut bytes = vec![0; 4096];
    let read = memory.read_at(&mut bytes, address).ok()?;
    let end = bytes[..read].iter().position(|byte| *byte == 0)?;
    let name = String::from_utf8_lossy(&bytes[..end]).into_owned();
    if name.starts_with('/') {
        return Some(PathBuf::from(name));
    }
    let here = folder.filter(|folder| *folder as i32 != libc::AT_FDCWD);
    let folder = match here {
        Some(folder) => open_file(pid, folder)?,
        None => std::fs::read_link(format!("/proc/{pid}/cwd")).ok()?,
    };
    Some(if name.is_empty() { folder } else { folder.join(name) })
}

/// The path of a file that a thread has open.
fn open_file(pid: Pid, descriptor: u64) -> Option<PathBuf> {
    std::fs::read_link(format!("/proc/{pid}/fd/{}", descriptor as i32)).ok()
}

/// Whether a file is made or only opened.
fn opened(flags: u64) -> Kind {
    if flags as i32 & libc::O_CREAT == 0 { Kind::Open } else { Kind::Create }
}
