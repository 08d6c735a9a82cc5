# shellcheck shell=bash
# Shared by the scripts beside it; sourced, not run. Sets `root`, the tree's top folder.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# Bold on a terminal, plain in a pipe.
if [[ -t 1 ]]; then bold=$'\033[1m' plain=$'\033[0m'; else bold='' plain=''; fi

say() { printf '%s\n' "$*"; }
heading() { printf '\n%s%s%s\n' "$bold" "$*" "$plain"; }

fail() {
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit 1
}

# Prints the comment at the top of a script as its help.
help_of() { sed -n '2,/^$/{s/^# \{0,1\}//p}' "$1"; }

# A command as someone would type it.
as_typed() {
  local word line=''
  for word in "$@"; do
    if [[ $word =~ ^[A-Za-z0-9_./=:,@%+-]+$ ]]; then line+=" $word"; else line+=" '$word'"; fi
  done
  printf '%s' "${line# }"
}

now_ms() { date +%s%3N; }

elapsed() {
  local ms=$(($(now_ms) - $1))
  if ((ms < 10000)); then
    printf '%d.%d s' $((ms / 1000)) $((ms % 1000 / 100))
  elif ((ms < 120000)); then
    printf '%d s' $((ms / 1000))
  else
    printf '%d min %02d s' $((ms / 60000)) $((ms % 60000 / 1000))
  fi
}

# Runs a command quietly; its output is kept in a file and shown only if it fails.
quietly() {
  local log=$1
  shift
  mkdir -p "$(dirname "$log")"
  if ! "$@" >"$log" 2>&1; then
    tail -n 60 "$log" >&2
    fail "this failed: $(as_typed "$@")  (all of its output: ${log#"$root"/})"
  fi
}

# configure_and_build PRESET TARGET...: only what changed is built. Other cores are left alone when
# UNFURL_JOBS says so. The array `options` holds what else cmake is told.
options=()
configure_and_build() {
  local preset=$1 start
  shift
  start=$(now_ms)
  heading "Building, preset $preset"
  # A whole build takes less where sources are compiled together, and by clang little over half of what it takes by g++;
  # a build that is there stays as it is, CXX names another compiler, and sanitizers are g++'s.
  local -a quick=()
  if [[ ! -e $root/build/$preset/CMakeCache.txt ]]; then
    quick=(-DUNFURL_UNITY=ON)
    if [[ $preset != asan && -z ${CC:-}${CXX:-} ]] && command -v clang++ >/dev/null; then
      quick+=(-DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++)
    fi
  fi
  say "  $(as_typed cmake --preset "$preset" "${quick[@]}" "${options[@]}") &&" \
    "cmake --build --preset $preset${1:+ --target $*}"
  [[ -e $root/build/$preset/build.ninja ]] || say "  (the first time takes some minutes)"
  quietly "$root/build/$preset/configure.log" cmake -S "$root" --preset "$preset" "${cache[@]}" "${quick[@]}" \
    "${options[@]}"
  local -a build=(cmake --build "$root/build/$preset" --parallel "${UNFURL_JOBS:-$(nproc)}")
  if (($# > 0)); then build+=(--target "$@"); fi
  if [[ -t 1 ]]; then
    "${build[@]}" || fail "the build failed; the messages are above"
  else
    quietly "$root/build/$preset/build.log" "${build[@]}"
  fi
  say "  built in $(elapsed "$start")"
}

# The compiler's cache, where there is one: it makes a second build of the same sources fast, in another folder too.
# Of sources with a precompiled header it keeps nothing unless told that these headers' macros and times do not matter.
cache=()
if command -v ccache >/dev/null; then
  launcher="env;CCACHE_SLOPPINESS=pch_defines,time_macros;CCACHE_BASEDIR=$root;CCACHE_NOHASHDIR=1;ccache"
  cache=("-DCMAKE_C_COMPILER_LAUNCHER=$launcher" "-DCMAKE_CXX_COMPILER_LAUNCHER=$launcher")
fi

# settings_of FILE: the quoted keys of a TOML file of overrides, as arguments `--set key=value`, in
# the array `settings`.
settings_of() {
  local line
  settings=()
  while IFS= read -r line; do
    settings+=(--set "$line")
  done < <(sed -n 's/^"\([^"]*\)" *= *\([^# ]*\).*/\1=\2/p' "$1")
  ((${#settings[@]} > 0)) || fail "$1 holds no line '\"key\" = value'"
}

# toml_number FILE KEY: the value of a top-level number.
toml_number() { sed -n "s/^$2 *= *\([^# ]*\).*/\1/p" "$1"; }

# step WORDS COMMAND...: says what is done and why, shows the command, then its own words.
steps=0
step() {
  local words=$1 start
  shift
  steps=$((steps + 1))
  heading "$steps. $words"
  say "   $(as_typed "$@")"
  start=$(now_ms)
  "$@" | sed 's/^/   | /' || fail "step $steps failed; its message is above"
  say "   took $(elapsed "$start")"
}
