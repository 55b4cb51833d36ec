//! How much memory there is. Systems that promise more than they have, as Linux does where
//! overcommit is on, do not refuse what will never fit: they end the program when it is written to.

/// From this many bytes on, a request is compared with what there is.
const LARGE: u64 = 1 << 28;

/// Whether this many bytes may fit: not if the machine has less, or the container of this process.
pub fn may_hold(bytes: u64) -> bool {
    bytes < LARGE || most().is_none_or(|most| bytes <= most)
}

/// The memory of the machine with its swap space, or of the container of this process. `None` where
/// nobody says.
#[cfg(target_os = "linux")]
fn most() -> Option<u64> {
    use std::sync::OnceLock;

    static MOST: OnceLock<u64> = OnceLock::new();
    Some(*MOST.get_or_init(|| {
        let info = rustix::system::sysinfo();
        // 32 or 64 bits, as the machine has.
        #[allow(clippy::useless_conversion)]
        let [ram, swap] = [info.totalram, info.totalswap].map(u64::from);
        let machine = ram.saturating_add(swap);
        let bytes = machine.saturating_mul(u64::from(info.mem_unit.max(1)));
        let own = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        bytes.min(groups::most(std::path::Path::new("/sys/fs/cgroup"), &own))
    }))
}

#[cfg(not(target_os = "linux"))]
fn most() -> Option<u64> {
    None
}

/// Containers: control groups, version 2.
#[cfg(target_os = "linux")]
mod groups {
    use std::path::Path;

    /// The least limit, with its swap space, of a group below `root` and of those that it is in.
    /// `own` is what the system says about the process.
    pub(super) fn most(root: &Path, own: &str) -> u64 {
        let path = own.lines().find_map(|line| line.strip_prefix("0::/"));
        let group = root.join(path.unwrap_or(""));
        let groups = group
            .ancestors()
            .take_while(|group| group.starts_with(root));
        groups.map(of_group).min().unwrap_or(u64::MAX)
    }

    fn of_group(group: &Path) -> u64 {
        let limit = |name| {
            let text = std::fs::read_to_string(group.join(name)).ok();
            text.and_then(|text| text.trim().parse().ok())
        };
        let memory: Option<u64> = limit("memory.max");
        let swap = limit("memory.swap.max");
        memory.map_or(u64::MAX, |memory| {
            memory.saturating_add(swap.unwrap_or(u64::MAX))
        })
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_container_has_the_least_memory_of_all_that_it_is_in() {
        let root = std::env::temp_dir().join(format!("impinge-groups-{}", std::process::id()));
        let inner = root.join("outer/inner");
        std::fs::create_dir_all(&inner).unwrap();
        let write = |folder: &std::path::Path, name: &str, text: &str| {
            std::fs::write(folder.join(name), text).unwrap();
        };
        let own = "1:cpu:/elsewhere\n0::/outer/inner\n";
        let none = groups::most(&root, own);
        write(&inner, "memory.max", "max\n");
        write(&root.join("outer"), "memory.max", "3000\n");
        write(&root.join("outer"), "memory.swap.max", "0\n");
        let of_outer = groups::most(&root, own);
        write(&inner, "memory.max", "1000\n");
        write(&inner, "memory.swap.max", "500\n");
        let of_inner = groups::most(&root, own);
        write(&inner, "memory.swap.max", "max\n");
        let with_any_swap = groups::most(&root, own);
        std::fs::remove_dir_all(&root).unwrap();
        assert_eq!(none, u64::MAX);
        assert_eq!([of_outer, of_inner, with_any_swap], [3000, 1500, 3000]);
    }

    #[test]
    fn what_no_machine_has_does_not_fit() {
        assert!(may_hold(LARGE));
        assert!(!may_hold(1 << 50));
    }
}
