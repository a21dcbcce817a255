#!/usr/bin/env bash
# The package's maintainer scripts, with a systemctl that only remembers: what is enabled when the package is installed, upgraded, removed, and installed
# again. dpkg tells `postinst` of an earlier version in the last case too.
#   maintainer_scripts_test.sh SOURCE-FOLDER
set -euo pipefail
source_folder=$1
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mkdir -p "$root/bin" "$root/systemd" "$root/lib"
cat >"$root/bin/systemctl" <<'SYSTEMCTL'
#!/bin/sh
# The enabled units are files.
verb=$1; shift
for unit; do
  case $verb:$unit in
    *:-*) ;;
    is-enabled:*) [ -e "$0.units/$unit" ] || exit 1 ;;
    enable:*) : >"$0.units/$unit" ;;
    disable:*) rm -f "$0.units/$unit" ;;
  esac
done
SYSTEMCTL
mkdir "$root/bin/systemctl.units"
for name in getent adduser install; do printf '#!/bin/sh\n' >"$root/bin/$name"; done
chmod +x "$root/bin/"*
for script in postinst prerm postrm; do
  sed -e "s#/run/systemd/system#$root/systemd#g; s#/var/lib/kiroku#$root/lib/kiroku#g; s#^\. /usr/share/debconf/confmodule#:#; s#/usr/share/debconf/confmodule#$root/none#g" \
    "$source_folder/deploy/package/$script" >"$root/$script"
done
run() { PATH="$root/bin:$PATH" sh "$root/$1" "${@:2}" 2>"$root/said"; }
enabled() { find "$root/bin/systemctl.units" -type f -printf '%f\n' | sort | tr '\n' ' '; }
expect() {
  [[ $(enabled) == "$1" ]] || { echo "$2: enabled are '$(enabled)', not '$1'" >&2; exit 1; }
}
usual="kiroku-evidence.timer kiroku-retention.timer kiroku-witness.timer kirokud.service "
shipped="kiroku-evidence.timer kiroku-retention.timer kiroku-ship.service kirokud.service "

run postinst configure ""
expect "$usual" "installed"
PATH="$root/bin:$PATH" systemctl disable kiroku-witness.timer
PATH="$root/bin:$PATH" systemctl enable kiroku-ship.service
run prerm upgrade 1.1
run postinst configure 1.0
expect "$shipped" "upgraded"
run prerm remove
expect "" "removed"
run postrm remove
run postinst configure 1.1
expect "$shipped" "installed again"
! grep -q "nothing is recorded" "$root/said" || { echo "installed again: says that nothing is recorded" >&2; exit 1; }
# Removed by a package that did not write down what was enabled.
run prerm remove
rm -f "$root/lib/kiroku.removed-units"
run postinst configure 1.1
expect "" "nobody wrote down what was enabled"
grep -q "nothing is recorded" "$root/said" || { echo "nobody wrote down what was enabled, and nobody is told" >&2; exit 1; }
run prerm remove
run postrm remove
run postrm purge
[[ ! -e $root/lib/kiroku.removed-units ]] || { echo "purged: a file is left" >&2; exit 1; }
run postinst configure ""
expect "$usual" "installed after a purge"
