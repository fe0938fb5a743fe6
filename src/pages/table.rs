//! Tables of words and numbers, for a terminal and for a page alike.

/// A column of words is not made narrower than this, characters.
const LEAST_WORDS: usize = 12;

/// A table: named columns, rows of ready-made cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<TableRow>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Column {
    pub(super) group: String,
    pub(super) name: String,
    pub(super) numbers: bool,
}

impl Column {
    /// Its name with that of its group.
    pub(super) fn label(&self) -> String {
        if self.group.is_empty() { self.name.clone() } else { format!("{} {}", self.group, self.name) }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TableRow {
    pub(super) cells: Vec<String>,
    pub(super) strong: bool,
    /// Where the first cell leads on a page.
    pub(super) link: Option<String>,
}

impl Table {
    /// A table without columns.
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

    /// Adds a row whose first cell leads to a page beside this one.
    pub(crate) fn linked_row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>, link: impl Into<String>) {
        self.row(cells);
        if let Some(row) = self.rows.last_mut() {
            row.link = Some(link.into());
        }
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
        self.rows.push(TableRow { cells, strong, link: None });
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

    pub(super) fn rows(&self) -> &[TableRow] {
        &self.rows
    }

    /// The table in plain characters, a rule under the head and above the rows that stand out.
    pub(crate) fn to_text(&self) -> String {
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

    /// The table in no more columns of characters than a terminal has: cells of words are broken over lines, and where that is not enough
    /// every row becomes a block with a line for each of its cells.
    pub fn to_text_within(&self, width: usize) -> String {
        let text = self.to_text();
        if text.lines().all(|line| length(line) <= width) {
            return text;
        }
        self.folded(width)
            .filter(|text| text.lines().all(|line| length(line) <= width))
            .unwrap_or_else(|| self.blocks(width))
    }

    /// The table with cells of words broken over several lines, where that brings it within a width.
    fn folded(&self, width: usize) -> Option<String> {
        let mut widths = self.widths();
        let spaces = 2 * widths.len().saturating_sub(1);
        let mut over = (widths.iter().sum::<usize>() + spaces).checked_sub(width)?;
        while over > 0 {
            // The widest column of words gives way first.
            let wide = (0..widths.len()).filter(|&i| !self.columns[i].numbers && widths[i] > LEAST_WORDS);
            let widest = wide.max_by_key(|&i| widths[i])?;
            widths[widest] -= 1;
            over -= 1;
        }
        let mut folded = Self { columns: self.columns.clone(), rows: vec![] };
        for row in &self.rows {
            let cells: Vec<Vec<String>> =
                row.cells.iter().zip(&widths).map(|(cell, room)| wrapped(cell, *room)).collect();
            let lines = cells.iter().map(Vec::len).max().unwrap_or(1);
            for line in 0..lines {
                let cells = cells.iter().map(|cell| cell.get(line).cloned().unwrap_or_default()).collect();
                folded.rows.push(TableRow { cells, strong: row.strong, link: row.link.clone() });
            }
        }
        for (column, room) in folded.columns.iter_mut().zip(&widths) {
            if !column.numbers && length(&column.name) > *room {
                column.name = column.name.chars().take(*room).collect();
            }
        }
        Some(folded.to_text())
    }

    /// Every row as a block: its first cell, and below it a line for each other cell that holds anything.
    fn blocks(&self, width: usize) -> String {
        let names: Vec<String> = self.columns.iter().map(Column::label).collect();
        let room = names.iter().skip(1).map(|name| length(name)).max().unwrap_or(0);
        let mut text = String::new();
        for row in &self.rows {
            let mut cells = row.cells.iter();
            text += &format!("{}\n", cells.next().map_or("", String::as_str));
            for (name, cell) in names.iter().skip(1).zip(cells).filter(|(_, cell)| !cell.is_empty()) {
                let gap = " ".repeat(room.saturating_sub(length(name)));
                for (i, line) in wrapped(cell, width.saturating_sub(room + 4).max(LEAST_WORDS)).iter().enumerate() {
                    let head = if i == 0 { format!("{name}{gap}") } else { " ".repeat(room) };
                    text += &format!("  {head}  {line}\n");
                }
            }
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

/// Text in lines of at most so many characters, broken at spaces; a longer word has a line of its own.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if length(line) + 1 + length(word) <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn length(text: &str) -> usize {
    text.chars().count()
}

#[cfg(test)]
mod tests {
    use super::Table;

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
    fn a_table_keeps_within_a_terminal() {
        let mut table = Table::new().words("test").numbers("bits").words("how to run it");
        table.row(["a step", "0.25", "Unit at standstill, isolated; record everything there is"]);
        assert_eq!(table.to_text_within(200), table.to_text());
        for width in [60, 40, 30] {
            let text = table.to_text_within(width);
            assert!(text.lines().all(|line| line.chars().count() <= width), "{width}: {text}");
            let words: Vec<&str> = text.split_whitespace().collect();
            for word in ["step", "0.25", "standstill,", "everything"] {
                assert!(words.contains(&word), "{width}: {word}: {text}");
            }
        }
        let mut figures = Table::new().words("process").numbers_of("spool", "MAE").numbers_of("spool", "RMSE");
        figures.row(["start-up", "0.00123456789", "0.00234567890"]);
        assert_eq!(figures.to_text_within(30), "start-up\n  spool MAE   0.00123456789\n  spool RMSE  0.00234567890\n");
    }
}
