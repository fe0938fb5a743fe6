//! What a right model shows: rest, balances, speeds, times and limits, through the twin's public face.
//!
//! The laws that the balances use are written out once more in `physics/textbook.rs`, from the text and not from the code.

#[path = "physics/balance.rs"]
mod balance;
#[path = "physics/limits.rs"]
mod limits;
#[path = "physics/rest.rs"]
mod rest;
#[path = "support/rows.rs"]
mod rows;
#[path = "physics/textbook.rs"]
mod textbook;
#[path = "physics/times.rs"]
mod times;

use govtwin_model::solver::Method;

/// Every method at a step that resolves the chain.
const METHODS: [Method; 3] = [
    Method::Split { max_step_s: govtwin_model::solver::split::SPOOL_STEP_S },
    Method::Rk4 { max_step_s: 5.0e-5 },
    Method::Rosenbrock { max_step_s: 1.0e-4 },
];
