#!/usr/bin/env bash
# An S3 server on one machine, in the foreground: Ceph's object gateway with one monitor and one file-backed disk.
# Everything it keeps is in $GATEWAY_FOLDER; it survives kill -9 and goes on there. It has no second copy: for data
# that matter use a bucket of a provider or a Ceph cluster of several machines.
# Needs ceph-mon, ceph-osd, ceph-common, radosgw, curl (Debian's packages).
set -euo pipefail

folder=${GATEWAY_FOLDER:?a short path: sockets lie there}
address=${GATEWAY_ADDRESS:-127.0.0.1}
port=${GATEWAY_PORT:-7480}
monitor=${GATEWAY_MONITOR_PORT:-7481}
bytes=${GATEWAY_BYTES:-8589934592}
buckets=${GATEWAY_BUCKETS:-}
: "${AWS_ACCESS_KEY_ID:?}" "${AWS_SECRET_ACCESS_KEY:?}"
export CEPH_CONF=$folder/ceph.conf
umask 077

fail() { echo "gateway: $*" >&2; exit 1; }

write_configuration() {
    mkdir -p "$folder"/{monitor,disk,gateway,crash}
    [ -s "$folder/fsid" ] || cat /proc/sys/kernel/random/uuid >"$folder/fsid"
    cat >"$CEPH_CONF" <<END
[global]
fsid = $(cat "$folder/fsid")
mon_initial_members = a
mon_host = v2:127.0.0.1:$monitor/0
ms_bind_msgr1 = false
public_addr = 127.0.0.1
cluster_addr = 127.0.0.1
auth_allow_insecure_global_id_reclaim = false
keyring = $folder/keyring
run_dir = $folder
admin_socket = $folder/\$name.asok
log_file = $folder/\$name.log
crash_dir = $folder/crash
# One disk holds the only copy of everything.
osd_pool_default_size = 1
osd_pool_default_min_size = 1
osd_pool_default_pg_num = 4
osd_pool_default_pg_autoscale_mode = off
osd_crush_chooseleaf_type = 0
mon_allow_pool_size_one = true
mon_max_pg_per_osd = 1000
mon_data = $folder/monitor
mon_data_avail_crit = 1
mon_osd_min_down_reporters = 1
paxos_propose_interval = 0.05
paxos_min_wait = 0.01
osd_data = $folder/disk
bluestore_block_size = $bytes
bluestore_cache_autotune = false
bluestore_cache_size = 67108864
# A small write that is put off can, after kill -9, be written over an object that has its place by then.
bluestore_prefer_deferred_size_hdd = 0
osd_op_num_shards = 2
osd_op_num_threads_per_shard = 1
osd_heartbeat_grace = 6
rgw_data = $folder/gateway
rgw_frontends = beast endpoint=$address:$port
rgw_run_sync_thread = false
rgw_enable_apis = s3
rgw_override_bucket_index_max_shards = 1
rgw_dynamic_resharding = false
END
}

# wait_for NAME PID COMMAND..: until the command succeeds, at most a minute, while the daemon lives.
wait_for() {
    local name=$1 pid=$2
    shift 2
    for _ in $(seq 600); do
        "$@" >/dev/null 2>&1 && return
        kill -0 "$pid" 2>/dev/null || fail "the $name ended: $(tail -n 3 "$folder"/*.log)"
        sleep 0.1
    done
    fail "the $name does not answer"
}

disk_is_up() { ceph osd stat 2>/dev/null | grep -q "1 up"; }

make_monitor() {
    local name
    ceph-authtool --create-keyring "$folder/keyring" --gen-key -n mon. --cap mon "allow *" >/dev/null
    for name in client.admin client.rgw osd.0; do
        ceph-authtool "$folder/keyring" --gen-key -n "$name" --cap mon "allow *" --cap osd "allow *" --cap mgr "allow *" \
            >/dev/null
    done
    monmaptool --create --clobber --fsid "$(cat "$folder/fsid")" --addv a "[v2:127.0.0.1:$monitor/0]" "$folder/monmap" \
        >/dev/null
    ceph-mon --mkfs -i a --monmap "$folder/monmap" --keyring "$folder/keyring" >/dev/null 2>&1 || fail "no monitor made"
}

make_disk() {
    local identity
    identity=$(cat /proc/sys/kernel/random/uuid)
    ceph osd new "$identity" >/dev/null
    ceph-osd --mkfs -i 0 --osd-uuid "$identity" >/dev/null 2>&1 || fail "no disk made"
    ceph osd crush add-bucket here host root=default >/dev/null 2>&1
    ceph osd crush add osd.0 1.0 root=default host=here >/dev/null 2>&1
}

make_bucket() {
    local status nothing
    nothing=$(sha256sum </dev/null | cut -d " " -f 1)
    status=$(printf 'user = "%s:%s"\n' "$AWS_ACCESS_KEY_ID" "$AWS_SECRET_ACCESS_KEY" |
        curl -sS -o /dev/null -w '%{http_code}' -K - --aws-sigv4 aws:amz:us-east-1:s3 \
            -H "x-amz-content-sha256: $nothing" -X PUT "http://127.0.0.1:$port/$1")
    [ "$status" = 200 ] || [ "$status" = 409 ] || fail "the bucket $1 was not made (status $status)"
}

ended() {
    trap - TERM INT EXIT
    for pid in ${gateway_pid:-} ${disk_pid:-} ${monitor_pid:-}; do
        kill "$pid" 2>/dev/null && wait "$pid" 2>/dev/null || true
    done
}
trap 'ended; exit 0' TERM INT
trap ended EXIT

write_configuration
[ -e "$folder/ready" ] || rm -rf "$folder"/{monitor,disk,gateway}/* "$folder/keyring"
[ -e "$folder/ready" ] || make_monitor
ceph-mon -f --id a &
monitor_pid=$!
wait_for monitor $monitor_pid ceph --connect-timeout 2 mon stat
[ -e "$folder/ready" ] || make_disk
# After a kill the map still calls the disk up: only its own word that it has booted counts.
ceph osd down 0 >/dev/null 2>&1 || true
ceph-osd -f --id 0 &
disk_pid=$!
wait_for disk $disk_pid disk_is_up
[ -e "$folder/ready" ] || radosgw-admin -n client.rgw user create --uid=glint --display-name=glint \
    --access-key "$AWS_ACCESS_KEY_ID" --secret-key "$AWS_SECRET_ACCESS_KEY" >/dev/null 2>&1 || fail "no user made"
touch "$folder/ready"
radosgw -f -n client.rgw &
gateway_pid=$!
wait_for gateway $gateway_pid curl -sf "http://127.0.0.1:$port/"
for bucket in $buckets; do make_bucket "$bucket"; done
echo "gateway: http://$address:$port"
wait -n $monitor_pid $disk_pid $gateway_pid
fail "a daemon ended: $(tail -n 3 "$folder"/*.log)"
