//! The tables of the accuracy benchmark.

use evtach_host::synth::Model;

use super::super::drive::Capacity;
use super::super::report::{Table, short};
use super::super::spec::{BLADES, DISTANCES_CM, Mount};
use super::cells::{Cells, Key, ModelKey, Place, Stage, Window};

/// One column: its head, and where its value comes from.
type Column = (&'static str, Window, bool, Stage);
/// One row: its name, and the places it averages over.
type Row = (String, Vec<Place>);

const STAGES: [Column; 9] = [
    ("initial", Window::Paper, false, Stage::Initial),
    ("refined", Window::Paper, false, Stage::Refined),
    ("further", Window::Paper, false, Stage::Further),
    ("lock", Window::Paper, false, Stage::Lock),
    ("reading 150 ms", Window::Paper, false, Stage::Reading),
    ("bound", Window::Paper, false, Stage::Bound),
    ("reading", Window::Adaptive, false, Stage::Reading),
    ("own", Window::Adaptive, false, Stage::Own),
    ("bound", Window::Adaptive, false, Stage::Bound),
];

const HANDHELD: [Column; 10] = [
    ("initial", Window::Paper, false, Stage::Initial),
    ("refined", Window::Paper, false, Stage::Refined),
    ("further", Window::Paper, false, Stage::Further),
    ("lock", Window::Paper, false, Stage::Lock),
    ("reading 150 ms", Window::Paper, false, Stage::Reading),
    ("reading", Window::Adaptive, false, Stage::Reading),
    ("bound", Window::Adaptive, false, Stage::Bound),
    ("room", Window::Adaptive, false, Stage::Room),
    ("room, gyro", Window::Adaptive, true, Stage::Room),
    ("roll", Window::Adaptive, false, Stage::Roll),
];

/// What a column is compared with: the head of the quotient, and its two columns.
type Limit = (&'static str, Column, Column);

/// All that the rotor's events hold, which any reading may reach.
const BOUND: Limit = (
    "x bound",
    ("", Window::Adaptive, false, Stage::Own),
    ("", Window::Adaptive, false, Stage::Bound),
);
/// What no method that only sees the rotor knows of its speed in the room.
const ROLL: Limit = (
    "x roll",
    ("", Window::Adaptive, false, Stage::Room),
    ("", Window::Adaptive, false, Stage::Roll),
);
/// The speed in rpm from which the paper's 150 ms hold more than a turn: a mean of its own, as slower ones rule the mean
/// over all, or have no reading in that window and so leave none.
pub const FAST_RPM: u32 = 600;
/// Quotient up to which a cell is near its limit.
const NEAR: f64 = 3.0;

/// All tables: one of each kind for each event model and capacity.
pub fn tables(cells: &Cells, models: &[Model], seeds: u64) -> Vec<Table> {
    let mut tables = Vec::new();
    for &model in models {
        for capacity in Capacity::ALL {
            let view = View { cells, model: model.into(), capacity, seeds };
            tables.extend(view.tables());
        }
    }
    tables
}

struct View<'a> {
    cells: &'a Cells,
    model: ModelKey,
    capacity: Capacity,
    seeds: u64,
}

impl View<'_> {
    fn tables(&self) -> Vec<Table> {
        let mut tables = Vec::new();
        for (mount, title, columns) in [
            (Mount::Fixed, "fixed camera", &STAGES[..]),
            (Mount::Handheld, "handheld, before a textured wall", &HANDHELD),
            (Mount::Vibrating, "vibrating host", &STAGES),
        ] {
            let rows = self.speeds(mount);
            if rows.iter().all(|(_, places)| !places.is_empty()) {
                tables.push(self.table(title, columns, &rows));
            }
        }
        let distances: Vec<u32> = DISTANCES_CM.iter().map(|d| *d as u32).collect();
        for mount in [Mount::Fixed, Mount::Handheld] {
            let row = |cm: &u32| (format!("{cm} cm"), self.averaged(mount, 3, *cm));
            let rows: Vec<Row> = distances.iter().map(row).collect();
            if rows.iter().all(|(_, places)| !places.is_empty()) {
                let title = format!("distance, {}, mean over the speeds", mount.as_str());
                let columns: &[Column] = if mount == Mount::Fixed { &STAGES } else { &HANDHELD };
                tables.push(self.table(&title, columns, &rows));
            }
        }
        let row = |n: &u8| (format!("{n} blades"), self.averaged(Mount::Fixed, *n, 40));
        let rows: Vec<Row> = BLADES.iter().map(row).collect();
        if rows.iter().all(|(_, places)| !places.is_empty()) {
            tables.push(self.table("blades, fixed, mean over the speeds", &STAGES, &rows));
        }
        if self.cells.places().contains(&Place::Quad) {
            let drone = ("drone".to_owned(), vec![Place::Quad]);
            tables.push(self.table("four rotors", &STAGES, &[drone]));
        }
        tables
    }

    /// A row for each speed that was measured, and their means.
    fn speeds(&self, mount: Mount) -> Vec<Row> {
        let all = self.averaged(mount, 3, 40);
        let one = |place: &Place| match place {
            Place::One { rpm, .. } => (format!("{rpm} rpm"), vec![*place]),
            Place::Quad => ("drone".to_owned(), vec![*place]),
        };
        let is_fast = |p: &&Place| matches!(p, Place::One { rpm, .. } if *rpm >= FAST_RPM);
        let fast = all.iter().filter(is_fast).copied().collect();
        let mut rows: Vec<Row> = all.iter().map(one).collect();
        rows.push((format!("mean from {FAST_RPM} rpm"), fast));
        rows.push(("mean".to_owned(), all));
        rows
    }

    /// The places of all speeds under the same conditions.
    fn averaged(&self, mount: Mount, blades: u8, distance_cm: u32) -> Vec<Place> {
        let wanted = |place: &Place| {
            matches!(place, Place::One { blades: b, distance_cm: d, mount: m, .. }
                if (*b, *d, *m) == (blades, distance_cm, mount))
        };
        self.cells.places().into_iter().filter(wanted).collect()
    }

    fn key(&self, place: Place, window: Window, gyro: bool) -> Key {
        Key { place, model: self.model, capacity: self.capacity, window, gyro }
    }

    /// Mean over the places, `None` where any of them has no value.
    fn mean(&self, places: &[Place], (_, window, gyro, stage): &Column) -> Option<f64> {
        let keys: Vec<Key> = places.iter().map(|p| self.key(*p, *window, *gyro)).collect();
        self.cells.mean(&keys, *stage)
    }

    fn table(&self, title: &str, columns: &[Column], rows: &[Row]) -> Table {
        let mut notes = vec![
            "RMAE in permille; bound: sqrt(12) jitter / (window sqrt(rotor events)); own: clock error taken out; x bound: own over bound"
                .to_owned(),
        ];
        let mut heads = vec![String::new()];
        heads.extend(columns.iter().map(|c| c.0.to_owned()));
        let rolls = columns.iter().any(|(_, _, _, stage)| *stage == Stage::Roll);
        let limits: &[Limit] = if rolls { &[BOUND, ROLL] } else { &[BOUND] };
        heads.extend(limits.iter().map(|(head, _, _)| (*head).to_owned()));
        heads.push("no reading".to_owned());
        let times = |places: &[Place], (_, of, limit): &Limit| {
            Some(self.mean(places, of)? / self.mean(places, limit)?)
        };
        let cells = rows.iter().map(|(name, places)| {
            let mut cells = vec![name.clone()];
            let value = |c: &Column| self.mean(places, c).map_or_else(|| "-".to_owned(), short);
            cells.extend(columns.iter().map(value));
            let shown = |limit| times(places, limit).map_or("-".to_owned(), |t| format!("{t:.1}"));
            cells.extend(limits.iter().map(shown));
            let missing = |p: &Place| {
                let key = self.key(*p, Window::Adaptive, false);
                self.cells.get(&key, Stage::Reading).map_or(0, |s| s.missing())
            };
            cells.push(places.iter().map(missing).sum::<u32>().to_string());
            cells
        });
        let cells: Vec<Vec<String>> = cells.collect();
        for limit in limits {
            let is_far = |(_, places): &&Row| times(places, limit).is_some_and(|t| t > NEAR);
            let far: Vec<&str> = rows.iter().filter(is_far).map(|(name, _)| &**name).collect();
            if !far.is_empty() {
                notes.push(format!("{} above {NEAR}: {}", limit.0, far.join(", ")));
            }
        }
        let title = format!(
            "{title} [{} model, {} memory, {} seeds]",
            self.model.as_str(),
            self.capacity.as_str(),
            self.seeds
        );
        Table { title, notes, columns: heads, rows: cells }
    }
}

#[cfg(test)]
mod tests {
    use evtach_host::synth::{Motion, Scene};

    use super::super::super::report::Report;
    use super::super::super::report::tests::assert_readable;
    use super::super::super::score::Score;
    use super::super::cells::Sample;
    use super::*;

    #[test]
    fn slow_speeds_without_a_reading_leave_a_mean_of_the_fast_ones() {
        let (scene, mut cells) = (Scene::default(), Cells::default());
        let motion = Motion::new(&scene);
        for (rpm, camera) in [(300, None), (600, Some(1e-4)), (1200, Some(3e-4))] {
            let place = Place::One { rpm, blades: 3, distance_cm: 40, mount: Mount::Fixed };
            let score = Score { camera, window_s: 0.15, ..Score::default() };
            let sample = Sample::new(score, &scene, &motion, 1e6);
            for window in [Window::Paper, Window::Adaptive] {
                for capacity in Capacity::ALL {
                    let key = Key { place, model: ModelKey::Edge, capacity, window, gyro: false };
                    cells.add(key, &sample);
                }
            }
        }
        let tables = tables(&cells, &[Model::Edge], 1);
        assert_eq!(tables.len(), 2);
        let column = tables[0].columns.iter().position(|head| head == "reading 150 ms");
        let read = |name: &str| {
            let row = tables[0].rows.iter().find(|row| row[0] == name);
            row.zip(column).map_or("none", |(row, column)| row[column].as_str())
        };
        assert_eq!((read("300 rpm"), read("600 rpm"), read("1200 rpm")), ("-", "0.100", "0.300"));
        assert_eq!((read("mean from 600 rpm"), read("mean")), ("0.200", "-"));
        let records = cells.records();
        assert_readable(&Report { name: "accuracy", tables, records, ..Report::default() });
    }
}
