//! From a picture to SVG: inks for colours, and a size that scales with its page.

use super::ink::Ink;
use super::layout::{
    self, LABEL_SIZE, LEGEND_SIZE, PanelPlace, RIGHT_PX, ROW_PX, TICKS_PX, TITLE_PX, TITLE_SIZE, label_lines,
    label_rows, legend_px, words_px,
};
use super::picture::{Mark, MarkShape, Panel, Picture};
use super::thin::{clip, clip_segment, runs, thin};
use super::ticks::ticks;
use govtwin_model::number::fixed;

/// Things are placed on whole units; this many of them to a pixel keep curves smooth.
const SCALE: f64 = 8.0;

/// Dashes and gaps by pattern, units.
const PATTERNS: [&str; 4] = ["56 32", "16 24", "96 24 16 24", "120 56"];

/// From one line of a label to the next, px.
const LINE_PX: f64 = 14.0;

/// A drawn picture: an SVG element that scales with its page and takes the page's inks, and the same picture for a narrow screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Svg {
    wide: String,
    narrow: String,
}

impl Svg {
    /// The element as text, which is also valid as a file of its own.
    pub fn as_str(&self) -> &str {
        &self.wide
    }

    /// The same picture for a screen as wide as a phone: one panel below the other, with words of the size that is read there.
    pub(crate) fn narrow(&self) -> &str {
        &self.narrow
    }
}

/// Draws a picture.
pub fn svg(picture: &Picture) -> Svg {
    Svg { wide: draw(picture), narrow: draw(&picture.narrow()) }
}

/// Which point of a text is where it is placed: `text-anchor` and `dy`.
type Anchor = [&'static str; 2];
const LEFT: Anchor = ["start", "0.5ex"];
const RIGHT: Anchor = ["end", "0.5ex"];
const CENTER: Anchor = ["middle", "0.5ex"];
const TOP: Anchor = ["middle", "0.76em"];
const TOP_RIGHT: Anchor = ["end", "0.76em"];
const BOTTOM: Anchor = ["middle", "-0.5ex"];

/// SVG in the making; places are in units.
struct Canvas(String);

impl Canvas {
    fn path(&mut self, points: &[[i32; 2]], (ink, opacity): (Ink, f64), width: i32, dash: u8) {
        let dashes = dash.checked_sub(1).map(|pattern| PATTERNS[usize::from(pattern) % PATTERNS.len()]);
        let dashes = dashes.map_or(String::new(), |dashes| format!(" stroke-dasharray=\"{dashes}\""));
        let (seen, ink) = (seen(opacity), ink.css());
        self.0 += &format!("<path fill=\"none\"{seen} stroke=\"{ink}\" stroke-width=\"{width}\"{dashes} d=\"");
        let mut last = [0, 0];
        for (k, point) in points.iter().enumerate() {
            let separator = ["m", "l", " "][k.min(2)];
            self.0 += &format!("{separator}{},{}", point[0] - last[0], point[1] - last[1]);
            last = *point;
        }
        self.0 += "\"/>\n";
    }

    fn rectangle(&mut self, [a, b]: [[i32; 2]; 2], (ink, opacity): (Ink, f64)) {
        let ([x, y], [right, bottom]) = ([0, 1].map(|k| a[k].min(b[k])), [0, 1].map(|k| a[k].max(b[k])));
        let (width, height, seen, ink) = (right - x, bottom - y, seen(opacity), ink.css());
        self.0 += &format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"{seen} fill=\"{ink}\"/>\n");
    }

    /// A dot, which may be hollow.
    fn dot(&mut self, [x, y]: [i32; 2], radius_px: f64, (ink, opacity): (Ink, f64), is_hollow: bool) {
        let (r, seen, ink) = (units(radius_px).max(0), seen(opacity), ink.css());
        self.0 += &format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\"{seen} fill=\"{ink}\" stroke-width=\"1\"/>\n");
        if is_hollow {
            self.dot([x, y], 0.55 * radius_px, (Ink::Paper, 1.0), false);
        }
    }

    fn write(&mut self, words: &str, at: [f64; 2], size: f64, ink: Ink, anchor: Anchor) {
        if !words.is_empty() {
            self.write_as(words, at, size, ink, anchor, "");
        }
    }

    fn write_as(&mut self, words: &str, at: [f64; 2], size: f64, ink: Ink, [side, dy]: Anchor, weight: &str) {
        let ([x, y], size, ink) = (at.map(units), size * SCALE / 1.24, ink.css());
        self.0 += &format!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"{dy}\" text-anchor=\"{side}\" font-family=\"sans-serif\" font-size=\"{size}\" "
        );
        self.0 += &format!("fill=\"{ink}\"{weight}>\n{}\n</text>\n", escaped(words));
    }
}

fn seen(opacity: f64) -> String {
    let opacity = (opacity * 1000.0).round() / 1000.0;
    if opacity == 1.0 { String::new() } else { format!(" opacity=\"{opacity}\"") }
}

fn escaped(words: &str) -> String {
    let words = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    words.replace('"', "&quot;").replace('\'', "&apos;")
}

fn draw(picture: &Picture) -> String {
    // The events' names stand over the first panel, in rows that must be known before anything is placed.
    let rows = match layout::places(picture, 0).0.first() {
        Some(first) => layout::event_rows(&picture.events, |x| to_px(first, x)),
        None => Vec::new(),
    };
    let (places, height) = layout::places(picture, rows.iter().map(|row| row + 1).max().unwrap_or(0));
    let name = picture.description.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    let size = format!("{} {}", units(f64::from(picture.width_px)), units(height));
    let mut canvas = Canvas(format!(
        "<svg role=\"img\" aria-label=\"{name}\" stroke-linejoin=\"round\" viewBox=\"0 0 {size}\" xmlns=\"http://www.w3.org/2000/svg\">\n"
    ));
    for (panel, place) in picture.panels.iter().zip(&places) {
        draw_panel(&mut canvas, picture, panel, place);
    }
    if let Some(first) = places.first() {
        for (event, row) in picture.events.iter().zip(rows) {
            let y = first.plot[1] - ROW_PX * (row as f64 + 0.5);
            let (x, width) = (to_px(first, event.x), words_px(&event.label, LABEL_SIZE));
            let beyond = x + width > first.plot[2] + 16.0;
            let (x, side) = if beyond { (x - 4.0, RIGHT) } else { (x + 4.0, LEFT) };
            canvas.write(&event.label, [x, y], LABEL_SIZE, event.ink, side);
        }
    }
    canvas.0 + "</svg>\n"
}

fn draw_panel(canvas: &mut Canvas, picture: &Picture, panel: &Panel, place: &PanelPlace) {
    let [left, top, right, bottom] = place.plot;
    for span in &picture.spans {
        if let Some((from, to)) = clip_segment([span.x[0], 0.0], [span.x[1], 0.0], place.x, [0.0, 0.0]) {
            canvas.rectangle([at(place, [from[0], place.y[0]]), at(place, [to[0], place.y[1]])], (span.ink, 0.10));
        }
    }
    let line = |canvas: &mut Canvas, ends: [[f64; 2]; 2], ink: (Ink, f64), width: i32| {
        canvas.path(&ends.map(|end| at(place, end)), ink, width, 0);
    };
    for (value, label) in ticks(&panel.y, place.y, bottom - top, 34.0) {
        if panel.y.categories.is_empty() {
            line(canvas, [[place.x[0], value], [place.x[1], value]], (Ink::Grid, 1.0), 8);
        }
        let lines = label_lines(&label, right + RIGHT_PX - place.from);
        for (line, words) in lines.iter().enumerate() {
            let below = LINE_PX * (line as f64 - 0.5 * (lines.len() - 1) as f64);
            let at = [left - 7.0, to_py(place, value) + below];
            canvas.write(words, at, LABEL_SIZE, Ink::Muted, RIGHT);
        }
    }
    let rows = label_rows(&panel.x, right - left);
    let ticks_x = ticks(&panel.x, place.x, right - left, 84.0);
    for (k, (value, label)) in ticks_x.into_iter().filter(|(_, label)| !label.is_empty()).enumerate() {
        if panel.x.categories.is_empty() {
            line(canvas, [[value, place.y[0]], [value, place.y[1]]], (Ink::Grid, 1.0), 8);
        }
        if place.labels_x {
            let at = [to_px(place, value), bottom + 6.0 + TICKS_PX * (k % rows) as f64];
            canvas.write(&label, at, LABEL_SIZE, Ink::Muted, TOP);
        }
    }
    for mark in &panel.marks {
        draw_mark(canvas, mark, place);
    }
    for event in picture.events.iter().filter(|event| event.x >= place.x[0] && event.x <= place.x[1]) {
        line(canvas, [[event.x, place.y[0]], [event.x, place.y[1]]], (event.ink, 0.9), 9);
    }
    if place.labels_x && !panel.x.name.is_empty() {
        let at = [right, bottom + 4.0 + TICKS_PX * rows as f64];
        canvas.write(&panel.x.name, at, LABEL_SIZE, Ink::Muted, TOP_RIGHT);
    }
    draw_title_and_legend(canvas, panel, place);
}

fn draw_title_and_legend(canvas: &mut Canvas, panel: &Panel, place: &PanelPlace) {
    let middle = place.top + 0.5 * TITLE_PX;
    // A title that is longer than its plot begins left of it.
    let fits = (place.plot[2] - words_px(&panel.title, TITLE_SIZE)).min(place.left);
    let at = [fits.max(place.from), middle];
    canvas.write_as(&panel.title, at, TITLE_SIZE, Ink::Text, LEFT, " font-weight=\"bold\"");
    let named = || panel.marks.iter().filter(|mark| !mark.label.is_empty());
    let total: f64 = named().map(|mark| legend_px(&mark.label)).sum();
    let (start, mut y) = match place.legend_rows {
        0 => (place.plot[2] - total + 10.0, middle),
        _ => (place.left, middle + ROW_PX + 2.0),
    };
    let mut x = start;
    for mark in named() {
        let width = legend_px(&mark.label);
        if x > start && x + width > place.plot[2] + 12.0 {
            (x, y) = (start, y + ROW_PX);
        }
        let corner = |right_px: f64, down_px: f64| [units(x + right_px), units(y + down_px)];
        match mark.shape {
            MarkShape::Line(_) | MarkShape::Segments(_) => {
                canvas.path(
                    &[corner(0.0, 0.0), corner(18.0, 0.0)],
                    (mark.ink, mark.opacity),
                    units(mark.width_px),
                    mark.dash,
                );
            }
            MarkShape::Dots(_) => {
                let radius_px = mark.width_px.clamp(3.0, 5.5);
                canvas.dot(corner(9.0, 0.0), radius_px, (mark.ink, mark.opacity), mark.dash > 0);
            }
            MarkShape::Band(_)
            | MarkShape::Blocks(_)
            | MarkShape::Words(_)
            | MarkShape::Above(_)
            | MarkShape::Cells { .. } => {
                canvas.rectangle([corner(0.0, -5.0), corner(18.0, 5.0)], (mark.ink, mark.opacity));
            }
        }
        canvas.write(&mark.label, [x + 23.0, y], LEGEND_SIZE, Ink::Text, LEFT);
        x += width;
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a plot is a few thousand pixels wide")]
fn draw_mark(canvas: &mut Canvas, mark: &Mark, place: &PanelPlace) {
    let (x, y) = (place.x, place.y);
    let ink = (mark.ink, mark.opacity);
    let bins = (place.plot[2] - place.plot[0]).max(1.0) as usize;
    match &mark.shape {
        MarkShape::Line(points) => {
            for run in runs(points) {
                if let [only] = run {
                    canvas.dot(at(place, *only), 0.7 * mark.width_px, ink, false);
                }
                for part in clip(&thin(run, x, bins), x, y) {
                    let part: Vec<_> = part.into_iter().map(|point| at(place, point)).collect();
                    canvas.path(&part, ink, units(mark.width_px), mark.dash);
                }
            }
        }
        MarkShape::Band(points) => {
            // Each edge keeps its own extremes, so a thinned band is never narrower than the whole one.
            let edge = |side: usize| {
                let line: Vec<_> = points.iter().map(|p| [p[0], p[side]]).filter(|p| p[1].is_finite()).collect();
                let inside = |p: [f64; 2]| at(place, [p[0].clamp(x[0], x[1]), p[1].clamp(y[0], y[1])]);
                thin(&line, x, bins).into_iter().map(inside).collect::<Vec<_>>()
            };
            let (low, high) = (edge(1), edge(2));
            let points = low.into_iter().chain(high.into_iter().rev()).map(|[x, y]| format!("{x},{y}"));
            let points: Vec<String> = points.collect();
            let (seen, ink) = (seen(mark.opacity), mark.ink.css());
            canvas.0 += &format!("<polygon{seen} fill=\"{ink}\" points=\"{}\"/>\n", points.join(" "));
        }
        MarkShape::Blocks(blocks) => {
            for &[x0, x1, y0, y1] in blocks {
                let inside = |a: f64, b: f64| at(place, [a.clamp(x[0], x[1]), b.clamp(y[0], y[1])]);
                canvas.rectangle([inside(x0, y1), inside(x1, y0)], ink);
            }
        }
        MarkShape::Segments(segments) => {
            for &[x0, y0, x1, y1] in segments {
                let reach =
                    |value: f64, [low, high]: [f64; 2]| if value.is_finite() { value } else { value.clamp(low, high) };
                let ends = clip_segment([reach(x0, x), reach(y0, y)], [reach(x1, x), reach(y1, y)], x, y);
                if let Some((a, b)) = ends {
                    canvas.path(&[at(place, a), at(place, b)], ink, units(mark.width_px), mark.dash);
                }
            }
        }
        MarkShape::Dots(dots) => {
            for dot in dots.iter().filter(|d| d[0] >= x[0] && d[0] <= x[1] && d[1] >= y[0] && d[1] <= y[1]) {
                canvas.dot(at(place, *dot), mark.width_px, ink, mark.dash > 0);
            }
        }
        MarkShape::Words(words) => {
            for (at, text) in words {
                let at = [to_px(place, at[0]) + 5.0, to_py(place, at[1])];
                canvas.write(text, at, LABEL_SIZE, mark.ink, LEFT);
            }
        }
        MarkShape::Above(words) => {
            for (at, text) in words {
                let at = [to_px(place, at[0]), to_py(place, at[1].clamp(y[0], y[1])) - 1.0];
                canvas.write(text, at, LABEL_SIZE, mark.ink, BOTTOM);
            }
        }
        MarkShape::Cells { rows, full, below, decimals } => {
            draw_cells(canvas, place, mark, (rows, *full, *below, *decimals));
        }
    }
}

fn draw_cells(
    canvas: &mut Canvas,
    place: &PanelPlace,
    mark: &Mark,
    (rows, full, below, decimals): (&[Vec<f64>], f64, Ink, usize),
) {
    for (row, values) in rows.iter().enumerate() {
        for (column, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let (x, y) = (column as f64, row as f64);
            let strength = (value.abs() / full).clamp(0.0, 1.0);
            let ink = (if value < 0.0 { below } else { mark.ink }, 0.06 + 0.9 * strength);
            canvas.rectangle([at(place, [x - 0.49, y + 0.48]), at(place, [x + 0.49, y - 0.48])], ink);
            let words = if strength > 0.55 { Ink::Paper } else { Ink::Text };
            let at = [to_px(place, x), to_py(place, y)];
            canvas.write(&fixed(value, decimals), at, LABEL_SIZE, words, CENTER);
        }
    }
}

fn to_px(place: &PanelPlace, x: f64) -> f64 {
    place.plot[0] + (x - place.x[0]) / (place.x[1] - place.x[0]) * (place.plot[2] - place.plot[0])
}

fn to_py(place: &PanelPlace, y: f64) -> f64 {
    place.plot[3] - (y - place.y[0]) / (place.y[1] - place.y[0]) * (place.plot[3] - place.plot[1])
}

/// The library's whole units of a length in px.
#[expect(clippy::cast_possible_truncation, reason = "a float-to-integer cast saturates")]
fn units(length_px: f64) -> i32 {
    (length_px * SCALE).round() as i32
}

/// Where a point of a panel is, units; what a rounding error keeps from the next unit is on it.
#[expect(clippy::cast_possible_truncation, reason = "a float-to-integer cast saturates")]
fn at(place: &PanelPlace, [x, y]: [f64; 2]) -> [i32; 2] {
    let [left, top, right, bottom] = place.plot.map(units);
    let across = f64::from(right - left) * ((x - place.x[0]) / (place.x[1] - place.x[0]));
    let up = f64::from(top - bottom) * ((y - place.y[0]) / (place.y[1] - place.y[0]));
    [left + (across + 1e-3).floor() as i32, bottom + (up - 1e-3).ceil() as i32]
}

#[cfg(test)]
mod tests {
    use super::{Canvas, Ink, LEFT};

    #[test]
    fn a_line_goes_from_point_to_point_and_may_be_dashed() {
        let mut canvas = Canvas(String::new());
        canvas.path(&[[10, 20], [13, 16], [13, 30]], (Ink::Text, 1.0), 11, 2);
        let expected = "stroke-width=\"11\" stroke-dasharray=\"16 24\" d=\"m10,20l3,-4 0,14\"/>\n";
        assert!(canvas.0.ends_with(expected), "{}", canvas.0);
        canvas.write("a < \"b\" & c", [1.0, 2.0], 10.0, Ink::Text, LEFT);
        assert!(canvas.0.ends_with(">\na &lt; &quot;b&quot; &amp; c\n</text>\n"), "{}", canvas.0);
    }
}
