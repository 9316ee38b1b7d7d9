//! Which exceptions wait, which are active, and who goes before whom (Armv7-M Architecture Reference Manual, B1.5, B3.4).

/// Interrupt lines of the STM32F746.
pub const LINES: usize = 98;
/// Priority bits that are implemented: the upper four.
const PRIORITY_BITS: u8 = 0xf0;
/// Number of the first interrupt among the exceptions.
pub const FIRST_LINE: u16 = 16;
/// Exception numbers.
pub const NMI: u16 = 2;
/// A fault that no other handler takes.
pub const HARD_FAULT: u16 = 3;
/// `svc`.
pub const SV_CALL: u16 = 11;
/// Pended by software.
pub const PEND_SV: u16 = 14;
/// The core's own timer.
pub const SYS_TICK: u16 = 15;

const WORDS: usize = LINES.div_ceil(32);
/// Priority of thread mode: below all.
const THREAD: i16 = 256;

/// Interrupt controller.
pub struct Nvic {
    enabled: [u32; WORDS],
    pending: [u32; WORDS],
    level: [u32; WORDS],
    /// Waiting exceptions below 16, a bit each.
    system: u16,
    /// By exception number.
    priorities: [u8; FIRST_LINE as usize + LINES],
    /// Handlers that run, the innermost last, with the priority that each was entered at.
    active: Vec<(u16, i16)>,
}

impl Default for Nvic {
    fn default() -> Self {
        Self {
            enabled: [0; WORDS],
            pending: [0; WORDS],
            level: [0; WORDS],
            system: 0,
            priorities: [0; FIRST_LINE as usize + LINES],
            active: Vec::new(),
        }
    }
}

impl Nvic {
    /// Sets an interrupt line; a rising line pends its interrupt.
    pub fn set_line(&mut self, line: u8, high: bool) {
        let (word, bit) = (usize::from(line) / 32, 1 << (line % 32));
        if high && self.level[word] & bit == 0 {
            self.pending[word] |= bit;
        }
        self.level[word] = if high { self.level[word] | bit } else { self.level[word] & !bit };
    }

    /// Pends an exception below 16.
    pub fn pend(&mut self, exception: u16) {
        self.system |= 1 << exception;
    }

    /// Takes back that an exception below 16 waits.
    pub fn unpend(&mut self, exception: u16) {
        self.system &= !(1 << exception);
    }

    /// Whether an exception below 16 waits.
    pub fn is_pending(&self, exception: u16) -> bool {
        self.system & (1 << exception) != 0
    }

    /// Whether any interrupt waits, enabled or not.
    pub fn any_line_pending(&self) -> bool {
        self.pending.iter().any(|word| *word != 0)
    }

    fn priority(&self, exception: u16) -> i16 {
        match exception {
            NMI => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priorities[usize::from(exception)]),
        }
    }

    /// The waiting exception that goes first, with its priority.
    pub fn first(&self) -> Option<(u16, i16)> {
        let mut best: Option<(u16, i16)> = None;
        let mut look = |exception: u16| {
            let priority = self.priority(exception);
            if best.is_none_or(|(_, least)| priority < least) {
                best = Some((exception, priority));
            }
        };
        let mut system = self.system;
        while system != 0 {
            look(system.trailing_zeros() as u16);
            system &= system - 1;
        }
        for (index, (pending, enabled)) in self.pending.iter().zip(self.enabled).enumerate() {
            let mut word = pending & enabled;
            while word != 0 {
                look(FIRST_LINE + index as u16 * 32 + word.trailing_zeros() as u16);
                word &= word - 1;
            }
        }
        best
    }

    /// The exception that would interrupt what runs now, were it not for the masks.
    pub fn preempting(&self) -> Option<(u16, i16)> {
        self.first().filter(|(_, priority)| *priority < self.running())
    }

    /// Priority of what runs now, without the masks.
    pub fn running(&self) -> i16 {
        self.active.iter().map(|(_, priority)| *priority).min().unwrap_or(THREAD)
    }

    /// Number of the handler that runs, 0 in thread mode.
    pub fn current(&self) -> u16 {
        self.active.last().map_or(0, |(exception, _)| *exception)
    }

    /// Handlers that have been entered and not left.
    pub fn depth(&self) -> usize {
        self.active.len()
    }

    /// A handler starts.
    pub fn enter(&mut self, exception: u16) {
        if let Some(line) = exception.checked_sub(FIRST_LINE) {
            self.pending[usize::from(line) / 32] &= !(1 << (line % 32));
        } else {
            self.unpend(exception);
        }
        self.active.push((exception, self.priority(exception)));
    }

    /// The innermost handler ends; an interrupt whose line is still high waits again.
    pub fn leave(&mut self) {
        let Some((exception, _)) = self.active.pop() else { return };
        if let Some(line) = exception.checked_sub(FIRST_LINE) {
            let (word, bit) = (usize::from(line) / 32, 1 << (line % 32));
            self.pending[word] |= self.level[word] & bit;
        }
    }

    /// Reads a register of the controller, by its offset from 0xE000E000.
    pub fn read(&self, at: u32) -> u32 {
        let word = |words: &[u32; WORDS], base: u32| {
            words.get(((at - base) / 4) as usize).copied().unwrap_or(0)
        };
        match at {
            0x100..0x140 => word(&self.enabled, 0x100),
            0x180..0x1c0 => word(&self.enabled, 0x180),
            0x200..0x240 => word(&self.pending, 0x200),
            0x280..0x2c0 => word(&self.pending, 0x280),
            0x300..0x340 => {
                let first = (at - 0x300) as usize / 4 * 32;
                let active = self.active.iter().filter_map(|(exception, _)| {
                    usize::from(*exception).checked_sub(usize::from(FIRST_LINE) + first)
                });
                active.filter(|bit| *bit < 32).fold(0, |word, bit| word | 1 << bit)
            }
            0x400..0x500 => self.priority_word((at - 0x400) as usize + usize::from(FIRST_LINE)),
            _ => 0,
        }
    }

    /// Writes a register of the controller, by its offset from 0xE000E000.
    pub fn write(&mut self, at: u32, value: u32, size: u8) {
        let index = (at & 0x3f) as usize / 4;
        match at {
            0x100..0x140 => set(&mut self.enabled, index, value),
            0x180..0x1c0 => clear(&mut self.enabled, index, value),
            0x200..0x240 => set(&mut self.pending, index, value),
            0x280..0x2c0 => {
                clear(&mut self.pending, index, value);
                // A line that is still high pends its interrupt again.
                if let (Some(pending), Some(level)) =
                    (self.pending.get_mut(index), self.level.get(index))
                {
                    *pending |= level & value;
                }
            }
            0x400..0x500 => {
                let first = (at - 0x400) as usize + usize::from(FIRST_LINE);
                self.set_priorities(first, value, size);
            }
            _ => {}
        }
    }

    /// Four priorities from this exception on.
    pub fn priority_word(&self, first: usize) -> u32 {
        let byte = |index: usize| self.priorities.get(first + index).copied().unwrap_or(0);
        u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
    }

    /// Sets as many priorities as the access is bytes wide.
    pub fn set_priorities(&mut self, first: usize, value: u32, size: u8) {
        for (index, byte) in value.to_le_bytes().into_iter().take(usize::from(size)).enumerate() {
            if let Some(priority) = self.priorities.get_mut(first + index) {
                *priority = byte & PRIORITY_BITS;
            }
        }
    }
}

fn set(words: &mut [u32; WORDS], index: usize, bits: u32) {
    if let Some(word) = words.get_mut(index) {
        *word |= bits;
    }
}

fn clear(words: &mut [u32; WORDS], index: usize, bits: u32) {
    if let Some(word) = words.get_mut(index) {
        *word &= !bits;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(priorities: &[(u8, u8)]) -> Nvic {
        let mut nvic = Nvic::default();
        for &(line, priority) in priorities {
            nvic.write(0x100 + u32::from(line) / 32 * 4, 1 << (line % 32), 4);
            nvic.write(0x400 + u32::from(line), u32::from(priority), 1);
        }
        nvic
    }

    #[test]
    fn a_handler_is_interrupted_by_a_more_urgent_one_only() {
        let mut nvic = with(&[(40, 0x80), (77, 0x40)]);
        nvic.set_line(40, true);
        assert_eq!(nvic.preempting(), Some((56, 0x80)));
        nvic.enter(56);
        nvic.set_line(77, true);
        assert_eq!(nvic.preempting(), Some((93, 0x40)));
        nvic.enter(93);
        nvic.set_line(77, false);
        assert_eq!((nvic.preempting(), nvic.current()), (None, 93));
        nvic.leave();
        assert_eq!(nvic.current(), 56);
        // Its line is still high: it is entered again.
        nvic.leave();
        assert_eq!(nvic.preempting(), Some((56, 0x80)));
    }

    #[test]
    fn of_two_alike_the_lower_number_goes_first() {
        let mut nvic = with(&[(40, 0x80), (41, 0x8f)]);
        nvic.set_line(41, true);
        nvic.set_line(40, true);
        assert_eq!(nvic.first(), Some((56, 0x80)));
    }

    #[test]
    fn what_is_not_enabled_waits() {
        let mut nvic = Nvic::default();
        nvic.set_line(3, true);
        assert_eq!((nvic.first(), nvic.any_line_pending()), (None, true));
    }
}
