//! Options of files of rows, which every answer has.

use std::path::PathBuf;

use clap::Args;

use crate::apart::Inputs;
use crate::error::Error;
use crate::values::{RowsFile, RowsFormat};

#[derive(Debug, Clone, Args)]
pub struct RowsArgs {
    /// Write a row per pair that is found (.csv, .jsonl, .npy or .parquet; "-" is standard output)
    #[arg(long, value_name = "FILE", aliases = ["pairs", "impacts"], group = "rows_file")]
    pub rows: Option<PathBuf>,
    /// The format of the rows, whatever the name of the file
    #[arg(long, value_enum, value_name = "FORMAT", requires = "rows_file")]
    pub rows_format: Option<RowsFormat>,
}

impl RowsArgs {
    /// The file of the rows. It must be no input, and not on standard output beside JSON.
    pub fn file(&self, inputs: &Inputs, json: bool) -> Result<Option<RowsFile>, Error> {
        self.checked("--rows", self.rows.as_ref(), inputs, json)
    }

    /// The same of the file that another option names.
    pub fn checked(
        &self,
        option: &str,
        path: Option<&PathBuf>,
        inputs: &Inputs,
        json: bool,
    ) -> Result<Option<RowsFile>, Error> {
        let Some(path) = path else {
            return Ok(None);
        };
        let file = RowsFile::new(path, self.rows_format)
            .map_err(|text| Error::Usage(format!("{option}: {text}")))?;
        if !file.is_stdout() {
            inputs.check(option, path)?;
        } else if json {
            return Err(Error::Usage(format!(
                "--json and {option} - both write to standard output: give one of them a file"
            )));
        }
        Ok(Some(file))
    }
}
