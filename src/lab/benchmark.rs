//! The benchmark: verdicts of diagnoses against what is truly in the units.
//!
//! The scorer is the only one that sees labels ([`crate::battery::Label`]); it scores [`DiagnosisReport`](govtwin_diagnosis::result::schema::DiagnosisReport), read back from
//! reports, so that a diagnosis made elsewhere or long ago is scored alike.

pub mod isolability;
pub mod learn;
pub mod next_test;
pub mod page;
pub mod rejudge;
pub mod score;
pub mod scored;
pub mod scored_report;
pub mod statistics;
pub mod validation;
