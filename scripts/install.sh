# Sourced by scripts that need system packages.

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# install COMMAND PACKAGE...
# Installs the packages, unless COMMAND succeeds, on a machine with apt. IMPINGE_NO_INSTALL=1 installs nothing.
install() {
  local present=$1
  shift
  if sh -c "$present" >/dev/null 2>&1 || [ -n "${IMPINGE_NO_INSTALL:-}" ]; then return; fi
  if ! command -v apt-get >/dev/null; then
    echo "$0: please install these packages (Debian names): $*" >&2
    return
  fi
  (
    # One at a time: scripts run beside each other.
    flock 9
    if sh -c "$present" >/dev/null 2>&1; then exit; fi
    echo "== install $*"
    [ -n "${IMPINGE_APT_UPDATED:-}" ] || as_root apt-get update -qq
    as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
  ) 9>"${TMPDIR:-/tmp}/impinge-apt.lock"
  # Once is enough for this script and those that it calls.
  export IMPINGE_APT_UPDATED=1
}

# cross_std [TARGET...]
# Installs what scripts/cross-cargo needs to build a standard library, unless rustup has installed that of each target.
cross_std() {
  local sysroot present=${1:+true} target
  sysroot=$(rustc --print sysroot)
  for target; do present+=" && ls -d $sysroot/lib/rustlib/$target/lib"; done
  # An old compiler does not know how to panic without a message, as scripts/web asks it to.
  install "(${present:-false}) || ls -d $sysroot/lib/rustlib/src/rust/library/std ||
    (ls -d /usr/lib/rustlib/src/rust/library/std /usr/bin/cargo &&
      RUSTC_BOOTSTRAP=1 /usr/bin/rustc -Zunstable-options -Cpanic=immediate-abort --print=sysroot)" rustc-web cargo-web rust-web-src
}
