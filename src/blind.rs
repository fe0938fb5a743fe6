//! The withheld check: what diagnoses said of units against what is truly in them.
//!
//! The scorer is the only one that sees labels ([`crate::battery::Label`]); what it judges is [`said::ReportVerdict`], read back from
//! reports, so that a diagnosis made elsewhere or long ago is scored alike.

pub mod isolability;
pub mod learn;
pub mod page;
pub mod rejudge;
pub mod said;
pub mod score;
pub mod scored;
pub mod statistics;
pub mod validation;
