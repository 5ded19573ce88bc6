#!/usr/bin/env bash
# Sends a whole conversion to Slurm: freezes the plan, then an array with a task for each shard, then finalize:
#   submit.sh MANIFEST [OUTPUT] [--workers N] [OPTION OF sbatch...] [-- OPTION OF eventgan convert...]
# With --workers there are N tasks, each for every N-th shard: for plans of many small shards. Options of sbatch go to
# all jobs (--partition=cpu --cpus-per-task=16 --time=4:00:00); logs to MANIFEST-logs, without the .json. EVENTGAN is
# the program, if it is not on the PATH. Run again, it goes on: tasks whose shards are done take seconds.
set -euo pipefail
usage() { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 64; }
(($#)) && [[ $1 != -* ]] || usage
manifest=$(realpath -- "$1")
shift
into=()
if (($#)) && [[ $1 != -* ]]; then
  into=(--output "$(realpath -m -- "$1")")
  shift
fi
workers=all
slurm_options=()
while (($#)) && [[ $1 != -- ]]; do
  case $1 in
    --workers) workers=${2:-nothing}; shift ;;
    --workers=*) workers=${1#*=} ;;
    *) slurm_options+=("$1") ;;
  esac
  shift || true
done
(($#)) && shift
[[ $workers =~ ^(all|[1-9][0-9]*)$ ]] || { echo "--workers: expected a count, got $workers" >&2; exit 64; }
convert_options=("$@")
export EVENTGAN=${EVENTGAN:-$(command -v eventgan || true)}
[[ -x $EVENTGAN ]] || { echo "expected eventgan on the PATH or in EVENTGAN, got '$EVENTGAN'" >&2; exit 64; }
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

logs=${manifest%.json}-logs
mkdir -p -- "$logs"
log=${logs//%/%%}  # Slurm fills in what follows a %
submit() { sbatch --parsable "${slurm_options[@]}" "$@" | cut -d ';' -f 1; }

# A node freezes the plan, not this machine: the processor's instruction sets are part of it.
echo "freezing the plan (waits for a node)"
frozen=$(mktemp "$logs/plan-XXXXXX")
submit --wait --ntasks=1 --output="${frozen//%/%%}.json" --error="${frozen//%/%%}.log" "$here/plan.sbatch" \
  "$manifest" --freeze "${into[@]}" --json >/dev/null ||
  { code=$?; echo "could not freeze the plan:" >&2; cat "$frozen.log" >&2; exit "$code"; }
rm "$frozen"
field() { python3 -c 'import json, sys; print(json.load(sys.stdin)[sys.argv[1]])' "$1" <"$frozen.json"; }
output=$(realpath -- "$(field folder)")
tasks=$(field shards)
unset SHARD_COUNT
if [[ $workers != all ]]; then
  export SHARD_COUNT=$workers
  tasks=$workers
fi

# Task numbers end below MaxArraySize, so a long plan is several arrays, each starting at its own offset.
window=$(scontrol show config | awk '$1 == "MaxArraySize" { print $3 }')
((window > 0)) || { echo "expected arrays in this Slurm, got MaxArraySize '$window'" >&2; exit 1; }
jobs=()
for ((first = 0; first < tasks; first += window)); do
  last=$((tasks - first < window ? tasks - first - 1 : window - 1))
  export SHARD_OFFSET=$first
  jobs+=("$(submit --array="0-$last" --output="$log/convert-%A_%a.log" "$here/convert.sbatch" \
    "$manifest" --output "$output" "${convert_options[@]}")")
  echo "array ${jobs[-1]}: tasks 0-$last are $first-$((first + last))"
done
# afterany: it says itself what is missing. One core for an hour is enough, whatever the workers take.
finalize=$(submit --dependency="afterany$(printf ':%s' "${jobs[@]}")" --cpus-per-task=1 --time=01:00:00 \
  --output="$log/finalize-%j.log" "$here/finalize.sbatch" "$output")
echo "finalize $finalize: runs after all arrays"
printf 'logs: %q\nlook: %q status %q\n' "$logs" "$EVENTGAN" "$output"
