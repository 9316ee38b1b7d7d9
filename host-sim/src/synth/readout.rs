//! The bus between pixels and computer: a queue of finite length served at a finite rate.

use super::made::Made;

/// Passes sorted events through a readout of `rate_mev_s` events per microsecond with room for `queue` waiting events.
/// Events are stamped when they are read, as on real sensors; those that find the queue full are lost.
/// Returns how many were lost. Events read after `end_us` are beyond the recording and not counted.
pub fn limit(made: &mut Vec<Made>, rate_mev_s: f64, queue: u32, end_us: u64) -> u64 {
    let service_us = 1.0 / rate_mev_s;
    let mut free_us = 0.0f64;
    let mut lost = 0;
    made.retain_mut(|event| {
        let t_us = event.t_us() as f64;
        if (free_us - t_us) * rate_mev_s > f64::from(queue) {
            lost += 1;
            return false;
        }
        let read_us = free_us.max(t_us);
        free_us = read_us + service_us;
        *event = event.at(read_us as u64);
        event.t_us() < end_us
    });
    lost
}

#[cfg(test)]
mod tests {
    use evtach_core::{Event, Polarity};

    use super::*;

    fn burst(count: u64, every_us: u64) -> Vec<Made> {
        (0..count)
            .map(|i| Event { t_us: i * every_us, x: 0, y: 0, polarity: Polarity::On })
            .map(|event| Made::new(event, None))
            .collect()
    }

    #[test]
    fn slow_events_pass_unchanged() {
        let mut events = burst(100, 10);
        let before = events.clone();
        assert_eq!(limit(&mut events, 1.0, 8, 10_000), 0);
        assert_eq!(events, before);
    }

    #[test]
    fn a_burst_is_delayed_then_lost() {
        // 1000 events at once, one read every 2 us, 10 may wait: one is read at once, 10 wait, the rest are lost.
        let mut events = burst(1000, 0);
        let lost = limit(&mut events, 0.5, 10, 10_000);
        assert_eq!(events.len() as u64 + lost, 1000);
        assert_eq!(events.len(), 11);
        assert_eq!(events[10].t_us(), 20);
    }
}
