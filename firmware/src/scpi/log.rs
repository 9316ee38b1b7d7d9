//! Log lines: the JSON object of a reading, as in the "readings" of `evtach measure --json`.

use core::fmt;

use evtach_core::{Reading, RotorReading, Status};

use super::seconds::Seconds;

/// One line without its end: times in seconds of the sensor's clock from `first_us` on.
#[derive(Clone, Copy, Debug)]
pub struct LogLine<'r> {
    /// What was measured.
    pub reading: &'r Reading,
    /// What times count from in sensor time, in microseconds.
    pub first_us: u64,
}

impl fmt::Display for LogLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Reading { t_us, window_us, status, rotors, .. } = self.reading;
        write!(
            f,
            "{{\"t_s\":{},\"window_s\":{},{},\"rotors\":[",
            Seconds(t_us.saturating_sub(self.first_us)),
            Seconds(u64::from(*window_us)),
            StatusFields(*status)
        )?;
        for (index, rotor) in rotors.iter().enumerate() {
            if index > 0 {
                f.write_str(",")?;
            }
            write_rotor(f, rotor)?;
        }
        f.write_str("]}")
    }
}

fn write_rotor(f: &mut fmt::Formatter<'_>, rotor: &RotorReading) -> fmt::Result {
    let RotorReading { id, x_px, y_px, radius_px, blades, status, speed, evidence: _ } = rotor;
    let speed = speed.as_ref();
    write!(
        f,
        "{{\"id\":\"{}\",\"x_px\":{},\"y_px\":{},\"radius_px\":{},\"rpm\":{},\"rpm_sigma\":{},",
        Letter(*id),
        Number(Some(*x_px)),
        Number(Some(*y_px)),
        Number(Some(*radius_px)),
        Number(speed.map(|speed| speed.rpm())),
        Number(speed.map(|speed| speed.rpm_sigma())),
    )?;
    write!(f, "\"direction\":{},\"blades\":", Word(speed.map(|speed| speed.direction().as_str())))?;
    match blades {
        Some(blades) => write!(f, "{blades}")?,
        None => f.write_str("null")?,
    }
    write!(
        f,
        ",\"accel_rpm_per_s\":{},\"frame\":{},{}}}",
        Number(speed.and_then(|speed| speed.accel_rpm_per_s())),
        Word(speed.map(|speed| speed.frame.as_str())),
        StatusFields(*status)
    )
}

/// A rotor's letter: A to Z, then R26 and on, as the PC writes it.
#[derive(Clone, Copy, Debug)]
pub struct Letter(pub u8);

impl fmt::Display for Letter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            id @ 0..26 => write!(f, "{}", char::from(b'A' + id)),
            id => write!(f, "R{id}"),
        }
    }
}

/// The shortest digits that give the same f32 again; null where there is no number.
struct Number(Option<f32>);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.filter(|value| value.is_finite()) {
            Some(value) => f.write_str(ryu::Buffer::new().format_finite(value)),
            None => f.write_str("null"),
        }
    }
}

struct Word(Option<&'static str>);

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(word) => write!(f, "\"{word}\""),
            None => f.write_str("null"),
        }
    }
}

struct StatusFields(Status);

impl fmt::Display for StatusFields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = Word(self.0.reason().map(evtach_core::Reason::as_str));
        write!(f, "\"status\":\"{}\",\"reason\":{reason}", self.0.as_str())
    }
}
