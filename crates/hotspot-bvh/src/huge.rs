//! Memory on large pages, where the system gives them on request (Linux, `transparent_hugepage` at `madvise`): rays visit
//! a large tree all over, and most of what they wait for would be page tables. Nothing but speed depends on it.

#![cfg_attr(
    target_os = "linux",
    expect(unsafe_code, reason = "madvise; nothing safe asks for large pages of a Vec")
)]

/// Below this the request is not worth a system call: two large pages.
#[cfg(target_os = "linux")]
const WORTHWHILE: usize = 4 << 20;

/// As [`Vec::with_capacity`].
pub(crate) fn with_capacity<T>(count: usize) -> Vec<T> {
    advised(Vec::with_capacity(count))
}

/// Asks for large pages for what a vector holds or will hold, where nothing has touched it yet.
pub(crate) fn advised<T>(vec: Vec<T>) -> Vec<T> {
    #[cfg(target_os = "linux")]
    if vec.capacity().saturating_mul(size_of::<T>()) >= WORTHWHILE {
        // Where pages are larger and the range does not begin on one, the system refuses, which is as good as no request.
        const PAGE: usize = 4096;
        let start = (vec.as_ptr() as usize).next_multiple_of(PAGE);
        let end = (vec.as_ptr() as usize + vec.capacity() * size_of::<T>()) / PAGE * PAGE;
        // SAFETY: the range lies within an allocation of ours, and the advice changes neither its contents nor what may be
        // done with it. Whether it is taken does not matter.
        unsafe {
            libc::madvise(start as *mut libc::c_void, end - start, libc::MADV_HUGEPAGE);
        }
    }
    vec
}

#[cfg(test)]
mod tests {
    #[test]
    fn holds_what_a_vec_holds_on_either_side_of_the_request() {
        for count in [0u32, 1, 1000, 3 << 20] {
            let mut vec = super::with_capacity(count as usize);
            assert!(vec.capacity() >= count as usize && vec.is_empty());
            vec.extend(0..count);
            assert!(vec.iter().copied().eq(0..count), "{count} numbers");
        }
    }
}
