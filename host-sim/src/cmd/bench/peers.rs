//! `evtach bench peers`: the conditions under which other methods were measured on one machine, their figures beside ours.
//!
//! Recordings of one second, three blades, radius 45 px (24 px at 20 000 rpm), 40 us jitter. The camera's clock is exact: an error drawn
//! from 15 ppm, as the standard scene's, is in no recording to be seen, and would be most of what is compared. Four conditions: plain;
//! tilted so that the disc appears at three quarters of its width; shaken by 3 px; low light (200 us jitter, 5 Hz/px noise). The other
//! methods were partly told the speed or the region; nothing is typed in here. Their figures are two-seed means from synthetic recordings
//! made to the same description, not a rerun. Those were made by an edge model; here both event models are asked, each on its own, as no
//! camera is quite like either.

use evtach_core::{Geometry, Settings};
use evtach_host::synth::{Model, Motion, Rotor, Scene, generate};
use rand::{Rng as _, SeedableRng as _};
use rayon::prelude::*;
use serde_json::{Map, Value};

use super::Common;
use super::drive::{Capacity, overall, readings};
use super::report::{Report, Table, progress, short};
use super::score::score;
use super::spec;

/// Names of the other methods, in the order of [`PUBLISHED`].
const METHODS: [&str; 5] =
    ["frequency_cam", "HelixTrack", "EEPPR 100 us", "EEPPR 20 us", "jAER RpmMeter"];

/// Mean error in ppm of the other methods; NaN: more than 20 % off, or no reading.
const PUBLISHED: [(&str, f64, [f64; 5]); 16] = {
    const FAIL: f64 = f64::NAN;
    [
        ("base", 300.0, [15.0, 427.0, 495.0, 67.0, 195_451.0]),
        ("base", 1500.0, [63.0, 146.0, 2222.0, 495.0, 128.0]),
        ("base", 6000.0, [1600.0, 140.0, 8924.0, 1003.0, 3322.0]),
        ("base", 20_000.0, [8064.0, FAIL, 5974.0, 5974.0, 1323.0]),
        ("tilt", 300.0, [19.0, 157.0, 495.0, 49.0, FAIL]),
        ("tilt", 1500.0, [101.0, 23.0, 2222.0, 495.0, 460.0]),
        ("tilt", 6000.0, [1450.0, FAIL, 8924.0, 1003.0, 2366.0]),
        ("tilt", 20_000.0, [18_820.0, FAIL, 5974.0, FAIL, 1289.0]),
        ("handheld", 300.0, [FAIL, 161.0, FAIL, FAIL, 180_963.0]),
        ("handheld", 1500.0, [1268.0, 33.0, FAIL, 6571.0, 1470.0]),
        ("handheld", 6000.0, [2348.0, 121.0, FAIL, 1003.0, 2692.0]),
        ("handheld", 20_000.0, [17_294.0, FAIL, FAIL, FAIL, 1301.0]),
        ("low light", 300.0, [111.0, 635.0, 495.0, 175.0, 197_569.0]),
        ("low light", 1500.0, [2310.0, 163.0, 2222.0, 630.0, 661.0]),
        ("low light", 6000.0, [24_805.0, 111.0, FAIL, 3047.0, 471.0]),
        ("low light", 20_000.0, [FAIL, 177_552.0, FAIL, FAIL, 1482.0]),
    ]
};

/// Beyond this a method counts as failed, in ppm.
const FAIL_PPM: f64 = 200_000.0;
/// Errors up to this are good whatever the others do, in ppm.
const GOOD_PPM: f64 = 15.0;

/// Arguments of `evtach bench peers`.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub common: Common,
    /// Seeds a cell.
    #[arg(long)]
    seeds: Option<u64>,
    /// Only this event model.
    #[arg(long, value_enum)]
    model: Option<Model>,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> anyhow::Result<Report> {
    let quick = args.common.quick;
    let seeds = args.seeds.unwrap_or(if quick { 1 } else { 10 });
    let first = spec::first_seed(args.common.tuning);
    let cells: Vec<usize> =
        (0..PUBLISHED.len()).filter(|i| !quick || PUBLISHED[*i].1 == 1500.0).collect();
    let models = spec::models(args.model);
    let jobs: Vec<(Model, usize, u64)> = models
        .iter()
        .flat_map(|&model| cells.iter().map(move |&cell| (model, cell)))
        .flat_map(|(model, cell)| (first..first + seeds).map(move |seed| (model, cell, seed)))
        .collect();
    let bar = progress(jobs.len(), "peers");
    let measured = jobs
        .par_iter()
        .map(|&(model, cell, seed)| {
            let (condition, rpm, _) = PUBLISHED[cell];
            let errors = measure(&scene(condition, rpm, model, seed));
            bar.inc(1);
            errors.map(|errors| (model, cell, errors))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    bar.finish_and_clear();
    let mut report = Report { name: "peers", ..Report::default() };
    for model in models {
        let rows = cells.iter().map(|&cell| {
            let of = |i: usize| {
                let these = measured.iter().filter(|(m, c, _)| (*m, *c) == (model, cell));
                // A seed without a reading fails the whole cell: a NaN stays one.
                these.map(|(_, _, errors)| errors[i]).sum::<f64>() / seeds as f64
            };
            Row { cell, full_ppm: of(0), device_ppm: of(1) }
        });
        let rows: Vec<Row> = rows.collect();
        report.tables.push(table(&rows, model, seeds));
        report.records.extend(rows.iter().map(|row| row.record(model)));
        report.short.extend(rows.iter().flat_map(|row| row.failed(model)));
        // One seed tells little.
        if !quick {
            report.short.extend(rows.iter().filter_map(|row| row.short(model)));
        }
    }
    Ok(report)
}

fn scene(condition: &str, rpm: f64, model: Model, seed: u64) -> Scene {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let mut scene = Scene { model, seed, duration_ms: 1000.0, ..Scene::default() };
    // The others were compared on one clock, and this table tells of methods, not of clocks.
    scene.clock.error_ppm = Some(0.0);
    scene.rotors = vec![Rotor {
        x_px: 173.0 + rng.random_range(-6.0..6.0),
        y_px: 130.0 + rng.random_range(-6.0..6.0),
        rpm: rpm * rng.random_range(0.97..1.03),
        radius_px: if rpm > 10_000.0 { 24.0 } else { 45.0 },
        ..Rotor::default()
    }];
    match condition {
        "tilt" => {
            scene.rotors[0].tilt_deg = 0.75f64.acos().to_degrees();
            scene.rotors[0].tilt_axis_deg = rng.random_range(0.0..180.0);
        }
        "handheld" => scene.camera.tremor_px = 3.0,
        "low light" => {
            scene.sensor.jitter_us = 200.0;
            scene.sensor.noise_hz = 5.0;
        }
        _ => {}
    }
    scene
}

/// Error in ppm of the reading over a recording at either capacity; NaN: no reading, or far off.
fn measure(scene: &Scene) -> anyhow::Result<[f64; 2]> {
    let made = generate(scene)?;
    let motion = Motion::new(scene);
    let Some(geometry) = Geometry::new(scene.width_px, scene.height_px) else {
        anyhow::bail!("the scene's sensor is larger than the tachometer's");
    };
    Ok(Capacity::ALL.map(|capacity| {
        let settings = Settings::new(geometry);
        let series = readings(&made.events, &[], settings, capacity);
        let end_us = (scene.duration_s() * 1e6) as u64;
        let reading = overall(&series, end_us, settings.clock_sigma_ppm);
        let scores = reading.map(|r| score(scene, &motion, &r)).unwrap_or_default();
        let error = scores.rotors.first().and_then(|s| s.as_ref()?.camera).unwrap_or(f64::NAN);
        let ppm = error.abs() * 1e6;
        if ppm > FAIL_PPM { f64::NAN } else { ppm }
    }))
}

struct Row {
    cell: usize,
    full_ppm: f64,
    device_ppm: f64,
}

impl Row {
    /// The best of the other methods, in ppm.
    fn best(&self) -> f64 {
        PUBLISHED[self.cell].2.into_iter().fold(f64::INFINITY, f64::min)
    }

    /// At most half the best other method's error, or good in itself.
    fn passes(&self, ppm: f64) -> bool {
        ppm <= GOOD_PPM || ppm <= self.best() / 2.0
    }

    /// Names the cell with each memory that failed: that is wrong however few seeds there are.
    fn failed(&self, model: Model) -> Vec<String> {
        let (condition, rpm, _) = PUBLISHED[self.cell];
        let model = spec::model_name(model);
        let failed = Capacity::ALL.into_iter().zip([self.full_ppm, self.device_ppm]);
        let failed = failed.filter(|(_, ppm)| ppm.is_nan()).map(|(capacity, _)| {
            let memory = capacity.as_str();
            format!("{condition}, {rpm} rpm, {model} model, {memory} memory: no reading, or more than 20 % off")
        });
        failed.collect()
    }

    /// Names the cell where more is asked.
    fn short(&self, model: Model) -> Option<String> {
        let (condition, rpm, _) = PUBLISHED[self.cell];
        let Self { full_ppm, .. } = self;
        (full_ppm.is_finite() && !self.passes(*full_ppm)).then(|| {
            let (half, model) = (self.best() / 2.0, spec::model_name(model));
            format!("{condition}, {rpm} rpm, {model} model: {full_ppm:.1} ppm, more than {GOOD_PPM} and than half the best, {half:.1}")
        })
    }

    fn record(&self, model: Model) -> Map<String, Value> {
        let (condition, rpm, others) = PUBLISHED[self.cell];
        let mut record = Map::new();
        record.insert("model".to_owned(), spec::model_name(model).into());
        record.insert("condition".to_owned(), condition.into());
        record.insert("rpm".to_owned(), rpm.into());
        // JSON has no NaN: a failure is null.
        record.insert("full_ppm".to_owned(), self.full_ppm.into());
        record.insert("device_ppm".to_owned(), self.device_ppm.into());
        for (name, ppm) in METHODS.iter().zip(others) {
            record.insert(format!("{}_ppm", name.replace(' ', "_")), ppm.into());
        }
        record.insert("passes".to_owned(), self.passes(self.full_ppm).into());
        record
    }
}

fn table(rows: &[Row], model: Model, seeds: u64) -> Table {
    let mut columns = vec!["condition".to_owned(), "rpm".to_owned(), "evtach".to_owned()];
    columns.extend(["device memory".to_owned()]);
    columns.extend(METHODS.map(str::to_owned));
    columns.push("half the best".to_owned());
    let text = |ppm: f64| if ppm.is_nan() { "FAIL".to_owned() } else { short(ppm) };
    let cells = rows.iter().map(|row| {
        let (condition, rpm, others) = PUBLISHED[row.cell];
        let mut cells = vec![condition.to_owned(), format!("{rpm}")];
        cells.extend([text(row.full_ppm), text(row.device_ppm)]);
        cells.extend(others.map(text));
        cells.push(if row.passes(row.full_ppm) { "yes" } else { "NO" }.to_owned());
        cells
    });
    let passed = rows.iter().filter(|row| row.passes(row.full_ppm)).count();
    Table {
        title: format!(
            "peers: mean error in ppm, recordings of 1 s [{} model, {seeds} seeds]",
            spec::model_name(model)
        ),
        notes: vec![
            "others: published two-seed means from recordings made to the same description, not a rerun".to_owned(),
            "the clock is exact: an error of 15 ppm, as it is drawn in the standard scene, would be added to all of them".to_owned(),
            format!(
                "half the best: at most half the best other method's error, or at most 15 ppm; {passed} of {} pass",
                rows.len()
            ),
        ],
        columns,
        rows: cells.collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::report::tests::assert_readable;
    use super::*;

    #[test]
    fn failures_of_others_never_count_as_the_best() {
        let row = |full_ppm| Row { cell: 11, full_ppm, device_ppm: 1.0 };
        assert_eq!(row(1.0).best(), 1301.0);
        assert!(row(650.0).passes(650.0));
        assert!(!row(651.0).passes(651.0));
        assert!(!row(f64::NAN).passes(f64::NAN));
        assert_eq!(row(650.0).short(Model::Edge), None);
        let short = row(651.0).short(Model::Edge).unwrap_or_default();
        assert!(short.starts_with("handheld, 20000 rpm, edge model: 651.0 ppm"), "{short}");
    }

    #[test]
    fn a_failure_is_named_once_with_either_memory() {
        const FAIL: f64 = f64::NAN;
        for (full_ppm, device_ppm, memories) in [
            (1.0, 1.0, &[][..]),
            (FAIL, 1.0, &["full"]),
            (1.0, FAIL, &["device"]),
            (FAIL, FAIL, &["full", "device"]),
        ] {
            let row = Row { cell: 11, full_ppm, device_ppm };
            let failed = row.failed(Model::Edge);
            let named = memories.iter().map(|memory| {
                format!("handheld, 20000 rpm, edge model, {memory} memory: no reading, or more than 20 % off")
            });
            assert_eq!(failed, named.collect::<Vec<_>>());
            assert_eq!(row.short(Model::Edge), None);
        }
    }

    #[test]
    fn each_event_model_is_judged_by_itself_and_a_failure_is_empty() {
        let rows = [
            Row { cell: 0, full_ppm: 15.0, device_ppm: 80.0 },
            Row { cell: 11, full_ppm: f64::NAN, device_ppm: f64::NAN },
        ];
        let report = Report {
            name: "peers",
            tables: vec![table(&rows, Model::Threshold, 10)],
            records: rows.iter().map(|row| row.record(Model::Threshold)).collect(),
            ..Report::default()
        };
        assert_readable(&report);
        assert!(report.tables[0].title.contains("[threshold model, 10 seeds]"));
        assert!(report.tables[0].notes[2].ends_with("1 of 2 pass"));
        assert_eq!(report.records[0]["passes"], true);
        assert!(report.records[1]["full_ppm"].is_null());
    }
}
