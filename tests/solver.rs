//! What a right integration shows: its order, agreement of all methods, and results that only time and inputs decide.

#[path = "solver/agreement.rs"]
mod agreement;
#[path = "solver/order.rs"]
mod order;
#[path = "solver/repeat.rs"]
mod repeat;
#[path = "support/rows.rs"]
mod rows;
