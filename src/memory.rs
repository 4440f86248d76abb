//! The memory of this process, where the system tells (Linux).

/// What it has in memory now (MB).
pub fn resident_mb() -> Option<f64> {
    of_status("VmRSS:")
}

/// The most that it has had (MB).
pub fn peak_resident_mb() -> Option<f64> {
    of_status("VmHWM:")
}

/// Has the system give so many bytes now, and gives them back to the allocator, which keeps them for some seconds. Where a
/// hypervisor hands out memory page by page (150 MB/s were measured), whoever takes more in than that comes to a stand.
pub fn prefault(bytes: usize) {
    std::hint::black_box(vec![1_u8; bytes]);
}

fn of_status(field: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    megabytes(&status, field)
}

/// The system writes kB and means KiB.
fn megabytes(status: &str, field: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix(field))?;
    let kib: f64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_calls_kilobytes_are_of_1024_bytes() {
        let status = "Name:\tcfodi\nVmHWM:\t  20000 kB\nVmRSS:\t  10000 kB\nThreads:\t7\n";
        assert_eq!(megabytes(status, "VmRSS:"), Some(10.24));
        assert_eq!(megabytes(status, "VmHWM:"), Some(20.48));
        assert_eq!([megabytes(status, "VmSwap:"), megabytes("VmRSS: many kB", "VmRSS:")], [None; 2]);
    }
}
