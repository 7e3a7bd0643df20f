//! The flight on a Cortex-M4F without an operating system: the machine `mps2-an386`, emulated by qemu.
//!
//! Lines and the exit status are written by semihosting. After the lines of the flight come
//!
//! ```text
//! bytes <step | flash | tuner | static | stack | beginning> <number>
//! ```
//!
//! *flash* is the whole image: code, tables, pack, axis. *static* is all static memory, including the tuner's.
//! *stack* is the high-water mark of the stack and *beginning* that before the first tick: the stack is painted
//! at reset, and the lowest changed word is searched. *step* is the stack of the tuner's core with its axis alone, as in a
//! control loop whose analysis runs in another thread.
#![no_std]
#![no_main]

use core::arch::{asm, global_asm};
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr;

use onecycle_flight::{Analyst, Line, fly, fly_core, settings};
use onecycle_onboard::identification::{Analysis, Bench, Desk};
use onecycle_onboard::pack::Pack;
use onecycle_onboard::tuner::{CheckedSettings, TunerCore};

/// Operations of semihosting, and the reason code of a normal exit (Arm, "Semihosting for AArch32 and AArch64",
/// 2.0).
const WRITE0: u32 = 0x04;
const EXIT_EXTENDED: u32 = 0x20;
const APPLICATION_EXIT: u32 = 0x2_0026;

/// Timer 0 of the machine, a CMSDK APB timer: control, value, reload. It counts down at 25 MHz.
const TIMER_CONTROL: *mut u32 = 0x4000_0000 as *mut u32;
const TIMER_VALUE: *const u32 = 0x4000_0004 as *const u32;
const TIMER_RELOAD: *mut u32 = 0x4000_0008 as *mut u32;
/// In run.sh an instruction takes 2^7 ns of the emulated time, 3.2 counts of 40 ns, so every instruction is
/// counted. The counter wraps after 1.3 thousand million instructions.
const COUNTS_OF_TEN_INSTRUCTIONS: u64 = 32;

/// Rounds of a loop of two instructions that checks the counter, and the tolerance for the instructions around
/// it.
const CHECKED_ROUNDS: u32 = 10_000;
const MOST_OFF: u64 = 10;

const PAINT: u32 = 0xa5a5_a5a5;

// Startup before Rust code: enable the floating-point unit, copy data, clear bss, paint the stack.
global_asm!(
    ".pushsection .text.onecycle_reset",
    ".global onecycle_reset",
    ".thumb_func",
    "onecycle_reset:",
    "ldr r0, =0xe000ed88",
    "ldr r1, [r0]",
    "orr r1, r1, #0xf00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "ldr r0, =__data_start",
    "ldr r1, =__data_end",
    "ldr r2, =__data_load",
    "0: cmp r0, r1",
    "ittt lo",
    "ldrlo r3, [r2], #4",
    "strlo r3, [r0], #4",
    "blo 0b",
    "ldr r0, =__bss_start",
    "ldr r1, =__bss_end",
    "movs r3, #0",
    "0: cmp r0, r1",
    "itt lo",
    "strlo r3, [r0], #4",
    "blo 0b",
    "ldr r0, =__stack_bottom",
    "ldr r3, ={paint}",
    "0: cmp r0, sp",
    "itt lo",
    "strlo r3, [r0], #4",
    "blo 0b",
    "bl {run}",
    "udf #0",
    ".popsection",
    paint = const PAINT,
    run = sym run,
);

unsafe extern "C" {
    fn onecycle_reset() -> !;
    static __stack_bottom: u32;
    static __stack_top: u32;
    static __data_start: u32;
    static __bss_end: u32;
    static __flash_end: u32;
}

/// Reset and exception vectors; the linker script puts the initial stack pointer before them.
#[unsafe(link_section = ".vectors")]
#[used]
static VECTORS: [unsafe extern "C" fn() -> !; 15] = {
    let mut vectors: [unsafe extern "C" fn() -> !; 15] = [fault; 15];
    vectors[0] = onecycle_reset;
    vectors
};

static mut CORE: MaybeUninit<TunerCore> = MaybeUninit::uninit();
static mut DESK: Desk = Desk::NEW;
static mut BENCH: Bench = Bench::NEW;

extern "C" fn run() -> ! {
    start_timer();
    if !counts_instructions() {
        leave(
            "the timer does not count instructions: check -icount in run.sh",
            1,
        )
    }
    let (Ok(checked), Ok(pack)) = (settings().checked(), Pack::embedded()) else {
        leave("settings rejected", 1)
    };
    // SAFETY: nothing else uses these statics, and this function runs once.
    let (core, desk, bench) = unsafe {
        (
            &mut *(&raw mut CORE),
            &mut *(&raw mut DESK),
            &mut *(&raw mut BENCH),
        )
    };
    let core = core.write(TunerCore::of(&checked));
    let mut analyst = Analyst {
        analysis: Analysis::new(pack),
        desk,
        bench,
    };
    let beginning = stack();
    let is_tuned = fly(core, &mut analyst, laps(), say);
    let whole = stack();
    let core = core_again(&checked);
    let step = stack_under(|| fly_core(core, desk));
    for (name, bytes) in [
        ("step", step),
        ("flash", (&raw const __flash_end).addr()),
        (
            "tuner",
            size_of::<TunerCore>()
                + size_of::<Analysis<'static>>()
                + size_of::<Desk>()
                + size_of::<Bench>(),
        ),
        (
            "static",
            distance(&raw const __data_start, &raw const __bss_end),
        ),
        ("stack", whole),
        ("beginning", beginning),
    ] {
        say(Line::default()
            .word("bytes")
            .word(name)
            .number(bytes as u64));
    }
    if is_tuned {
        leave("ok", 0)
    } else {
        leave("no controller found, or a wrong one", 1)
    }
}

/// A second core, in the place of the first.
fn core_again(checked: &CheckedSettings) -> &'static mut TunerCore {
    // SAFETY: the first core is no longer used.
    unsafe { (*(&raw mut CORE)).write(TunerCore::of(checked)) }
}

/// Stack that `work` takes below this function's frame (bytes).
#[inline(never)]
fn stack_under(work: impl FnOnce()) -> usize {
    let here: *const u32;
    // SAFETY: reads the stack pointer.
    unsafe { asm!("mov {0}, sp", out(reg) here, options(nomem, nostack)) };
    let mut word = (&raw const __stack_bottom).cast_mut();
    while word.cast_const() < here {
        // SAFETY: below the stack pointer no frame lives.
        unsafe { ptr::write_volatile(word, PAINT) };
        word = word.wrapping_add(1);
    }
    work();
    stack() - distance(here, &raw const __stack_top)
}

/// Largest use of the stack so far (bytes).
fn stack() -> usize {
    let (mut lowest, top) = (&raw const __stack_bottom, &raw const __stack_top);
    // SAFETY: reads words between the ends of the stack; the caller's frame is not part of the paint.
    while lowest < top && unsafe { ptr::read_volatile(lowest) } == PAINT {
        lowest = lowest.wrapping_add(1);
    }
    distance(lowest, top)
}

fn distance(from: *const u32, to: *const u32) -> usize {
    to.addr() - from.addr()
}

fn start_timer() {
    // SAFETY: registers of the timer, which nothing else uses.
    unsafe {
        ptr::write_volatile(TIMER_RELOAD, u32::MAX);
        ptr::write_volatile(TIMER_CONTROL, 1);
    }
}

/// Returns a function that tells the instructions since its last call, rounded.
fn laps() -> impl FnMut() -> u64 {
    let mut last = u32::MAX;
    move || {
        // SAFETY: a register of the timer.
        let now = unsafe { ptr::read_volatile(TIMER_VALUE) };
        let counts = u64::from(last.wrapping_sub(now));
        last = now;
        (10 * counts + COUNTS_OF_TEN_INSTRUCTIONS / 2) / COUNTS_OF_TEN_INSTRUCTIONS
    }
}

/// Whether a loop with a known number of instructions is counted correctly.
fn counts_instructions() -> bool {
    let mut lap = laps();
    lap();
    let idle = lap();
    // SAFETY: counts a register of its own down to zero.
    unsafe {
        asm!("0: subs {0}, #1", "bne 0b", inout(reg) CHECKED_ROUNDS => _, options(nomem, nostack));
    }
    let counted = lap().saturating_sub(idle);
    counted.abs_diff(2 * u64::from(CHECKED_ROUNDS)) <= MOST_OFF
}

fn say(line: &mut Line) {
    let ended = line.ended();
    semihost(WRITE0, ended.as_ptr());
}

fn leave(sentence: &str, status: u32) -> ! {
    say(Line::default().word(sentence));
    let block = [APPLICATION_EXIT, status];
    loop {
        semihost(EXIT_EXTENDED, block.as_ptr().cast());
    }
}

fn semihost(operation: u32, argument: *const u8) {
    // SAFETY: the emulator reads what the argument points to, which lives as long as the call.
    unsafe {
        asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument, options(nostack));
    }
}

extern "C" fn fault() -> ! {
    leave("a fault of the processor", 101)
}

#[panic_handler]
fn panicked(_: &PanicInfo<'_>) -> ! {
    leave("panicked", 101)
}
