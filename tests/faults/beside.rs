//! Two of one writer at once: while one is at work, others of the same command come and are killed. The first one's work is there in the end,
//! whole, and nothing of the others.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use super::cases::{self, ENVIRONMENT};
use super::{FaultRun, tree};

/// Of the time that the first takes, the second lives for each of these parts in turn.
pub const LIVES_MS: [u64; 5] = [3, 10, 30, 100, 300];

/// How often each outcome was met.
#[derive(Debug, Default)]
pub struct Beside {
    /// Others that were killed while the first was at work.
    killed: usize,
    /// Others that had ended by then, refused or done.
    ended: usize,
}

impl FaultRun<'_> {
    fn start(&self) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        command.args(cases::words(&self.root, self.case.arguments)).envs(ENVIRONMENT);
        command.env("TMPDIR", self.root.join("tmp")).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// Lets others come and be killed while one is at work; what is wrong then.
    pub fn beside(&self, outcomes: &mut Beside) -> Vec<String> {
        self.restore();
        let mut found = vec![];
        let mut first = self.start();
        // Once it has a place of its own it is the first; where it has none before its output, whoever comes later wins.
        while first.try_wait().unwrap().is_none() && !tree(&self.root).keys().any(|path| super::is_hidden(path)) {
            std::thread::sleep(Duration::from_millis(1));
        }
        let lives = LIVES_MS.iter().cycle();
        for life_ms in lives {
            if first.try_wait().unwrap().is_some() {
                break;
            }
            let mut other = self.start();
            std::thread::sleep(Duration::from_millis(*life_ms));
            let ended = other.try_wait().unwrap().is_some();
            other.kill().unwrap();
            other.wait().unwrap();
            *(if ended { &mut outcomes.ended } else { &mut outcomes.killed }) += 1;
        }
        let first = first.wait_with_output().unwrap();
        if first.status.code() != Some(self.code) {
            found.push(format!(
                "the first: code {:?}, {}",
                first.status.code(),
                String::from_utf8_lossy(&first.stderr)
            ));
        }
        let is_old = self.broken_off(&mut found);
        if is_old {
            found.push("the first one's work is lost".to_owned());
        }
        self.next(&mut found);
        found
    }
}
