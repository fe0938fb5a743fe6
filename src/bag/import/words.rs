//! Lists of words, each written as one text.

/// Words with strokes between them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words(pub(super) &'static str);

impl Words {
    pub(super) fn all(self) -> impl Iterator<Item = &'static str> + Clone {
        self.0.split('|')
    }

    pub(super) fn has(self, word: &str) -> bool {
        self.all().any(|known| known == word)
    }

    /// The words with the weight that stands behind each.
    pub(super) fn weighed(self) -> impl Iterator<Item = (&'static str, f64)> {
        self.all()
            .filter_map(|one| one.rsplit_once(' '))
            .filter_map(|(word, weight)| Some((word, weight.parse().ok()?)))
    }
}
