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
  echo "== install $*"
  as_root apt-get update -qq
  as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# cross_std TARGET...
# Installs what scripts/cross-cargo needs for these targets, unless rustup has installed the standard library of each.
cross_std() {
  local libraries present="true" target
  libraries=$(rustc --print sysroot)/lib/rustlib
  for target; do present+=" && ls -d $libraries/$target/lib"; done
  install "($present) || ls -d /usr/lib/rustlib/src/rust/library/std /usr/bin/cargo" rustc-web cargo-web rust-web-src
}
