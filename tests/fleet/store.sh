#!/usr/bin/env bash
# A Ceph store with S3 and Object Lock for tests: one monitor, one OSD in a file, one gateway, as plain processes of this user on 127.0.0.1.
#
# Usage: tests/fleet/store.sh up FOLDER | down FOLDER | kill FOLDER PART | again FOLDER PART
#   up    starts it with all its state below FOLDER, and prints its endpoint; its user has access key "testaccess" and secret key "testsecret0123456789"
#   down  ends its processes
#   kill  ends a part of it by SIGKILL: "osd", where the bytes lie, or "gateway"
#   again starts that part of it anew
#
# Leaves with 77 where Ceph is not installed (group fleet of deploy/dependencies).
set -euo pipefail
action=${1-} folder=${2-} part=${3-}
[[ -n $folder && ($action == up || $action == down || ($action =~ ^(kill|again)$ && $part =~ ^(osd|gateway)$)) ]] || { sed -n '2,/^[^#]/{s/^# \{0,1\}//p}' "$0"; exit 2; }
for program in ceph-mon ceph-osd radosgw radosgw-admin ceph monmaptool ceph-authtool; do
  command -v "$program" >/dev/null || { echo "SKIPPED: $program is not installed"; exit 77; }
done
configuration=$folder/ceph.conf log=$folder/log/out

stop() {
  local file pid
  for file in "$folder"/run/{client.rgw.a,osd.0,mon.a}.pid; do
    pid=$(cat "$file" 2>/dev/null) || continue
    # Where it ended by itself its number may be another process's.
    grep -qs "^\(ceph-\|radosgw\)" "/proc/$pid/comm" || continue
    kill "$pid" 2>/dev/null || continue
    for _ in {1..100}; do [[ -d /proc/$pid ]] || break; sleep 0.1; done
    [[ ! -d /proc/$pid ]] || kill -KILL "$pid"
  done
}
start_osd() { ceph-osd -i 0 -c "$configuration"; }
start_gateway() { radosgw -n client.rgw.a -c "$configuration" --rgw_frontends="beast endpoint=$(cat "$folder/address")"; }
pid_of() { cat "$folder/run/$([[ $1 == osd ]] && echo osd.0 || echo client.rgw.a).pid"; }
case $action in
  down) stop && exit ;;
  kill)
    pid=$(pid_of "$part")
    grep -qs "^\(ceph-\|radosgw\)" "/proc/$pid/comm" || { echo "the $part does not run" >&2; exit 1; }
    kill -KILL "$pid"
    while [[ -d /proc/$pid ]]; do sleep 0.05; done
    exit
    ;;
  again) "start_$part" >>"$log" 2>&1 && exit ;;
esac

free_port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
monitor_port=$(free_port) gateway_port=$(free_port) identifier=$(cat /proc/sys/kernel/random/uuid) osd=$(cat /proc/sys/kernel/random/uuid)
mkdir -p "$folder"/{run,log,mon,osd,gateway}
# Authentication stays on: the gateway refuses a cluster without.
cat >"$configuration" <<EOF
[global]
fsid = $identifier
mon_host = [v2:127.0.0.1:$monitor_port]
public_addr = 127.0.0.1
cluster_addr = 127.0.0.1
ms_bind_ipv6 = false
keyring = $folder/keyring
run_dir = $folder/run
admin_socket = $folder/run/\$name.asok
pid_file = $folder/run/\$name.pid
log_file = $folder/log/\$name.log
crash_dir = $folder/log
osd_pool_default_size = 1
osd_pool_default_min_size = 1
osd_pool_default_pg_num = 4
osd_pool_default_pgp_num = 4
osd_pool_default_pg_autoscale_mode = off
osd_crush_chooseleaf_type = 0
mon_allow_pool_size_one = true
mon_warn_on_pool_no_redundancy = false
auth_allow_insecure_global_id_reclaim = false
[mon]
mon_data = $folder/mon
mon_data_avail_crit = 1
mon_data_avail_warn = 2
# Else each pool that the gateway makes waits for a second: eight of them before it answers at all.
paxos_propose_interval = 0.05
[osd]
osd_data = $folder/osd
osd_objectstore = bluestore
bluestore_block_size = 2147483648
bluestore_block_create = true
bluestore_cache_autotune = false
bluestore_cache_size = 33554432
[client]
rgw_data = $folder/gateway
EOF
ask() { timeout 60 ceph -c "$configuration" --connect-timeout 20 "$@"; }
key() { ceph-authtool "$folder/keyring" --gen-key "$@"; }
{
  monmaptool --create --clobber --fsid "$identifier" --addv a "[v2:127.0.0.1:$monitor_port]" "$folder/monmap"
  ceph-authtool -C "$folder/keyring" --gen-key -n mon. --cap mon 'allow *'
  key -n client.admin --cap mon 'allow *' --cap osd 'allow *' --cap mgr 'allow *'
  key -n client.rgw.a --cap mon 'allow rw' --cap osd 'allow rwx'
  key -n osd.0 --cap mon 'allow profile osd' --cap mgr 'allow profile osd' --cap osd 'allow *'
  ceph-mon --mkfs -i a -c "$configuration" --keyring "$folder/keyring" --monmap "$folder/monmap"
  ceph-mon -i a -c "$configuration"
  ask osd new "$osd" 0
  ceph-osd -i 0 -c "$configuration" --mkfs --osd-uuid "$osd"
  start_osd
  echo "127.0.0.1:$gateway_port" >"$folder/address"
  start_gateway
  for _ in {1..600}; do
    [[ $(curl -so /dev/null -w '%{http_code}' "http://127.0.0.1:$gateway_port/") != 200 ]] || break
    sleep 0.2
  done
  radosgw-admin -c "$configuration" user create --uid=test --display-name=Test --access-key=testaccess --secret-key=testsecret0123456789
} >>"$log" 2>&1 || { stop; echo "the store could not be started:" >&2; tail -5 "$log" >&2; exit 1; }
echo "http://127.0.0.1:$gateway_port"
