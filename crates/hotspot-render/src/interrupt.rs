//! Ctrl-C: the first asks the work to finish its wave and save, the second ends the process.

use crate::fail::INTERRUPTED;
use std::sync::atomic::{AtomicBool, Ordering};

/// Set by the first Ctrl-C; the second ends the process at once.
pub(crate) fn flag() -> &'static AtomicBool {
    static CANCEL: AtomicBool = AtomicBool::new(false);
    // Without a handler Ctrl-C simply ends the process, which is acceptable.
    let _ = ctrlc::set_handler(|| {
        if CANCEL.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(INTERRUPTED));
        }
        crate::say::err!("interrupted: finishing this wave and saving (again to end at once)");
    });
    &CANCEL
}
