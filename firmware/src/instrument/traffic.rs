//! How many events arrive.

/// Events a second from which on the device can no longer use them all: at 94 instructions an event, reading them and taking
/// them in alone fills 140 of the processor's 216 million instructions.
pub const SATURATION_EV_S: u32 = 1_500_000;

/// Shortest time over which a rate is told, in microseconds.
const RATE_US: u64 = 100_000;

/// Counts since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Traffic {
    /// Events that arrived and found room.
    pub events: u64,
    /// Events that the sensor or the link lost, or that found no room: none of those above.
    pub lost: u64,
}

/// Rates over the last moments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rate {
    /// Events that arrived, per second.
    pub events_per_s: u32,
    /// Events lost, in permille of those sent.
    pub lost_permille: u16,
}

/// From counts to rates.
#[derive(Debug)]
pub(super) struct Meter {
    from_us: Option<u64>,
    from: Traffic,
    last: Traffic,
    /// When the sensor was last seen to have sent an event, lost or not.
    pub last_event_us: Option<u64>,
    pub rate: Rate,
}

impl Meter {
    pub const NEW: Self = Self {
        from_us: None,
        from: Traffic { events: 0, lost: 0 },
        last: Traffic { events: 0, lost: 0 },
        last_event_us: None,
        rate: Rate { events_per_s: 0, lost_permille: 0 },
    };

    /// Takes in the counts at a time.
    pub fn update(&mut self, now_us: u64, traffic: Traffic) {
        if traffic != self.last {
            self.last_event_us = Some(now_us);
        }
        self.last = traffic;
        let Some(from_us) = self.from_us.filter(|from_us| *from_us <= now_us) else {
            (self.from_us, self.from, self.rate) = (Some(now_us), traffic, Rate::default());
            return;
        };
        let took_us = now_us - from_us;
        if took_us < RATE_US {
            return;
        }
        let events = traffic.events.saturating_sub(self.from.events);
        let lost = traffic.lost.saturating_sub(self.from.lost);
        let per_s = events.saturating_mul(1_000_000) / took_us;
        let sent = events.saturating_add(lost).max(1);
        self.rate = Rate {
            events_per_s: u32::try_from(per_s).unwrap_or(u32::MAX),
            // Ten lost of a million are not none.
            lost_permille: lost.saturating_mul(1_000).div_ceil(sent) as u16,
        };
        (self.from_us, self.from) = (Some(now_us), traffic);
    }
}
