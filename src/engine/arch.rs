//! The instructions that loops over points are run in: the widest that the processor has, which is asked.
//!
//! To measure what each is worth, a build is held to fewer by `RUSTFLAGS='--cfg cfodi_simd="plain"'`, or `"avx2"`.

use pulp::Arch;

/// The widest instructions of the processor that this build takes.
pub(crate) fn arch() -> Arch {
    if cfg!(cfodi_simd = "plain") {
        return Arch::Scalar;
    }
    #[cfg(target_arch = "x86_64")]
    if cfg!(cfodi_simd = "avx2") {
        return pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3);
    }
    Arch::new()
}
