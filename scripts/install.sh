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
