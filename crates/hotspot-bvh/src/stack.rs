//! The traversal's stack: a fixed array that is not cleared for each ray, spilling to the heap for hostile trees.

#![expect(unsafe_code, reason = "an uninitialised array; clearing it would cost as much as a short ray")]

use core::mem::MaybeUninit;

const INLINE: usize = 96;

/// A stack of small values.
pub(crate) struct Stack<T: Copy> {
    inline: [MaybeUninit<T>; INLINE],
    /// Invariant: the first `len` elements of `inline` are initialised, and `len <= INLINE`.
    len: usize,
    spilled: Vec<T>,
}

/// Apart from the stack itself, so that its length can live in a register.
#[cold]
#[inline(never)]
fn spill<T>(spilled: &mut Vec<T>, value: T) {
    spilled.push(value);
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { inline: [const { MaybeUninit::uninit() }; INLINE], len: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, value: T) {
        if self.len < INLINE {
            self.inline[self.len] = MaybeUninit::new(value);
            self.len += 1;
        } else {
            spill(&mut self.spilled, value);
        }
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        // Spilled values are younger than all inline ones.
        if self.len == INLINE
            && let Some(value) = self.spilled.pop()
        {
            return Some(value);
        }
        self.len = self.len.checked_sub(1)?;
        // SAFETY: the index is below the old `len`, so `push` initialised it.
        Some(unsafe { self.inline[self.len].assume_init() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behaves_as_a_vec_across_the_spill() {
        let (mut stack, mut vec) = (Stack::new(), Vec::new());
        // Deterministic walk that crosses the inline limit many times.
        let mut state = 1u64;
        for step in 0..100_000u64 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let grow = if step / 300 % 2 == 0 { 3 } else { 1 };
            if (state >> 33) % 4 < grow {
                stack.push(step);
                vec.push(step);
            } else {
                assert_eq!(stack.pop(), vec.pop());
            }
        }
        while let Some(expected) = vec.pop() {
            assert_eq!(stack.pop(), Some(expected));
        }
        assert_eq!(stack.pop(), None);
    }
}
