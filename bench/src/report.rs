//! Tables and records.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub use impinge_io::grouped;
use serde_json::json;

use crate::Failure;
use crate::measure::Table;

/// The output of a run: Markdown while it runs, JSON at the end.
#[derive(Debug)]
pub struct Report {
    command: String,
    markdown: String,
    tables: Vec<serde_json::Value>,
}

impl Report {
    /// A report of one command; its header names the machine.
    pub fn new(command: &str) -> Self {
        let mut report = Report {
            command: command.to_owned(),
            markdown: String::new(),
            tables: Vec::new(),
        };
        report.say(&format!("## {command}\n\n{}\n", machine()));
        report
    }

    /// Prints lines and keeps them.
    pub fn say(&mut self, text: &str) {
        println!("{text}");
        self.markdown.push_str(text);
        self.markdown.push('\n');
    }

    /// Prints the table of one problem.
    pub fn contest(&mut self, table: &Table) {
        let mut text = format!(
            "### {}: {} elements in {}, {} pairs\n\n{}. {} frames each, {} in a row.\n\n",
            table.name,
            grouped(table.n_elements as u64),
            match table.n_bodies {
                1 => "1 body".to_owned(),
                n => format!("{} bodies", grouped(n as u64)),
            },
            grouped(table.rows[0].n_pairs),
            table.about,
            table.n_frames,
            table.turn,
        );
        text += "| | median ms | mean ms | min ms | first frame ms | ratio | pairs | setting |\n";
        text += "|---|---:|---:|---:|---:|---:|---:|---|\n";
        let best = &table.rows[0];
        for row in &table.rows {
            let difference = i128::from(row.n_pairs) - i128::from(best.n_pairs);
            let pairs = match difference {
                0 => grouped(row.n_pairs),
                _ => format!("{} ({difference:+})", grouped(row.n_pairs)),
            };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {:.2} | {pairs} | {} |",
                row.name,
                figures(row.median_ms),
                figures(row.mean_ms),
                figures(row.min_ms),
                figures(row.first_ms),
                row.median_ms / best.median_ms,
                row.setting,
            );
        }
        self.say(&text);
        self.keep(table);
    }

    /// Keeps a table for the record without printing it.
    pub fn keep(&mut self, table: &Table) {
        self.tables.push(table.json());
    }

    /// Keeps figures for the record.
    pub fn keep_json(&mut self, figures: serde_json::Value) {
        self.tables.push(figures);
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "command": self.command,
            "machine": machine(),
            "version": env!("CARGO_PKG_VERSION"),
            "tables": self.tables,
        })
    }

    /// Writes the JSON to a file and both forms to a record folder, if requested.
    pub fn write(&self, file: Option<&Path>, record: Option<&str>) -> Result<(), Failure> {
        let text = format!("{:#}\n", self.json());
        if let Some(path) = file {
            std::fs::write(path, &text).map_err(|error| format!("{}: {error}", path.display()))?;
        }
        if let Some(name) = record {
            let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
                .join("record")
                .join(name);
            std::fs::create_dir_all(&folder)?;
            std::fs::write(folder.join(format!("{}.json", self.command)), &text)?;
            std::fs::write(folder.join(format!("{}.md", self.command)), &self.markdown)?;
        }
        Ok(())
    }
}

/// Processor, threads, operating system.
fn machine() -> String {
    let processor = std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let n_threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut features = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx2") {
            features.push("AVX2");
        }
        if std::arch::is_x86_feature_detected!("avx512f") {
            features.push("AVX-512");
        }
    }
    if cfg!(target_arch = "aarch64") {
        features.push("NEON");
    }
    format!(
        "{processor}, {n_threads} threads, {}, {}",
        features.join(" and "),
        std::env::consts::OS
    )
}

/// A time with three significant figures.
pub fn figures(ms: f64) -> String {
    if ms >= 100.0 {
        format!("{ms:.0}")
    } else if ms >= 10.0 {
        format!("{ms:.1}")
    } else if ms >= 1.0 {
        format!("{ms:.2}")
    } else {
        format!("{ms:.3}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!(figures(0.0451), "0.045");
        assert_eq!(figures(123.4), "123");
    }
}
