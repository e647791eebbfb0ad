//! How much memory the process used.

/// Peak resident memory in bytes; 0 where the system does not say.
pub(crate) fn peak() -> u64 {
    // Linux: "VmHWM:   12345 kB".
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}
