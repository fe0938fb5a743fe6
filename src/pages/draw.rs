//! From a picture to SVG: the only file that knows the plotting library.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Polygon, Rectangle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontDesc, FontFamily, FontStyle, RGBAColor, RGBColor, ShapeStyle};

use super::dress::{DASH, dressed};
use super::ink::Ink;
use super::layout::{
    self, LABEL_SIZE, LEGEND_SIZE, PanelPlace, RIGHT_PX, ROW_PX, TICKS_PX, TITLE_PX, TITLE_SIZE, label_lines,
    label_rows, legend_px, words_px,
};
use super::picture::{Mark, MarkShape, Panel, Picture};
use super::thin::{clip, clip_segment, runs, thin};
use super::ticks::ticks;
use govtwin_model::number::fixed;

/// The plotting library places things on whole units; this many of them to a pixel keep curves smooth.
const SCALE: f64 = 8.0;

/// From one line of a label to the next, px.
const LINE_PX: f64 = 14.0;

/// A picture that could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the picture \"{picture}\": {reason}")]
pub struct DrawError {
    picture: String,
    reason: String,
}

/// A drawn picture: an SVG element that scales with its page and takes the page's inks, and the same picture for a narrow screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Svg {
    wide: String,
    narrow: String,
}

impl Svg {
    /// The element as text, which is also valid as a file of its own.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.wide
    }

    /// The same picture for a screen as wide as a phone: one panel below the other, with words of the size that is read there.
    #[must_use]
    pub fn narrow(&self) -> &str {
        &self.narrow
    }
}

type Failure = DrawingAreaErrorKind<std::io::Error>;
type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plot<'a> = DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws a picture.
///
/// # Errors
/// The plotting library's own; none is known for a picture drawn into memory.
pub fn svg(picture: &Picture) -> Result<Svg, DrawError> {
    let drawn = |picture: &Picture| {
        let failed = |error: Failure| DrawError { picture: picture.description.clone(), reason: error.to_string() };
        draw(picture).map(|text| dressed(&text, picture)).map_err(failed)
    };
    Ok(Svg { wide: drawn(picture)?, narrow: drawn(&picture.narrow())? })
}

fn draw(picture: &Picture) -> Result<String, Failure> {
    let rows = match layout::places(picture, 0).0.first() {
        Some(first) => layout::event_rows(&picture.events, |x| to_px(first, x)),
        None => Vec::new(),
    };
    let (places, height) = layout::places(picture, rows.iter().map(|row| row + 1).max().unwrap_or(0));
    let mut text = String::new();
    {
        let size = (units(f64::from(picture.width_px)).unsigned_abs(), units(height).unsigned_abs());
        let canvas = SVGBackend::with_string(&mut text, size).into_drawing_area();
        for (panel, place) in picture.panels.iter().zip(&places) {
            draw_panel(&canvas, picture, panel, place)?;
        }
        if let Some(first) = places.first() {
            for (event, row) in picture.events.iter().zip(rows) {
                #[expect(clippy::cast_precision_loss, reason = "a handful of rows")]
                let y = first.plot[1] - ROW_PX * (row as f64 + 0.5);
                let (x, width) = (to_px(first, event.x), words_px(&event.label, LABEL_SIZE));
                let beyond = x + width > first.plot[2] + 16.0;
                let (x, side) = if beyond { (x - 4.0, HPos::Right) } else { (x + 4.0, HPos::Left) };
                write(&canvas, &event.label, [x, y], LABEL_SIZE, event.ink, side, VPos::Center)?;
            }
        }
        canvas.present()?;
    }
    Ok(text)
}

#[expect(clippy::cast_precision_loss, reason = "a handful of lines")]
fn draw_panel(canvas: &Canvas, picture: &Picture, panel: &Panel, place: &PanelPlace) -> Result<(), Failure> {
    let [left, top, right, bottom] = place.plot;
    let plot: Plot = canvas.clone().apply_coord_spec(Cartesian2d::new(
        place.x[0]..place.x[1],
        place.y[0]..place.y[1],
        (units(left)..units(right), units(bottom)..units(top)),
    ));
    for span in &picture.spans {
        if let Some((from, to)) = clip_segment([span.x[0], 0.0], [span.x[1], 0.0], place.x, [0.0, 0.0]) {
            let tint = Rectangle::new([(from[0], place.y[0]), (to[0], place.y[1])], ink(span.ink, 0.10).filled());
            plot.draw(&tint)?;
        }
    }
    let grid = ink(Ink::Grid, 1.0).stroke_width(8);
    for (value, label) in ticks(&panel.y, place.y, bottom - top, 34.0) {
        if panel.y.categories.is_empty() {
            plot.draw(&PathElement::new([(place.x[0], value), (place.x[1], value)], grid))?;
        }
        let lines = label_lines(&label, right + RIGHT_PX - place.from);
        for (line, words) in lines.iter().enumerate() {
            let below = LINE_PX * (line as f64 - 0.5 * (lines.len() - 1) as f64);
            let at = [left - 7.0, to_py(place, value) + below];
            write(canvas, words, at, LABEL_SIZE, Ink::Muted, HPos::Right, VPos::Center)?;
        }
    }
    let rows = label_rows(&panel.x, right - left);
    let ticks_x = ticks(&panel.x, place.x, right - left, 84.0);
    for (k, (value, label)) in ticks_x.into_iter().filter(|(_, label)| !label.is_empty()).enumerate() {
        if panel.x.categories.is_empty() {
            plot.draw(&PathElement::new([(value, place.y[0]), (value, place.y[1])], grid))?;
        }
        if place.labels_x {
            let at = [to_px(place, value), bottom + 6.0 + TICKS_PX * (k % rows) as f64];
            write(canvas, &label, at, LABEL_SIZE, Ink::Muted, HPos::Center, VPos::Top)?;
        }
    }
    for mark in &panel.marks {
        draw_mark(canvas, &plot, mark, place)?;
    }
    for event in picture.events.iter().filter(|event| event.x >= place.x[0] && event.x <= place.x[1]) {
        let line = [(event.x, place.y[0]), (event.x, place.y[1])];
        plot.draw(&PathElement::new(line, ink(event.ink, 0.9).stroke_width(9)))?;
    }
    if place.labels_x && !panel.x.name.is_empty() {
        let at = [right, bottom + 4.0 + TICKS_PX * rows as f64];
        write(canvas, &panel.x.name, at, LABEL_SIZE, Ink::Muted, HPos::Right, VPos::Top)?;
    }
    draw_title_and_legend(canvas, panel, place)
}

fn draw_title_and_legend(canvas: &Canvas, panel: &Panel, place: &PanelPlace) -> Result<(), Failure> {
    let middle = place.top + 0.5 * TITLE_PX;
    // A title that is longer than its plot begins left of it.
    let fits = (place.plot[2] - words_px(&panel.title, TITLE_SIZE)).min(place.left);
    write_bold(canvas, &panel.title, [fits.max(place.from), middle])?;
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
        let (from, to) = ((units(x), units(y)), (units(x + 18.0), units(y)));
        match mark.shape {
            MarkShape::Line(_) | MarkShape::Segments(_) => {
                canvas.draw(&PathElement::new([from, to], stroke(mark)))?;
            }
            MarkShape::Dots(_) => {
                let at = (units(x + 9.0), from.1);
                let radius_px = mark.width_px.clamp(3.0, 5.5);
                canvas.draw(&Circle::new(at, units(radius_px), ink(mark.ink, mark.opacity).filled()))?;
                if mark.dash > 0 {
                    canvas.draw(&Circle::new(at, units(0.55 * radius_px), ink(Ink::Paper, 1.0).filled()))?;
                }
            }
            MarkShape::Band(_)
            | MarkShape::Blocks(_)
            | MarkShape::Words(_)
            | MarkShape::Above(_)
            | MarkShape::Cells { .. } => {
                let corners = [(from.0, units(y - 5.0)), (to.0, units(y + 5.0))];
                canvas.draw(&Rectangle::new(corners, ink(mark.ink, mark.opacity).filled()))?;
            }
        }
        write(canvas, &mark.label, [x + 23.0, y], LEGEND_SIZE, Ink::Text, HPos::Left, VPos::Center)?;
        x += width;
    }
    Ok(())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a plot is a few thousand pixels wide")]
fn draw_mark(canvas: &Canvas, plot: &Plot, mark: &Mark, place: &PanelPlace) -> Result<(), Failure> {
    let (x, y) = (place.x, place.y);
    let fill = ink(mark.ink, mark.opacity).filled();
    let bins = (place.plot[2] - place.plot[0]).max(1.0) as usize;
    match &mark.shape {
        MarkShape::Line(points) => {
            for run in runs(points) {
                if let [only] = run {
                    plot.draw(&Circle::new((only[0], only[1]), units(0.7 * mark.width_px), fill))?;
                }
                for part in clip(&thin(run, x, bins), x, y) {
                    plot.draw(&PathElement::new(part.iter().map(|p| (p[0], p[1])).collect::<Vec<_>>(), stroke(mark)))?;
                }
            }
        }
        MarkShape::Band(points) => {
            // Each edge keeps its own extremes, so a thinned band is never narrower than the whole one.
            let edge = |side: usize| {
                let line: Vec<_> = points.iter().map(|p| [p[0], p[side]]).filter(|p| p[1].is_finite()).collect();
                let inside = |p: [f64; 2]| (p[0].clamp(x[0], x[1]), p[1].clamp(y[0], y[1]));
                thin(&line, x, bins).into_iter().map(inside).collect::<Vec<_>>()
            };
            let (low, high) = (edge(1), edge(2));
            plot.draw(&Polygon::new(low.into_iter().chain(high.into_iter().rev()).collect::<Vec<_>>(), fill))?;
        }
        MarkShape::Blocks(blocks) => {
            for &[x0, x1, y0, y1] in blocks {
                let corners = [(x0, y1), (x1, y0)].map(|(a, b)| (a.clamp(x[0], x[1]), b.clamp(y[0], y[1])));
                plot.draw(&Rectangle::new(corners, fill))?;
            }
        }
        MarkShape::Segments(segments) => {
            for &[x0, y0, x1, y1] in segments {
                let reach =
                    |value: f64, [low, high]: [f64; 2]| if value.is_finite() { value } else { value.clamp(low, high) };
                let ends = clip_segment([reach(x0, x), reach(y0, y)], [reach(x1, x), reach(y1, y)], x, y);
                if let Some((a, b)) = ends {
                    plot.draw(&PathElement::new([(a[0], a[1]), (b[0], b[1])], stroke(mark)))?;
                }
            }
        }
        MarkShape::Dots(dots) => {
            for dot in dots.iter().filter(|d| d[0] >= x[0] && d[0] <= x[1] && d[1] >= y[0] && d[1] <= y[1]) {
                plot.draw(&Circle::new((dot[0], dot[1]), units(mark.width_px), fill))?;
                if mark.dash > 0 {
                    let inside = units(0.55 * mark.width_px);
                    plot.draw(&Circle::new((dot[0], dot[1]), inside, ink(Ink::Paper, 1.0).filled()))?;
                }
            }
        }
        MarkShape::Words(words) => {
            for (at, text) in words {
                let at = [to_px(place, at[0]) + 5.0, to_py(place, at[1])];
                write(canvas, text, at, LABEL_SIZE, mark.ink, HPos::Left, VPos::Center)?;
            }
        }
        MarkShape::Above(words) => {
            for (at, text) in words {
                let at = [to_px(place, at[0]), to_py(place, at[1].clamp(y[0], y[1])) - 1.0];
                write(canvas, text, at, LABEL_SIZE, mark.ink, HPos::Center, VPos::Bottom)?;
            }
        }
        MarkShape::Cells { rows, full, below, decimals } => {
            draw_cells(canvas, plot, place, mark, (rows, *full, *below, *decimals))?;
        }
    }
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "a heat map has few cells")]
fn draw_cells(
    canvas: &Canvas,
    plot: &Plot,
    place: &PanelPlace,
    mark: &Mark,
    (rows, full, below, decimals): (&[Vec<f64>], f64, Ink, usize),
) -> Result<(), Failure> {
    for (row, values) in rows.iter().enumerate() {
        for (column, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let (x, y) = (column as f64, row as f64);
            let strength = (value.abs() / full).clamp(0.0, 1.0);
            let colour = ink(if value < 0.0 { below } else { mark.ink }, 0.06 + 0.9 * strength);
            plot.draw(&Rectangle::new([(x - 0.49, y + 0.48), (x + 0.49, y - 0.48)], colour.filled()))?;
            let words = if strength > 0.55 { Ink::Paper } else { Ink::Text };
            let at = [to_px(place, x), to_py(place, y)];
            write(canvas, &fixed(value, decimals), at, LABEL_SIZE, words, HPos::Center, VPos::Center)?;
        }
    }
    Ok(())
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

fn ink(ink: Ink, opacity: f64) -> RGBAColor {
    let [red, green, blue] = ink.rgb();
    // Three digits: what a reader can see, and no more bytes than that.
    RGBColor(red, green, blue).mix((opacity * 1000.0).round() / 1000.0)
}

fn stroke(mark: &Mark) -> ShapeStyle {
    let width = units(mark.width_px).unsigned_abs() + DASH * u32::from(mark.dash);
    ink(mark.ink, mark.opacity).stroke_width(width)
}

fn write_bold(canvas: &Canvas, text: &str, [x, y]: [f64; 2]) -> Result<(), Failure> {
    let font = FontDesc::new(FontFamily::SansSerif, TITLE_SIZE * SCALE, FontStyle::Bold);
    let style = font.color(&ink(Ink::Text, 1.0)).pos(Pos::new(HPos::Left, VPos::Center));
    canvas.draw_text(text, &style, (units(x), units(y)))
}

fn write(canvas: &Canvas, text: &str, at: [f64; 2], size: f64, colour: Ink, h: HPos, v: VPos) -> Result<(), Failure> {
    if text.is_empty() {
        return Ok(());
    }
    let font = FontDesc::new(FontFamily::SansSerif, size * SCALE, FontStyle::Normal);
    let style = font.color(&ink(colour, 1.0)).pos(Pos::new(h, v));
    canvas.draw_text(text, &style, (units(at[0]), units(at[1])))
}
