# Sourced by the scripts that need programs of the system.

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# install COMMAND-THAT-SUCCEEDS-WHERE-NOTHING-IS-MISSING PACKAGE...
# Installs what is missing where the machine has apt. IMPINGE_NO_INSTALL=1 leaves the machine as it is.
install() {
  local present=$1
  shift
  if sh -c "$present" >/dev/null 2>&1 || [ -n "${IMPINGE_NO_INSTALL:-}" ]; then return; fi
  if ! command -v apt-get >/dev/null; then
    echo "$0: please install what Debian calls: $*" >&2
    return
  fi
  echo "== install $*"
  as_root apt-get update -qq
  as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}
