//! Even thinning of what comes one after the other, where its number is known.

/// Keeps at most so many of so many, evenly: the first, and then each that is due.
#[derive(Clone, Copy, Debug)]
pub struct Thinning {
    most: usize,
    of: usize,
    /// How many came.
    count: usize,
    /// The next one that is kept: its number times `most`, at least.
    due: usize,
}

impl Thinning {
    /// Keeps `most` of `of`, or all where these are no more.
    #[must_use]
    pub const fn new(most: usize, of: usize) -> Self {
        Self { most, of, count: 0, due: 0 }
    }

    /// Whether the next one is kept.
    pub const fn keeps_next(&mut self) -> bool {
        let keeps = self.count * self.most >= self.due;
        if keeps {
            self.due += self.of;
        }
        self.count += 1;
        keeps
    }

    /// How many came, whether kept or not.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn kept(most: usize, of: usize) -> Vec<usize> {
        let mut thinning = Thinning::new(most, of);
        (0..of).filter(|_| thinning.keeps_next()).collect()
    }

    #[test]
    fn all_are_kept_where_there_is_room_and_else_as_many_as_there_is_room_for() {
        for most in 1..40 {
            for of in 0..100 {
                assert_eq!(kept(most, of).len(), most.min(of), "{most} of {of}");
            }
        }
    }

    #[test]
    fn what_is_kept_is_spread_evenly() {
        assert_eq!(kept(4, 10), [0, 3, 5, 8]);
        for (most, of) in [(7, 100), (128, 131), (13, 27)] {
            let kept = kept(most, of);
            let steps: Vec<usize> = kept.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let shortest = of / most;
            let even = steps.iter().all(|step| (shortest..=shortest + 1).contains(step));
            assert!(even && kept[0] == 0, "{most} of {of}: {kept:?}");
        }
    }
}
