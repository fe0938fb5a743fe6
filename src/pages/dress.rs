//! From the plotting library's SVG to the page's: inks for colours, a size that scales, fewer bytes.

use super::ink::{Ink, hex};
use super::picture::Picture;

/// What is added to the width of a stroke for each pattern of dashes, which the library does not know.
pub const DASH: u32 = 1000;

/// Dashes and gaps by pattern, in the library's units.
const PATTERNS: [&str; 4] = ["56 32", "16 24", "96 24 16 24", "120 56"];

/// Turns the library's fixed colours into the page's inks, and its fixed size into one that scales.
pub fn dressed(text: &str, picture: &Picture) -> String {
    let body = text.split_once("viewBox").map_or("", |(_, rest)| rest);
    let name: String = picture.description.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    let mut svg = format!("<svg role=\"img\" aria-label=\"{name}\" stroke-linejoin=\"round\" viewBox{body}");
    for ink in Ink::ALL {
        svg = svg.replace(&format!("\"{}\"", hex(ink.rgb())), &format!("\"{}\"", ink.css()));
    }
    let svg = with_dashes(&relative(&svg));
    svg.replace(" opacity=\"1\"", "").replace(" \"/>", "\"/>").replace(" stroke=\"none\"", "")
}

/// Strokes whose width names a pattern, with the width and the pattern apart.
fn with_dashes(svg: &str) -> String {
    let mut parts = svg.split("stroke-width=\"");
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        text += "stroke-width=\"";
        let coded = part.split_once('"').and_then(|(width, rest)| Some((width.parse::<u32>().ok()?, rest)));
        match coded.filter(|(width, _)| *width >= DASH) {
            Some((width, rest)) => {
                let pattern = PATTERNS[(width / DASH - 1) as usize % PATTERNS.len()];
                text += &format!("{}\" stroke-dasharray=\"{pattern}\"{rest}", width % DASH);
            }
            None => text += part,
        }
    }
    text
}

/// Polylines as paths of relative moves: half the bytes.
fn relative(svg: &str) -> String {
    let mut text = String::with_capacity(svg.len());
    for line in svg.lines() {
        if let Some((head, points)) = line.strip_prefix("<polyline").and_then(|rest| rest.split_once(" points=\"")) {
            text += &format!("<path{head} d=\"");
            let numbers = points.split([' ', ',']).map_while(|number| number.parse::<i32>().ok()).collect::<Vec<_>>();
            let mut last = [0, 0];
            for (i, point) in numbers.as_chunks::<2>().0.iter().enumerate() {
                let separator = [" ", "m", "l"][if i < 2 { i + 1 } else { 0 }];
                text += &format!("{separator}{},{}", point[0] - last[0], point[1] - last[1]);
                last = [point[0], point[1]];
            }
            text += "\"/>\n";
        } else {
            text += line;
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{relative, with_dashes};

    #[test]
    fn a_polyline_becomes_a_path_through_the_same_points() {
        let svg = "<polyline fill=\"none\" points=\"10,20 13,16 13,30 \"/>\n<text>points=\"1,2\"</text>\n";
        let expected = "<path fill=\"none\" d=\"m10,20l3,-4 0,14\"/>\n<text>points=\"1,2\"</text>\n";
        assert_eq!(relative(svg), expected);
    }

    #[test]
    fn a_width_that_names_a_pattern_becomes_width_and_dashes() {
        let svg = "<path stroke-width=\"11\"/><path stroke-width=\"2011\" d=\"m1,2\"/>";
        let expected = "<path stroke-width=\"11\"/><path stroke-width=\"11\" stroke-dasharray=\"16 24\" d=\"m1,2\"/>";
        assert_eq!(with_dashes(svg), expected);
    }
}
