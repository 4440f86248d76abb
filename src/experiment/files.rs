//! The files of an experiment: each whole or not at all, and none left of an earlier run.

use std::fs;
use std::path::Path;

use super::figures::figure2_name;
use super::results::Results;
use crate::export::{WriteError, write_whole};

impl Results {
    /// Writes tables, summary and figures into a folder, which is made where it is missing.
    ///
    /// `scans.csv`, `throughput.csv`, `effects.csv`, `summary.json`, the SVG of each of [`Self::figures`] and the PNG of
    /// each of [`Self::pictures`]. Figures of an earlier experiment that this one does not have are removed.
    ///
    /// # Errors
    ///
    /// Where the folder or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let failed = |source| WriteError { path: folder.to_owned(), source };
        fs::create_dir_all(folder).map_err(failed)?;
        let text =
            |name: &str, text: &str| write_whole(&folder.join(name), |out| out.write_all(text.as_bytes()));
        text("scans.csv", &self.scans_csv())?;
        text("throughput.csv", &self.throughput_csv())?;
        text("effects.csv", &self.effects_csv())?;
        write_whole(&folder.join("summary.json"), |out| {
            serde_json::to_writer_pretty(&mut *out, &self.summary())?;
            writeln!(out)
        })?;
        for figure in self.figures() {
            text(&format!("{}.svg", figure.name), &figure.svg)?;
        }
        for picture in self.pictures() {
            let path = folder.join(format!("{}.png", picture.name));
            write_whole(&path, |out| picture.picture.write_png(out))?;
        }
        // Last: where one of the new files cannot be written, those before are still there.
        self.remove_others(folder)
    }

    /// Removes pictures of moments, and effects, that an earlier experiment has left and this one does not have.
    fn remove_others(&self, folder: &Path) -> Result<(), WriteError> {
        let moments = (self.moments.len()..4).map(|place| format!("{}.png", figure2_name(place)));
        let without_effects = self.effects.is_empty();
        let effects = super::effects::names().filter(|_| without_effects);
        for name in moments.chain(effects.map(|name| format!("effects_{name}.svg"))) {
            let path = folder.join(name);
            match fs::remove_file(&path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(WriteError { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }
}
