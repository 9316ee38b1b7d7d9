//! Scenes by name.

use super::scene::{
    Background, Camera, Clock, Gyro, Lamp, Mover, Rotor, Scene, Sensor, Shape, Vibration,
};

/// A scene by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Preset {
    /// The standard scene: one three-blade rotor at 3000 rpm before a plain wall, camera on a tripod.
    Standard,
    /// The same from the hand, before a textured wall, with gyro samples.
    Handheld,
    /// The same with the rotor on a shaken table.
    Vibrating,
    /// The same through a readout that cannot keep up.
    Saturated,
    /// A drone: four two-blade rotors, four speeds, two directions.
    Quad,
    /// Two rotors that touch.
    Touching,
    /// A large and a small rotor, speeds ten to one.
    Unequal,
    /// A single mark on a disc.
    Dot,
    /// Four blades, one of them narrow.
    OddBlade,
    /// A wheel with sixteen spokes.
    Spokes,
    /// A motor that speeds up and hunts.
    Ramp,
    /// A rotor seen 20 degrees off its axis.
    Tilted,
    /// A slow rotor under a mains lamp.
    Lamplit,
    /// No rotor: a textured wall from the hand.
    Still,
    /// No rotor: a mains lamp.
    Flicker,
    /// No rotor: a bar slides across.
    Bar,
    /// No rotor: a grating slides across.
    Grating,
    /// No rotor: a walking figure.
    Walker,
    /// No rotor: noise and hot pixels.
    Noise,
}

impl Preset {
    /// The scene of this name.
    #[must_use]
    pub fn scene(self) -> Scene {
        let standard = Scene::default();
        let none = Scene { rotors: Vec::new(), ..Scene::default() };
        match self {
            Self::Standard => standard,
            Self::Handheld => Scene {
                camera: Camera { gyro: Some(Gyro::default()), ..hand() },
                background: wall(),
                ..standard
            },
            Self::Vibrating => Scene { vibration: shaken(), ..standard },
            Self::Saturated => Scene {
                sensor: Sensor { readout_mev_s: Some(1.5), ..Sensor::default() },
                ..standard
            },
            Self::Quad => {
                let at = |x_px, y_px, rpm| Rotor {
                    x_px,
                    y_px,
                    rpm,
                    radius_px: 44.0,
                    blades: 2,
                    ..Rotor::default()
                };
                Scene {
                    width_px: 640,
                    height_px: 480,
                    rotors: vec![
                        at(205.0, 135.0, 4310.0),
                        at(440.0, 140.0, -4120.0),
                        at(438.0, 335.0, 4470.0),
                        at(203.0, 330.0, -4250.0),
                    ],
                    ..standard
                }
            }
            Self::Touching => two((50.0, 3000.0), (50.0, -2400.0), 100.0),
            Self::Unequal => two((60.0, 600.0), (25.0, 6000.0), 120.0),
            Self::Dot => {
                one(Rotor { blades: 1, shape: Shape::Dot, radius_px: 80.0, ..Rotor::default() })
            }
            Self::OddBlade => one(Rotor { blades: 4, odd_width: 0.6, ..Rotor::default() }),
            Self::Spokes => one(Rotor {
                blades: 16,
                shape: Shape::Spokes,
                radius_px: 80.0,
                rpm: 400.0,
                ..Rotor::default()
            }),
            Self::Ramp => Scene {
                duration_ms: 1000.0,
                ..one(Rotor {
                    rpm: 1800.0,
                    ramp_per_s: 0.1,
                    hunting: 0.01,
                    hunting_hz: 3.0,
                    ..Rotor::default()
                })
            },
            Self::Tilted => one(Rotor {
                tilt_deg: 20.0,
                tilt_axis_deg: 30.0,
                radius_px: 70.0,
                ..Rotor::default()
            }),
            Self::Lamplit => Scene {
                duration_ms: 800.0,
                lamp: Some(Lamp { depth: 0.3, ..Lamp::default() }),
                ..one(Rotor { rpm: 150.0, blades: 2, radius_px: 80.0, ..Rotor::default() })
            },
            Self::Still => Scene { camera: hand(), background: wall(), duration_ms: 300.0, ..none },
            Self::Flicker => Scene {
                lamp: Some(Lamp { spot_px: Some([150.0, 120.0, 60.0]), ..Lamp::default() }),
                duration_ms: 300.0,
                ..none
            },
            Self::Bar => Scene { movers: vec![bars(None)], ..none },
            Self::Grating => Scene { movers: vec![bars(Some(40.0))], ..none },
            Self::Walker => Scene {
                movers: vec![Mover::Walker {
                    x_px: 120.0,
                    y_px: 125.0,
                    height_px: 150.0,
                    speed_px_s: 120.0,
                    step_hz: 2.0,
                    contrast: -0.8,
                }],
                duration_ms: 500.0,
                ..none
            },
            Self::Noise => Scene {
                sensor: Sensor { noise_hz: 5.0, hot_pixels: 12, ..Sensor::default() },
                clock: Clock::default(),
                ..none
            },
        }
    }
}

/// The standard scene's hand: 3 px and 3 mrad rms.
#[must_use]
pub fn hand() -> Camera {
    Camera { tremor_px: 3.0, tremor_mrad: 3.0, ..Camera::default() }
}

/// The standard scene's shaken table: 1 px, and 0.4 px at twice its frequency.
#[must_use]
pub fn shaken() -> Vibration {
    Vibration { amplitude_px: 1.0, second_px: 0.4, frequency_hz: None }
}

/// A wall with texture and things on it.
#[must_use]
pub fn wall() -> Background {
    Background { contrast: 0.25, boxes: 8, ..Background::default() }
}

fn one(rotor: Rotor) -> Scene {
    Scene { rotors: vec![rotor], ..Scene::default() }
}

fn two(left: (f64, f64), right: (f64, f64), apart_px: f64) -> Scene {
    let at = |x_px, (radius_px, rpm)| Rotor { x_px, radius_px, rpm, ..Rotor::default() };
    let rotors = vec![at(173.0 - apart_px / 2.0, left), at(173.0 + apart_px / 2.0, right)];
    Scene { rotors, ..Scene::default() }
}

fn bars(spacing_px: Option<f64>) -> Mover {
    Mover::Bars {
        direction_deg: 20.0,
        speed_px_s: 1500.0,
        width_px: 15.0,
        spacing_px,
        offset_px: -110.0,
        contrast: 0.8,
    }
}
