# Sourced by scripts that do two things at the same time, because each often leaves a core idle.

# beside FUNCTION: runs it in the background. It is in a process group of its own, so that all of it ends if this script fails.
beside() {
  beside_log=$(mktemp)
  set -m
  "$1" >"$beside_log" 2>&1 &
  set +m
  beside_pid=$!
  trap 'kill -- -$beside_pid 2>/dev/null || true; rm -f "$beside_log"' EXIT
}

# Waits for it and prints what it has printed. The script fails if it has failed.
beside_done() {
  local result=0
  wait "$beside_pid" || result=$?
  cat "$beside_log"
  rm "$beside_log"
  trap - EXIT
  if [ $result != 0 ]; then exit $result; fi
}
