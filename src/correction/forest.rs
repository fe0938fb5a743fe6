//! Regression trees, walked without memory, locks or foreign code: what runs a trained model.
//!
//! The value of a row is the sum over trees of the leaf that the row falls into; at a node it goes left where its feature
//! is not above the threshold. Sums run in the order of the trees, so that the result equals the trainer's to the last bit.
//!
//! A single row costs what its walks wait for memory. So several trees are walked side by side, level by level and without a branch: the children of
//! a node lie next to each other, a leaf is a node that leads to itself, and a walk takes as many steps as the deepest tree of its group has levels.

use serde::{Deserialize, Serialize};

/// Trees as a file holds them: per tree its nodes' features, thresholds and children, and its leaves.
///
/// A child that is not negative is a node of the same tree, and one below zero is leaf `−1 − child`. A tree without
/// nodes is its first leaf.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tree {
    /// Index of the feature that a node looks at.
    pub feature: Vec<u32>,
    /// Its threshold, in the feature's unit.
    pub threshold: Vec<f64>,
    /// Where rows go that are not above it.
    pub left: Vec<i32>,
    /// Where the others go.
    pub right: Vec<i32>,
    /// Values of the leaves.
    pub leaf: Vec<f64>,
}

/// What is wrong with trees that were read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("tree {tree}: {problem}")]
pub struct ForestError {
    tree: usize,
    problem: String,
}

/// Trees that are walked side by side.
const LANES: usize = 16;

/// A node, or a leaf, which is a node that leads to itself.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TreeNode {
    /// In the unit of the feature that it splits, or a leaf's value: the coefficient's unit is the feature's or the target's.
    threshold: f64,
    /// The left child; the right one lies behind it.
    first: u32,
    feature: u16,
    /// 1, or 0 for a leaf.
    step: u16,
}

/// Trees that are walked side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
struct TreeGroup {
    roots: [u32; LANES],
    /// How many of the roots count.
    trees: usize,
    /// Levels of the deepest.
    levels: u32,
}

/// Trees in walking order, checked: no walk leaves them or runs in a circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Forest {
    nodes: Vec<TreeNode>,
    groups: Vec<TreeGroup>,
    features: usize,
}

impl Forest {
    /// Checks the trees for rows of `features` numbers.
    ///
    /// # Errors
    /// Where a tree names a feature, node or leaf that is not there, runs in a circle, or holds what is no number.
    pub fn new(trees: &[Tree], features: usize) -> Result<Self, ForestError> {
        let mut forest = Self { nodes: vec![], groups: vec![], features };
        for (index, tree) in trees.iter().enumerate() {
            let wrong = |problem| ForestError { tree: index, problem };
            check(tree, features).map_err(wrong)?;
            let (root, levels) =
                forest.lay_out(tree).ok_or_else(|| wrong("more nodes than can be counted".to_owned()))?;
            if index % LANES == 0 {
                forest.groups.push(TreeGroup { roots: [root; LANES], trees: 0, levels: 0 });
            }
            if let Some(group) = forest.groups.last_mut() {
                group.roots[group.trees] = root;
                group.trees += 1;
                group.levels = group.levels.max(levels);
            }
        }
        Ok(forest)
    }

    /// Lays a checked tree out level by level; its root, and its levels.
    fn lay_out(&mut self, tree: &Tree) -> Option<(u32, u32)> {
        let root = u32::try_from(self.nodes.len()).ok()?;
        // Nodes, or leaves below zero, whose place is taken; both children of a node are taken together.
        let mut level = vec![(if tree.feature.is_empty() { -1 } else { 0 }, self.nodes.len())];
        self.nodes.push(TreeNode { threshold: 0.0, first: 0, feature: 0, step: 0 });
        let mut levels = 0;
        loop {
            let mut next = vec![];
            for (child, place) in level {
                self.nodes[place] = if let Ok(node) = usize::try_from(child) {
                    let first = self.nodes.len();
                    self.nodes.extend([TreeNode { threshold: 0.0, first: 0, feature: 0, step: 0 }; 2]);
                    next.extend([(tree.left[node], first), (tree.right[node], first + 1)]);
                    let (first, feature) = (u32::try_from(first).ok()?, u16::try_from(tree.feature[node]).ok()?);
                    TreeNode { threshold: tree.threshold[node], first, feature, step: 1 }
                } else {
                    let leaf = usize::try_from(-1 - i64::from(child)).ok()?;
                    TreeNode { threshold: tree.leaf[leaf], first: u32::try_from(place).ok()?, feature: 0, step: 0 }
                };
            }
            if next.is_empty() {
                return Some((root, levels));
            }
            level = next;
            levels += 1;
        }
    }

    /// How many trees there are.
    pub fn len(&self) -> usize {
        self.groups.iter().map(|group| group.trees).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// The value of a row; NaN where the row is shorter than the trees' list of features. Allocates nothing.
    pub fn value(&self, row: &[f64]) -> f64 {
        self.walk(row, |_| ())
    }

    /// The same, and the leaf of each tree that the row falls into, as a place below [`Self::places`]; `leaves` holds one a tree.
    #[must_use]
    pub(crate) fn value_and_leaves(&self, row: &[f64], leaves: &mut [u32]) -> f64 {
        let mut rest = leaves.iter_mut();
        self.walk(row, |found| rest.by_ref().zip(found).for_each(|(leaf, place)| *leaf = *place))
    }

    /// How many nodes and leaves there are.
    pub fn places(&self) -> usize {
        self.nodes.len()
    }

    /// Adds up the leaves of a row and hands the places of each group on.
    fn walk(&self, row: &[f64], mut found: impl FnMut(&[u32])) -> f64 {
        if row.len() < self.features {
            return f64::NAN;
        }
        let mut sum = 0.0;
        for group in &self.groups {
            let mut at = group.roots;
            for _ in 0..group.levels {
                for place in &mut at {
                    let node = &self.nodes[*place as usize];
                    let above = u16::from(row[usize::from(node.feature)] > node.threshold);
                    *place = node.first + u32::from(node.step & above);
                }
            }
            let at = &at[..group.trees];
            sum = at.iter().fold(sum, |sum, place| sum + self.nodes[*place as usize].threshold);
            found(at);
        }
        sum
    }
}

fn check(tree: &Tree, features: usize) -> Result<(), String> {
    let nodes = tree.feature.len();
    for (what, len) in [("threshold", tree.threshold.len()), ("left", tree.left.len()), ("right", tree.right.len())] {
        if len != nodes {
            return Err(format!("`{what}` has {len} entries, `feature` {nodes}"));
        }
    }
    if tree.leaf.len() != nodes + 1 {
        return Err(format!("{nodes} nodes need {} leaves, found {}", nodes + 1, tree.leaf.len()));
    }
    if !tree.threshold.iter().chain(&tree.leaf).all(|value| value.is_finite()) {
        return Err("a threshold or leaf is not finite".to_owned());
    }
    for node in 0..nodes {
        if tree.feature[node] as usize >= features {
            return Err(format!("node {node} looks at feature {}, of {features}", tree.feature[node]));
        }
        for child in [tree.left[node], tree.right[node]] {
            let fits = match usize::try_from(child) {
                // Children come after their node, so that every walk ends.
                Ok(child) => child > node && child < nodes,
                Err(_) => usize::try_from(-1 - i64::from(child)).is_ok_and(|leaf| leaf <= nodes),
            };
            if !fits {
                return Err(format!("node {node} has the child {child}, which is neither a later node nor a leaf"));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Forest, Tree};

    fn tree() -> Tree {
        Tree {
            feature: vec![0, 1],
            threshold: vec![0.5, -1.0],
            left: vec![1, -2],
            right: vec![-1, -3],
            leaf: vec![10.0, 1.0, 2.0],
        }
    }

    #[test]
    fn rows_reach_their_leaves_and_trees_add_up() {
        let single = Tree { leaf: vec![0.25], ..Tree::default() };
        let forest = Forest::new(&[tree(), single, tree()], 2).unwrap();
        assert_eq!(forest.value(&[0.5, -1.0]), 2.25);
        assert_eq!(forest.value(&[0.5, 0.0]), 4.25);
        assert_eq!(forest.value(&[0.6, 0.0]), 20.25);
        assert!(forest.value(&[0.6]).is_nan());
        assert_eq!(forest.len(), 3);
        let (mut here, mut there) = ([0; 3], [0; 3]);
        assert_eq!(forest.value_and_leaves(&[0.5, -1.0], &mut here), 2.25);
        assert_eq!(forest.value_and_leaves(&[0.6, 0.0], &mut there), 20.25);
        assert!(here.iter().chain(&there).all(|place| (*place as usize) < forest.places()));
        // The tree of one leaf has the same for both rows, the others have leaves of their own.
        assert_eq!([0, 1, 2].map(|tree| here[tree] == there[tree]), [false, true, false]);
    }

    #[test]
    fn damage_is_found() {
        let breaks: [fn(&mut Tree); 7] = [
            |tree| tree.feature[1] = 2,
            |tree| tree.left[0] = 0,
            |tree| tree.right[0] = 2,
            |tree| tree.right[1] = -4,
            |tree| tree.leaf[0] = f64::NAN,
            |tree| tree.leaf.truncate(2),
            |tree| tree.left.truncate(1),
        ];
        for damage in breaks {
            let mut broken = tree();
            damage(&mut broken);
            let error = Forest::new(&[tree(), broken], 2).unwrap_err();
            assert!(error.to_string().starts_with("tree 1: "), "{error}");
        }
    }
}
