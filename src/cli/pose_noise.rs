//! `--pose-noise M,RAD`, of the verbs that simulate.

use cfodi::sim::PoseNoise;

/// Two standard deviations, each from 0 to 1 (m, rad).
pub(super) fn pose_noise(text: &str) -> Result<PoseNoise, String> {
    let sigma = |text: &str| {
        let sigma: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
        let fits = (0.0..=1.0).contains(&sigma);
        if fits { Ok(sigma) } else { Err(format!("{sigma} is not from 0 to 1")) }
    };
    let (m, rad) = text.split_once(',').ok_or("two numbers are meant: M,RAD")?;
    Ok(PoseNoise { metres: sigma(m)?, radians: sigma(rad)? })
}
