//! Sums over the trials.

use serde_json::{Map, Value};

use super::super::drive::Capacity;
use super::super::report::{Report, Table};
use super::{Outcome, Spoken, Trial};

/// What one capacity made of all trials.
#[derive(Debug, Default)]
struct Tally {
    scenes: usize,
    still_scenes: usize,
    /// Still scenes with any speed.
    ghost_scenes: usize,
    /// Speeds where no rotor is, in scenes that have one elsewhere.
    ghosts: usize,
    speeds: usize,
    wrong: usize,
    rotors: usize,
    read: usize,
    locked: usize,
    owed: usize,
    owed_refused: usize,
    within_95: usize,
    beyond_6: usize,
    with_sigma: usize,
    reasons: Vec<(String, usize)>,
}

impl Tally {
    fn add(&mut self, trial: &Trial, outcome: &Outcome) {
        self.scenes += 1;
        if trial.rotors == 0 {
            self.still_scenes += 1;
            self.ghost_scenes += usize::from(outcome.ghosts > 0);
        } else {
            self.ghosts += outcome.ghosts;
        }
        self.speeds += outcome.speeds;
        self.wrong += outcome.wrong;
        for rotor in &outcome.rotors {
            self.add_rotor(rotor, outcome);
        }
    }

    fn add_rotor(&mut self, rotor: &Spoken, outcome: &Outcome) {
        self.rotors += 1;
        self.owed += usize::from(rotor.owed);
        self.locked += usize::from(rotor.locked);
        let Some(error) = rotor.error else {
            self.owed_refused += usize::from(rotor.owed);
            let reason = rotor.reason.as_ref().or(outcome.reason.as_ref());
            let name = reason.map_or("not found", String::as_str);
            match self.reasons.iter_mut().find(|(n, _)| n == name) {
                Some((_, count)) => *count += 1,
                None => self.reasons.push((name.to_owned(), 1)),
            }
            return;
        };
        self.read += 1;
        if let Some(sigma) = rotor.sigma.filter(|s| *s > 0.0) {
            let z = (error / sigma).abs();
            self.with_sigma += 1;
            self.within_95 += usize::from(z <= 1.96);
            self.beyond_6 += usize::from(z > 6.0);
        }
    }

    /// Name, count, whole, and the limit that is asked for.
    fn lines(&self) -> [(&'static str, usize, usize, &'static str); 9] {
        [
            ("speeds more than 1 % off, all readings", self.wrong, self.speeds, "none"),
            (
                "speeds where no rotor is, beside one",
                self.ghosts,
                self.scenes - self.still_scenes,
                "none",
            ),
            ("still scenes with any speed", self.ghost_scenes, self.still_scenes, "none"),
            ("beyond 6 sigma", self.beyond_6, self.with_sigma, "at most 1 in 2000"),
            ("truth within 1.96 sigma", self.within_95, self.with_sigma, "92 to 98 %"),
            ("refused although a reading is owed", self.owed_refused, self.owed, "at most 3 %"),
            ("rotors read", self.read, self.rotors, "at least 60 %"),
            ("of these locked", self.locked, self.read, ""),
            ("rotors refused", self.rotors - self.read, self.rotors, ""),
        ]
    }
}

/// Names the scene where speeds were wrong, or were told where no rotor is.
fn wrong(trial: &Trial) -> impl Iterator<Item = String> + '_ {
    let of = |outcome: &Outcome| {
        let Outcome { capacity, wrong, speeds, ghosts, .. } = outcome;
        (wrong + ghosts > 0).then(|| {
            format!(
                "wrong readings: {wrong} of {speeds} speeds more than 1 % off, {ghosts} where no rotor is, {capacity} memory; \
                 bench trust --show {} prints the scene",
                trial.trial
            )
        })
    };
    trial.results.iter().filter_map(of)
}

/// The report over all trials.
pub fn report(trials: &[Trial]) -> Report {
    let wrong = trials.iter().flat_map(wrong).collect();
    let mut report = Report { name: "trust", wrong, ..Report::default() };
    for capacity in Capacity::ALL {
        let mut tally = Tally::default();
        for trial in trials {
            let of = trial.results.iter().filter(|o| o.capacity == capacity.as_str());
            of.for_each(|outcome| tally.add(trial, outcome));
        }
        let percent = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
        let mut record = Map::new();
        record.insert("capacity".to_owned(), capacity.as_str().into());
        record.insert("scenes".to_owned(), tally.scenes.into());
        let mut rows = Vec::new();
        for (name, part, whole, limit) in tally.lines() {
            let share = format!("{:.2} %", percent(part, whole));
            rows.push(vec![
                name.to_owned(),
                part.to_string(),
                whole.to_string(),
                share,
                limit.to_owned(),
            ]);
            record.insert(name.replace(' ', "_"), Value::from(part));
            record.insert(format!("{}_of", name.replace(' ', "_")), Value::from(whole));
        }
        tally.reasons.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let reasons: Vec<String> = tally.reasons.iter().map(|(n, c)| format!("{n} {c}")).collect();
        let notes = vec![format!("reasons of the refused: {}", reasons.join(", "))];
        let columns = ["", "count", "of", "share", "asked for"].map(str::to_owned).to_vec();
        let title = format!("trust: {} random scenes [{} memory]", tally.scenes, capacity.as_str());
        report.tables.push(Table { title, notes, columns, rows });
        report.records.push(record);
    }
    report
}

#[cfg(test)]
mod tests {
    use super::super::super::report::tests::assert_readable;
    use super::*;

    fn spoken(error: Option<f64>, sigma: f64, owed: bool) -> Spoken {
        Spoken { owed, error, sigma: error.map(|_| sigma), locked: true, reason: None }
    }

    #[test]
    fn sums_are_right() {
        let outcome = |ghosts, rotors: Vec<Spoken>| Outcome {
            capacity: "full".to_owned(),
            ghosts,
            speeds: rotors.len(),
            wrong: 0,
            reason: Some("no_rotation".to_owned()),
            rotors,
        };
        let rotors = vec![
            spoken(Some(1e-4), 1e-4, true),
            spoken(Some(-7e-4), 1e-4, true),
            spoken(None, 0.0, true),
            spoken(None, 0.0, false),
        ];
        let turning = Trial { trial: 0, rotors: 4, results: vec![outcome(0, rotors)] };
        let still = Trial { trial: 1, rotors: 0, results: vec![outcome(2, Vec::new())] };
        let mut tally = Tally::default();
        for trial in [&turning, &still] {
            tally.add(trial, &trial.results[0]);
        }
        assert_eq!((tally.read, tally.owed, tally.owed_refused), (2, 3, 1));
        assert_eq!((tally.within_95, tally.beyond_6, tally.with_sigma), (1, 1, 2));
        assert_eq!((tally.ghost_scenes, tally.still_scenes, tally.ghosts), (1, 1, 0));
        assert_eq!(tally.reasons, vec![("no_rotation".to_owned(), 2)]);
        assert_eq!(wrong(&turning).count(), 0);
        let named: Vec<_> = wrong(&still).collect();
        assert!(named.len() == 1 && named[0].contains("--show 1 "), "{named:?}");
        assert_readable(&report(&[turning, still]));
    }
}
