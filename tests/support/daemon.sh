# A kirokud with a room for scripts of tests and benchmarks; sourced, not run. Wants `kiroku` and `scratch` to be set and KIROKU_HOME to be exported.
daemon=$(dirname "$kiroku")/kirokud
recorder=

fail() { echo "FAILED: $*"; tail -30 "$scratch/daemon.log"; exit 1; }
# room KEY=VALUE...: prints TOML
room() {
  printf '[[room]]\nname = "or-1"\n'
  printf '%s\n' "$@"
}
# stream NAME KIND SOURCE [KEY=VALUE...]: prints TOML
stream() {
  printf '[[room.stream]]\nname = "%s"\nkind = "%s"\nsource = "%s"\n' "$1" "$2" "$3"
  shift 3
  printf '%s\n' "$@"
}
# start_recorder [COMMAND...]: kirokud, by that command, in the background as $recorder, and it answers
start_recorder() {
  "$@" "$daemon" 2>>"$scratch/daemon.log" &
  recorder=$!
  for ((wait = 0; wait < 200; ++wait)); do
    "$kiroku" status >/dev/null 2>&1 && return
    kill -0 "$recorder" 2>/dev/null || break
    sleep 0.1
  done
  fail "kirokud did not start"
}
stop_recorder() {
  kill "$recorder"
  wait "$recorder" || fail "kirokud did not end well"
  recorder=
}
