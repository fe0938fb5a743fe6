//! Fewer points for the same picture: runs without gaps, thinned per pixel column, cut to the frame.

/// The stretches of a line between NaNs, each at least one point long.
pub(crate) fn runs(points: &[[f64; 2]]) -> impl Iterator<Item = &[[f64; 2]]> {
    points.split(|point| !(point[0].is_finite() && point[1].is_finite())).filter(|run| !run.is_empty())
}

/// Keeps the first, lowest, highest and last point of each of `bins` columns between `from` and `to`.
///
/// The extremes of every column survive, so no spike is ever hidden, and the drawn line covers the
/// same pixels as the whole one would. x must not fall. Points outside the range are left out but
/// for the nearest on each side, which the line needs to reach the edge.
pub(crate) fn thin(run: &[[f64; 2]], [from, to]: [f64; 2], bins: usize) -> Vec<[f64; 2]> {
    let start = run.partition_point(|point| point[0] < from).saturating_sub(1);
    let end = (run.partition_point(|point| point[0] <= to) + 1).min(run.len());
    let run = run.get(start..end).unwrap_or_default();
    if run.len() <= 4 * bins {
        return run.to_vec();
    }
    let column = |point: &[f64; 2]| ((point[0] - from) / (to - from) * bins as f64).floor();
    let mut kept = Vec::with_capacity(4 * bins);
    for points in run.chunk_by(|a, b| column(a) == column(b)) {
        let extreme = |better: fn(f64, f64) -> bool| {
            let mut best = 0;
            for (i, point) in points.iter().enumerate() {
                if better(point[1], points[best][1]) {
                    best = i;
                }
            }
            best
        };
        let mut chosen = [0, extreme(|a, b| a < b), extreme(|a, b| a > b), points.len() - 1];
        chosen.sort_unstable();
        for (k, &i) in chosen.iter().enumerate() {
            if k == 0 || chosen[k - 1] != i {
                kept.push(points[i]);
            }
        }
    }
    kept
}

/// The parts of a polyline inside a rectangle, with new points where it crosses the edge.
pub(crate) fn clip(line: &[[f64; 2]], x: [f64; 2], y: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut parts: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut open = false;
    for pair in line.windows(2) {
        let Some((a, b)) = clip_segment(pair[0], pair[1], x, y) else {
            open = false;
            continue;
        };
        match parts.last_mut() {
            Some(part) if open && a == pair[0] => part.push(b),
            _ => parts.push(vec![a, b]),
        }
        open = b == pair[1];
    }
    parts
}

/// The part of a segment inside a rectangle (Liang and Barsky 1984).
pub(crate) fn clip_segment(a: [f64; 2], b: [f64; 2], x: [f64; 2], y: [f64; 2]) -> Option<([f64; 2], [f64; 2])> {
    let step = [b[0] - a[0], b[1] - a[1]];
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (axis, [low, high]) in [(0, x), (1, y)] {
        if step[axis] == 0.0 {
            if a[axis] < low || a[axis] > high {
                return None;
            }
            continue;
        }
        let (one, other) = ((low - a[axis]) / step[axis], (high - a[axis]) / step[axis]);
        enter = enter.max(one.min(other));
        leave = leave.min(one.max(other));
    }
    let at = |share: f64| [a[0] + share * step[0], a[1] + share * step[1]];
    let start = if enter == 0.0 { a } else { at(enter) };
    let end = if leave == 1.0 { b } else { at(leave) };
    (enter <= leave).then_some((start, end))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::{Strategy, prop};
    use proptest::{prop_assert, proptest};

    use super::{clip, runs, thin};

    fn signal() -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec(-1.0..1.0, 2..3000)
            .prop_map(|ys| (0_u32..).zip(ys).map(|(i, y)| [f64::from(i) * 0.01, y]).collect())
    }

    #[test]
    fn a_single_spike_in_a_million_points_survives() {
        let mut points: Vec<[f64; 2]> = (0..1_000_000).map(|i| [f64::from(i), 0.0]).collect();
        points[654_321][1] = -7.0;
        let thinned = thin(&points, [0.0, 1e6], 900);
        assert!(thinned.len() < 4000);
        assert!(thinned.contains(&[654_321.0, -7.0]));
    }

    #[test]
    fn gaps_break_a_line() {
        let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0], [3.0, 4.0]];
        let runs: Vec<_> = runs(&points).collect();
        assert_eq!(runs, [&points[..1], &points[2..]]);
    }

    #[test]
    fn a_line_that_leaves_and_returns_is_cut_at_the_edge() {
        let line = [[0.0, 0.0], [1.0, 2.0], [2.0, 2.0], [3.0, 0.0]];
        let parts = clip(&line, [0.0, 3.0], [-1.0, 1.0]);
        assert_eq!(parts, [vec![[0.0, 0.0], [0.5, 1.0]], vec![[2.5, 1.0], [3.0, 0.0]]]);
    }

    #[test]
    fn what_lies_inside_stays_whole() {
        let line = [[0.0, 0.0], [1.0, 0.5], [2.0, -0.5]];
        assert_eq!(clip(&line, [0.0, 2.0], [-1.0, 1.0]), [line.to_vec()]);
    }

    proptest! {
        #[test]
        fn thinning_keeps_extremes_ends_and_order(points in signal(), bins in 1_usize..50) {
            let range = [points[0][0], points[points.len() - 1][0]];
            let thinned = thin(&points, range, bins);
            let highest = |p: &[[f64; 2]]| p.iter().map(|p| p[1]).fold(f64::MIN, f64::max);
            let lowest = |p: &[[f64; 2]]| p.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
            prop_assert!(highest(&points) == highest(&thinned) && lowest(&points) == lowest(&thinned));
            prop_assert!(points.first() == thinned.first() && points.last() == thinned.last());
            prop_assert!(thinned.windows(2).all(|w| w[0][0] < w[1][0]));
            prop_assert!(thinned.len() <= points.len() && thinned.len() <= 4 * (bins + 1));
        }

        #[test]
        fn clipped_lines_stay_inside(points in signal()) {
            let close = |v: f64, low: f64, high: f64| v >= low - 1e-9 && v <= high + 1e-9;
            for part in clip(&points, [0.1, 5.0], [-0.3, 0.4]) {
                prop_assert!(part.len() >= 2);
                prop_assert!(part.iter().all(|p| close(p[0], 0.1, 5.0) && close(p[1], -0.3, 0.4)));
            }
        }
    }
}
