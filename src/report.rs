//! Pictures and pages of results: say as data what to show, get SVG and self-contained HTML.
//!
//! A [`picture::Picture`] holds panels, a panel holds marks; [`draw::svg`] is the only place that
//! knows the plotting library. A [`page::Page`] holds blocks; it is the only place that knows the
//! HTML library. Colours are roles ([`ink::Ink`]) that the page turns into light or dark ones.

pub mod draw;
mod dress;
pub mod ink;
mod layout;
pub mod page;
pub mod picture;
pub mod replay;
pub mod table;
mod thin;
