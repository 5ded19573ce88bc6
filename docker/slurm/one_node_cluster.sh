#!/usr/bin/env bash
# A real Slurm of one node, on this machine alone, for trying job files:
#   one_node_cluster.sh start FOLDER [SLURM.CONF LINE...]   starts it; prints what to export to speak with it
#   one_node_cluster.sh stop FOLDER                         ends its jobs and its daemons
# Needs root, and Debian's slurm-wlm and munge (docker/bootstrap.sh packages slurm). No systemd, no cgroups, nothing
# outside FOLDER: keys, settings, state and logs all lie there. CPUS sets how many CPUs the node says it has.
set -euo pipefail
command=${1:-}
[[ $command =~ ^(start|stop)$ && -n ${2:-} ]] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 64; }
mkdir -p "$2"
folder=$(cd "$2" && pwd -P)
shift 2
[[ $folder != *[[:space:]]* ]] || { echo "expected a folder without spaces, as Slurm's settings need it, got $folder" >&2; exit 64; }
export SLURM_CONF=$folder/slurm.conf
patience_s=30

# The daemon's number, or nothing. By cat: what ends takes its files along, and bash itself ends at a $(<FILE) without
# its file, even before ||.
pid_of() { cat "$folder/$1.pid" 2>/dev/null || true; }

# Whether a daemon runs; a number left from before a reboot may be another process by now.
running() { [[ $(cat "/proc/$(pid_of "$1")/comm" 2>/dev/null) == "$1" ]]; }

# Waits until a command succeeds.
within() {
  local deadline=$((SECONDS + $1))
  shift
  until "$@" >/dev/null 2>&1; do
    ((SECONDS < deadline)) || return 1
    sleep 0.2
  done
}

# A port that nobody listens on, of the 5,000 from a number on.
free_port() {
  local port
  for _ in {1..100}; do
    port=$(($1 + RANDOM % 5000))
    (: <"/dev/tcp/127.0.0.1/$port") 2>/dev/null || { echo "$port"; return; }
  done
  return 1
}

write_settings() {
  local node=${HOSTNAME%%.*} memory_mb
  memory_mb=$(awk '$1 == "MemTotal:" { print int($2 / 1024) }' /proc/meminfo)
  cat >"$SLURM_CONF" <<CONF
ClusterName=one_node
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=$(free_port 20000)
SlurmdPort=$(free_port 25000)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$folder/munge.socket
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
# Containers have no cgroups to give away.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=2
ReturnToService=2
KillWait=30
MinJobAge=3600
SlurmdParameters=config_overrides
NodeName=$node NodeAddr=127.0.0.1 CPUs=${CPUS:-$(nproc)} RealMemory=$memory_mb State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
  printf '%s\n' "$@" >>"$SLURM_CONF"
  # Even unused, they are looked for, and slurmd ends where there are none; this kind is not looked for.
  echo "CgroupPlugin=cgroup/v1" >"$(dirname "$SLURM_CONF")/cgroup.conf"
}

node_is_up() { [[ $(sinfo -h -o %T) == idle ]]; }

start() {
  local daemon
  [[ $(id -u) -eq 0 ]] || { echo "expected root, got user $(id -un)" >&2; exit 1; }
  for daemon in munged slurmctld slurmd; do
    command -v "$daemon" >/dev/null || { echo "expected $daemon, got none: docker/bootstrap.sh packages slurm" >&2; exit 1; }
    ! running "$daemon" || { echo "expected a folder without a running cluster, got $folder" >&2; exit 64; }
  done
  # Munge asks for folders that nobody else can write to, and a key that nobody else can read.
  chmod 755 "$folder"
  mkdir -p "$folder/state" "$folder/spool"
  (umask 077 && head -c 128 /dev/urandom >"$folder/munge.key")
  write_settings "$@"
  trap 'tail -n 20 "$folder"/{munged,slurmctld,slurmd}.log >&2; stop' ERR
  # --force: FOLDER may lie in one that others can write to, such as /tmp.
  munged --force --key-file="$folder/munge.key" --socket="$folder/munge.socket" --pid-file="$folder/munged.pid" \
    --log-file="$folder/munged.log" --seed-file="$folder/munge.seed" --num-threads=2
  slurmctld -c
  slurmd -c
  within "$patience_s" node_is_up
  trap - ERR
  echo "export SLURM_CONF=$SLURM_CONF"
}

# What belongs to this cluster: daemons, job steps and what those run; but no shell that merely exports SLURM_CONF.
processes() {
  local environment process
  for environment in $(grep -lzxsF "SLURM_CONF=$SLURM_CONF" /proc/[0-9]*/environ); do
    process=${environment%/environ}
    if [[ $(cat "$process/comm") =~ ^(slurm|munged) ]] || grep -qzs '^SLURM_JOB_ID=' "$environment"; then
      echo "${process#/proc/}"
    fi
  done 2>/dev/null
}

no_processes() { [[ -z $(processes) ]]; }

stop() {
  local daemon pids
  trap - ERR
  if running slurmctld; then
    timeout 10 scancel --full --signal=KILL --user="$(id -un)" || true
    timeout 10 scontrol shutdown || true
  fi
  for daemon in slurmd slurmctld munged; do
    ! running "$daemon" || kill "$(pid_of "$daemon")" 2>/dev/null || true
  done
  within 10 no_processes && return
  mapfile -t pids < <(processes)
  kill -KILL "${pids[@]}" 2>/dev/null || true
}

"$command" "$@"
