//! Timers that count up: enough for a time base with compare channels.

use super::Device;
use crate::cpu::nvic::Nvic;
use crate::time::{NEVER, S};

const CR1: u32 = 0x00;
const DIER: u32 = 0x0c;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2c;
const CCR1: u32 = 0x34;
const CCR4: u32 = 0x40;
const CEN: u32 = 1;
const UDIS: u32 = 1 << 1;
const URS: u32 = 1 << 2;
const ONE_PULSE: u32 = 1 << 3;
const UIF: u32 = 1;

/// One timer.
pub struct Tim {
    line: u8,
    widest: u32,
    /// What it counts, before the prescaler.
    hz: u64,
    registers: [u32; 32],
    status: u32,
    psc: u32,
    /// The count at `since`.
    count: u32,
    /// When the count last took its value.
    since: u64,
}

impl Tim {
    /// A timer of 16 or 32 bits.
    pub fn new(line: u8, bits: u8) -> Self {
        let mut tim = Self {
            line,
            widest: if bits == 32 { u32::MAX } else { 0xffff },
            hz: 16_000_000,
            registers: [0; 32],
            status: 0,
            psc: 0,
            count: 0,
            since: 0,
        };
        tim.reset();
        tim
    }

    /// The clock changes.
    pub fn set_clock(&mut self, hz: u64, now: u64) {
        if hz != self.hz {
            self.sync(now);
            self.hz = hz;
            self.since = now;
        }
    }

    fn get(&self, at: u32) -> u32 {
        self.registers[(at / 4) as usize & 31]
    }

    fn on(&self) -> bool {
        self.get(CR1) & CEN != 0 && self.hz > 0
    }

    /// Time in which it counts so many.
    fn span_ps(&self, ticks: u64) -> u64 {
        let ps = u128::from(ticks) * u128::from(S) * u128::from(self.psc + 1);
        u64::try_from(ps.div_ceil(u128::from(self.hz))).unwrap_or(NEVER)
    }

    fn ticks(&self, now: u64) -> u64 {
        let ps = u128::from(now - self.since) * u128::from(self.hz);
        (ps / u128::from(S) / u128::from(self.psc + 1)) as u64
    }

    /// Counts until the count is this, at least one.
    fn until(&self, wanted: u32) -> Option<u64> {
        let (top, count) = (u64::from(self.get(ARR)), u64::from(self.count));
        let wanted = u64::from(wanted);
        if wanted > top {
            return None;
        }
        Some(if wanted > count { wanted - count } else { wanted + top + 1 - count })
    }

    /// Counts up to now and notes what was passed.
    fn sync(&mut self, now: u64) {
        if !self.on() {
            self.since = now;
            return;
        }
        let ticks = self.ticks(now);
        if ticks == 0 {
            return;
        }
        for channel in 0..4 {
            if self.until(self.get(CCR1 + 4 * channel)).is_some_and(|left| left <= ticks) {
                self.status |= 2 << channel;
            }
        }
        let turn = u64::from(self.get(ARR)) + 1;
        let sum = u64::from(self.count) + ticks;
        // The span is rounded up, so that the division above never loses the tick it stands for.
        self.since += self.span_ps(ticks).min(now - self.since);
        if sum >= turn {
            if self.get(CR1) & UDIS == 0 {
                self.status |= UIF;
                self.psc = self.get(PSC) & 0xffff;
            }
            if self.get(CR1) & ONE_PULSE != 0 {
                self.registers[0] &= !CEN;
                self.count = 0;
                return;
            }
        }
        self.count = (sum % turn) as u32;
    }
}

impl Device for Tim {
    fn read(&mut self, at: u32, _size: u8, now: u64) -> u32 {
        self.sync(now);
        match at {
            SR => self.status,
            CNT => self.count,
            _ => self.get(at),
        }
    }

    fn write(&mut self, at: u32, value: u32, _size: u8, now: u64) {
        self.sync(now);
        match at {
            SR => self.status &= value,
            EGR => {
                if value & 1 != 0 {
                    self.psc = self.get(PSC) & 0xffff;
                    self.count = 0;
                    self.since = now;
                    if self.get(CR1) & (URS | UDIS) == 0 {
                        self.status |= UIF;
                    }
                }
                self.status |= value & 0x1e;
            }
            CNT => {
                self.count = value & self.widest;
                self.since = now;
            }
            ARR | CCR1..=CCR4 => self.registers[(at / 4) as usize & 31] = value & self.widest,
            _ => self.registers[(at / 4) as usize & 31] = value,
        }
        if at == CR1 {
            self.since = now.max(self.since);
        }
    }

    fn next(&self) -> u64 {
        let wanted = self.get(DIER) & 0x1f & !self.status;
        if !self.on() || wanted == 0 {
            return NEVER;
        }
        let mut least = NEVER;
        if wanted & UIF != 0 {
            least =
                least.min(u64::from(self.get(ARR)) + 1 - u64::from(self.count.min(self.get(ARR))));
        }
        for channel in 0..4 {
            if wanted & 2 << channel != 0
                && let Some(left) = self.until(self.get(CCR1 + 4 * channel))
            {
                least = least.min(left);
            }
        }
        if least == NEVER { NEVER } else { self.since.saturating_add(self.span_ps(least)) }
    }

    fn advance(&mut self, now: u64, _memory: &mut dyn super::Memory) {
        self.sync(now);
    }

    fn lines(&self, nvic: &mut Nvic) {
        nvic.set_line(self.line, self.status & self.get(DIER) & 0x5f != 0);
    }

    fn reset(&mut self) {
        self.registers = [0; 32];
        self.registers[(ARR / 4) as usize] = self.widest;
        (self.status, self.psc, self.count) = (0, 0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::US;

    /// One count a microsecond, as the time driver sets it.
    fn one_a_microsecond() -> Tim {
        let mut tim = Tim::new(50, 16);
        tim.set_clock(108_000_000, 0);
        tim.write(PSC, 107, 4, 0);
        tim.write(CR1, URS, 4, 0);
        tim.write(EGR, 1, 4, 0);
        assert_eq!(tim.read(SR, 4, 0), 0, "URS keeps the flag off");
        tim.write(CCR1, 0x8000, 4, 0);
        tim.write(DIER, 3, 4, 0);
        tim.write(CR1, URS | CEN, 4, 0);
        tim
    }

    #[test]
    fn counts_exactly_over_many_wraps() {
        let mut tim = one_a_microsecond();
        for step in 0..100_000 {
            let now = step * 7 * US + US / 2;
            assert_eq!(u64::from(tim.read(CNT, 4, now)), step * 7 % 0x1_0000);
        }
    }

    #[test]
    fn flags_come_when_they_are_due() {
        let mut tim = one_a_microsecond();
        assert_eq!(tim.next(), 0x8000 * US);
        assert_eq!(tim.read(SR, 4, 0x8000 * US - 1), 0);
        assert_eq!(tim.read(SR, 4, 0x8000 * US), 2);
        tim.write(SR, !2, 4, 0x8000 * US);
        assert_eq!(tim.next(), 0x1_0000 * US);
        // The other channels compare with zero.
        assert_eq!(tim.read(SR, 4, 0x1_0000 * US) & 3, 1);
    }
}
