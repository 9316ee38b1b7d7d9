//! A report with pictures: one HTML file with its drawings inside, readable without network.

mod heat;
mod phase;
mod speed;

use evtach_core::{Event, Frame, Geometry, Reading};
use plotters::drawing::DrawingAreaErrorKind;
use plotters::style::RGBColor;

use crate::measure::{FileFacts, PROGRAM, Plan, SettingsRow, Summary, evidence, letter, table};

/// A drawing that failed.
#[derive(Debug, thiserror::Error)]
#[error("the {drawing} cannot be drawn: {cause}; report it with the recording")]
pub struct ReportError {
    /// Which drawing.
    drawing: &'static str,
    /// What the plotting library says.
    cause: String,
}

impl ReportError {
    fn of<E: std::error::Error + Send + Sync>(
        drawing: &'static str,
    ) -> impl Fn(DrawingAreaErrorKind<E>) -> Self {
        move |cause| Self { drawing, cause: cause.to_string() }
    }
}

/// What a report is made from.
#[derive(Debug)]
pub struct Subject<'a> {
    /// How it was measured.
    pub plan: &'a Plan,
    /// The file.
    pub facts: &'a FileFacts,
    /// Size of the sensor.
    pub geometry: Geometry,
    /// All events that were measured.
    pub events: &'a [Event],
    /// The series of readings.
    pub readings: &'a [Reading],
    /// The reading over the recording.
    pub summary: &'a Summary,
    /// What was assumed about the file, one sentence each.
    pub assumed: &'a [String],
}

/// What a report begins with, and nothing else does.
const HEAD: &str = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"generator\" content=\"evtach\">";

/// One colour a rotor, distinct in print and for most colour-blind readers (Okabe and Ito).
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 110, 0),
    RGBColor(70, 70, 70),
];

fn colour(id: u8) -> RGBColor {
    COLOURS[usize::from(id) % COLOURS.len()]
}

/// Writes the report as one HTML document.
///
/// # Errors
/// When a drawing fails.
pub fn html(subject: &Subject<'_>) -> Result<String, ReportError> {
    let title = escaped(&subject.facts.file);
    let mut body = format!("<h1>{title}</h1>\n");
    let told = table(subject.facts, subject.summary, subject.readings);
    body += &format!("<pre>{}</pre>\n", escaped(&told));
    for rotor in &subject.summary.rotors {
        if let Some(speed) = rotor.speed {
            let (name, frame) = (letter(rotor.id), relative(speed.frame));
            body += &format!("<p>Rotor {name}: relative to the {frame}.</p>\n");
        }
    }
    for assumed in subject.assumed {
        body += &format!("<p>Assumed: {}.</p>\n", escaped(assumed));
    }
    let settings = SettingsRow::new(subject.plan).to_string();
    body += &format!("<p>Measured by {PROGRAM}: {}.</p>\n", escaped(&settings));
    body += "<h2>Where events come from</h2>\n<p>Events per cell, lighter is more. Circles: the rotors above, \
             dashed where no speed was given.</p>\n";
    body += &heat::draw(subject)?;
    for rotor in subject.summary.rotors.iter().filter(|r| r.speed.is_some()) {
        let name = letter(rotor.id);
        if let Some(picture) = phase::draw(subject, rotor.id)? {
            body += &format!("<h2>Rotor {name}: phase</h2>\n{picture}");
        }
    }
    body += "<h2>Speed over time</h2>\n";
    body += &match speed::draw(subject)? {
        Some(picture) => format!(
            "<p>One mark a reading, at the middle of its window; bars: 1.96 sigma either way, where the truth lies in \
             95 of 100 cases. Hollow: coarse.</p>\n{picture}"
        ),
        None => "<p>No reading has a speed.</p>\n".to_owned(),
    };
    let stages = evidence(subject.facts, subject.readings);
    body += &format!("<h2>What each stage found</h2>\n<pre>{}</pre>\n", escaped(&stages));
    Ok(format!(
        "{HEAD}<title>{title}</title>\n<style>{STYLE}</style>\
         </head><body>\n{body}</body></html>\n"
    ))
}

/// Whether a file that begins so is a report of ours, of whatever version.
#[must_use]
pub fn is_report(start: &[u8]) -> bool {
    start.starts_with(HEAD.as_bytes())
}

/// Draws the heat map with its rotors alone, as one SVG document.
///
/// # Errors
/// When the drawing fails.
pub fn heat_map(subject: &Subject<'_>) -> Result<String, ReportError> {
    heat::draw(subject)
}

const STYLE: &str = "body{font:16px/1.5 sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}\
    pre{background:#f6f6f6;padding:1rem;overflow-x:auto;font-size:13px}svg{max-width:100%;height:auto}";

/// What a speed is relative to, in the word of the JSON, and what that means.
const fn relative(frame: Frame) -> &'static str {
    match frame {
        Frame::Camera => "camera; its own roll is in the speed, and in the error bar",
        Frame::Room => "room; the camera's own roll has been taken out by its gyro",
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use evtach_core::{Direction, Evidence, Reason, RotorReading, Settings, Speed, Status};

    use super::*;
    use crate::measure::{Capacity, measure_events, summarise};
    use crate::synth::{Model, Scene, generate};

    fn report_of(scene: &Scene) -> (String, Summary) {
        let made = generate(scene).unwrap();
        let geometry = Geometry::new(scene.width_px, scene.height_px).unwrap();
        let settings = Settings { blades: Some(3), ..Settings::new(geometry) };
        let plan =
            Plan { settings, capacity: Capacity::Full, takes_gyro: false, since_us: 0..u64::MAX };
        let (readings, _) = measure_events(&made.events, &[], settings, Capacity::Full);
        let summary = summarise(&readings, &(0..150_000), 15.0);
        let facts = FileFacts { file: "a<b>.raw".to_owned(), ..FileFacts::default() };
        let subject = Subject {
            plan: &plan,
            facts: &facts,
            geometry,
            events: &made.events,
            readings: &readings,
            summary: &summary,
            assumed: &["640x480 & more".to_owned()],
        };
        (html(&subject).unwrap(), summary)
    }

    #[test]
    fn a_report_holds_every_picture_and_escapes_names() {
        let scene = Scene { model: Model::Edge, duration_ms: 300.0, ..Scene::default() };
        let (page, summary) = report_of(&scene);
        assert_eq!(summary.rotors[0].speed.unwrap().direction(), Direction::Cw);
        assert_eq!(page.matches("<svg").count(), 3);
        assert!(page.contains("Rotor A: phase"));
        assert!(page.contains("about one axis, by one speed and its steady change"));
        assert!(page.contains("Rotor A: relative to the camera;"));
        let told = format!(
            "Measured by {PROGRAM}: blades 3, capacity \"full\", clock_ppm 15.0, start_s 0.0."
        );
        assert!(page.contains(&told), "{page}");
        assert!(page.contains("a&lt;b&gt;.raw") && !page.contains("a<b>"));
        assert!(page.contains("640x480 &amp; more"));
    }

    #[test]
    fn each_rotor_of_the_table_is_drawn_though_the_last_reading_has_not_all() {
        let speed = Speed {
            omega_rad_s: 314.16,
            omega_sigma_rad_s: 0.01,
            alpha_rad_s2: None,
            frame: Frame::Camera,
        };
        let followed = RotorReading {
            id: 0,
            x_px: 90.0,
            y_px: 130.0,
            radius_px: 50.0,
            blades: Some(3),
            status: Status::Locked,
            speed: Some(speed),
            evidence: Evidence::default(),
        };
        let status = Status::Refused(Reason::TooFast);
        let refused = RotorReading { id: 1, x_px: 250.0, status, speed: None, ..followed.clone() };
        let last = Reading {
            t_us: 75_000,
            window_us: 150_000,
            events: 1000,
            thinned: 0,
            lost: 0,
            status: Status::Locked,
            rotors: [followed.clone()].into_iter().collect(),
        };
        let geometry = Geometry::new(346, 260).unwrap();
        let settings = Settings::new(geometry);
        let plan =
            Plan { settings, capacity: Capacity::Full, takes_gyro: false, since_us: 0..u64::MAX };
        let subject = Subject {
            plan: &plan,
            facts: &FileFacts::default(),
            geometry,
            events: &[],
            readings: &[last],
            summary: &Summary { status: Status::Locked, rotors: vec![followed, refused] },
            assumed: &[],
        };
        let drawn = heat_map(&subject).unwrap();
        let tags: Vec<&str> = drawn
            .lines()
            .map(str::trim)
            .filter(|line| line.starts_with("A ") || *line == "B")
            .collect();
        assert_eq!(tags, ["A 3000.0 rpm cw", "B"], "{drawn}");
    }

    #[test]
    fn a_recording_without_a_rotor_is_reported_as_such() {
        let scene = Scene { rotors: Vec::new(), ..Scene::default() };
        let (page, _) = report_of(&scene);
        assert_eq!(page.matches("<svg").count(), 1);
        assert!(page.contains("No reading has a speed.") && !page.contains("relative to"));
    }
}
