//! Where things go in a picture: ranges of the axes, rectangles of the panels, rows of words.

use super::picture::{Axis, EventLine, MarkShape, Panel, Picture};
use super::table::wrapped;

/// Size of titles, px of the plotting library, which draws letters a fifth smaller.
pub(crate) const TITLE_SIZE: f64 = 15.5;
/// Size of the words in legends.
pub(crate) const LEGEND_SIZE: f64 = 14.0;
/// Size of the words along axes.
pub(crate) const LABEL_SIZE: f64 = 13.5;
/// Height of a panel's title row, px.
pub(crate) const TITLE_PX: f64 = 26.0;
/// Height of one row of legend or event names, px.
pub(crate) const ROW_PX: f64 = 18.0;
/// Height of one row of tick labels below a panel, px.
pub(crate) const TICKS_PX: f64 = 20.0;
/// Height of an axis name, px.
const NAME_PX: f64 = 19.0;
/// Space between panels, px.
const GAP_PX: f64 = 12.0;
/// Space right of a plot, which half a tick label may fill, px.
pub(crate) const RIGHT_PX: f64 = 20.0;

/// Estimated width of words, px: the average letter of a sans-serif face is about half the library's size wide.
pub(crate) fn words_px(words: &str, size_px: f64) -> f64 {
    words.chars().count() as f64 * size_px * 0.5
}

/// One panel's place, px from the picture's top left, and its ranges.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PanelPlace {
    /// Left, top, right, bottom of the plot itself.
    pub plot: [f64; 4],
    /// Top of the title row.
    pub top: f64,
    /// Left end of the title.
    pub left: f64,
    /// Left end of the panel, labels included.
    pub from: f64,
    /// Rows that the legend fills below the title; 0 where it fits beside it.
    pub legend_rows: usize,
    /// Horizontal range.
    pub x: [f64; 2],
    /// Vertical range.
    pub y: [f64; 2],
    /// Whether tick labels are drawn below.
    pub labels_x: bool,
}

/// The places of all panels, and the picture's height, px.
pub(crate) fn places(picture: &Picture, event_rows: usize) -> (Vec<PanelPlace>, f64) {
    let columns = picture.columns.max(1) as usize;
    let width = (f64::from(picture.width_px) - GAP_PX * (columns - 1) as f64) / columns as f64;
    let shared_x = picture.shared_x.then(|| union(picture.panels.iter().map(x_range)));
    let rows = picture.panels.len().div_ceil(columns);
    let mut places: Vec<PanelPlace> = Vec::with_capacity(picture.panels.len());
    let mut top = 0.0;
    for (row, panels) in picture.panels.chunks(columns).enumerate() {
        let labels_x = !picture.shared_x || row + 1 == rows;
        let mut bottom = top;
        // Panels side by side begin at one height.
        let own = |column: usize, panel: &Panel| {
            let labels = picture.panels.iter().skip(column).step_by(columns).map(|p| label_px(&p.y, width));
            legend_rows(panel, width - RIGHT_PX - labels.fold(0.0, f64::max))
        };
        let most = panels.iter().enumerate().map(|(column, panel)| own(column, panel)).max().unwrap_or(0);
        for (column, panel) in panels.iter().enumerate() {
            let left = (width + GAP_PX) * column as f64;
            let labels = picture.panels.iter().skip(column).step_by(columns).map(|p| label_px(&p.y, width));
            let plot_left = left + labels.fold(0.0, f64::max);
            let plot_right = left + width - RIGHT_PX;
            let legend_rows = most;
            let above = if row == 0 { event_rows } else { 0 };
            let plot_top = top + TITLE_PX + ROW_PX * (legend_rows + above) as f64;
            let plot_bottom = plot_top + f64::from(panel.height_px);
            let x = shared_x.unwrap_or_else(|| x_range(panel));
            let y = y_range(panel, x);
            let plot = [plot_left, plot_top, plot_right, plot_bottom];
            places.push(PanelPlace { plot, top, left: plot_left, from: left, legend_rows, x, y, labels_x });
            let name = if panel.x.name.is_empty() { 0.0 } else { NAME_PX };
            let ticks = TICKS_PX * label_rows(&panel.x, plot_right - plot_left) as f64;
            bottom = f64::max(bottom, plot_bottom + if labels_x { ticks + name } else { 4.0 });
        }
        top = bottom + GAP_PX;
    }
    (places, (top - GAP_PX).max(1.0))
}

/// Width of the labels left of a plot, px, in a panel of so many px.
fn label_px(axis: &Axis, width: f64) -> f64 {
    let lines = axis.categories.iter().flat_map(|name| label_lines(name, width));
    let longest = lines.map(|line| words_px(&line, LABEL_SIZE)).fold(0.0, f64::max);
    if axis.categories.is_empty() { 56.0 } else { longest + 14.0 }
}

/// Width of a picture for a narrow screen, px.
const NARROW_PX: u32 = 380;

/// Least height of a category whose name may take two lines there, px.
const NARROW_ROW_PX: u32 = 32;

impl Picture {
    /// The same panels one below the other, as wide as a phone.
    pub(crate) fn narrow(&self) -> Self {
        let mut narrow = Self { width_px: NARROW_PX, columns: 1, ..self.clone() };
        for panel in &mut narrow.panels {
            let names = || panel.y.categories.iter();
            if names().any(|name| label_lines(name, f64::from(NARROW_PX)).len() > 1) {
                let least = NARROW_ROW_PX * u32::try_from(names().count()).unwrap_or(1);
                panel.height_px = panel.height_px.max(least);
            }
        }
        narrow
    }
}

/// A label left of a plot, broken into lines that leave the plot its half of the panel.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a panel is a few hundred letters wide")]
pub(crate) fn label_lines(label: &str, width: f64) -> Vec<String> {
    wrapped(label, (0.45 * width / words_px("m", LABEL_SIZE)) as usize)
}

/// Rows that the names below a plot of so many px take so that none runs into its neighbour.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
pub(crate) fn label_rows(axis: &Axis, width: f64) -> usize {
    let longest = axis.categories.iter().map(|name| words_px(name, LABEL_SIZE) + 8.0).fold(0.0, f64::max);
    // Only every so many may have a name.
    let named = axis.categories.iter().enumerate().filter(|(_, name)| !name.is_empty()).map(|(at, _)| at);
    let named: Vec<usize> = named.collect();
    let every = named.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(1);
    let apart = width * every as f64 / axis.categories.len().max(1) as f64;
    (longest / apart.max(1.0)).ceil().clamp(1.0, 4.0) as usize
}

/// Width of one legend entry, px.
pub(crate) fn legend_px(label: &str) -> f64 {
    words_px(label, LEGEND_SIZE) + 40.0
}

fn legend_rows(panel: &Panel, width: f64) -> usize {
    let labels = || panel.marks.iter().map(|mark| mark.label.as_str()).filter(|label| !label.is_empty());
    let total: f64 = labels().map(legend_px).sum();
    if total + words_px(&panel.title, TITLE_SIZE) + 16.0 <= width {
        return 0;
    }
    let (mut rows, mut used) = (1, 0.0);
    for label in labels() {
        let needed = legend_px(label);
        if used > 0.0 && used + needed > width {
            rows += 1;
            used = 0.0;
        }
        used += needed;
    }
    rows
}

/// A row for each event's name, so that no two run into each other; `at` turns x into px.
pub(crate) fn event_rows(events: &[EventLine], at: impl Fn(f64) -> f64) -> Vec<usize> {
    let mut ends: Vec<f64> = Vec::new();
    let row_of = |event: &EventLine| {
        let start = at(event.x);
        let end = start + words_px(&event.label, LABEL_SIZE) + 12.0;
        let free = ends.iter().position(|&taken| taken <= start);
        let row = free.unwrap_or(ends.len());
        if free.is_none() {
            ends.push(end);
        } else {
            ends[row] = end;
        }
        row
    };
    events.iter().map(row_of).collect()
}

fn union(ranges: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |all, [low, high]| [all[0].min(low), all[1].max(high)])
}

/// A range that can be drawn: finite and not empty.
fn sound([low, high]: [f64; 2]) -> [f64; 2] {
    if !(low.is_finite() && high.is_finite() && low <= high) {
        return [0.0, 1.0];
    }
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-3);
    if high - low < least { [low - least.max(0.5e-3), high + least.max(0.5e-3)] } else { [low, high] }
}

/// The horizontal range of a panel alone.
pub(crate) fn x_range(panel: &Panel) -> [f64; 2] {
    if let Some(range) = panel.x.range {
        return sound(range);
    }
    if let Some(range) = category_range(&panel.x) {
        return range;
    }
    let all = union(panel.marks.iter().map(|mark| span(&mark.shape, 0, [f64::NEG_INFINITY, f64::INFINITY])));
    let airy = panel.marks.iter().all(|mark| !matches!(mark.shape, MarkShape::Line(_) | MarkShape::Band(_)));
    if airy { padded(sound(all), true) } else { sound(all) }
}

/// The vertical range of a panel whose horizontal one is settled.
fn y_range(panel: &Panel, x: [f64; 2]) -> [f64; 2] {
    if let Some(range) = panel.y.range {
        return sound(range);
    }
    if let Some(range) = category_range(&panel.y) {
        return range;
    }
    let all = union(panel.marks.iter().map(|mark| span(&mark.shape, 1, x)));
    let bars = panel.marks.iter().any(|mark| matches!(mark.shape, MarkShape::Blocks(_)));
    padded(sound(all), bars)
}

fn category_range(axis: &Axis) -> Option<[f64; 2]> {
    (!axis.categories.is_empty()).then(|| [-0.5, axis.categories.len() as f64 - 0.5])
}

/// A little air at both ends, but not below bars that stand on zero.
fn padded([low, high]: [f64; 2], bars: bool) -> [f64; 2] {
    let air = 0.06 * (high - low);
    [if bars && low == 0.0 { low } else { low - air }, if bars && high == 0.0 { high } else { high + air }]
}

/// Least and greatest finite coordinate of a shape along an axis (0 x, 1 y), within a horizontal range.
fn span(shape: &MarkShape, axis: usize, x: [f64; 2]) -> [f64; 2] {
    let mut all = [f64::INFINITY, f64::NEG_INFINITY];
    let mut take = |at_x: f64, value: f64| {
        if value.is_finite() && at_x >= x[0] && at_x <= x[1] {
            all = [all[0].min(value), all[1].max(value)];
        }
    };
    match shape {
        MarkShape::Line(points) | MarkShape::Dots(points) => points.iter().for_each(|p| take(p[0], p[axis])),
        MarkShape::Band(points) => points.iter().for_each(|p| {
            take(p[0], p[axis]);
            take(p[0], p[2 * axis]);
        }),
        MarkShape::Blocks(blocks) => blocks.iter().for_each(|b| {
            take(b[0].max(x[0]), b[2 * axis]);
            take(b[1].min(x[1]), b[2 * axis + 1]);
        }),
        MarkShape::Segments(segments) => segments.iter().for_each(|s| {
            take(s[0].max(x[0]), s[axis]);
            take(s[2].min(x[1]), s[axis + 2]);
        }),
        MarkShape::Words(words) | MarkShape::Above(words) => words.iter().for_each(|(p, _)| take(p[0], p[axis])),
        MarkShape::Cells { rows, .. } => {
            let across = rows.first().map_or(0, Vec::len);
            let count = if axis == 0 { across } else { rows.len() };
            all = [-0.5, count as f64 - 0.5];
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::{TICKS_PX, event_rows, label_lines, label_rows, places, x_range};
    use crate::ink::Ink;
    use crate::picture::{EventLine, Panel, Picture};

    #[test]
    fn stacked_panels_share_one_horizontal_range_and_never_overlap() {
        let panel = |to: f64| Panel::new("a").line(Ink::Measured, "m", vec![[0.0, 1.0], [to, 2.0]]);
        let picture = Picture::stacked("", vec![panel(5.0), panel(9.0), panel(7.0)]);
        let (places, height) = places(&picture, 0);
        assert!(places.iter().all(|place| place.x == [0.0, 9.0]));
        assert!(places.windows(2).all(|pair| pair[0].plot[3] < pair[1].top));
        assert!(places[2].plot[3] < height && places[2].labels_x && !places[0].labels_x);
    }

    #[test]
    fn long_names_leave_the_plot_its_half_and_never_run_into_each_other() {
        let names = ["named verdicts with an effect that is not there", "stage right"];
        let panel =
            Panel::new("a").y_categories(names).x_categories(["supply loss", "pilot filter", "port overlap", "none"]);
        let narrow = Picture::stacked("", vec![panel]).narrow();
        let (places, height) = places(&narrow, 0);
        let [left, _, right, bottom] = places[0].plot;
        assert!(left < 0.55 * f64::from(narrow.width_px), "{left}");
        assert!(label_lines(names[0], f64::from(narrow.width_px)).len() > 1);
        let rows = label_rows(&narrow.panels[0].x, right - left);
        assert!(rows > 1 && height >= bottom + TICKS_PX * f64::from(u32::try_from(rows).unwrap()));
    }

    #[test]
    fn ranges_are_drawable_whatever_the_data() {
        for values in [vec![], vec![[f64::NAN, 1.0]], vec![[3.0, 3.0]], vec![[0.0, f64::INFINITY], [0.0, 0.0]]] {
            let picture = Picture::stacked("", vec![Panel::new("a").line(Ink::Measured, "", values)]);
            let (places, _) = places(&picture, 0);
            for [low, high] in [places[0].x, places[0].y] {
                assert!(low.is_finite() && high.is_finite() && low < high);
            }
        }
    }

    #[test]
    fn the_vertical_range_follows_the_horizontal_window() {
        let points = vec![[0.0, 0.0], [1.0, 1.0], [2.0, 100.0]];
        let panel = Panel::new("a").line(Ink::Measured, "", points).x_range(0.0, 1.5);
        assert!(super::y_range(&panel, x_range(&panel))[1] < 2.0);
    }

    #[test]
    fn names_of_close_events_take_rows_of_their_own() {
        let event = |x: f64| EventLine { x, label: "ESV trip".into(), ink: Ink::Alarm };
        let rows = event_rows(&[event(1.0), event(1.1), event(60.0)], |x| 10.0 * x);
        assert_eq!(rows, [0, 1, 0]);
    }
}
