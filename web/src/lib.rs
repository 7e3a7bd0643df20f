//! The library for a page: messages in JSON, and one file that the page reads in pieces.
//!
//! The page writes a message into the buffer ([`buffer`]) and calls [`ask`], which leaves its answer there
//! ([`answer`]). While it works, it calls three functions of the page: for bytes of the file, for news of its progress, and
//! before it stops in a panic. Lengths are in bytes, texts are UTF-8.

use std::cell::RefCell;
use std::io::{self, BufReader, Read};

use onecycle::Source;
use onecycle_cli::studio::{self, Studio};

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Copies at most `length` bytes of the file from `offset` on to `target`. Returns their number, negative: failed.
    fn read(offset: f64, target: *mut u8, length: usize) -> i32;
    /// Hears what goes on: bytes done, and bytes in all, which are negative where nobody knows.
    fn progress(work: *const u8, length: usize, done: f64, all: f64);
    /// Hears why the program stops.
    fn stopped(reason: *const u8, length: usize);
}

/// Bytes asked for at once.
const PIECE: usize = 1 << 20;

/// Bytes between two messages on the progress.
const STEP: u64 = 1 << 21;

/// The file of the page.
struct File {
    name: String,
    length: u64,
}

impl Source for File {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn open(&self) -> io::Result<Box<dyn Read + '_>> {
        let reader = Reader {
            work: format!("reading {}", self.name),
            length: self.length,
            offset: 0,
            told: 0,
        };
        tell(&reader.work, 0, Some(self.length));
        Ok(Box::new(BufReader::with_capacity(PIECE, reader)))
    }
}

struct Reader {
    work: String,
    length: u64,
    offset: u64,
    told: u64,
}

/// Tells the page what goes on.
fn tell(work: &str, done: u64, all: Option<u64>) {
    let all = all.map_or(-1.0, |all| all as f64);
    // SAFETY: the page only reads the text.
    unsafe { progress(work.as_ptr(), work.len(), done as f64, all) };
}

impl Read for Reader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        // SAFETY: the page writes at most `bytes.len()` bytes from `bytes` on.
        let count = unsafe { read(self.offset as f64, bytes.as_mut_ptr(), bytes.len()) };
        let count = usize::try_from(count)
            .map_err(|_| io::Error::other("the browser cannot read the file any more"))?;
        self.offset += count as u64;
        if self.offset - self.told >= STEP {
            self.told = self.offset;
            tell(&self.work, self.offset, Some(self.length));
        }
        Ok(count)
    }
}

thread_local! {
    static STUDIO: RefCell<Studio> = RefCell::default();
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(vec![]) };
}

/// To be called once, first.
#[unsafe(no_mangle)]
pub extern "C" fn start() {
    studio::listen(tell);
    std::panic::set_hook(Box::new(|about| {
        let reason = about.to_string();
        // SAFETY: the page only reads the text.
        unsafe { stopped(reason.as_ptr(), reason.len()) };
    }));
}

/// Makes the buffer `length` bytes long and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn buffer(length: usize) -> *mut u8 {
    BUFFER.with_borrow_mut(|buffer| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// Address of the buffer.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    BUFFER.with_borrow(|buffer| buffer.as_ptr())
}

fn text() -> String {
    BUFFER.with_borrow(|buffer| String::from_utf8_lossy(buffer).into_owned())
}

/// The file of the page has the name in the buffer and this length.
#[unsafe(no_mangle)]
pub extern "C" fn file(length: f64) {
    let file = File {
        name: text(),
        length: length as u64,
    };
    STUDIO.with_borrow_mut(|studio| studio.take(Box::new(file)));
}

/// Answers the message in the buffer there. Returns the length of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn ask() -> usize {
    let message = text();
    let answer = STUDIO.with_borrow_mut(|studio| studio.ask(&message));
    BUFFER.replace(answer.into_bytes());
    BUFFER.with_borrow(Vec::len)
}
