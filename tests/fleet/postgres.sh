#!/usr/bin/env bash
# A PostgreSQL server for tests: a cluster of its own, reached by a socket in its folder alone.
#
# Usage: tests/fleet/postgres.sh up FOLDER [durable] | down FOLDER | with COMMAND...
#   up    starts it with all its state below FOLDER, and prints how to connect as its administrator; "durable": it flushes what it commits, as in a hospital.
#         Where FOLDER has a cluster already, that one goes on
#   down  ends it
#   with  runs COMMAND beside one that lives as long; KIROKU_POSTGRES says how to connect
#
# Leaves with 77 where PostgreSQL is not installed (group fleet of deploy/dependencies).
set -euo pipefail
action=${1-}
[[ $# -ge 2 && $action =~ ^(up|down|with)$ ]] || { sed -n '2,/^[^#]/{s/^# \{0,1\}//p}' "$0"; exit 2; }
programs=$(find /usr/lib/postgresql -mindepth 2 -maxdepth 2 -name bin 2>/dev/null | sort -V | tail -1)
[[ -n $programs && -x $programs/initdb ]] || { echo "SKIPPED: PostgreSQL is not installed"; exit 77; }

# The server refuses to run as root, and its user may not be let into this folder.
as_user() (
  cd /
  if ((EUID == 0)); then setpriv --reuid=postgres --regid=postgres --clear-groups "$@"; else "$@"; fi
)

up() { # FOLDER [durable]
  local flushes=off
  [[ ${2-} != durable ]] || flushes=on
  mkdir -p "$1"
  ((EUID != 0)) || chown postgres: "$1"
  [[ -e $1/data/PG_VERSION ]] ||
    as_user "$programs/initdb" --pgdata="$1/data" --username=administrator --auth=trust --encoding=UTF8 --no-sync >"$1.log" 2>&1 || { cat "$1.log" >&2; exit 1; }
  as_user "$programs/pg_ctl" --pgdata="$1/data" --log="$1/server.log" --wait \
    --options="-c listen_addresses='' -c unix_socket_directories='$1' -c fsync=$flushes" start >>"$1.log" 2>&1 ||
    { cat "$1.log" "$1/server.log" >&2; exit 1; }
  echo "host=$1 user=administrator dbname=postgres"
}

down() { as_user "$programs/pg_ctl" --pgdata="$1/data" --mode=immediate --wait stop >/dev/null; }

case $action in
  up | down) "$action" "${@:2}" ;;
  with)
    shift
    folder=$(mktemp -d)
    chmod 755 "$folder"
    trap 'down "$folder/server" || true; rm -rf "$folder"' EXIT
    KIROKU_POSTGRES=$(up "$folder/server")
    export KIROKU_POSTGRES
    "$@"
    ;;
esac
