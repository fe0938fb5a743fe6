//! From the plotting library's SVG to the page's: inks for colours, a size that scales, fewer bytes.

use super::ink::{Ink, hex};
use super::picture::Picture;

/// Turns the library's fixed colours into the page's inks, and its fixed size into one that scales.
pub fn dressed(text: &str, picture: &Picture) -> String {
    let body = text.split_once("viewBox").map_or("", |(_, rest)| rest);
    let name: String = picture.description.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    let mut svg = format!("<svg role=\"img\" aria-label=\"{name}\" stroke-linejoin=\"round\" viewBox{body}");
    for ink in Ink::ALL {
        svg = svg.replace(&format!("\"{}\"", hex(ink.rgb())), &format!("\"{}\"", ink.css()));
    }
    let svg = relative(&svg);
    svg.replace(" opacity=\"1\"", "").replace(" \"/>", "\"/>").replace(" stroke=\"none\"", "")
}

/// Polylines as paths of relative moves: half the bytes.
fn relative(svg: &str) -> String {
    let mut text = String::with_capacity(svg.len());
    for line in svg.lines() {
        if let Some((head, points)) = line.strip_prefix("<polyline").and_then(|rest| rest.split_once(" points=\"")) {
            text += &format!("<path{head} d=\"");
            let numbers = points.split([' ', ',']).map_while(|number| number.parse::<i32>().ok()).collect::<Vec<_>>();
            let mut last = [0, 0];
            for (i, point) in numbers.chunks_exact(2).enumerate() {
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
    use super::relative;

    #[test]
    fn a_polyline_becomes_a_path_through_the_same_points() {
        let svg = "<polyline fill=\"none\" points=\"10,20 13,16 13,30 \"/>\n<text>points=\"1,2\"</text>\n";
        let expected = "<path fill=\"none\" d=\"m10,20l3,-4 0,14\"/>\n<text>points=\"1,2\"</text>\n";
        assert_eq!(relative(svg), expected);
    }
}
