#!/usr/bin/env bash
# A nightly on a real Slurm of one node, which this script starts and stops, against the same nightly run here: the figures
# must be the same, although one of the tasks is killed on the way.
#
# Needs Slurm and MUNGE and jq (Debian: apt-get install slurm-wlm munge jq); any user may run it. Usage: tests/slurm.sh [PROGRAM]
set -euo pipefail
cd "$(dirname "$0")/.."
program=$(realpath "${1:-target/release/millstream}")
export PATH=$PATH:/usr/sbin:/sbin
for needed in jq munged slurmctld slurmd sbatch scancel squeue; do
    command -v "$needed" >/dev/null || { echo "$needed is missing: apt-get install slurm-wlm munge jq" >&2; exit 2; }
done

home=$(mktemp -d)
chmod 755 "$home"
host=$(hostname -s)
user=$(id -un)
stop() {
    status=$?
    [ "$status" = 0 ] || tail -n 20 "$home"/*.log >&2 || true
    for pid in "$home"/*.pid; do [ -s "$pid" ] && kill "$(cat "$pid")" 2>/dev/null || true; done
    sleep 1
    rm -rf "$home"
    exit "$status"
}
trap stop EXIT

mkdir -p "$home"/{munge,state,spool}
chmod 700 "$home"/{state,spool}
dd if=/dev/urandom of="$home/munge/key" bs=1 count=1024 status=none
chmod 400 "$home/munge/key"
munged --force --key-file="$home/munge/key" --socket="$home/munge/socket" --pid-file="$home/munged.pid" \
    --log-file="$home/munged.log" --seed-file="$home/munge/seed"

cat >"$home/slurm.conf" <<CONF
ClusterName=one
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$home/munge/socket
CredType=cred/munge
StateSaveLocation=$home/state
SlurmdSpoolDir=$home/spool
SlurmctldPidFile=$home/slurmctld.pid
SlurmdPidFile=$home/slurmd.pid
SlurmctldLogFile=$home/slurmctld.log
SlurmdLogFile=$home/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
KillWait=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=2
PartitionName=all Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$home/slurm.conf
slurmctld -f "$SLURM_CONF"
slurmd -f "$SLURM_CONF"
for _ in $(seq 60); do
    [ "$(sinfo -h -o %t 2>/dev/null)" = idle ] && break
    sleep 0.5
done
[ "$(sinfo -h -o %t)" = idle ]

scenes=(scenes/nightly/plane-ball.toml scenes/nightly/slope-ball.toml scenes/nightly/exact-slope.toml
    scenes/nightly/pocket-flat.toml scenes/nightly/slope-bull.toml scenes/nightly/steps-wave.toml)
"$program" nightly "${scenes[@]}" --out "$home/here" >"$home/here.txt" || [ $? = 1 ]
"$program" nightly "${scenes[@]}" --out "$home/there" --jobs 1 --slurm 3

# The first task that runs is killed with all that it started, as a machine that fails would, and is queued again.
for _ in $(seq 100); do
    task=$(squeue -h -t R -n millstream-nightly -o %A | head -n 1)
    [ -n "$task" ] && break
    sleep 0.1
done
[ -n "$task" ] || { echo "no task was seen running" >&2; exit 1; }
sleep 1
scontrol requeue "$task"
echo "Task $task was killed and queued again."

for _ in $(seq 600); do
    [ -z "$(squeue -h)" ] && break
    sleep 1
done
[ -z "$(squeue -h)" ]
# What differs is when it was run and how long it took.
same='del(.. | .date?, .wall_s?, .cpu_s?, .peak_mib?, .reference_s?, .shard?, .page?)'
figures() { jq -S "$same" "$1/nightly.json"; }
diff <(figures "$home/here") <(figures "$home/there")
test -s "$home/there/report.html"
echo "The shards on Slurm, merged, equal the run here: $(jq '.scenes | length' "$home/there/nightly.json") scenes."
