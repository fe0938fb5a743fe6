//! A part of a battery: which units one of several processes makes and judges.

use std::str::FromStr;

/// Part `number` of `of`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Default for Shard {
    /// The whole.
    fn default() -> Self {
        Self { number: 1, of: 1 }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err(format!("expected I/N, part I of N counted from 1, such as 1/4, found `{text}`")),
        }
    }
}

impl Shard {
    /// Its part of a list, dealt out one by one, so that kinds which follow each other are spread over all parts.
    pub fn of<T>(self, all: Vec<T>) -> Vec<T> {
        all.into_iter()
            .enumerate()
            .filter(|(place, _)| place % self.of == self.number - 1)
            .map(|(_, one)| one)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Shard;

    #[test]
    fn parts_are_the_whole_each_once() {
        for of in [1, 2, 3, 7, 12] {
            let mut dealt: Vec<usize> = (1..=of)
                .flat_map(|number| format!("{number}/{of}").parse::<Shard>().unwrap().of((0..10).collect()))
                .collect();
            dealt.sort_unstable();
            assert_eq!(dealt, (0..10).collect::<Vec<_>>());
        }
        for wrong in ["0/3", "4/3", "1", "1/0", "a/b", "-1/2", ""] {
            assert!(wrong.parse::<Shard>().unwrap_err().contains("such as 1/4"), "{wrong}");
        }
    }
}
