//! Regression trees, walked without memory, locks or foreign code: what runs a trained model.
//!
//! The value of a row is the sum over trees of the leaf that the row falls into; at a node it goes left where its feature
//! is not above the threshold. Sums run in the order of the trees, so that the result equals the trainer's to the last bit.

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

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    /// In the unit of the feature that it splits: the coefficient's unit is the feature's.
    threshold: f64,
    feature: u32,
    children: [i32; 2],
}

/// Trees in walking order, checked: no walk leaves them or runs in a circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Forest {
    nodes: Vec<Node>,
    leaves: Vec<f64>,
    /// First node or, below zero, the only leaf of each tree.
    roots: Vec<i32>,
    features: usize,
}

impl Forest {
    /// Checks the trees for rows of `features` numbers.
    ///
    /// # Errors
    /// Where a tree names a feature, node or leaf that is not there, runs in a circle, or holds what is no number.
    pub fn new(trees: &[Tree], features: usize) -> Result<Self, ForestError> {
        let mut forest = Self { nodes: vec![], leaves: vec![], roots: vec![], features };
        for (index, tree) in trees.iter().enumerate() {
            check(tree, features).map_err(|problem| ForestError { tree: index, problem })?;
            let too_many = |_| ForestError { tree: index, problem: "more nodes than can be counted".to_owned() };
            let first_node = i32::try_from(forest.nodes.len()).map_err(too_many)?;
            let first_leaf = i32::try_from(forest.leaves.len()).map_err(too_many)?;
            let moved = |child: i32| if child >= 0 { child + first_node } else { child - first_leaf };
            forest.roots.push(if tree.feature.is_empty() { -1 - first_leaf } else { first_node });
            for node in 0..tree.feature.len() {
                forest.nodes.push(Node {
                    threshold: tree.threshold[node],
                    feature: tree.feature[node],
                    children: [moved(tree.left[node]), moved(tree.right[node])],
                });
            }
            forest.leaves.extend(&tree.leaf);
        }
        Ok(forest)
    }

    /// How many trees there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.roots.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.roots.is_empty()
    }

    /// The value of a row; NaN where the row is shorter than the trees' list of features. Allocates nothing.
    #[must_use]
    pub fn value(&self, row: &[f64]) -> f64 {
        if row.len() < self.features {
            return f64::NAN;
        }
        let mut sum = 0.0;
        for &root in &self.roots {
            let mut at = root;
            // A negative number is a leaf.
            while let Ok(index) = usize::try_from(at) {
                let node = &self.nodes[index];
                at = node.children[usize::from(row[node.feature as usize] > node.threshold)];
            }
            sum += self.leaves[usize::try_from(-1 - at).unwrap_or(0)];
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
