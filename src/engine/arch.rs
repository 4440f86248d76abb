//! The instructions that loops over points are run in: the widest that the processor has, which is asked.
//!
//! To measure what each is worth, a build is held to fewer where `CFODI_SIMD` is `plain` or `avx2` while it is compiled.

use pulp::Arch;

const _: () = assert!(
    match option_env!("CFODI_SIMD") {
        None => true,
        Some(most) => matches!(most.as_bytes(), b"plain" | b"avx2"),
    },
    "CFODI_SIMD is `plain`, `avx2` or not set"
);

/// The widest instructions of the processor that this build takes.
pub(crate) fn arch() -> Arch {
    match option_env!("CFODI_SIMD") {
        Some("plain") => Arch::Scalar,
        #[cfg(target_arch = "x86_64")]
        Some("avx2") => pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3),
        _ => Arch::new(),
    }
}
