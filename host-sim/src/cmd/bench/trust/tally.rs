//! Sums over the trials.

use std::ops::RangeInclusive;

use evtach_firmware::instrument::SATURATION_EV_S;
use serde_json::{Map, Value};

use super::super::drive::Capacity;
use super::super::report::{Report, Table, counted};
use super::super::spec::{MODELS, model_name};
use super::{Outcome, Spoken, Trial, off_sigmas};

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
    /// The same where the device would not have its camera leave out events.
    owed_live: usize,
    owed_live_refused: usize,
    with_sigma: usize,
    beyond_6: usize,
    last_with_sigma: usize,
    last_within_95: usize,
    last_beyond_6: usize,
    /// Why each rotor that was not read was refused.
    reasons: Vec<String>,
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
        self.with_sigma += outcome.with_sigma;
        self.beyond_6 += outcome.beyond_6;
        for rotor in &outcome.rotors {
            self.add_rotor(rotor, outcome);
            if trial.events_per_s <= f64::from(SATURATION_EV_S) {
                self.owed_live += usize::from(rotor.owed);
                self.owed_live_refused += usize::from(rotor.owed && rotor.error.is_none());
            }
        }
    }

    fn add_rotor(&mut self, rotor: &Spoken, outcome: &Outcome) {
        self.rotors += 1;
        self.owed += usize::from(rotor.owed);
        self.locked += usize::from(rotor.locked);
        let Some(error) = rotor.error else {
            self.owed_refused += usize::from(rotor.owed);
            let reason = rotor.reason.as_ref().or(outcome.reason.as_ref());
            self.reasons.push(reason.map_or("not found", String::as_str).to_owned());
            return;
        };
        self.read += 1;
        if let Some(off) = off_sigmas(error, rotor.sigma) {
            self.last_with_sigma += 1;
            self.last_within_95 += usize::from(off <= 1.96);
            self.last_beyond_6 += usize::from(off > 6.0);
        }
    }

    fn lines(&self) -> [Line; 11] {
        let line = |key, name, count, of, asked| Line { key, name, count, of, asked };
        let turning_scenes = self.scenes - self.still_scenes;
        [
            line("wrong", "speeds more than 1 % off, all readings", self.wrong, self.speeds, NONE),
            line(
                "ghosts",
                "speeds where no rotor is, beside one",
                self.ghosts,
                turning_scenes,
                NONE,
            ),
            line(
                "ghost_scenes",
                "still scenes with any speed",
                self.ghost_scenes,
                self.still_scenes,
                NONE,
            ),
            line(
                "beyond_6_sigma",
                "beyond 6 sigma, all readings",
                self.beyond_6,
                self.with_sigma,
                None,
            ),
            line(
                "last_beyond_6_sigma",
                "beyond 6 sigma, last reading",
                self.last_beyond_6,
                self.last_with_sigma,
                Some(("at most 1 in 2000", 0.0..=1.0 / 2000.0)),
            ),
            line(
                "last_within_1_96_sigma",
                "truth within 1.96 sigma, last reading",
                self.last_within_95,
                self.last_with_sigma,
                Some(("92 to 98 %", 0.92..=0.98)),
            ),
            line(
                "owed_refused",
                "refused although a reading is owed",
                self.owed_refused,
                self.owed,
                Some(("at most 3 %", 0.0..=0.03)),
            ),
            line(
                "owed_live_refused",
                "of those at 1.5 Mev/s or less",
                self.owed_live_refused,
                self.owed_live,
                None,
            ),
            line("read", "rotors read", self.read, self.rotors, Some(("at least 60 %", 0.6..=1.0))),
            line("locked", "of these locked", self.locked, self.read, None),
            line("refused", "rotors refused", self.rotors - self.read, self.rotors, None),
        ]
    }
}

/// A row of the table.
struct Line {
    /// Its name in records; `KEY_of` is the whole.
    key: &'static str,
    name: &'static str,
    count: usize,
    of: usize,
    asked: Asked,
}

/// What is asked of a share, in words and in numbers.
type Asked = Option<(&'static str, RangeInclusive<f64>)>;

// A line's name says it.
const _: () = assert!(SATURATION_EV_S == 1_500_000);
const NONE: Asked = Some(("none", 0.0..=0.0));
/// Scenes from which on a share tells.
const ENOUGH_SCENES: usize = 1000;

impl Line {
    fn share(&self) -> f64 {
        self.count as f64 / self.of.max(1) as f64
    }

    /// Says what is asked, where the share is not that.
    fn short(&self) -> Option<String> {
        let Self { name, count, of, asked, .. } = self;
        let (text, range) = asked.as_ref()?;
        (!range.contains(&self.share())).then(|| format!("{name}: {count} of {of}; asked: {text}"))
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

/// The report over all trials: for each capacity a table of all, and one for each event model.
pub fn report(trials: &[Trial]) -> Report {
    let short = trials.iter().flat_map(wrong).collect();
    let mut report = Report { name: "trust", short, ..Report::default() };
    for model in std::iter::once(None).chain(MODELS.map(Some)) {
        for capacity in Capacity::ALL {
            let mut tally = Tally::default();
            for trial in trials.iter().filter(|t| model.is_none_or(|model| t.model == model)) {
                let of = trial.results.iter().filter(|o| o.capacity == capacity.as_str());
                of.for_each(|outcome| tally.add(trial, outcome));
            }
            if model.is_none() && tally.scenes >= ENOUGH_SCENES {
                let short = tally.lines().into_iter().filter_map(|line| line.short());
                report.short.extend(short.map(|s| format!("{} memory: {s}", capacity.as_str())));
            }
            let model = model.map_or("both", model_name);
            report.tables.push(table(&tally, model, capacity));
            report.records.push(record(&tally, model, capacity));
        }
    }
    report
}

fn table(tally: &Tally, model: &str, capacity: Capacity) -> Table {
    let mut notes = Vec::new();
    if !tally.reasons.is_empty() {
        let reasons = counted(tally.reasons.iter().map(String::as_str));
        notes.push(format!("reasons of the refused: {reasons}"));
    }
    let rows = tally.lines().map(|line| {
        let share = format!("{:.2} %", 100.0 * line.share());
        let asked = line.asked.map_or("", |(text, _)| text);
        vec![
            line.name.to_owned(),
            line.count.to_string(),
            line.of.to_string(),
            share,
            asked.to_owned(),
        ]
    });
    Table {
        title: format!(
            "trust: {} random scenes [{model} model{}, {} memory]",
            tally.scenes,
            if model == "both" { "s" } else { "" },
            capacity.as_str()
        ),
        notes,
        columns: ["", "count", "of", "share", "asked for"].map(str::to_owned).to_vec(),
        rows: rows.into(),
    }
}

fn record(tally: &Tally, model: &str, capacity: Capacity) -> Map<String, Value> {
    let mut record = Map::new();
    record.insert("model".to_owned(), model.into());
    record.insert("capacity".to_owned(), capacity.as_str().into());
    record.insert("scenes".to_owned(), tally.scenes.into());
    for Line { key, count, of, .. } in tally.lines() {
        record.insert(key.to_owned(), count.into());
        record.insert(format!("{key}_of"), of.into());
    }
    record
}

#[cfg(test)]
mod tests {
    use evtach_host::synth::Model;

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
            with_sigma: 3,
            beyond_6: 2,
            reason: Some("no_rotation".to_owned()),
            rotors,
        };
        let rotors = vec![
            spoken(Some(1e-4), 1e-4, true),
            spoken(Some(-7e-4), 1e-4, true),
            spoken(None, 0.0, true),
            spoken(None, 0.0, false),
        ];
        let turning = Trial {
            trial: 0,
            model: Model::Edge,
            rotors: 4,
            events_per_s: 1.5e6,
            results: vec![outcome(0, rotors)],
        };
        let still = Trial {
            trial: 1,
            model: Model::Threshold,
            rotors: 0,
            events_per_s: 1e5,
            results: vec![outcome(2, Vec::new())],
        };
        let mut tally = Tally::default();
        for trial in [&turning, &still] {
            tally.add(trial, &trial.results[0]);
        }
        assert_eq!((tally.read, tally.owed, tally.owed_refused), (2, 3, 1));
        assert_eq!((tally.owed_live, tally.owed_live_refused), (3, 1));
        let last = (tally.last_within_95, tally.last_beyond_6, tally.last_with_sigma);
        assert_eq!(last, (1, 1, 2));
        assert_eq!((tally.beyond_6, tally.with_sigma), (4, 6));
        assert_eq!((tally.ghost_scenes, tally.still_scenes, tally.ghosts), (1, 1, 0));
        assert_eq!(tally.reasons, ["no_rotation"; 2]);
        let short: Vec<_> = tally.lines().into_iter().filter_map(|line| line.short()).collect();
        let refused = "refused although a reading is owed: 1 of 3; asked: at most 3 %";
        assert!(short.len() == 5 && short.contains(&refused.to_owned()), "{short:?}");
        tally.add(&Trial { events_per_s: 1.6e6, ..turning.clone() }, &turning.results[0]);
        assert_eq!((tally.owed, tally.owed_live), (6, 3));
        assert_eq!(wrong(&turning).count(), 0);
        let named: Vec<_> = wrong(&still).collect();
        assert!(named.len() == 1 && named[0].contains("--show 1 "), "{named:?}");
        let report = report(&[turning, still]);
        assert_readable(&report);
        let of = |model: &str, key: &str| {
            let is = |r: &&Map<String, Value>| r["model"] == model && r["capacity"] == "full";
            report.records.iter().find(is).and_then(|r| r[key].as_u64())
        };
        assert_eq!(of("both", "scenes"), Some(2));
        assert_eq!((of("edge", "read"), of("edge", "ghost_scenes")), (Some(2), Some(0)));
        assert_eq!((of("threshold", "read"), of("threshold", "ghost_scenes")), (Some(0), Some(1)));
    }
}
