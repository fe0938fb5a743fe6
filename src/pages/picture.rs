//! A picture as data: panels in a grid, marks in a panel, events across panels.

use super::ink::Ink;

/// One axis of a panel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// What it counts, with its unit, such as `time, s`; empty draws no name.
    pub name: String,
    /// First and last value; taken from the marks where not given.
    pub range: Option<[f64; 2]>,
    /// Names for the values 0, 1, 2 …; where given, they stand in place of numbers.
    pub categories: Vec<String>,
    /// Values are decimal logarithms, and the labels name what they are of.
    pub decades: bool,
}

/// The shape of a mark.
#[derive(Clone, Debug, PartialEq)]
pub enum MarkShape {
    /// A polyline through x and y; a NaN breaks it. x must not fall.
    Line(Vec<[f64; 2]>),
    /// The area between low and high over x, as x, low, high.
    Band(Vec<[f64; 3]>),
    /// Filled rectangles, as x from, x to, y from, y to.
    Blocks(Vec<[f64; 4]>),
    /// Straight segments, as x, y, x, y: whiskers, rules, reference lines.
    Segments(Vec<[f64; 4]>),
    /// Dots at x and y.
    Dots(Vec<[f64; 2]>),
    /// Words beside x, y.
    Words(Vec<([f64; 2], String)>),
    /// Words above x, y.
    Above(Vec<([f64; 2], String)>),
    /// A heat map: rows from the bottom up, on whole coordinates; strength is |value| / full, its
    /// ink for values above zero and the second ink for those below. Cells show their value.
    Cells {
        /// Rows of values; NaN leaves a cell empty.
        rows: Vec<Vec<f64>>,
        /// The absolute value at full strength.
        full: f64,
        /// Ink for values below zero.
        below: Ink,
        /// Digits after the point.
        decimals: usize,
    },
}

/// Something drawn in a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Its shape, in data coordinates.
    pub shape: MarkShape,
    /// Its meaning.
    pub ink: Ink,
    /// Its name in the legend; empty keeps it out.
    pub label: String,
    /// Line width or dot size, px.
    pub width_px: f64,
    /// 0 clear to 1 solid.
    pub opacity: f64,
    /// What distinguishes it without its colour: 0 solid; from 1 on a pattern of dashes, and hollow dots.
    pub dash: u8,
}

impl Mark {
    /// A mark with the usual width and opacity of its shape.
    pub fn new(shape: MarkShape, ink: Ink, label: impl Into<String>) -> Self {
        let (width_px, opacity) = match shape {
            MarkShape::Band(_) => (0.0, 0.22),
            MarkShape::Blocks(_) => (0.0, 0.85),
            MarkShape::Segments(_) => (1.2, 1.0),
            MarkShape::Dots(_) => (2.5, 0.8),
            MarkShape::Line(_) | MarkShape::Words(_) | MarkShape::Above(_) | MarkShape::Cells { .. } => (1.4, 1.0),
        };
        Self { shape, ink, label: label.into(), width_px, opacity, dash: 0 }
    }

    /// The same in a pattern of dashes, or with hollow dots.
    #[must_use]
    pub fn dashed(self, pattern: u8) -> Self {
        Self { dash: pattern, ..self }
    }
}

/// One coordinate system with its marks, drawn in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// What it shows, with its unit, such as `Spool position, pu`.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Height of the plot without title and labels, px.
    pub height_px: u32,
    /// What is drawn, the first undermost.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel of the usual height.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), x: Axis::default(), y: Axis::default(), height_px: 150, marks: Vec::new() }
    }

    /// Sets the plot's height.
    #[must_use]
    pub fn height(mut self, height_px: u32) -> Self {
        self.height_px = height_px;
        self
    }

    /// Names the horizontal axis.
    #[must_use]
    pub fn x_name(mut self, name: impl Into<String>) -> Self {
        self.x.name = name.into();
        self
    }

    /// Takes horizontal values for decimal logarithms: the labels name what they are of.
    pub(crate) fn x_decades(mut self) -> Self {
        self.x.decades = true;
        self
    }

    /// Fixes the horizontal range; what lies outside is cut off.
    #[must_use]
    pub fn x_range(mut self, from: f64, to: f64) -> Self {
        self.x.range = Some([from, to]);
        self
    }

    /// Fixes the vertical range; what lies outside is cut off.
    #[must_use]
    pub fn y_range(mut self, from: f64, to: f64) -> Self {
        self.y.range = Some([from, to]);
        self
    }

    /// Gives the horizontal axis names in place of numbers.
    #[must_use]
    pub fn x_categories(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.x.categories = names.into_iter().map(Into::into).collect();
        self
    }

    /// Gives the vertical axis names in place of numbers, from the bottom up.
    #[must_use]
    pub fn y_categories(mut self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.y.categories = names.into_iter().map(Into::into).collect();
        self
    }

    /// Adds a mark.
    #[must_use]
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// Adds a line of the usual width.
    #[must_use]
    pub fn line(self, ink: Ink, label: &str, points: Vec<[f64; 2]>) -> Self {
        self.mark(Mark::new(MarkShape::Line(points), ink, label))
    }

    /// Adds a line of dashes, distinct from a solid one without its colour.
    pub(crate) fn dashed_line(self, ink: Ink, label: &str, points: Vec<[f64; 2]>) -> Self {
        self.mark(Mark::new(MarkShape::Line(points), ink, label).dashed(1))
    }

    /// Adds what was measured as a thick line, the reference of a thinner one that is drawn later.
    #[must_use]
    pub fn thick_line(self, label: &str, points: Vec<[f64; 2]>) -> Self {
        self.mark(Mark { width_px: 4.0, opacity: 0.75, ..Mark::new(MarkShape::Line(points), Ink::Measured, label) })
    }

    /// Adds an area between two curves, given as x, low, high.
    #[must_use]
    pub fn band(self, ink: Ink, label: &str, points: Vec<[f64; 3]>) -> Self {
        self.mark(Mark::new(MarkShape::Band(points), ink, label))
    }

    /// Adds dots.
    #[must_use]
    pub fn dots(self, ink: Ink, label: &str, points: Vec<[f64; 2]>) -> Self {
        self.mark(Mark::new(MarkShape::Dots(points), ink, label))
    }

    /// Adds the bars of one of `of` series side by side: bar `i` is at category `i`. Of several each has its number, in the legend and above
    /// its bars, so that they are distinct without colours.
    #[must_use]
    pub fn bars(self, ink: Ink, label: &str, values: &[f64], series: usize, of: usize) -> Self {
        let slot = 0.8 / of.max(1) as f64;
        let blocks = values.iter().enumerate().map(|(i, &value)| {
            let left = i as f64 - 0.4 + slot * series as f64;
            [left + 0.04 * slot, left + 0.96 * slot, 0.0, value]
        });
        let bars = MarkShape::Blocks(blocks.collect());
        if of < 2 {
            return self.mark(Mark::new(bars, ink, label));
        }
        let number = (series + 1).to_string();
        let middle = |i: usize| i as f64 - 0.4 + slot * (series as f64 + 0.5);
        let standing = values.iter().enumerate().filter(|(_, value)| value.is_finite());
        let above = standing.map(|(i, &value)| ([middle(i), value.max(0.0)], number.clone()));
        let above = MarkShape::Above(above.collect());
        self.mark(Mark::new(bars, ink, format!("{number} {label}"))).mark(Mark::new(above, Ink::Muted, ""))
    }

    /// Adds lying bars from zero: bar `i` lies at category `i` of the vertical axis.
    #[must_use]
    pub fn lying_bars(self, ink: Ink, label: &str, values: &[f64]) -> Self {
        let blocks = values.iter().enumerate().map(|(i, &value)| [0.0, value, i as f64 - 0.36, i as f64 + 0.36]);
        self.mark(Mark::new(MarkShape::Blocks(blocks.collect()), ink, label))
    }

    /// Adds a histogram: share of the finite values per bin, the outer bins taking what lies beyond.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the bins before the cast")]
    pub fn histogram(self, ink: Ink, values: &[f64], [from, to]: [f64; 2], bins: usize) -> Self {
        let width = (to - from) / bins.max(1) as f64;
        let mut counts = vec![0_u64; bins.max(1)];
        let mut total = 0_u64;
        for value in values.iter().filter(|value| value.is_finite()) {
            let bin = ((value - from) / width).floor().clamp(0.0, (counts.len() - 1) as f64) as usize;
            counts[bin] += 1;
            total += 1;
        }
        let blocks = counts.iter().enumerate().filter(|(_, count)| **count > 0).map(|(bin, &count)| {
            let left = from + width * bin as f64;
            [left, left + width, 0.0, count as f64 / total as f64]
        });
        self.mark(Mark::new(MarkShape::Blocks(blocks.collect()), ink, ""))
    }

    /// Adds a level across the panel's own data, such as zero.
    pub(crate) fn level(self, ink: Ink, label: &str, y: f64) -> Self {
        self.mark(Mark::new(MarkShape::Segments(vec![[f64::NEG_INFINITY, y, f64::INFINITY, y]]), ink, label))
    }
}

/// Something that happened at one instant; a line through every panel.
#[derive(Clone, Debug, PartialEq)]
pub struct EventLine {
    /// Where on the shared horizontal axis.
    pub x: f64,
    /// Its name, written at the top.
    pub label: String,
    /// Its colour.
    pub ink: Ink,
}

/// A stretch of the shared horizontal axis, tinted in every panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// From where to where.
    pub x: [f64; 2],
    /// Its colour.
    pub ink: Ink,
}

/// Panels in a grid, filled row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// A sentence on its contents, for readers who cannot see it.
    pub description: String,
    /// Width, px; the page scales it to fit.
    pub width_px: u32,
    /// Panels side by side.
    pub columns: u32,
    /// All panels have one horizontal range, and only the lowest name it.
    pub shared_x: bool,
    /// The panels.
    pub panels: Vec<Panel>,
    /// Instants marked in every panel.
    pub events: Vec<EventLine>,
    /// Stretches tinted in every panel.
    pub spans: Vec<Span>,
}

impl Picture {
    /// Panels below each other with one horizontal axis: signals over time.
    pub fn stacked(description: impl Into<String>, panels: Vec<Panel>) -> Self {
        Self { shared_x: true, ..Self::grid(description, 1, panels) }
    }

    /// Panels in a grid, each with its own axes.
    pub fn grid(description: impl Into<String>, columns: u32, panels: Vec<Panel>) -> Self {
        Self {
            description: description.into(),
            width_px: 960,
            columns: columns.max(1),
            shared_x: false,
            panels,
            events: Vec::new(),
            spans: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{MarkShape, Panel};
    use crate::ink::Ink;

    /// Bars side by side are distinct without their colours.
    #[test]
    fn bars_of_several_series_have_their_numbers() {
        let alone = Panel::new("a").bars(Ink::Simulated, "one", &[1.0], 0, 1);
        assert!(alone.marks.len() == 1 && alone.marks[0].label == "one");
        let second = Panel::new("a").bars(Ink::Simulated, "other", &[1.0, f64::NAN], 1, 2);
        assert_eq!(second.marks[0].label, "2 other");
        let MarkShape::Above(words) = &second.marks[1].shape else { panic!("{:?}", second.marks[1]) };
        assert!(words.len() == 1 && words[0].1 == "2" && (words[0].0[0] - 0.2).abs() < 1e-9, "{words:?}");
    }
}
