//! Pictures and pages of results: the contents as data, the result as SVG and self-contained HTML.
//!
//! A `picture::Picture` holds panels, a panel holds marks; `draw::svg` is the only place that
//! writes SVG. A [`page::Page`] holds blocks; it is the only place that knows the
//! HTML library. Colours are roles (`ink::Ink`) that the page turns into light or dark ones.
//!
//! ```
//! use govtwin_pages::draw::svg;
//! use govtwin_pages::ink::Ink;
//! use govtwin_pages::page::Page;
//! use govtwin_pages::picture::{Panel, Picture};
//!
//! let panel = Panel::new("Spool position, pu")
//!     .thick_line("measured", vec![[0.0, 0.0], [1.0, 0.4]])
//!     .line(Ink::Simulated, "simulated", vec![[0.0, 0.0], [1.0, 0.38]])
//!     .x_name("time, s");
//! let mut page = Page::new("One second", "of a spool");
//! page.body.figure(svg(&Picture::stacked("The spool opens", vec![panel])), "It opens.");
//! assert!(page.to_html().starts_with("<!DOCTYPE html>"));
//! ```

pub mod acceptance;
pub mod diagnosis;
pub mod draw;
pub mod fleet;
pub mod import;
pub mod ink;
mod layout;
pub mod page;
pub mod picture;
pub mod replay;
pub mod table;
mod thin;
mod ticks;
pub mod watch;

use govtwin_model::signal::Signal;

/// What the errors of a signal are multiplied by where they are shown, and the unit of that.
pub(crate) fn scale(signal: Signal) -> (f64, &'static str) {
    if signal == Signal::ControlPressure { (1e-3, "kPa") } else { (100.0, "%") }
}
