#!/usr/bin/env bash
# Sets up a Debian 12 or 13 machine, builds eventgan and runs it:
#   docker/bootstrap.sh demo [DIR]   a small demo dataset in DIR (default: ./demo), converted, checked and drawn
#   docker/bootstrap.sh test         the whole test suite
#   docker/bootstrap.sh build        only the program, build/release/eventgan
#   docker/bootstrap.sh package      Debian packages, build/release/*.deb: eventgan, eventgan-torch adds LibTorch, libeventgan1, its -dev, python3-eventgan
#   docker/bootstrap.sh wheel        for any Linux of this processor, on Debian 12: build/wheel/*.whl for pip and *.tar.xz to unpack, without LibTorch
#   docker/bootstrap.sh release      on Debian 12: build/files, what a release has: packages, wheel, archive, sources, SHA-256 sums
#   docker/bootstrap.sh packages [LIST...]   only installs what is missing of docker/packages/LIST.txt (default: build test)
# Run again, it does only what is left to do. JOBS sets the number of compilers at a time (default: all cores).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
jobs=${JOBS:-$(nproc)}
umask 022  # what is packed is for everybody

say() { printf '\n== %s\n' "$*"; }

listed() { sed -e 's/#.*//' -e '/^[[:space:]]*$/d' "$@"; }

installed() { dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q 'ok installed'; }

# Whether apt may have the packages under the names of docker/packages; says what helps where it has not.
is_supported() (
  ID='' VERSION_ID='' PRETTY_NAME=$(uname)
  [ ! -r /etc/os-release ] || . /etc/os-release
  case "$ID $VERSION_ID" in
    "debian 12" | "debian 13") return ;;
    "ubuntu 22.04" | "ubuntu 24.04") echo "$PRETTY_NAME is untested: trying apt under Debian's names" >&2; return ;;
  esac
  echo "expected Debian 12 or 13, got $PRETTY_NAME: install yourself what Debian calls as follows, or take the wheel," \
    "or build the image: docker build --file docker/Dockerfile --tag eventgan ." >&2
  printf '%s\n' "$@" >&2
  return 1
)

# Installs the packages of the given lists that are missing; asks for rights only if there are any. Where apt cannot, all
# but `packages` goes on: what is there under another name does, and CMake names what is not there.
install_packages() {
  local missing=() package
  while read -r package; do
    installed "$package" || missing+=("$package")
  done < <(listed "$@")
  [ ${#missing[@]} -eq 0 ] && return
  if ! is_supported "${missing[@]}"; then
    [ "$task" != packages ] || exit 1
    return 0
  fi
  say "installing ${missing[*]}"
  local root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "expected root or sudo, to install: ${missing[*]}" >&2; exit 1; }
    root=(sudo)
  fi
  "${root[@]}" apt-get update -qq
  "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}"
}

# The programs, with their tests (ON) or without (OFF).
build() {
  say "building"
  cmake --preset release "-DEVENTGAN_TESTS=$1"
  cmake --build --preset release -j "$jobs"
}

build_program() {
  install_packages docker/packages/build.txt
  build OFF
}

package() {
  build_program
  install_packages docker/packages/package.txt
  say "packing"
  (cd build/release && cpack)
}

# On Debian 12, the oldest of the tag: what is built there asks for no newer glibc.
wheel() {
  install_packages docker/packages/build.txt docker/packages/package.txt docker/packages/wheel.txt
  say "building FFmpeg"
  JOBS=$jobs docker/wheel/ffmpeg.sh build/wheel/ffmpeg
  say "building"
  PKG_CONFIG_PATH=$PWD/build/wheel/ffmpeg/lib/pkgconfig \
    cmake --preset release -B build/wheel -DEVENTGAN_TESTS=OFF -DEVENTGAN_TORCH=OFF -DEVENTGAN_PORTABLE=ON
  cmake --build build/wheel -j "$jobs" --target eventgan libeventgan
  say "packing"
  docker/wheel/pack.py build/wheel
}

# What .github/workflows/release.yml attaches to a tag. The sources are those of the last commit, so nothing may differ.
release() {
  local git=(git -c safe.directory='*')  # a container's root may not own the checkout
  [ -z "$("${git[@]}" status --porcelain)" ] || { echo "expected no change since the last commit: git status" >&2; exit 1; }
  package
  wheel
  local version
  version=$(sed -n 's/^CMAKE_PROJECT_VERSION:STATIC=//p' build/wheel/CMakeCache.txt)
  say "collecting"
  rm -rf build/files
  mkdir -p build/files
  cp build/release/*"$version"*.deb build/wheel/eventgan-"$version"-* build/files
  "${git[@]}" archive --prefix "eventgan-$version/" HEAD | xz >"build/files/eventgan-$version.tar.xz"
  (cd build/files && sha256sum -- * >SHA256SUMS && cat SHA256SUMS)
}

demo() {
  local folder=${1:-demo} program=build/release/eventgan
  build_program
  if [ ! -e "$folder/manifest.json" ]; then
    say "making a small dataset in $folder"
    "$program" make-demo "$folder"
  fi
  say "converting it"
  # The folder may be of an earlier build, which would have written other bytes.
  "$program" convert "$folder/manifest.json" --overwrite
  "$program" verify "$folder/events"
  "$program" preview "$folder/events" --out "$folder/images" --count 12 >/dev/null
  "$program" report "$folder/events" >/dev/null
  say "done"
  echo "shards:    $folder/events/*.h5"
  echo "images:    $folder/images/*.png"
  echo "report:    $folder/events/report.html, open it in a browser"
}

run_tests() {
  install_packages docker/packages/build.txt docker/packages/test.txt
  build ON
  say "testing"
  ctest --preset release -j "$jobs"
}

packages() {
  [ $# -gt 0 ] || set -- build test
  local name lists=()
  for name in "$@"; do
    [ -f "docker/packages/$name.txt" ] || { echo "expected one of docker/packages, got $name" >&2; exit 64; }
    lists+=("docker/packages/$name.txt")
  done
  install_packages "${lists[@]}"
}

task=${1:-}
case "$task" in
  demo) demo "${@:2}" ;;
  test) run_tests ;;
  build) build_program ;;
  package) package ;;
  wheel) wheel ;;
  release) release ;;
  packages) packages "${@:2}" ;;
  *) sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 64 ;;
esac
