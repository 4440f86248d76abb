//! The files of an experiment: each whole or not at all, and none left of an earlier run.

use std::fs;
use std::path::Path;

use super::figures::figure2_name;
use super::results::Results;
use crate::export::{WriteError, write_whole};

impl Results {
    /// Writes tables, summary and figures into a folder, which is made where it is missing; what can be written is, whatever becomes
    /// of the others. Gives the errors of those.
    ///
    /// `scans.csv`, `throughput.csv`, `effects.csv`, `summary.json`, the SVG of each of [`Self::figures`] and the PNG of
    /// each of [`Self::pictures`]. Figures of an earlier experiment that this one does not have are removed.
    #[must_use = "a file may be missing"]
    pub fn write(&self, folder: &Path) -> Vec<WriteError> {
        if let Err(source) = fs::create_dir_all(folder) {
            return vec![WriteError { path: folder.to_owned(), source }];
        }
        let text =
            |name: &str, text: &str| write_whole(&folder.join(name), |out| out.write_all(text.as_bytes()));
        let tables = [
            text("scans.csv", &self.scans_csv()),
            text("throughput.csv", &self.throughput_csv()),
            text("effects.csv", &self.effects_csv()),
            write_whole(&folder.join("summary.json"), |out| {
                serde_json::to_writer_pretty(&mut *out, &self.summary())?;
                writeln!(out)
            }),
        ];
        let figures =
            self.figures().into_iter().map(|figure| text(&format!("{}.svg", figure.name), &figure.svg));
        let pictures = self.pictures().into_iter().map(|picture| {
            let path = folder.join(format!("{}.png", picture.name));
            write_whole(&path, |out| picture.picture.write_png(out))
        });
        let written = tables.into_iter().chain(figures).chain(pictures);
        let mut failed: Vec<_> = written.filter_map(Result::err).collect();
        // Last, and only where all of the new ones are written: else those before are still there.
        if failed.is_empty() {
            failed = self.remove_others(folder);
        }
        failed
    }

    /// Removes pictures of moments, and effects, that an earlier experiment has left and this one does not have.
    fn remove_others(&self, folder: &Path) -> Vec<WriteError> {
        let moments = (self.moments.len()..4).map(|place| format!("{}.png", figure2_name(place)));
        let without_effects = self.effects.is_empty();
        let effects = super::effects::names().filter(|_| without_effects);
        let others = moments.chain(effects.map(|name| format!("effects_{name}.svg")));
        let removed = others.map(|name| {
            let path = folder.join(name);
            fs::remove_file(&path).map_err(|source| WriteError { path, source })
        });
        let failed = removed.filter_map(Result::err);
        failed.filter(|error| error.source.kind() != std::io::ErrorKind::NotFound).collect()
    }
}
