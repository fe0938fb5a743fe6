//! Machines whose signals stand in one file, told apart by their names: `U3_Y_CMD` and `U5_Y_CMD` differ in one word, as all their signals do.

use std::collections::{BTreeMap, BTreeSet};

use super::names::{is_known, words};

/// Pairs of columns that differ in one word, by the two words.
type Pairs = BTreeMap<(String, String), Vec<(usize, usize, usize)>>;

/// Signals that must differ by the same two words: numbers and letters, and other words, which also tell signals apart.
const FEWEST: usize = 2;
const FEWEST_WORDS: usize = 3;
/// A name may have so many words more than the same of another machine.
const MOST_WORDS_MORE: usize = 3;
/// More columns are not compared with each other.
const MOST_COLUMNS: usize = 400;

/// The machines of a file and their columns.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Machines {
    /// What tells each from the others in the names, in the order of the file.
    pub(super) words: Vec<String>,
    /// The machine of each column; none where its name tells no machine.
    of: Vec<Option<usize>>,
}

impl Machines {
    /// Whether a column can be of a machine.
    pub(super) fn may_be_of(&self, column: usize, machine: usize) -> bool {
        self.of.get(column).copied().flatten().is_none_or(|own| own == machine)
    }
}

/// A place in a name at which it differs from another: the words on both sides.
type Context = (Option<String>, Option<String>);

/// Finds the machines in the names of columns; none where all are of one.
pub(super) fn machines<'a>(names: impl Iterator<Item = &'a str>) -> Machines {
    let names: Vec<Vec<String>> = names.take(MOST_COLUMNS).map(|name| words(&without_indices(name))).collect();
    // Pairs of columns that differ in one word, by the two words.
    let mut pairs = Pairs::new();
    for (first, one) in names.iter().enumerate() {
        for (second, other) in names.iter().enumerate().skip(first + 1).filter(|(_, other)| other.len() == one.len()) {
            let mut differ = (0..one.len()).filter(|place| one[*place] != other[*place]);
            let (Some(place), None) = (differ.next(), differ.next()) else { continue };
            if tells_machines(&one[place]) && tells_machines(&other[place]) {
                // Signals of two machines may stand in either order.
                let (low, high) = if one[place] <= other[place] { (first, second) } else { (second, first) };
                let words = (names[low][place].clone(), names[high][place].clone());
                pairs.entry(words).or_default().push((low, high, place));
            }
        }
    }
    pairs.retain(|(one, other), columns| {
        let short = |word: &str| word.len() == 1 || word.bytes().all(|byte| byte.is_ascii_digit());
        columns.len() >= if short(one) && short(other) { FEWEST } else { FEWEST_WORDS }
    });
    let Some(found) = most_columns(&pairs) else { return with_a_word_more(&names) };
    let context = |name: &[String], place: usize| -> Context {
        (place.checked_sub(1).and_then(|before| name.get(before)).cloned(), name.get(place + 1).cloned())
    };
    let mut contexts: BTreeSet<(String, Option<String>)> = BTreeSet::new();
    let mut of = vec![None; names.len()];
    let mut said: Vec<String> = vec![];
    for ((one, other), columns) in pairs.iter().filter(|((one, _), _)| found.contains(one)) {
        for (first, second, place) in columns {
            for (column, word) in [(*first, one), (*second, other)] {
                contexts.insert((word.clone(), context(&names[column], *place).0));
            }
        }
    }
    for (column, name) in names.iter().enumerate() {
        let place = (0..name.len()).find(|place| contexts.contains(&(name[*place].clone(), context(name, *place).0)));
        of[column] = place.map(|place| {
            said.iter().position(|known| *known == name[place]).unwrap_or_else(|| {
                said.push(name[place].clone());
                said.len() - 1
            })
        });
    }
    Machines { words: said, of }
}

/// Signals that hold the same twice, once with a word more or with some: `Y_CMD` and `Y_CMD_2`, `/command` and `/unit5/command`. Two that do may be two
/// transducers of one machine.
fn with_a_word_more(names: &[Vec<String>]) -> Machines {
    let mut found: BTreeMap<String, Vec<(usize, usize)>> = BTreeMap::new();
    for (second, longer) in names.iter().enumerate() {
        for count in 1..=MOST_WORDS_MORE {
            for (place, more) in longer.windows(count).enumerate() {
                let tells = more.iter().any(|word| tells_machines(word));
                let pure = count > 1 || more.iter().all(|word| tells_machines(word));
                let without = |shorter: &&Vec<String>| {
                    shorter.len() + count == longer.len()
                        && shorter[..place] == longer[..place]
                        && shorter[place..] == longer[place + count..]
                };
                if let Some(first) = names.iter().position(|shorter| without(&shorter)).filter(|_| tells && pure) {
                    found.entry(more.join(" ")).or_default().push((first, second));
                }
            }
        }
    }
    let best = found.into_iter().filter(|(_, pairs)| pairs.len() >= FEWEST_WORDS).max_by_key(|(_, pairs)| pairs.len());
    let Some((word, pairs)) = best else { return Machines::default() };
    let mut of = vec![None; names.len()];
    for (first, second) in pairs {
        (of[first], of[second]) = (Some(0), Some(1));
    }
    Machines { words: vec![format!("without {word}"), word], of }
}

/// Two of the signals of one proposal whose names have different numbers behind the same word, or before everything else, as names of several machines
/// have. Numbers that no two signals share are those of channels.
pub(super) fn two_machines(names: &[&str]) -> Option<(String, String)> {
    let mut found: BTreeMap<Option<String>, Vec<(String, usize)>> = BTreeMap::new();
    for (name, text) in names.iter().enumerate() {
        let words = words(&without_indices(text));
        let first = words.iter().position(|word| word.bytes().all(|byte| byte.is_ascii_digit()));
        // A number behind everything else counts transducers, and one behind another number parts of a machine.
        if let Some(place) = first.filter(|place| place + 1 < words.len()) {
            let before = place.checked_sub(1).and_then(|before| words.get(before)).cloned();
            found.entry(before).or_default().push((words[place].clone(), name));
        }
    }
    found.into_values().find_map(|numbers| {
        let count = |number: &String| numbers.iter().filter(|(other, _)| other == number).count();
        let (most, first) = numbers.iter().max_by_key(|(number, _)| count(number))?;
        let (_, other) = numbers.iter().find(|(number, name)| number != most && name != first)?;
        (count(most) > 1).then(|| (format!("`{}`", names[*first]), format!("`{}`", names[*other])))
    })
}

/// The words that belong together and tell most columns apart.
fn most_columns(pairs: &Pairs) -> Option<BTreeSet<String>> {
    let mut groups: Vec<(BTreeSet<String>, BTreeSet<usize>)> = vec![];
    for ((one, other), columns) in pairs {
        let mut group = (BTreeSet::from([one.clone(), other.clone()]), BTreeSet::new());
        group.1.extend(columns.iter().flat_map(|(first, second, _)| [*first, *second]));
        groups.retain(|(words, columns)| {
            let apart = words.is_disjoint(&group.0);
            if !apart {
                group.0.extend(words.iter().cloned());
                group.1.extend(columns);
            }
            apart
        });
        groups.push(group);
    }
    groups.into_iter().max_by_key(|(_, columns)| columns.len()).map(|(words, _)| words)
}

/// Whether a word can tell one machine from another, and says nothing of a signal.
fn tells_machines(word: &str) -> bool {
    !is_known(word)
}

/// A name without what stands in brackets: units, and elements of arrays.
fn without_indices(name: &str) -> String {
    let mut depth = 0_u32;
    let mut plain = String::new();
    for letter in name.chars() {
        match letter {
            '[' | '(' => depth += 1,
            ']' | ')' => depth = depth.saturating_sub(1),
            _ if depth == 0 => plain.push(letter),
            _ => {}
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> (Vec<String>, Vec<Option<usize>>) {
        let found = machines(names.iter().copied());
        (found.words, found.of)
    }

    #[test]
    fn machines_are_told_apart_by_number_letter_and_name() {
        for (names, words, machines) in [
            (
                &["Time", "U3_Y_CMD [%]", "U3_Y [%]", "U5_Y_CMD [%]", "U5_Y [%]", "U5_P [bar]"][..],
                &["3", "5"][..],
                &[2, 0, 0, 1, 1, 1][..],
            ),
            (&["t", "cmd_A", "pos_A", "cmd_B", "pos_B", "oil"], &["a", "b"], &[2, 0, 0, 1, 1, 2][..]),
            (
                &[
                    "/unit3/governor/command.opening",
                    "/unit3/plant/state.spool",
                    "/unit5/governor/command.opening",
                    "/unit5/plant/state.spool",
                ],
                &["3", "5"],
                &[0, 0, 1, 1][..],
            ),
            (
                &["north cmd", "north gate", "north spool", "south cmd", "south gate", "south spool"],
                &["north", "south"],
                &[0, 0, 0, 1, 1, 1][..],
            ),
            (
                &["Nord Soll", "Süd Soll", "Süd Servo", "Nord Servo", "Süd Kolben", "Nord Kolben"],
                &["nord", "sud"],
                &[0, 1, 1, 0, 1, 0][..],
            ),
            (
                &["Y_CMD", "Y_POS", "SPOOL", "Y_CMD_2", "Y_POS_2", "SPOOL_2", "ESV"],
                &["without 2", "2"],
                &[0, 0, 0, 1, 1, 1, 2][..],
            ),
            (
                &[
                    "/governor/command.opening",
                    "/plant/state.spool",
                    "/plant/state.servo",
                    "/unit5/governor/command.opening",
                    "/unit5/plant/state.spool",
                    "/unit5/plant/state.servo",
                ],
                &["without unit 5", "unit 5"],
                &[0, 0, 0, 1, 1, 1][..],
            ),
        ] {
            let (found, own) = of(names);
            assert_eq!(found, words, "{names:?}");
            assert_eq!(own.iter().map(|machine| machine.unwrap_or(2)).collect::<Vec<_>>(), machines, "{names:?}");
        }
    }

    #[test]
    fn a_proposal_of_two_machines_is_seen() {
        for (names, two) in [
            (&["U5_Y_CMD [%]", "U3_Y_POS [%]", "U3_SPOOL [%]"][..], true),
            (&["/unit3/governor/command.opening", "/unit5/plant/state.spool", "/unit5/plant/state.servo"], true),
            (&["10MEB CMD", "20MEB POS", "20MEB SPOOL"], true),
            (&["AI1_CMD", "AI2_POS", "AI3_SPOOL"], false),
            (&["U3_Y_CMD", "U3_Y", "U3_P1", "U3_P2"], false),
            (&["MEB10 CG001 pos", "MEB10 CG001 cmd", "MEB10 CG002 spool"], false),
            (&["cmd", "servo", "spool"], false),
        ] {
            assert_eq!(two_machines(names).is_some(), two, "{names:?}");
        }
    }

    #[test]
    fn the_signals_of_one_machine_are_of_one() {
        for names in [
            &["t", "spool_pos", "servo_pos", "spool_cmd", "servo_cmd"][..],
            &["t", "spool_min", "spool_max", "servo_min", "servo_max", "p_min", "p_max"],
            &[
                "/joint_states.position[0]",
                "/joint_states.position[1]",
                "/joint_states.velocity[0]",
                "/joint_states.velocity[1]",
            ],
            &["U3_Y_CMD", "U3_Y", "U3_SPOOL", "U3_P1", "U3_P2"],
            &["cmd", "servo", "servo 2", "spool", "spool 2", "p"],
        ] {
            assert!(of(names).0.is_empty(), "{names:?}: {:?}", of(names));
        }
    }
}
