//! No more memory from one of a writer's requests for it on, as where a limit is reached there. The program may end by it, which tells the
//! user so; what is under a final name is whole all the same, and the next run completes and cleans.

use super::cases::Case;
use super::trace::Fault;
use super::{FaultRun, SAMPLED};

/// The most requests of a writer that are tried: `scripts/faults all` would take days for each of thousands.
pub const MOST: usize = 100;

/// How often each outcome was met.
#[derive(Debug, Default)]
pub struct Starved {
    /// Ended by a signal, as programs in Rust do where an allocation fails or a stack cannot grow, or by the loader.
    ended: usize,
    /// A thread could not be started, and the program ended by that.
    threadless: usize,
    told: usize,
    no_matter: usize,
    still_old: usize,
}

/// How many requests of a writer are tried.
pub fn sampled(case: &Case) -> usize {
    match std::env::var("FAULTS").as_deref() {
        Err(_) if case.costly => 1,
        Err(_) => SAMPLED / 2,
        Ok("all") => MOST,
        Ok(count) => count.parse().expect("FAULTS: expected `all` or a count"),
    }
}

impl FaultRun<'_> {
    /// Refuses memory from one request on; what is wrong then.
    pub fn starve(&self, at: usize, outcomes: &mut Starved) -> Vec<String> {
        self.restore();
        let run = self.run(Some((at, Fault::Starved)));
        let mut found = vec![];
        match run.code {
            // Before `main` it is the loader that ends, by its own code.
            None | Some(127) => outcomes.ended += 1,
            Some(101) if run.stderr.contains("thread") => outcomes.threadless += 1,
            Some(1) => outcomes.told += 1,
            // It was a child that ended.
            Some(3) if run.stderr.contains("failed (") => outcomes.told += 1,
            Some(0 | 3) if self.differs(&self.new).is_empty() => outcomes.no_matter += 1,
            code => found.push(format!("code {code:?}: {}", run.stderr)),
        }
        outcomes.still_old += usize::from(self.broken_off(&mut found));
        self.next(&mut found);
        found
    }
}
