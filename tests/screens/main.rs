//! The screen in every state and on every page, pixel for pixel as in the pictures beside this file.
//!
//! After a change that is meant, look at what is drawn and keep it:
//!
//! ```sh
//! EVTACH_RENEW_SCREENS=1 cargo test -p evtach-tests --test screens
//! ```

mod scenes;

use std::collections::BTreeSet;
use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use evtach_firmware::ui::Screen;
use evtach_host::frame::Frame;

use scenes::Scene;

const RENEW: &str = "EVTACH_RENEW_SCREENS";

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("screens")
}

fn drawn(scene: &Scene) -> Frame {
    let mut frame = Frame::default();
    let Ok(()) = Screen::new().draw(&mut frame, &scene.instrument);
    frame
}

#[test]
fn every_state_and_page_looks_as_it_did() -> Result<(), Box<dyn Error>> {
    let mut differ = Vec::new();
    for scene in scenes::all() {
        let path = folder().join(&scene.name).with_extension("png");
        let frame = drawn(&scene);
        if env::var_os(RENEW).is_some() {
            frame.write_png(&path)?;
        } else if Frame::read_png(&path)? != frame {
            let now = env::temp_dir().join(format!("evtach-{}.png", scene.name));
            frame.write_png(&now)?;
            differ.push(format!("{} is now {}", path.display(), now.display()));
        }
    }
    assert!(differ.is_empty(), "{}\nif that is meant, run with {RENEW}=1", differ.join("\n"));
    Ok(())
}

#[test]
fn every_picture_is_drawn_by_a_scene() -> Result<(), Box<dyn Error>> {
    let drawn: BTreeSet<String> = scenes::all().into_iter().map(|scene| scene.name).collect();
    let mut kept = BTreeSet::new();
    for entry in fs::read_dir(folder())? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "png") {
            kept.extend(path.file_stem().map(|stem| stem.to_string_lossy().into_owned()));
        }
    }
    assert_eq!(kept, drawn);
    Ok(())
}

/// Drawing only what has changed leaves nothing of what was there before.
#[test]
fn step_by_step_is_as_from_nothing() {
    let mut frame = Frame::default();
    let mut screen = Screen::new();
    let mut steps = 0;
    scenes::play(|instrument| {
        let Ok(()) = screen.draw(&mut frame, instrument);
        let mut fresh = Frame::default();
        let Ok(()) = Screen::new().draw(&mut fresh, instrument);
        let pixels = frame.pixels().iter().zip(fresh.pixels());
        let first = pixels.enumerate().find(|(_, (a, b))| a != b).map(|(i, _)| (i % 480, i / 480));
        assert_eq!(first, None, "first pixel that differs in step {steps}");
        steps += 1;
    });
    assert!(steps > 50, "{steps}");
}
