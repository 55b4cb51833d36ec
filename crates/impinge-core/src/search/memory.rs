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
    use std::path::Path;
    use std::sync::OnceLock;

    static MOST: OnceLock<u64> = OnceLock::new();
    Some(*MOST.get_or_init(|| {
        let info = rustix::system::sysinfo();
        let unit = u64::from(info.mem_unit.max(1));
        // 32 or 64 bits, as the machine has.
        #[allow(clippy::useless_conversion)]
        let [ram, swap] =
            [info.totalram, info.totalswap].map(|n| u64::from(n).saturating_mul(unit));
        let own = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        let of_container = groups::most(Path::new("/sys/fs/cgroup"), &own, swap);
        ram.saturating_add(swap).min(of_container)
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

    /// The least limit of a group below `root` and of those that it is in, each with its share of
    /// the machine's swap space. `own` is what the system says about the process.
    pub(super) fn most(root: &Path, own: &str, swap: u64) -> u64 {
        let path = own.lines().find_map(|line| line.strip_prefix("0::/"));
        let group = root.join(path.unwrap_or(""));
        let groups = group
            .ancestors()
            .take_while(|group| group.starts_with(root));
        let limits = groups.map(|group| {
            // No limit is the word `max`.
            let limit = |name| -> Option<u64> {
                let text = std::fs::read_to_string(group.join(name)).ok();
                text.and_then(|text| text.trim().parse().ok())
            };
            let own_swap = limit("memory.swap.max").map_or(swap, |limit| limit.min(swap));
            limit("memory.max").map_or(u64::MAX, |memory| memory.saturating_add(own_swap))
        });
        limits.min().unwrap_or(u64::MAX)
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
        let most = || groups::most(&root, own, 800);
        let none = most();
        write(&inner, "memory.max", "max\n");
        write(&root.join("outer"), "memory.max", "3000\n");
        write(&root.join("outer"), "memory.swap.max", "0\n");
        let of_outer = most();
        write(&inner, "memory.max", "1000\n");
        write(&inner, "memory.swap.max", "500\n");
        let of_inner = most();
        write(&inner, "memory.swap.max", "max\n");
        let with_any_swap = most();
        std::fs::remove_dir_all(&root).unwrap();
        assert_eq!(none, u64::MAX);
        assert_eq!([of_outer, of_inner, with_any_swap], [3000, 1500, 1800]);
    }

    #[test]
    fn what_no_machine_has_does_not_fit() {
        assert!(may_hold(LARGE));
        assert!(!may_hold(1 << 50));
    }
}
