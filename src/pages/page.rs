//! A self-contained HTML page made of blocks: the only file that knows the HTML library.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::draw::Svg;
use super::ink::Ink;
use super::table::Table;

/// Units that stay on the line of their number.
const UNITS: [&str; 17] =
    ["%", "s", "ms", "min", "mm", "mm²", "m", "N", "kN", "Pa", "kPa", "MPa", "GPa", "Hz", "L", "bits", "σ"];

/// How a note sounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Good to know.
    Plain,
    /// Something went well.
    Good,
    /// Read this before believing the figures.
    Warning,
}

/// One number that the reader came for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyFigure {
    /// What it is, such as `RMSE of the spool`.
    pub name: String,
    /// The value, such as `0.0041`.
    pub value: String,
    /// Its unit; empty where there is none.
    pub unit: String,
    /// One more line, such as the span over recordings.
    pub hint: String,
}

impl KeyFigure {
    /// A figure without hint.
    pub fn new(name: impl Into<String>, value: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), value: value.into(), unit: unit.into(), hint: String::new() }
    }

    /// The same with one more line.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Block {
    Answers(Vec<(String, Vec<String>)>),
    Heading(String),
    Paragraph(String),
    Text(String),
    KeyFigures(Vec<KeyFigure>),
    Figure { svg: Svg, caption: String },
    Table { table: Table, caption: String },
    Facts(Vec<(String, String)>),
    Note { tone: Tone, text: String },
    Details { summary: String, blocks: PageBody },
}

/// The contents of a page, in reading order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PageBody(Vec<Block>);

impl PageBody {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Questions with their answers, which are what the reader came for; the first paragraph of the first answer is set large.
    pub fn answers(&mut self, answers: impl IntoIterator<Item = (impl Into<String>, Vec<String>)>) {
        self.0.push(Block::Answers(answers.into_iter().map(|(question, answer)| (question.into(), answer)).collect()));
    }

    /// A heading; the page's contents list it.
    pub fn heading(&mut self, text: impl Into<String>) {
        self.0.push(Block::Heading(text.into()));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: impl Into<String>) {
        self.0.push(Block::Paragraph(text.into()));
    }

    /// The text of a file, line by line, unchanged.
    pub(crate) fn file_text(&mut self, text: impl Into<String>) {
        self.0.push(Block::Text(text.into()));
    }

    /// The numbers that the reader came for, side by side.
    pub fn key_figures(&mut self, figures: impl IntoIterator<Item = KeyFigure>) {
        self.0.push(Block::KeyFigures(figures.into_iter().collect()));
    }

    /// A picture with words below it.
    pub fn figure(&mut self, svg: Svg, caption: impl Into<String>) {
        self.0.push(Block::Figure { svg, caption: caption.into() });
    }

    /// A table with words above it.
    pub fn table(&mut self, table: Table, caption: impl Into<String>) {
        self.0.push(Block::Table { table, caption: caption.into() });
    }

    /// Names and values in two columns: provenance, settings.
    pub fn facts(&mut self, facts: impl IntoIterator<Item = (impl Into<String>, impl Into<String>)>) {
        let facts = facts.into_iter().map(|(name, value)| (name.into(), value.into()));
        self.0.push(Block::Facts(facts.collect()));
    }

    /// A remark set apart.
    pub fn note(&mut self, tone: Tone, text: impl Into<String>) {
        self.0.push(Block::Note { tone, text: text.into() });
    }

    /// Blocks behind a line that opens them.
    pub fn details(&mut self, summary: impl Into<String>, blocks: PageBody) {
        self.0.push(Block::Details { summary: summary.into(), blocks });
    }

    /// A table behind a line that opens it.
    pub(crate) fn details_table(&mut self, summary: impl Into<String>, table: Table, caption: impl Into<String>) {
        self.details(summary, Self(vec![Block::Table { table, caption: caption.into() }]));
    }

    /// Names and values behind a line that opens them.
    pub(crate) fn details_facts(
        &mut self,
        summary: impl Into<String>,
        facts: impl IntoIterator<Item = (impl Into<String>, impl Into<String>)>,
    ) {
        let mut inner = Self::default();
        inner.facts(facts);
        self.details(summary, inner);
    }
}

/// A page under a title. Everything it needs is inside: no scripts, fonts or style sheets. Rows of tables may lead to other pages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// Title of the page.
    pub title: String,
    /// One line below the title.
    pub subtitle: String,
    /// Its contents.
    pub body: PageBody,
}

impl Page {
    /// An empty page.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), body: PageBody::new() }
    }

    /// The page as HTML.
    pub fn to_html(&self) -> String {
        let headings: Vec<&str> = self.body.0.iter().filter_map(heading_of).collect();
        // Answers come first; where there are none, the contents do.
        let answered = matches!(self.body.0.first(), Some(Block::Answers(_)));
        let (opening, rest) = self.body.0.split_at(usize::from(answered));
        let light = Ink::declarations(false);
        let dark = Ink::declarations(true);
        let inks = format!(
            ":root{{color-scheme:light dark;{light}}}@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}"
        );
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    title { (self.title) }
                    style { (PreEscaped(inks)) (PreEscaped(include_str!("page.css"))) }
                }
                body {
                    main {
                        header {
                            h1 { (self.title) }
                            @if !self.subtitle.is_empty() { p.subtitle { (self.subtitle) } }
                            @if !answered { (contents(&headings)) }
                        }
                        (blocks(&PageBody(opening.to_vec())))
                        @if answered { (contents(&headings)) }
                        (blocks(&PageBody(rest.to_vec())))
                        footer { "govtwin " (env!("CARGO_PKG_VERSION")) }
                    }
                }
            }
        };
        page.into_string()
    }
}

/// The contents of the page further down.
fn contents(headings: &[&str]) -> Markup {
    html! {
        @if headings.len() > 2 {
            nav { @for heading in headings { a href={ "#" (slug(heading)) } { (heading) } } }
        }
    }
}

fn heading_of(block: &Block) -> Option<&str> {
    if let Block::Heading(text) = block { Some(text) } else { None }
}

/// The anchor of a heading.
fn slug(heading: &str) -> String {
    heading.chars().map(|c| if c.is_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}

fn blocks(blocks: &PageBody) -> Markup {
    html! { @for item in &blocks.0 { (block(item)) } }
}

fn block(block: &Block) -> Markup {
    html! {
        @match block {
            Block::Answers(answers) => dl.answers {
                @for (question, paragraphs) in answers {
                    dt { (question) }
                    dd {
                        @if let [first, more @ ..] = paragraphs.as_slice() {
                            p { (prose(first)) }
                            @if !more.is_empty() {
                                // A phone shows the rest when it is asked for.
                                label.more { input type="checkbox"; " more" }
                                @for text in more { p { (prose(text)) } }
                            }
                        }
                    }
                }
            },
            Block::Heading(text) => h2 id=(slug(text)) { (text) },
            Block::Paragraph(text) => p { (prose(text)) },
            Block::Text(text) => pre { (text) },
            Block::KeyFigures(figures) => dl.key-figures {
                @for figure in figures {
                    div {
                        dt { (figure.name) }
                        dd { (figure.value) @if !figure.unit.is_empty() { " " span.unit { (figure.unit) } } }
                        @if !figure.hint.is_empty() { dd.hint { (spaced(&figure.hint)) } }
                    }
                }
            },
            Block::Figure { svg, caption } => figure {
                div.picture { div.wide { (PreEscaped(svg.as_str())) } div.narrow { (PreEscaped(svg.narrow())) } }
                label.zoom { input type="checkbox"; " enlarge" }
                @if !caption.is_empty() { figcaption { (prose(caption)) } }
            },
            Block::Table { table, caption } => (table_markup(table, caption)),
            Block::Facts(facts) => dl.facts { @for (name, value) in facts { dt { (name) } dd { (value) } } },
            Block::Note { tone, text } => p.note.(tone_class(*tone)) role="note" { (prose(text)) },
            Block::Details { summary, blocks: inner } => details { summary { (summary) } (blocks(inner)) },
        }
    }
}

/// Text with code between backticks; an unpaired backtick is a character.
fn prose(text: &str) -> Markup {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return html! { (spaced(text)) };
    }
    html! {
        @for (place, part) in parts.iter().enumerate() {
            @if place % 2 == 1 { code { (typed(part)) } } @else { (spaced(part)) }
        }
    }
}

/// What a reader types, in which no line ends within the dashes of an option.
fn typed(text: &str) -> Markup {
    html! {
        @for (place, word) in text.split(' ').enumerate() {
            @if place > 0 { " " }
            @if word.starts_with("--") { span { (word) } } @else { (word) }
        }
    }
}

/// Text in which no line ends between a number and its unit.
fn spaced(text: &str) -> String {
    let mut all = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find(' ') {
        let (before, after) = (&rest[..at], &rest[at + 1..]);
        let number = before.ends_with(|c: char| c.is_ascii_digit());
        let unit = after.split(|c: char| !c.is_alphanumeric() && c != '%' && c != '²').next().unwrap_or_default();
        all += before;
        all.push(if number && UNITS.contains(&unit) { '\u{a0}' } else { ' ' });
        rest = after;
    }
    all + rest
}

fn tone_class(tone: Tone) -> &'static str {
    match tone {
        Tone::Plain => "plain",
        Tone::Good => "good",
        Tone::Warning => "warning",
    }
}

fn table_markup(table: &Table, caption: &str) -> Markup {
    let groups = table.groups();
    let class = |numbers: bool| if numbers { "number" } else { "words" };
    html! {
        @if !caption.is_empty() { p.caption { (prose(caption)) } }
        div.table {
            table {
                thead {
                    @if !groups.is_empty() {
                        tr { @for (name, columns) in &groups { th.group[!name.is_empty()] colspan=(columns) scope="colgroup" { (name) } } }
                    }
                    tr { @for column in table.columns() { th.(class(column.numbers)) scope="col" { (column.name) } } }
                }
                tbody {
                    @for row in table.rows() {
                        tr.strong[row.strong] {
                            @for (place, (cell, column)) in row.cells.iter().zip(table.columns()).enumerate() {
                                td.(class(column.numbers)) data-label=(column.label()) {
                                    @match row.link.as_ref().filter(|_| place == 0) {
                                        Some(link) => a href=(link) { (cell) },
                                        None => (spaced(cell)),
                                    }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{KeyFigure, Page, PageBody, Tone, prose};
    use crate::draw::svg;
    use crate::ink::Ink;
    use crate::picture::{Panel, Picture};
    use crate::table::Table;

    fn page() -> Page {
        let mut page = Page::new("Replay <of> \"bags\"", "measured & simulated");
        let panel = Panel::new("Position, pu").line(Ink::Measured, "a <b>", vec![[0.0, 0.0], [1.0, 1.0]]);
        page.body.figure(svg(&Picture::stacked("a & \"b\"", vec![panel])), "caption");
        page.body.key_figures([KeyFigure::new("R²", "0.99", "").hint("overall")]);
        let mut table = Table::new().words("a").numbers("b");
        table.strong_row(["<script>alert(1)</script>", "2"]);
        table.linked_row(["unit <3>", "4"], "../a\"b/report.html");
        let mut inner = PageBody::new();
        inner.table(table, "t");
        page.body.details("more", inner);
        page.body.note(Tone::Warning, "care");
        page
    }

    #[test]
    fn everything_is_escaped_and_inside() {
        let html = page().to_html();
        assert!(html.contains("Replay &lt;of&gt;") && html.contains("&lt;script&gt;"));
        assert!(html.contains("<a href=\"../a&quot;b/report.html\">unit &lt;3&gt;</a>"));
        assert!(
            !html.contains("<script") && !html.contains("<link") && !html.contains("@import") && !html.contains("src=")
        );
        let outside = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!outside.contains("http"), "a page fetches nothing");
    }

    #[test]
    fn pictures_take_the_inks_of_the_page() {
        let html = page().to_html();
        assert!(html.contains(&format!("stroke=\"{}\"", Ink::Measured.css())));
        assert!(html.contains(&Ink::declarations(true)));
    }

    #[test]
    fn what_stands_between_backticks_is_typed() {
        let of = |text: &str| prose(text).into_string();
        assert_eq!(of("see `a <b>` and `c`."), "see <code>a &lt;b&gt;</code> and <code>c</code>.");
        assert_eq!(of("`a --map b`"), "<code>a <span>--map</span> b</code>");
        assert_eq!(of("one ` alone"), "one ` alone");
        assert_eq!(of("none"), "none");
        assert_eq!(of("2 % of 20 seconds, 3 s"), "2\u{a0}% of 20 seconds, 3\u{a0}s");
    }
}
