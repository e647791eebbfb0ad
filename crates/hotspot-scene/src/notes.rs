//! What the loader collects beside the scene: features not modelled, repairs, and names already taken.

use std::collections::HashMap;

use crate::scene::{Repair, Unmodelled};

/// Notes for the user, each reported once.
#[derive(Default)]
pub(crate) struct Notes {
    unmodelled: Vec<Unmodelled>,
    unmodelled_at: HashMap<(String, String), usize>,
    repairs: Vec<Repair>,
    repairs_at: HashMap<(String, String), usize>,
}

impl Notes {
    /// Something that the file uses and the scene does not carry.
    pub(crate) fn unmodelled(&mut self, feature: &str, element: &str, effect: &str) {
        self.unmodelled_at.entry((feature.into(), element.into())).or_insert_with(|| {
            self.unmodelled.push(Unmodelled {
                feature: feature.into(),
                element: element.into(),
                effect: effect.into(),
            });
            self.unmodelled.len()
        });
    }

    /// Something that was mended `count` times; zero is no repair.
    pub(crate) fn repair(&mut self, what: &str, element: &str, count: u64) {
        if count == 0 {
            return;
        }
        let next = self.repairs.len();
        let index = *self.repairs_at.entry((what.into(), element.into())).or_insert(next);
        match self.repairs.get_mut(index) {
            Some(repair) => repair.count = repair.count.saturating_add(count),
            None => self.repairs.push(Repair { what: what.into(), element: element.into(), count }),
        }
    }

    /// Both lists, in order of first mention.
    pub(crate) fn into_lists(self) -> (Vec<Unmodelled>, Vec<Repair>) {
        (self.unmodelled, self.repairs)
    }
}

/// The beginning of a name from the file. Names are copied for every element that lacks one of its own, and a file may make
/// one as long as itself.
pub(crate) fn cut(name: &str) -> &str {
    const MAX: usize = 200;
    name.char_indices().nth(MAX).and_then(|(end, _)| name.get(..end)).unwrap_or(name)
}

/// Makes names unique: the second `Chair` becomes `Chair #2`.
#[derive(Default)]
pub(crate) struct Names {
    /// How often each name was asked for or handed out.
    taken: HashMap<String, u64>,
}

impl Names {
    /// The name, cut where it is long, with a number where it is taken.
    pub(crate) fn unique(&mut self, name: &str) -> String {
        let name = cut(name);
        let mut n = self.taken.get(name).copied().unwrap_or(0);
        let mut candidate = name.to_owned();
        loop {
            n += 1;
            if n > 1 {
                candidate = format!("{name} #{n}");
            }
            // A file may itself call something `Chair #2`.
            if n == 1 || !self.taken.contains_key(&candidate) {
                break;
            }
        }
        self.taken.insert(name.to_owned(), n);
        if n > 1 {
            self.taken.insert(candidate.clone(), 1);
        }
        candidate
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_unique_even_against_names_that_look_numbered() {
        let mut names = Names::default();
        let got: Vec<_> = ["a", "a #2", "a", "a", "a #2"].iter().map(|n| names.unique(n)).collect();
        assert_eq!(got, ["a", "a #2", "a #3", "a #4", "a #2 #2"]);
    }

    #[test]
    fn long_names_are_cut_between_characters_and_stay_unique() {
        let mut names = Names::default();
        let long = "ü".repeat(300);
        assert_eq!(names.unique(&long), "ü".repeat(200));
        assert_eq!(names.unique(&long), format!("{} #2", "ü".repeat(200)));
        assert_eq!(cut("short"), "short");
    }

    #[test]
    fn repairs_of_one_kind_are_counted_together() {
        let mut notes = Notes::default();
        notes.repair("x", "e", 2);
        notes.repair("x", "f", 1);
        notes.repair("x", "e", 3);
        notes.repair("y", "e", 0);
        notes.unmodelled("sheen", "materials[0]", "ignored");
        notes.unmodelled("sheen", "materials[0]", "ignored");
        let (unmodelled, repairs) = notes.into_lists();
        assert_eq!(unmodelled.len(), 1);
        assert_eq!(repairs.iter().map(|r| r.count).collect::<Vec<_>>(), [5, 1]);
    }
}
