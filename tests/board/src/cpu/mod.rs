//! What the engine leaves out of a Cortex-M7: exceptions, their frames, and the system control space
//! (Armv7-M Architecture Reference Manual, B1.5).

pub mod nvic;
pub mod system;

use unicorn_engine::{RegisterARM as R, Unicorn, uc_error};

use nvic::{FIRST_LINE, Nvic};

/// The engine, with nothing of ours in it.
pub type Engine = Unicorn<'static, ()>;

/// Addresses from here on are no code: a jump there ends a handler.
const EXC_RETURN: u32 = 0xffff_ff00;
/// Bit of EXC_RETURN: the frame holds no floating-point registers.
const BASIC: u32 = 1 << 4;
/// Bit of EXC_RETURN: back to thread mode.
const TO_THREAD: u32 = 1 << 3;
/// Bit of EXC_RETURN: the frame lies on the process stack.
const PROCESS_STACK: u32 = 1 << 2;
/// Bit of CONTROL: floating-point registers are in use.
const FPCA: u32 = 1 << 2;
/// Bit of CONTROL: thread mode runs on the process stack.
const SPSEL: u32 = 1 << 1;
/// Bit of a stacked xPSR: the stack pointer was moved to a multiple of eight.
const ALIGNED: u32 = 1 << 9;
/// The Thumb bit of xPSR.
const THUMB: u32 = 1 << 24;

const BASIC_WORDS: usize = 8;
const EXTENDED_WORDS: usize = 26;
const GENERAL: [R; 6] = [R::R0, R::R1, R::R2, R::R3, R::R12, R::LR];
const SINGLES: i32 = R::S0 as i32;

/// Reads a register. The engine knows all that are asked for.
pub fn register(engine: &Unicorn<'_, ()>, register: impl Into<i32>) -> u32 {
    engine.reg_read(register).unwrap_or(0) as u32
}

/// Writes a register.
pub fn set_register(engine: &mut Engine, register: impl Into<i32>, value: u32) {
    // The same: it does not fail for a register that there is.
    let _ = engine.reg_write(register, u64::from(value));
}

/// Whether the masks let an exception of this priority through.
pub fn unmasked(engine: &Unicorn<'_, ()>, priority: i16) -> bool {
    if priority < 0 {
        // A fault passes PRIMASK; only its like keeps it off.
        return true;
    }
    let base = register(engine, R::BASEPRI) & 0xf0;
    register(engine, R::PRIMASK) & 1 == 0
        && register(engine, R::FAULTMASK) & 1 == 0
        && (base == 0 || priority < base as i16)
}

/// Starts the handler of an exception and returns its address.
///
/// # Errors
/// When the frame or the vector cannot be reached. The handler of a fault starts all the same: its stack is then lost.
pub fn enter(
    engine: &mut Engine,
    nvic: &mut Nvic,
    exception: u16,
    vtor: u32,
) -> Result<u32, uc_error> {
    let control = register(engine, R::CONTROL);
    let from_thread = nvic.depth() == 0;
    let on_process_stack = from_thread && control & SPSEL != 0;
    let extended = control & FPCA != 0;
    let words = if extended { EXTENDED_WORDS } else { BASIC_WORDS };

    let before = register(engine, R::SP);
    let at = (before - 4 * words as u32) & !7;
    let odd = if before & 4 != 0 { ALIGNED } else { 0 };
    let mut frame = Vec::with_capacity(4 * EXTENDED_WORDS);
    for general in GENERAL {
        frame.extend(register(engine, general).to_le_bytes());
    }
    frame.extend((register(engine, R::PC) & !1).to_le_bytes());
    let xpsr = register(engine, R::XPSR) & !(0x1ff | ALIGNED) | u32::from(nvic.current()) | THUMB;
    frame.extend((xpsr | odd).to_le_bytes());
    if extended {
        for index in 0..16 {
            frame.extend(register(engine, SINGLES + index).to_le_bytes());
        }
        frame.extend(register(engine, R::FPSCR).to_le_bytes());
        frame.extend([0; 4]);
    }
    let stacked = engine.mem_write(u64::from(at), &frame);

    set_register(engine, R::SP, at);
    let mut link = 0xffff_ffe1;
    if !extended {
        link |= BASIC;
    }
    if from_thread {
        link |= TO_THREAD;
    }
    if on_process_stack {
        link |= PROCESS_STACK;
    }
    nvic.enter(exception);
    // No IT block reaches into the handler.
    const IT: u32 = 0x0600_fc00;
    set_register(engine, R::XPSR_NZCVQG, xpsr & !(IT | 0x1ff) | u32::from(exception));
    set_register(engine, R::CONTROL, control & !(FPCA | if from_thread { SPSEL } else { 0 }));
    set_register(engine, R::LR, link);
    let mut vector = [0; 4];
    engine.mem_read(u64::from(vtor + 4 * u32::from(exception)), &mut vector)?;
    let vector = u32::from_le_bytes(vector);
    set_register(engine, R::PC, vector);
    stacked.map(|()| vector)
}

/// Whether this is a jump that ends a handler. The engine tells it without the lowest bit.
pub fn is_return(pc: u32) -> bool {
    pc >= EXC_RETURN
}

/// Ends a handler.
///
/// # Errors
/// When the frame cannot be reached.
pub fn leave(engine: &mut Engine, nvic: &mut Nvic, link: u32) -> Result<(), uc_error> {
    nvic.leave();
    let control = register(engine, R::CONTROL);
    let spsel = if link & PROCESS_STACK != 0 { SPSEL } else { 0 };
    // In handler mode FAULTMASK goes with the handler, except for that of the NMI, which nothing here uses.
    set_register(engine, R::FAULTMASK, 0);
    let extended = link & BASIC == 0;
    let words = if extended { EXTENDED_WORDS } else { BASIC_WORDS };
    let mut frame = [0; 4 * EXTENDED_WORDS];
    let frame = &mut frame[..4 * words];
    let at = register(engine, if spsel != 0 { R::PSP } else { R::SP });
    engine.mem_read(u64::from(at), frame)?;
    let (frame, _) = frame.as_chunks::<4>();
    let word = |index: usize| u32::from_le_bytes(frame[index]);

    let xpsr = word(7);
    set_register(engine, R::IPSR, u32::from(nvic.current()));
    let fpca = if extended { FPCA } else { 0 };
    set_register(engine, R::CONTROL, control & !(FPCA | SPSEL) | fpca | spsel);
    if extended {
        for index in 0..16 {
            set_register(engine, SINGLES + index, word(8 + index as usize));
        }
        set_register(engine, R::FPSCR, word(24));
    }
    for (index, general) in GENERAL.into_iter().enumerate() {
        set_register(engine, general, word(index));
    }
    let moved = if xpsr & ALIGNED != 0 { 4 } else { 0 };
    set_register(engine, R::SP, at + 4 * words as u32 + moved);
    set_register(engine, R::XPSR_NZCVQG, xpsr & !(ALIGNED | 0x1ff) | u32::from(nvic.current()));
    set_register(engine, R::PC, word(6) | 1);
    Ok(())
}

/// Puts the processor where a reset puts it.
///
/// # Errors
/// When the vectors cannot be read.
pub fn reset(engine: &mut Engine, vtor: u32) -> Result<(), uc_error> {
    let mut vectors = [0; 8];
    engine.mem_read(u64::from(vtor), &mut vectors)?;
    let [s0, s1, s2, s3, p0, p1, p2, p3] = vectors;
    for masks in [R::PRIMASK, R::BASEPRI, R::FAULTMASK, R::IPSR, R::CONTROL, R::FPSCR] {
        set_register(engine, masks, 0);
    }
    set_register(engine, R::XPSR_NZCVQG, THUMB);
    set_register(engine, R::LR, 0xffff_ffff);
    set_register(engine, R::SP, u32::from_le_bytes([s0, s1, s2, s3]));
    set_register(engine, R::PC, u32::from_le_bytes([p0, p1, p2, p3]));
    Ok(())
}

/// Name of an exception, as the reference manual of the STM32F746 gives it where a user of this board meets it.
pub fn name(exception: usize) -> String {
    let known = match exception {
        0 => "thread",
        2 => "NMI",
        3 => "HardFault",
        4 => "MemManage",
        5 => "BusFault",
        6 => "UsageFault",
        11 => "SVCall",
        14 => "PendSV",
        15 => "SysTick",
        _ => "",
    };
    if !known.is_empty() {
        return known.to_owned();
    }
    let line = exception.saturating_sub(usize::from(FIRST_LINE));
    match line {
        6..=10 => format!("EXTI{}", line - 6),
        23 => "EXTI9_5".to_owned(),
        24 => "TIM1_BRK_TIM9".to_owned(),
        27 => "TIM1_CC".to_owned(),
        28..=30 => format!("TIM{}", line - 26),
        40 => "EXTI15_10".to_owned(),
        43 => "TIM8_BRK_TIM12".to_owned(),
        44 => "TIM8_UP_TIM13".to_owned(),
        45 => "TIM8_TRG_COM_TIM14".to_owned(),
        50 => "TIM5".to_owned(),
        52 => "UART4".to_owned(),
        53 => "UART5".to_owned(),
        54 => "TIM6_DAC".to_owned(),
        55 => "TIM7".to_owned(),
        67 => "OTG_FS".to_owned(),
        72 => "I2C3_EV".to_owned(),
        73 => "I2C3_ER".to_owned(),
        74 => "OTG_HS_EP1_OUT".to_owned(),
        77 => "OTG_HS".to_owned(),
        82 => "UART7".to_owned(),
        88 => "LTDC".to_owned(),
        92 => "QUADSPI".to_owned(),
        _ => format!("IRQ{line}"),
    }
}
