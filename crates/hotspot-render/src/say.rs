//! Lines for people. A reader that went away (`hotspot-render … | head`) is no reason to end a render, so errors of the
//! two streams are ignored.

/// A line on standard output.
macro_rules! out {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($words)*);
    }};
}

/// A line on standard error.
macro_rules! err {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($words)*);
    }};
}

pub(crate) use {err, out};
