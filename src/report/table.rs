//! Tables of words and numbers, for a terminal and for a page alike.

/// A table: named columns, rows of ready-made cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Row>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) numbers: bool,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    pub(super) cells: Vec<String>,
    pub(super) strong: bool,
}

impl Table {
    /// A table without columns.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a column of words, set to the left.
    #[must_use]
    pub fn words(mut self, name: impl Into<String>) -> Self {
        self.columns.push(Column { group: String::new(), name: name.into(), numbers: false });
        self
    }

    /// Adds a column of numbers, set to the right.
    #[must_use]
    pub fn numbers(self, name: impl Into<String>) -> Self {
        self.numbers_of("", name)
    }

    /// Adds a column of numbers below a head that neighbours of the same group share.
    #[must_use]
    pub fn numbers_of(mut self, group: impl Into<String>, name: impl Into<String>) -> Self {
        self.columns.push(Column { group: group.into(), name: name.into(), numbers: true });
        self
    }

    /// Adds a row; cells beyond the columns are dropped, missing ones stay empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.push(cells.into_iter().map(Into::into).collect(), false);
    }

    /// Adds a row that stands out, such as a total.
    pub fn strong_row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.push(cells.into_iter().map(Into::into).collect(), true);
    }

    fn push(&mut self, mut cells: Vec<String>, strong: bool) {
        cells.resize(self.columns.len(), String::new());
        for cell in cells.iter_mut().filter(|cell| cell.contains(char::is_control)) {
            // A cell with a line break would pass for a row.
            *cell = cell.replace('\n', "\\u000a").replace('\t', "\\u0009");
        }
        self.rows.push(Row { cells, strong });
    }

    /// The heads above the columns, each with the columns below it; none where no column has a group.
    pub(super) fn groups(&self) -> Vec<(&str, usize)> {
        if self.columns.iter().all(|column| column.group.is_empty()) {
            return Vec::new();
        }
        self.columns.chunk_by(|a, b| a.group == b.group).map(|of| (of[0].group.as_str(), of.len())).collect()
    }

    pub(super) fn columns(&self) -> &[Column] {
        &self.columns
    }

    pub(super) fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The table in plain characters, a rule under the head and above the rows that stand out.
    #[must_use]
    pub fn to_text(&self) -> String {
        let widths = self.widths();
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            let mut text = String::new();
            for (i, cell) in cells.enumerate() {
                let gap = " ".repeat(widths[i].saturating_sub(length(cell)));
                let (before, after) = if self.columns[i].numbers { (gap.as_str(), "") } else { ("", gap.as_str()) };
                text += &format!("{}{before}{cell}{after}", if i == 0 { "" } else { "  " });
            }
            text.truncate(text.trim_end().len());
            text + "\n"
        };
        let rule = "─".repeat(widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1)) + "\n";
        let mut text = self.group_line(&widths);
        text += &line(&mut self.columns.iter().map(|column| column.name.as_str()));
        text += &rule;
        let mut strong = true;
        for row in &self.rows {
            if row.strong && !strong {
                text += &rule;
            }
            strong = row.strong;
            text += &line(&mut row.cells.iter().map(String::as_str));
        }
        text
    }

    /// The widest cell of each column, the first of a group making room for the group's head.
    fn widths(&self) -> Vec<usize> {
        let mut widths: Vec<usize> = (0..self.columns.len())
            .map(|i| {
                let cells = self.rows.iter().map(|row| length(&row.cells[i]));
                cells.fold(length(&self.columns[i].name), usize::max)
            })
            .collect();
        let mut start = 0;
        for (group, columns) in self.groups() {
            let room = widths[start..start + columns].iter().sum::<usize>() + 2 * (columns - 1);
            widths[start] += (length(group) + 1).saturating_sub(room);
            start += columns;
        }
        widths
    }

    fn group_line(&self, widths: &[usize]) -> String {
        let (mut text, mut start) = (String::new(), 0);
        for (group, columns) in self.groups() {
            let room = widths[start..start + columns].iter().sum::<usize>() + 2 * (columns - 1);
            let gap = if start == 0 { "" } else { "  " };
            let head = if group.is_empty() { String::new() } else { format!("{group} ") };
            let fill = if group.is_empty() { " " } else { "╌" };
            text += &format!("{gap}{head}{}", fill.repeat(room - length(&head)));
            start += columns;
        }
        if text.is_empty() { text } else { text + "\n" }
    }
}

fn length(text: &str) -> usize {
    text.chars().count()
}

/// A value with a number of significant digits, without an exponent for everyday sizes; a dash for NaN.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
pub fn significant(value: f64, digits: u32) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let sign = if value < 0.0 { "\u{2212}" } else { "" };
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let magnitude = size.log10().floor();
    if !(-6.0..9.0).contains(&magnitude) {
        return format!("{sign}{size:.*e}", digits.saturating_sub(1) as usize);
    }
    let decimals = (f64::from(digits) - 1.0 - magnitude).clamp(0.0, 12.0) as usize;
    format!("{sign}{size:.decimals$}")
}

/// A value with a fixed number of digits after the point and a true minus sign; a dash for NaN.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let text = format!("{:.decimals$}", value.abs());
    // What rounds to zero has no sign.
    let zero = text.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    if value < 0.0 && !zero { format!("\u{2212}{text}") } else { text }
}

#[cfg(test)]
mod tests {
    use super::{Table, fixed, significant};

    #[test]
    fn columns_line_up() {
        let mut table = Table::new().words("process").numbers("MAE, pu");
        table.row(["start-up", "0.00123"]);
        table.strong_row(["overall", "12"]);
        let expected =
            "process   MAE, pu\n─────────────────\nstart-up  0.00123\n─────────────────\noverall        12\n";
        assert_eq!(table.to_text(), expected);
    }

    #[test]
    fn columns_of_a_group_share_a_head() {
        let mut table = Table::new().words("p").numbers_of("spool", "MAE").numbers_of("spool", "R²");
        table.row(["a", "0.5", "0.9"]);
        assert_eq!(table.to_text(), "   spool ╌╌\np  MAE   R²\n───────────\na  0.5  0.9\n");
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(significant(0.000_123_456, 3), "0.000123");
        assert_eq!(significant(-12.3456, 3), "\u{2212}12.3");
        assert_eq!(significant(6_300_000.0, 3), "6300000");
        assert_eq!(significant(2.0e-13, 2), "2.0e-13");
        assert_eq!(significant(f64::NAN, 3), "–");
        assert_eq!(fixed(-0.123_45, 3), "\u{2212}0.123");
        assert_eq!(fixed(-0.000_4, 3), "0.000");
    }
}
