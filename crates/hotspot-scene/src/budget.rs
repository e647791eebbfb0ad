//! Memory accounting: every allocation whose size a file dictates is announced here before it is made.

use std::cell::Cell;

use crate::error::{Result, limit};

/// What loading may still allocate. Charges are estimates from above and are not given back, since buffers, decoded
/// geometry and textures are alive together while a file loads.
pub(crate) struct Budget {
    used: Cell<u64>,
    limit: u64,
}

impl Budget {
    pub(crate) fn new(limit: u64) -> Self {
        Self { used: Cell::new(0), limit }
    }

    /// Announces `count` items of `size` bytes for `element`.
    pub(crate) fn charge(&self, count: u64, size: u64, element: &str) -> Result<()> {
        let total = count.checked_mul(size).and_then(|bytes| self.used.get().checked_add(bytes));
        match total {
            Some(total) if total <= self.limit => {
                self.used.set(total);
                Ok(())
            }
            _ => Err(limit(
                element,
                format!(
                    "loading needs more than the memory limit of {} ({count} more items of {size} bytes)",
                    readable(self.limit)
                ),
                "raise the memory limit or simplify the scene",
            )),
        }
    }

    /// Bytes that may still be charged.
    pub(crate) fn left(&self) -> u64 {
        self.limit.saturating_sub(self.used.get())
    }
}

/// A size as people read it.
pub(crate) fn readable(bytes: u64) -> String {
    match bytes {
        0..0x400 => format!("{bytes} bytes"),
        0x400..0x10_0000 => format!("{} KiB", bytes >> 10),
        0x10_0000..0x4000_0000 => format!("{} MiB", bytes >> 20),
        _ => format!("{:.1} GiB", bytes as f64 / f64::from(1u32 << 30)),
    }
}

/// An empty vector with room for `count` items, or a clear error where the machine has no more.
pub(crate) fn room_for<T>(count: usize, element: &str) -> Result<Vec<T>> {
    let mut items = Vec::new();
    items.try_reserve_exact(count).map_err(|_| {
        limit(
            element,
            format!("the system has no memory for {count} items of {} bytes", size_of::<T>()),
            "free memory or simplify the scene",
        )
    })?;
    Ok(items)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charges_add_up_and_never_wrap() {
        let budget = Budget::new(100);
        budget.charge(5, 10, "a").unwrap();
        budget.charge(1, 50, "b").unwrap();
        assert_eq!(budget.left(), 0);
        assert!(budget.charge(1, 1, "c").unwrap_err().to_string().contains("memory limit of 100 bytes"));
        assert!(Budget::new(u64::MAX).charge(1 << 62, 12, "d").is_err());
    }

    #[test]
    fn room_that_does_not_exist_is_an_error() {
        assert!(room_for::<u64>(usize::MAX / 16, "accessors[0]").is_err());
    }
}
