//! The machine of a measurement.

use serde::Serialize;

/// The processor and the operating system.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Machine {
    /// The CPU's model.
    pub cpu: String,
    /// Threads that the system offers.
    pub n_threads_offered: usize,
    /// Threads used.
    pub n_threads: usize,
    /// Vector instructions that the library uses here.
    pub vectors: String,
    /// The operating system.
    pub os: String,
}

/// A GPU, or a software driver.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adapter {
    /// The name given by the driver.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is a software driver on the CPU.
    pub is_software: bool,
}

impl Machine {
    /// This machine; `n_threads` is the requested number of threads, 0 for one per core.
    pub fn of_this(n_threads: usize) -> Self {
        let n_threads_offered = std::thread::available_parallelism().map_or(1, usize::from);
        Machine {
            cpu: cpu().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            n_threads_offered,
            n_threads: if n_threads == 0 {
                n_threads_offered
            } else {
                n_threads
            },
            vectors: vectors().to_owned(),
            os: std::env::consts::OS.to_owned(),
        }
    }
}

/// The processor's name on Linux.
#[cfg(target_os = "linux")]
fn cpu() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let named = ["model name", "Model", "Hardware"];
    let line = named
        .iter()
        .find_map(|name| text.lines().find(|line| line.starts_with(name)))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// The processor's name on macOS.
#[cfg(target_os = "macos")]
fn cpu() -> Option<String> {
    let output = std::process::Command::new("sysctl")
        .args(["-n", "machdep.cpu.brand_string"])
        .output()
        .ok()?;
    let name = String::from_utf8(output.stdout).ok()?;
    (!name.trim().is_empty()).then(|| name.trim().to_owned())
}

/// The processor's name from the environment, as on Windows.
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn cpu() -> Option<String> {
    std::env::var("PROCESSOR_IDENTIFIER").ok()
}

/// With the features that the library asks for: see `Isa::detect` of `impinge-core`.
#[cfg(target_arch = "x86_64")]
fn vectors() -> &'static str {
    use std::arch::is_x86_feature_detected as has;

    let counts_bits = has!("bmi1") && has!("bmi2") && has!("popcnt") && has!("lzcnt");
    let has_avx512 = has!("avx512f")
        && has!("avx512vl")
        && has!("avx512dq")
        && has!("avx512bw")
        && has!("avx512vbmi2");
    if has_avx512 && counts_bits {
        "AVX-512"
    } else if has!("avx2") && counts_bits {
        "AVX2"
    } else {
        "SSE2"
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn vectors() -> &'static str {
    "the target's baseline"
}
