//! The library for a page: messages in JSON, files in chunks.
//!
//! The page writes into the transfer buffer ([`transfer`]), then calls [`append`] (bytes of the file) or [`ask`] (a
//! message, see [`session`]); `ask` leaves its answer in the same buffer. Lengths are in bytes.

pub mod session;

use std::cell::RefCell;

use session::Session;

thread_local! {
    static SESSION: RefCell<(Session, Vec<u8>)> = RefCell::default();
}

/// Makes the transfer buffer `length` bytes long and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn transfer(length: usize) -> *mut u8 {
    SESSION.with_borrow_mut(|(_, buffer)| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// Address of the transfer buffer.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    SESSION.with_borrow(|(_, buffer)| buffer.as_ptr())
}

/// Appends the transfer buffer to the file.
#[unsafe(no_mangle)]
pub extern "C" fn append() {
    SESSION.with_borrow_mut(|(session, buffer)| session.append(buffer));
}

/// Answers the message in the transfer buffer there. Returns the length of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn ask() -> usize {
    SESSION.with_borrow_mut(|(session, buffer)| {
        *buffer = session.ask(buffer).to_string().into_bytes();
        buffer.len()
    })
}
