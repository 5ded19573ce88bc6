#!/usr/bin/env bash
# Sends a whole conversion to Slurm: freezes the plan, then an array with a task for each shard, then finalize:
#   submit.sh MANIFEST [OUTPUT] [--workers N] [--dry-run] [OPTION OF sbatch...] [-- OPTION OF eventgan convert...]
# With --workers there are N tasks, each for every N-th shard: for plans of many small shards. Options of sbatch go to
# all jobs (--partition=cpu --cpus-per-task=16 --time=4:00:00); logs to MANIFEST-logs, without the .json. Options of
# convert are --limit and --sensor, which the plan takes too, --grace, --progress and --threads. --dry-run prints the
# calls of sbatch and makes none. EVENTGAN is the program, if it is not on the PATH. Run again, it goes on: tasks whose
# shards are done take seconds.
set -euo pipefail
usage() { sed -n '2,8s/^# \{0,1\}//p' "$0"; }
refuse() { echo "$1" >&2; exit 64; }
[[ ${1:-} =~ ^(-h|--help)$ ]] && { usage; exit; }
(($#)) && [[ $1 != -* ]] || { usage >&2; exit 64; }
manifest=$(realpath -- "$1")
shift
into=()
if (($#)) && [[ $1 != -* ]]; then
  into=(--output "$(realpath -m -- "$1")")
  shift
fi
workers=all
dry_run=
slurm_options=()
while (($#)) && [[ $1 != -- ]]; do
  case $1 in
    -h | --help) usage; exit ;;
    --dry-run) dry_run=1 ;;
    --workers) workers=${2:-nothing}; shift ;;
    --workers=*) workers=${1#*=} ;;
    *) slurm_options+=("$1") ;;
  esac
  shift || true
done
(($#)) && shift
[[ $workers =~ ^(all|[1-9][0-9]*)$ ]] || refuse "--workers: expected a count, got $workers"
plan_options=()  # what changes the plan
task_options=()
while (($#)); do
  [[ $1 == *=* ]] && option=("$1") || option=("${@:1:2}")
  case ${1%%=*} in
    --limit | --sensor) plan_options+=("${option[@]}") ;;
    --grace | --progress | --threads) task_options+=("${option[@]}") ;;
    *) refuse "expected --limit, --sensor, --grace, --progress or --threads after --, got $1" ;;
  esac
  [[ $1 == *=* ]] || (($# > 1)) || refuse "$1: expected a value, got none"
  shift ${#option[@]}
done
export EVENTGAN=${EVENTGAN:-$(command -v eventgan || true)}
[[ -x $EVENTGAN ]] || refuse "expected eventgan on the PATH or in EVENTGAN, got '$EVENTGAN'"
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

logs=${manifest%.json}-logs
log=${logs//%/%%}  # Slurm fills in what follows a %
unset SHARD_COUNT SHARD_OFFSET
submit() {
  local call=(sbatch --parsable "${slurm_options[@]}" "$@")
  if [[ -n $dry_run ]]; then
    printf '%q ' "EVENTGAN=$EVENTGAN" ${SHARD_COUNT:+"SHARD_COUNT=$SHARD_COUNT"} "${call[@]}"
    echo
  else
    "${call[@]}" | cut -d ';' -f 1
  fi
}
freeze() {  # $1: its output and its log, without .json and .log
  submit --wait --ntasks=1 --output="${1//%/%%}.json" --error="${1//%/%%}.log" "$here/plan.sbatch" \
    "$manifest" --freeze "${into[@]}" "${plan_options[@]}" --json
}
convert() {  # $1: the tasks
  submit --array="$1" --output="$log/convert-%A_%a.log" "$here/convert.sbatch" \
    "$manifest" --output "$output" "${plan_options[@]}" "${task_options[@]}"
}
finalize() {  # $@: the arrays. afterany: it says itself what is missing. One core for an hour is always enough.
  submit --dependency="afterany$(printf ':%s' "$@")" --cpus-per-task=1 --time=01:00:00 \
    --output="$log/finalize-%j.log" "$here/finalize.sbatch" "$output"
}
[[ $workers == all ]] || export SHARD_COUNT=$workers

if [[ -n $dry_run ]]; then  # words in capitals stand for what the jobs before say
  output=${into[1]:-OUTPUT}
  freeze "$logs/plan"
  convert "0-$([[ $workers == all ]] && echo LAST || echo $((workers - 1)))"
  finalize ARRAY
  exit
fi

# A node freezes the plan, not this machine: the processor's instruction sets are part of it.
echo "freezing the plan (waits for a node)"
mkdir -p -- "$logs"
frozen=$(mktemp "$logs/plan-XXXXXX")
freeze "$frozen" >/dev/null ||
  { code=$?; echo "could not freeze the plan:" >&2; cat "$frozen.log" >&2; exit "$code"; }
rm "$frozen"
field() { python3 -c 'import json, sys; print(json.load(sys.stdin)[sys.argv[1]])' "$1" <"$frozen.json"; }
output=$(realpath -- "$(field folder)")
tasks=$([[ $workers == all ]] && field shards || echo "$workers")

# Task numbers end below MaxArraySize, so a long plan is several arrays, each starting at its own offset.
window=$(scontrol show config | awk '$1 == "MaxArraySize" { print $3 }')
((window > 0)) || { echo "expected arrays in this Slurm, got MaxArraySize '$window'" >&2; exit 1; }
jobs=()
for ((first = 0; first < tasks; first += window)); do
  last=$((tasks - first < window ? tasks - first - 1 : window - 1))
  export SHARD_OFFSET=$first
  jobs+=("$(convert "0-$last")")
  echo "array ${jobs[-1]}: tasks 0-$last are $first-$((first + last))"
done
finalizing=$(finalize "${jobs[@]}")
echo "finalize $finalizing: runs after all arrays"
printf 'logs: %q\nlook: %q status %q\n' "$logs" "$EVENTGAN" "$output"
