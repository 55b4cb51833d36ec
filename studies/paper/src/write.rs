//! Writes the files of a report.

use std::path::Path;

use crate::error::Error;
use crate::run::Outcome;
use crate::{chapters, markdown};

impl Outcome {
    /// Writes `report.md`, `report.json` and all figures to a folder, which is created if it does
    /// not exist. Files of the same names are replaced.
    ///
    /// # Errors
    /// The folder cannot be created, or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        let failed = |path: &Path, source| Error::Write {
            path: path.to_owned(),
            source,
        };
        std::fs::create_dir_all(folder).map_err(|source| failed(folder, source))?;
        let put = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            std::fs::write(&path, bytes).map_err(|source| failed(&path, source))
        };
        for figure in &self.figures {
            put(&figure.name, &figure.bytes)?;
        }
        let document = chapters::all(&self.report);
        put("report.md", markdown::write(&document).as_bytes())?;
        // Plain data: numbers, strings and lists, on one line: most of it is of single frames.
        let json = serde_json::to_string(&self.report)
            .map_err(|error| failed(&folder.join("report.json"), error.into()))?;
        put("report.json", (json + "\n").as_bytes())
    }
}
