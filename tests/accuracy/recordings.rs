//! Every recording at hand, measured as `evtach measure` does, in both capacities, against its truth.

use std::fs;
use std::path::{Path, PathBuf};

use evtach_core::{Direction, Frame, RotorReading, Status};
use evtach_host::measure::{Capacity, Summary};
use evtach_tests::{Truth, load, measure, pair, recordings, show};
use serde::Deserialize;

/// Largest relative error of a speed, with either memory.
const LARGEST_ERROR: f64 = 0.001;
/// The same in standard errors.
const LARGEST_ERROR_SIGMA: f64 = 4.0;
/// Largest standard error that is stated of a speed where nobody holds the camera.
const LARGEST_SIGMA_AT_REST: f64 = 0.001;

/// The part of a truth file that is compared.
#[derive(Deserialize)]
struct TruthFile {
    verdict: String,
    camera: Camera,
    rotors: Vec<Truth>,
}

/// What held the camera.
#[derive(Deserialize)]
struct Camera {
    handheld: bool,
}

/// What is asked of a reading beyond four standard errors.
#[derive(Clone, Copy)]
struct Asked {
    largest_error: f64,
    /// Of the stated standard error, relative.
    largest_sigma: f64,
}

/// A table with its failures.
#[derive(Default)]
struct Report {
    rows: String,
    failures: Vec<String>,
}

impl Report {
    fn row(&mut self, cells: [&str; 10]) {
        let [file, capacity, truth, reading, error, sigma, centre, radius, status, right] = cells;
        self.rows += &format!(
            "{file:<44} {capacity:<7} {truth:>17} {reading:>17} {error:>9} {sigma:>9} {centre:>9} {radius:>9} {status:<12} {right}\n"
        );
    }

    /// Prints the table and fails with all that was wrong.
    fn end(self, title: &str) {
        let mut head = Self::default();
        head.row([
            "file",
            "memory",
            "truth, rpm",
            "reading, rpm",
            "error ppm",
            "sigma ppm",
            "centre px",
            "radius px",
            "status",
            "right",
        ]);
        show(&format!("{title}\n{}{}", head.rows, self.rows));
        assert!(self.failures.is_empty(), "\n{}", self.failures.join("\n"));
    }

    fn fail(&mut self, file: &str, capacity: Capacity, what: &str) {
        self.failures.push(format!("{file}, {} memory: {what}", capacity.as_str()));
    }

    /// One true rotor and what was read in its place.
    fn compare(
        &mut self,
        (file, capacity): (&str, Capacity),
        truth: &Truth,
        read: Option<&RotorReading>,
        asked: Asked,
    ) {
        let told = signed(truth.rpm_camera, truth.blades.into());
        let Some((rotor, speed)) = read.and_then(|rotor| Some((rotor, rotor.speed?))) else {
            self.row([file, capacity.as_str(), &told, "-", "-", "-", "-", "-", "no speed", ""]);
            self.fail(file, capacity, &format!("the rotor with {told} has no speed"));
            return;
        };
        let rpm = match speed.direction() {
            Direction::Cw => f64::from(speed.rpm()),
            Direction::Ccw => -f64::from(speed.rpm()),
        };
        let right = match speed.frame {
            Frame::Camera => truth.rpm_camera,
            Frame::Room => truth.rpm_room,
        };
        let error = rpm / right - 1.0;
        let sigma = f64::from(speed.rpm_sigma()) / rpm.abs();
        let near = error.abs() <= asked.largest_error.min(LARGEST_ERROR_SIGMA * sigma);
        let centre_px = truth.centre_off_px(rotor);
        let blades = rotor.blades.map_or("?".to_owned(), |n| n.to_string());
        self.row([
            file,
            capacity.as_str(),
            &told,
            &format!("{rpm:+.2} x{blades}"),
            &format!("{:+.0}", error * 1e6),
            &format!("{:.0}", sigma * 1e6),
            &format!("{centre_px:.1}"),
            &format!("{:+.1}", f64::from(rotor.radius_px) - truth.radius_px),
            rotor.status.as_str(),
            if near { "yes" } else { "NO" },
        ]);
        if !near {
            self.fail(file, capacity, &format!("{rpm:+.2} rpm instead of {told}"));
        }
        if sigma > asked.largest_sigma {
            self.fail(file, capacity, &format!("{told}: sigma is {:.0} ppm", sigma * 1e6));
        }
        if let Some(misplaced) = truth.misplaced(rotor) {
            self.fail(file, capacity, &format!("{told}: {misplaced}"));
        }
        if rotor.blades != Some(truth.blades) {
            self.fail(file, capacity, &format!("{blades} blades instead of {}", truth.blades));
        }
    }

    /// A recording in which nothing turns.
    fn compare_refusal(&mut self, file: &str, capacity: Capacity, summary: &Summary) {
        let Status::Refused(reason) = summary.status else {
            let read: Vec<_> =
                summary.rotors.iter().filter_map(|r| Some(r.speed?.rpm().to_string())).collect();
            let read = read.join(" ");
            self.row([
                file,
                capacity.as_str(),
                "refuse",
                &read,
                "",
                "",
                "",
                "",
                summary.status.as_str(),
                "NO",
            ]);
            self.fail(file, capacity, &format!("nothing turns, but {read} rpm was read"));
            return;
        };
        let capacity = capacity.as_str();
        self.row([file, capacity, "refuse", "-", "", "", "", "", reason.as_str(), "yes"]);
    }
}

fn signed(rpm: f64, blades: u32) -> String {
    format!("{rpm:+.2} x{blades}")
}

/// Recordings of a folder with their truth files.
fn with_truth(folder: &Path) -> Vec<(PathBuf, TruthFile)> {
    let mut found: Vec<(PathBuf, TruthFile)> = fs::read_dir(folder)
        .expect("a readable folder")
        .filter_map(|entry| {
            let path = entry.expect("a readable entry").path();
            let truth = path.with_extension("truth.json");
            // A truth file's own sibling would be "name.truth.truth.json".
            let text = fs::read_to_string(&truth).ok()?;
            Some((path, serde_json::from_str(&text).expect("a truth file of the known form")))
        })
        .collect();
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn simulated(capacity: Capacity) {
    let Some(folder) = recordings("simulated") else { return };
    let found = with_truth(&folder);
    assert!(!found.is_empty(), "{}: no recording with a truth.json beside it", folder.display());
    let mut report = Report::default();
    for (path, truth) in found {
        let file = name(&path);
        let loaded = load(&path).expect("an undamaged recording");
        let (_, summary) = measure(&loaded, capacity);
        if truth.verdict == "refuse" {
            report.compare_refusal(&file, capacity, &summary);
            continue;
        }
        let truths = truth.rotors;
        assert!(!truths.is_empty(), "{file}: a reading is due, but no rotor is named");
        let (paired, ghosts) = pair(&truths, &summary);
        // A hand's own roll is in the speed and in its sigma, and no event tells the two apart.
        let largest_sigma =
            if truth.camera.handheld { f64::INFINITY } else { LARGEST_SIGMA_AT_REST };
        let asked = Asked { largest_error: LARGEST_ERROR, largest_sigma };
        for (truth, read) in truths.iter().zip(paired) {
            report.compare((&file, capacity), truth, read, asked);
        }
        for ghost in ghosts {
            let place = format!("at ({:.0}, {:.0})", ghost.x_px, ghost.y_px);
            report.fail(&file, capacity, &format!("a speed where nothing turns, {place}"));
        }
    }
    report.end("simulated recordings");
}

#[test]
fn simulated_in_full_memory() {
    simulated(Capacity::Full);
}

#[test]
fn simulated_in_the_devices_memory() {
    simulated(Capacity::Device);
}

fn without_a_rotor(files: &[&str]) {
    let Some(folder) = recordings("real") else { return };
    let mut report = Report::default();
    for file in files {
        let path = folder.join(file);
        if !path.exists() {
            show(&format!("skipped: no {file}"));
            continue;
        }
        let loaded = load(&path).expect("an undamaged recording");
        for capacity in Capacity::ALL {
            let (_, summary) = measure(&loaded, capacity);
            report.compare_refusal(file, capacity, &summary);
        }
    }
    report.end("real recordings without a rotor");
}

#[test]
fn real_without_a_rotor() {
    without_a_rotor(&[
        "lamp-100hz.davis346.aedat4",
        "street.evt3.raw",
        "person.aedat4",
        "dvs128.aedat2.aedat",
        "dvs.es",
    ]);
}

/// 0.965 of a turn of one dot: a coarse reading whose interval covers what others found for the sequence.
fn spinning_dot(capacity: Capacity) {
    let Some(folder) = recordings("real") else { return };
    let file = "spinning-dot.evt2.raw";
    let path = folder.join(file);
    if !path.exists() {
        show(&format!("skipped: no {file}"));
        return;
    }
    let loaded = load(&path).expect("an undamaged recording");
    let mut report = Report::default();
    let (_, summary) = measure(&loaded, capacity);
    let truth = Truth {
        centre_px: [314.0, 202.0],
        // Of the disc that the dot sweeps; the ring of its middle has 106.
        radius_px: 125.0,
        tilt_deg: 0.0,
        blades: 1,
        rpm_camera: 1170.0,
        rpm_room: 1170.0,
    };
    let (paired, ghosts) = pair(&[truth], &summary);
    let asked = Asked { largest_error: 0.02, largest_sigma: f64::INFINITY };
    report.compare((file, capacity), &truth, paired[0], asked);
    if let Some(speed) = paired[0].and_then(|rotor| rotor.speed) {
        let (rpm, sigma) = (f64::from(speed.rpm()), f64::from(speed.rpm_sigma()));
        let (low, high) = (rpm - 1.96 * sigma, rpm + 1.96 * sigma);
        if low > 1164.0 || high < 1176.0 {
            let interval = format!("95 % interval {low:.1} to {high:.1} leaves out 1164 to 1176");
            report.fail(file, capacity, &interval);
        }
    }
    if !ghosts.is_empty() {
        report.fail(file, capacity, "a speed where nothing turns");
    }
    report.end("real recording of a rotor");
}

#[test]
fn real_spinning_dot() {
    spinning_dot(Capacity::Full);
}

#[test]
fn real_spinning_dot_on_the_device() {
    spinning_dot(Capacity::Device);
}
