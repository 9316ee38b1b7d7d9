//! The tables of the blind benchmark.

use serde_json::{Map, Value};

use super::super::drive::Capacity;
use super::super::report::{Table, counted};
use super::super::spec;
use super::{ASKED_SHARE, Found, MAX_PASSAGES, MAX_RPM, Outcome, Verdict};

/// Rights by speed and blades, and their sums as notes.
pub fn table(title: String, all: &[&Outcome], speeds: &[f64], counts: &[u8]) -> Table {
    let count = |f: &dyn Fn(&Outcome) -> bool| all.iter().filter(|o| f(o)).count();
    let owed = count(&|o| o.owed);
    let right = count(&|o| o.owed && o.found.verdict == Verdict::Right);
    let wrong = count(&|o| o.found.verdict == Verdict::Wrong);
    let named = count(&|o| o.found.verdict == Verdict::Right && blades_right(o));
    let any_right = count(&|o| o.found.verdict == Verdict::Right);
    let readings: usize = all.iter().map(|o| o.found.readings).sum();
    let wrong_readings: usize = all.iter().map(|o| o.found.wrong_readings).sum();
    let share = |part: usize, whole: usize| 100.0 * part as f64 / whole.max(1) as f64;
    let mut notes = vec![
        "right/recordings; !n: recordings with a wrong reading; brackets: no reading is owed"
            .to_owned(),
        format!("right where owed: {right} of {owed} ({:.1} %)", share(right, owed)),
        format!(
            "wrong anywhere: {wrong} of {}, by {wrong_readings} of their {readings} readings",
            all.len()
        ),
        format!("blade count right among right speeds: {:.1} %", share(named, any_right)),
    ];
    let too_fast = count(&|o| o.too_fast);
    if too_fast > 0 {
        let refused = all.iter().filter(|o| o.too_fast && o.found.verdict == Verdict::Refused);
        let reasons: Vec<&str> = refused.map(|o| o.found.reason.unwrap_or("not found")).collect();
        notes.push(format!(
            "above {MAX_PASSAGES} passages or {MAX_RPM} turns a minute: {} of {too_fast} refused; {}",
            reasons.len(),
            counted(reasons)
        ));
    }
    let mut columns = vec!["rpm".to_owned()];
    columns.extend(counts.iter().map(|n| format!("{n} blades")));
    let cell = |rpm: f64, blades: u8| {
        let here: Vec<_> = all.iter().filter(|o| o.rpm == rpm && o.blades == blades).collect();
        let of = |v: Verdict| here.iter().filter(|o| o.found.verdict == v).count();
        let wrong = of(Verdict::Wrong);
        let mark = if wrong > 0 { format!("!{wrong}") } else { String::new() };
        let text = format!("{}/{}{mark}", of(Verdict::Right), here.len());
        if here.iter().any(|o| o.owed) { text } else { format!("({text})") }
    };
    let rows = speeds
        .iter()
        .map(|&rpm| {
            let mut row = vec![format!("{rpm}")];
            row.extend(counts.iter().map(|&n| cell(rpm, n)));
            row
        })
        .collect();
    Table { title, notes, columns, rows }
}

/// Names the recording that was read wrongly.
pub fn wrong(o: &Outcome) -> Option<String> {
    (o.found.verdict == Verdict::Wrong).then(|| {
        let Outcome { rpm, blades, seed, found: Found { readings, wrong_readings, .. }, .. } = o;
        let (model, capacity) = (spec::model_name(o.model), o.capacity.as_str());
        format!(
            "wrong readings: {wrong_readings} of {readings}, {rpm} rpm, {blades} blades, seed {seed}, {model} model, {capacity} memory"
        )
    })
}

fn blades_right(o: &Outcome) -> bool {
    o.found.blades == Some(o.blades)
}

/// Names the recording of which a wrong number of blades was told beside the right speed; what was not counted is not wrong.
pub fn miscounted(o: &Outcome) -> Option<String> {
    let told = o.found.blades.filter(|_| o.found.verdict == Verdict::Right && !blades_right(o))?;
    let Outcome { rpm, blades, seed, .. } = o;
    let (model, capacity) = (spec::model_name(o.model), o.capacity.as_str());
    Some(format!(
        "wrong blade count: {told}, {rpm} rpm, {blades} blades, seed {seed}, {model} model, {capacity} memory"
    ))
}

/// Says how many are right with this memory where a reading is owed, if more is asked.
pub fn refused(all: &[Outcome], capacity: Capacity) -> Option<String> {
    let owed: Vec<_> = all.iter().filter(|o| o.capacity == capacity && o.owed).collect();
    let right = owed.iter().filter(|o| o.found.verdict == Verdict::Right).count();
    ((right as f64) < ASKED_SHARE * owed.len() as f64).then(|| {
        let (owed, capacity) = (owed.len(), capacity.as_str());
        format!("right where owed: {right} of {owed}, {capacity} memory; asked: {ASKED_SHARE}")
    })
}

/// For programs.
pub fn record(o: &Outcome) -> Map<String, Value> {
    let verdict = match o.found.verdict {
        Verdict::Right => "right",
        Verdict::Wrong => "wrong",
        Verdict::Refused => "refused",
    };
    let pairs: [(&str, Value); 12] = [
        ("rpm", o.rpm.into()),
        ("blades", o.blades.into()),
        ("model", spec::model_name(o.model).into()),
        ("seed", o.seed.into()),
        ("capacity", o.capacity.as_str().into()),
        ("owed", o.owed.into()),
        ("too_fast", o.too_fast.into()),
        ("verdict", verdict.into()),
        ("readings", o.found.readings.into()),
        ("wrong_readings", o.found.wrong_readings.into()),
        ("blades_right", blades_right(o).into()),
        ("reason", o.found.reason.into()),
    ];
    pairs.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
}

#[cfg(test)]
mod tests {
    use evtach_host::synth::Model;

    use super::super::super::report::Report;
    use super::super::super::report::tests::assert_readable;
    use super::super::super::score::Scores;
    use super::super::judge;
    use super::super::tests::{refused, told};
    use super::*;

    #[test]
    fn a_wrong_blade_count_beside_a_right_speed_is_named() {
        let named = |blades, scored: &[Scores]| {
            let found = judge(scored, &scored[0], None);
            let outcome = Outcome {
                rpm: 3000.0,
                blades,
                model: Model::Edge,
                seed: 1,
                capacity: Capacity::Device,
                owed: true,
                too_fast: false,
                found,
            };
            miscounted(&outcome)
        };
        let uncounted = || {
            let mut scores = told(0.001);
            scores.rotors.iter_mut().flatten().for_each(|score| score.blades = None);
            scores
        };
        let short = "wrong blade count: 3, 3000 rpm, 6 blades, seed 1, edge model, device memory";
        assert_eq!(named(6, &[told(0.001)]).as_deref(), Some(short));
        // Nor is it named twice where the speed is wrong, too.
        for (blades, scores) in [(3, told(0.001)), (6, uncounted()), (6, told(0.5))] {
            assert_eq!(named(blades, &[scores]), None);
        }
    }

    #[test]
    fn programs_and_people_read_the_same() {
        let outcome = |rpm, too_fast: bool, last: Scores| Outcome {
            rpm,
            blades: 3,
            model: Model::Edge,
            seed: 1,
            capacity: Capacity::Full,
            owed: !too_fast,
            too_fast,
            found: judge(&[], &last, Some("no_rotation")),
        };
        let outcomes = [
            outcome(3000.0, false, told(0.001)),
            outcome(60_000.0, true, refused("too_fast")),
            outcome(60_000.0, true, refused("too_fast")),
            outcome(60_000.0, true, Scores::default()),
        ];
        assert_eq!(super::refused(&outcomes, Capacity::Full), None);
        let half = [outcome(3000.0, false, told(0.001)), outcome(60.0, false, Scores::default())];
        let short = super::refused(&half, Capacity::Full).unwrap_or_default();
        assert_eq!(short, "right where owed: 1 of 2, full memory; asked: 0.99");
        let all: Vec<&Outcome> = outcomes.iter().collect();
        let table = table("blind".to_owned(), &all, &[3000.0, 60_000.0], &[3]);
        assert_eq!(
            table.rows,
            [["3000", "1/1"], ["60000", "(0/3)"]].map(|row| row.map(str::to_owned).to_vec())
        );
        let of_fast = "above 150000 passages or 60000 turns a minute: 3 of 3 refused; too_fast 2, no_rotation 1";
        assert!(table.notes.iter().any(|note| note == of_fast), "{:?}", table.notes);
        let records = outcomes.iter().map(record).collect();
        assert_readable(&Report {
            name: "blind",
            tables: vec![table],
            records,
            ..Report::default()
        });
    }
}
