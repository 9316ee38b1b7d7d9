//! A reading as lines of text that keep every bit.

use core::fmt;

use evtach_core::{Evidence, Reading, RotorReading, Speed, Status};

/// One `reading` line, then one `rotor` line per rotor, each ended by a newline. Floats stand as the
/// eight hexadecimal digits of their bits, so that equal lines are equal readings.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'r>(pub &'r Reading);

impl fmt::Display for Lines<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Taken apart without `..`: a new field does not compile until it stands in the line.
        let Reading { t_us, window_us, events, thinned, lost, status, rotors } = self.0;
        writeln!(
            f,
            "reading t_us={t_us} window_us={window_us} events={events} thinned={thinned} lost={lost} status={}",
            StatusWord(*status)
        )?;
        rotors.iter().try_for_each(|rotor| write_rotor(f, rotor))
    }
}

fn write_rotor(f: &mut fmt::Formatter<'_>, rotor: &RotorReading) -> fmt::Result {
    let RotorReading { id, x_px, y_px, radius_px, blades, status, speed, evidence } = rotor;
    write!(
        f,
        "rotor id={id} x_px={} y_px={} radius_px={} blades=",
        Bits(*x_px),
        Bits(*y_px),
        Bits(*radius_px)
    )?;
    match blades {
        Some(blades) => write!(f, "{blades}")?,
        None => f.write_str("-")?,
    }
    write!(f, " status={}", StatusWord(*status))?;
    if let Some(Speed { omega_rad_s, omega_sigma_rad_s, alpha_rad_s2, frame }) = speed {
        write!(
            f,
            " omega_rad_s={} omega_sigma_rad_s={} alpha_rad_s2={} frame={}",
            Bits(*omega_rad_s),
            Bits(*omega_sigma_rad_s),
            MaybeBits(*alpha_rad_s2),
            frame.as_str()
        )?;
    }
    write_evidence(f, evidence)?;
    writeln!(f)
}

/// Writes every field of the evidence under its name; one that is not named does not compile.
macro_rules! write_named {
    ($f:ident, $evidence:ident: events, $($name:ident),+) => {{
        let Evidence { events, $($name),+ } = *$evidence;
        write!($f, " used={events}")?;
        $(write!($f, concat!(" ", stringify!($name), "={}"), MaybeBits($name))?;)+
        Ok(())
    }};
}

fn write_evidence(f: &mut fmt::Formatter<'_>, evidence: &Evidence) -> fmt::Result {
    write_named!(
        f, evidence: events,
        scan_rad_s, scan_score, scan_standing, coherence, symmetry_score,
        initial_rad_s, refined_rad_s, refined_sigma_rad_s, further_rad_s,
        lock_rad_s, lock_sigma_rad_s, sharpness_px, phase_rad_s, phase_sigma_rad_s,
        swing_rad_s, fractional_deviation, periods
    )
}

struct Bits(f32);

impl fmt::Display for Bits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08x}", self.0.to_bits())
    }
}

struct MaybeBits(Option<f32>);

impl fmt::Display for MaybeBits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(value) => Bits(value).fmt(f),
            None => f.write_str("-"),
        }
    }
}

struct StatusWord(Status);

impl fmt::Display for StatusWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.as_str())?;
        match self.0.reason() {
            Some(reason) => write!(f, ":{}", reason.as_str()),
            None => Ok(()),
        }
    }
}
