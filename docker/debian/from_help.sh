#!/usr/bin/env bash
# from_help.sh PROGRAM VERSION FOLDER: man pages (FOLDER/man1) and the completion for bash (FOLDER/eventgan), all from
# what the program says of itself with --help.
set -euo pipefail
program=$1 version=$2 folder=$3
command -v help2man >/dev/null || { echo "expected help2man (Debian: apt-get install help2man), got none" >&2; exit 1; }
rm -rf "$folder"
mkdir -p "$folder/man1" "$folder/said"

# What it says, once: it loads hundreds of megabytes of libraries at each start. help2man gets a program that repeats it.
"$program" --help >"$folder/said/--help"
commands=$(sed -n '/^Subcommands:/,/^$/s/^  \([a-z-]\{1,\}\) .*/\1/p' "$folder/said/--help")
for command in $commands; do "$program" "$command" --help >"$folder/said/$command"; done
printf '#!/bin/sh\ncat "%s/said/$1"\n' "$folder" >"$folder/said/eventgan"
chmod +x "$folder/said/eventgan"

# A page's name is followed by the help's first line, up to where that goes into detail.
page() {
  PATH=$folder/said:$PATH help2man --no-info --version-string="$version" --source="eventgan $version" \
    --name="$(sed 's/[;:.(].*//;q' "$folder/said/${1:---help}")" "eventgan${1:+ $1}" |
    sed '/^\.TH/s/"[A-Z][a-z]* [0-9]\{4\}"/""/' | gzip -9n >"$folder/man1/eventgan${1:+-$1}.1.gz"
}
page ""
for command in $commands; do page "$command"; done

{
  echo "# Made from eventgan --help, version $version."
  echo "declare -gA _eventgan_options=("
  for command in $commands; do
    sed -n 's/^  \(-h,\)\{0,1\}\(--[a-z0-9-]\{1,\}\).*/\2/p' "$folder/said/$command" |
      tr '\n' ' ' | sed "s/.*/  [$command]=\"&\"\n/"
  done
  echo ")"
  echo "declare -gA _eventgan_words=("
  for command in $commands; do
    sed -n "s/^  \(--[a-z0-9-]\{1,\}\) [A-Z:]*{\([^}]*\)}.*/  [\"$command \1\"]=\"\2\"/p" "$folder/said/$command" | tr ',' ' '
  done
  echo ")"
  cat "$(dirname "${BASH_SOURCE[0]}")/completion.bash"
} >"$folder/eventgan"
rm -r "$folder/said"
