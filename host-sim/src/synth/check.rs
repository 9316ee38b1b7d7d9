//! What a scene's values may be.

use super::scene::{
    Background, Camera, Clock, Gyro, Lamp, Mover, Rotor, Scene, SceneError, Sensor, Vibration,
};

impl Scene {
    /// Checks every value that could make the synthesiser run for ever, divide by zero or write no sensible event.
    ///
    /// # Errors
    /// Names the first field that is out of range.
    pub fn check(&self) -> Result<(), SceneError> {
        let side = |v: u16| (1..=2048).contains(&v);
        check("width_px", self.width_px.into(), side(self.width_px), "1 to 2048")?;
        check("height_px", self.height_px.into(), side(self.height_px), "1 to 2048")?;
        let d = self.duration_ms;
        check("duration_ms", d, d > 0.0 && d <= 60_000.0, "above 0, at most 60000")?;
        for (i, rotor) in self.rotors.iter().enumerate() {
            rotor.check(&format!("rotors[{i}]"), self.duration_s())?;
        }
        self.camera.check()?;
        self.vibration.check()?;
        self.sensor.check()?;
        self.clock.check()?;
        self.background.check()?;
        self.lamp.as_ref().map_or(Ok(()), Lamp::check)?;
        for (i, mover) in self.movers.iter().enumerate() {
            mover.check(&format!("movers[{i}]"))?;
        }
        Ok(())
    }
}

/// Lets a number pass that is `ok`.
fn check(place: &str, value: f64, ok: bool, allowed: &'static str) -> Result<(), SceneError> {
    if ok && value.is_finite() {
        Ok(())
    } else {
        Err(SceneError { place: place.to_owned(), value, allowed })
    }
}

impl Rotor {
    fn check(&self, place: &str, duration_s: f64) -> Result<(), SceneError> {
        let at = |name: &str| format!("{place}.{name}");
        check(&at("x_px"), self.x_px, self.x_px.abs() < 1e4, "within 10000")?;
        check(&at("y_px"), self.y_px, self.y_px.abs() < 1e4, "within 10000")?;
        let radius = self.radius_px;
        check(&at("radius_px"), radius, radius > 2.0 && radius < 2000.0, "2 to 2000")?;
        let hub = self.hub_radius_px();
        check(&at("hub_px"), hub, hub >= 0.0 && hub < radius, "0 to the radius")?;
        check(&at("blades"), self.blades.into(), (1..=32).contains(&self.blades), "1 to 32")?;
        let odd = self.odd_width;
        check(&at("odd_width"), odd, odd > 0.0 && odd <= 1.2, "above 0, at most 1.2")?;
        let spread = self.blade_spread_mrad;
        check(&at("blade_spread_mrad"), spread, (0.0..=20.0).contains(&spread), "0 to 20")?;
        check(&at("tilt_deg"), self.tilt_deg, self.tilt_deg.abs() < 80.0, "below 80")?;
        check(&at("contrast"), self.contrast, self.contrast.abs() < 10.0, "within 10")?;
        // Beyond that the angles would be rounded.
        for (name, angle) in
            [("phase_deg", self.phase_deg.unwrap_or(0.0)), ("tilt_axis_deg", self.tilt_axis_deg)]
        {
            check(&at(name), angle, angle.abs() <= 1e6, "within 1000000")?;
        }
        self.check_speed(place, duration_s)
    }

    fn check_speed(&self, place: &str, duration_s: f64) -> Result<(), SceneError> {
        let at = |name: &str| format!("{place}.{name}");
        let rpm = self.rpm.abs();
        check(&at("rpm"), self.rpm, (1.0..=200_000.0).contains(&rpm), "1 to 200000")?;
        let (hunting, hz) = (self.hunting.abs(), self.hunting_hz);
        check(&at("hunting"), self.hunting, hunting < 0.95, "within 0.95")?;
        check(&at("hunting_hz"), hz, (1e-3..=1e4).contains(&hz), "0.001 to 10000")?;
        let ramp = self.ramp_per_s;
        let least = 1.0 - hunting + ramp.min(0.0) * duration_s;
        check(&at("ramp_per_s"), ramp, least > 0.05, "such that the rotor never stops")?;
        let most_rpm = rpm * (1.0 + hunting + ramp.max(0.0) * duration_s);
        let allowed = "such that the rotor stays below 400000 rpm";
        check(&at("ramp_per_s"), ramp, most_rpm < 400_000.0, allowed)
    }
}

impl Camera {
    fn check(&self) -> Result<(), SceneError> {
        for (place, rms) in
            [("camera.tremor_px", self.tremor_px), ("camera.tremor_mrad", self.tremor_mrad)]
        {
            check(place, rms, (0.0..=1e4).contains(&rms), "0 to 10000")?;
        }
        let [right, down] = self.drift_px_s;
        for (place, speed) in [
            ("camera.drift_px_s[0]", right),
            ("camera.drift_px_s[1]", down),
            ("camera.roll_rad_s", self.roll_rad_s),
        ] {
            check(place, speed, speed.abs() <= 1e4, "within 10000")?;
        }
        self.gyro.as_ref().map_or(Ok(()), Gyro::check)
    }
}

impl Gyro {
    fn check(&self) -> Result<(), SceneError> {
        let f = self.rate_hz;
        check("camera.gyro.rate_hz", f, (1.0..=20_000.0).contains(&f), "1 to 20000")?;
        let (noise, offset) = (self.noise_rad_s, self.offset_rad_s);
        check("camera.gyro.noise_rad_s", noise, (0.0..=1e3).contains(&noise), "0 to 1000")?;
        check("camera.gyro.offset_rad_s", offset, offset.abs() <= 1e3, "within 1000")
    }
}

impl Vibration {
    fn check(&self) -> Result<(), SceneError> {
        for (place, amplitude) in
            [("vibration.amplitude_px", self.amplitude_px), ("vibration.second_px", self.second_px)]
        {
            check(place, amplitude, (0.0..=1e3).contains(&amplitude), "0 to 1000")?;
        }
        // Poses are 50 us apart: what shakes faster falls between them.
        let f = self.frequency_hz.unwrap_or(1.0);
        check("vibration.frequency_hz", f, f > 0.0 && f <= 1e3, "above 0, at most 1000")
    }
}

impl Sensor {
    fn check(&self) -> Result<(), SceneError> {
        check("sensor.threshold", self.threshold, self.threshold > 0.01, "above 0.01")?;
        let spread = self.threshold_spread;
        check("sensor.threshold_spread", spread, (0.0..0.5).contains(&spread), "0 to 0.5")?;
        for (place, us) in [
            ("sensor.refractory_us", self.refractory_us),
            ("sensor.latency_spread_us", self.latency_spread_us),
            ("sensor.jitter_us", self.jitter_us),
        ] {
            check(place, us, us >= 0.0, "0 or more")?;
        }
        let (noise, hot) = (self.noise_hz, self.hot_hz);
        check("sensor.noise_hz", noise, (0.0..=1e4).contains(&noise), "0 to 10000")?;
        check("sensor.hot_hz", hot, (0.0..=1e5).contains(&hot), "0 to 100000")?;
        let count = self.hot_pixels;
        check("sensor.hot_pixels", count.into(), count <= 10_000, "0 to 10000")?;
        let (dropout, blur) = (self.dropout, self.blur_px);
        check("sensor.dropout", dropout, (0.0..=1.0).contains(&dropout), "0 to 1")?;
        check("sensor.blur_px", blur, (0.1..=5.0).contains(&blur), "0.1 to 5")?;
        let limit = self.readout_mev_s.unwrap_or(1.0);
        check("sensor.readout_mev_s", limit, limit > 0.0, "above 0")
    }
}

impl Clock {
    fn check(&self) -> Result<(), SceneError> {
        // A clock that is a million ppm slow stands still; one that is drawn stays clear of that at many sigma.
        let (ppm, sigma) = (self.error_ppm.unwrap_or(0.0), self.sigma_ppm);
        check("clock.error_ppm", ppm, ppm.abs() <= 1e5, "within 100000")?;
        check("clock.sigma_ppm", sigma, (0.0..=1e4).contains(&sigma), "0 to 10000")
    }
}

impl Background {
    fn check(&self) -> Result<(), SceneError> {
        let (contrast, grain) = (self.contrast, self.grain_px);
        check("background.contrast", contrast, (0.0..=10.0).contains(&contrast), "0 to 10")?;
        check("background.grain_px", grain, (1.0..=200.0).contains(&grain), "1 to 200")?;
        check("background.boxes", self.boxes.into(), self.boxes <= 1000, "0 to 1000")
    }
}

impl Lamp {
    fn check(&self) -> Result<(), SceneError> {
        let f = self.frequency_hz;
        check("lamp.frequency_hz", f, (1.0..=5000.0).contains(&f), "1 to 5000")?;
        check("lamp.depth", self.depth, (0.0..=0.95).contains(&self.depth), "0 to 0.95")?;
        for (i, &share) in self.harmonics.iter().enumerate() {
            check(&format!("lamp.harmonics[{i}]"), share, share.abs() <= 1e3, "within 1000")?;
        }
        let Some([x, y, radius]) = self.spot_px else { return Ok(()) };
        check("lamp.spot_px[0]", x, x.abs() <= 1e4, "within 10000")?;
        check("lamp.spot_px[1]", y, y.abs() <= 1e4, "within 10000")?;
        check("lamp.spot_px[2]", radius, (0.0..=1e5).contains(&radius), "0 to 100000")
    }
}

impl Mover {
    fn check(&self, place: &str) -> Result<(), SceneError> {
        let at = |name: &str| format!("{place}.{name}");
        let (Self::Bars { contrast, speed_px_s, .. } | Self::Walker { contrast, speed_px_s, .. }) =
            *self;
        check(&at("contrast"), contrast, contrast.abs() < 10.0, "within 10")?;
        check(&at("speed_px_s"), speed_px_s, speed_px_s.abs() <= 1e6, "within 1000000")?;
        match *self {
            Self::Bars { direction_deg, width_px, spacing_px, offset_px, .. } => {
                for (name, value) in [("direction_deg", direction_deg), ("offset_px", offset_px)] {
                    check(&at(name), value, value.abs() <= 1e6, "within 1000000")?;
                }
                for (name, size) in
                    [("width_px", width_px), ("spacing_px", spacing_px.unwrap_or(1.0))]
                {
                    let ok = size > 0.0 && size <= 1e6;
                    check(&at(name), size, ok, "above 0, at most 1000000")?;
                }
            }
            Self::Walker { x_px, y_px, height_px, step_hz, .. } => {
                for (name, value) in [("x_px", x_px), ("y_px", y_px)] {
                    check(&at(name), value, value.abs() <= 1e4, "within 10000")?;
                }
                let ok = (1.0..=1e4).contains(&height_px);
                check(&at("height_px"), height_px, ok, "1 to 10000")?;
                check(&at("step_hz"), step_hz, step_hz.abs() <= 1e3, "within 1000")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::synth::presets::Preset;

    /// The field that is refused once the scene is changed.
    fn refused(change: impl Fn(&mut Scene)) -> String {
        let mut scene = Scene {
            camera: Camera { gyro: Some(Gyro::default()), ..Camera::default() },
            lamp: Some(Lamp { spot_px: Some([150.0, 120.0, 60.0]), ..Lamp::default() }),
            ..Scene::default()
        };
        assert!(scene.check().is_ok());
        change(&mut scene);
        scene.check().unwrap_err().place
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(refused(|s| s.rotors[0].phase_deg = Some(x)), "rotors[0].phase_deg");
            assert_eq!(refused(|s| s.rotors[0].tilt_axis_deg = x), "rotors[0].tilt_axis_deg");
            assert_eq!(refused(|s| s.rotors[0].hunting = x), "rotors[0].hunting");
            assert_eq!(refused(|s| s.rotors[0].ramp_per_s = x), "rotors[0].ramp_per_s");
            assert_eq!(refused(|s| s.camera.tremor_px = x), "camera.tremor_px");
            assert_eq!(refused(|s| s.camera.drift_px_s[1] = x), "camera.drift_px_s[1]");
            assert_eq!(refused(|s| s.camera.roll_rad_s = x), "camera.roll_rad_s");
            assert_eq!(refused(|s| s.vibration.amplitude_px = x), "vibration.amplitude_px");
            assert_eq!(refused(|s| s.vibration.second_px = x), "vibration.second_px");
            assert_eq!(refused(|s| s.vibration.frequency_hz = Some(x)), "vibration.frequency_hz");
            assert_eq!(refused(|s| s.sensor.jitter_us = x), "sensor.jitter_us");
            assert_eq!(refused(|s| s.clock.error_ppm = Some(x)), "clock.error_ppm");
            assert_eq!(refused(|s| s.clock.sigma_ppm = x), "clock.sigma_ppm");
            assert_eq!(refused(|s| s.background.contrast = x), "background.contrast");
            let harmonics = |s: &mut Scene| s.lamp.as_mut().unwrap().harmonics[1] = x;
            assert_eq!(refused(harmonics), "lamp.harmonics[1]");
            let spot = |s: &mut Scene| s.lamp.as_mut().unwrap().spot_px = Some([1.0, x, 1.0]);
            assert_eq!(refused(spot), "lamp.spot_px[1]");
            let noise = |s: &mut Scene| s.camera.gyro.as_mut().unwrap().noise_rad_s = x;
            assert_eq!(refused(noise), "camera.gyro.noise_rad_s");
            let offset = |s: &mut Scene| s.camera.gyro.as_mut().unwrap().offset_rad_s = x;
            assert_eq!(refused(offset), "camera.gyro.offset_rad_s");
        }
    }

    #[test]
    fn numbers_without_sense_are_refused() {
        assert_eq!(refused(|s| s.clock.error_ppm = Some(-1e6)), "clock.error_ppm");
        assert_eq!(refused(|s| s.clock.sigma_ppm = -1.0), "clock.sigma_ppm");
        assert_eq!(refused(|s| s.vibration.amplitude_px = -1.0), "vibration.amplitude_px");
        assert_eq!(refused(|s| s.vibration.frequency_hz = Some(0.0)), "vibration.frequency_hz");
        assert_eq!(refused(|s| s.rotors[0].ramp_per_s = 1e9), "rotors[0].ramp_per_s");
        let noise = |s: &mut Scene| s.camera.gyro.as_mut().unwrap().noise_rad_s = -1.0;
        assert_eq!(refused(noise), "camera.gyro.noise_rad_s");
    }

    #[test]
    fn movers_are_checked() {
        let mover = |preset: Preset, change: fn(&mut Mover)| {
            refused(|s| {
                s.movers = preset.scene().movers;
                assert!(s.check().is_ok());
                change(&mut s.movers[0]);
            })
        };
        let spacing = mover(Preset::Grating, |mover| {
            if let Mover::Bars { spacing_px, .. } = mover {
                *spacing_px = Some(0.0);
            }
        });
        assert_eq!(spacing, "movers[0].spacing_px");
        let height = mover(Preset::Walker, |mover| {
            if let Mover::Walker { height_px, .. } = mover {
                *height_px = 0.0;
            }
        });
        assert_eq!(height, "movers[0].height_px");
        let speed = mover(Preset::Walker, |mover| {
            if let Mover::Walker { speed_px_s, .. } = mover {
                *speed_px_s = f64::NAN;
            }
        });
        assert_eq!(speed, "movers[0].speed_px_s");
    }

    #[test]
    fn a_refusal_names_field_value_and_limits() {
        let mut scene = Scene::default();
        scene.clock.error_ppm = Some(-1e6);
        let told = scene.check().unwrap_err().to_string();
        assert!(
            told.starts_with("clock.error_ppm is -1000000, but has to be within 100000"),
            "{told}"
        );
    }
}
