//! Limits of a child process.

/// Limits of the process that checks a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// The most bytes of address space (`RLIMIT_AS`); `None` for no limit. If the limit is reached,
    /// the process ends and its mesh gets a row of kind `memory`. Unix only; macOS accepts the
    /// limit and does not enforce it.
    pub memory: Option<u64>,
}

/// Limits this process; a child calls it at its start. On Linux the process then also ends with its
/// parent, so that a mesh that takes forever does not outlive the run.
///
/// # Errors
/// The system refuses the limit, or does not support it.
#[cfg(unix)]
pub fn apply_limits(limits: &Limits) -> std::io::Result<()> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    #[cfg(target_os = "linux")]
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL))?;
    if let Some(memory) = limits.memory {
        let held = getrlimit(Resource::As);
        let current = held.maximum.map_or(memory, |maximum| maximum.min(memory));
        let limit = Rlimit {
            current: Some(current),
            maximum: held.maximum,
        };
        setrlimit(Resource::As, limit)?;
    }
    Ok(())
}

/// Limits this process; a child calls it at its start.
///
/// # Errors
/// There is a memory limit: this system does not support it.
#[cfg(not(unix))]
pub fn apply_limits(limits: &Limits) -> std::io::Result<()> {
    match limits.memory {
        None => Ok(()),
        Some(_) => Err(std::io::Error::new(
            std::io::ErrorKind::Unsupported,
            "a memory limit per mesh needs a Unix system",
        )),
    }
}
