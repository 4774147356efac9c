#!/usr/bin/env bash
# tests/packages.sh [PART...]: what packaging/release.sh has put into dist/, as users get it. As root, on Debian or Ubuntu; takes minutes,
# so tests/run.sh leaves it out. PART is one of
#   files    checksums, tags of wheels, the list of crates
#   rosdebian  the folders debian/ of the ROS package
#   plan     what cargo-dist would make of a tag
#   wheel    in a clean environment of each Python 3.10 to 3.13 that is here: numpy alone, README's lines, the same model everywhere
#   deb      lintian; a minimal Debian: installed, the demo as a user, purged without a trace
#   image    the steps of the Dockerfile's second stage, in the same minimal Debian
#   aarch64  the command for 64-bit ARM, by qemu with the libraries of Debian's arm64: the demo, and the bytes of its runs
#   offline  the vendored source builds with CMake where there is no network (with Debian's catkin, or the shell's ROS)
# Ends with 'N passed, N failed'. Exit 77 when the tools cannot be had.
set -uo pipefail
cd "$(dirname "$0")/.."
. tests/lib.sh

parts=("$@")
[ $# -gt 0 ] || parts=(files rosdebian plan wheel deb image aarch64 offline)
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
work=$(mktemp -d)
trap 'rm -rf --one-file-system "$work"' EXIT
passed=0 failed=0
check() { # what, then the command
  local what=$1
  shift
  if "$@" >"$work/log" 2>&1; then
    passed=$((passed + 1))
    echo "ok: $what"
  else
    failed=$((failed + 1))
    echo "FAIL: $what" >&2
    tail -20 "$work/log" >&2
  fi
}
# The one file in dist/ that fits; fails if there are more or none.
made() {
  local found
  found=$(compgen -G "dist/$1") && [ "$(wc -l <<<"$found")" = 1 ] || broken "dist/ has not just one $1: packaging/release.sh --dry-run makes it"
  realpath "$found"
}

# Is it linked to symbols of glibc 2.28 at the newest?
old_enough() {
  local newest
  newest=$(objdump -T "$1" | grep -oE 'GLIBC_2\.[0-9]+' | cut -d. -f2 | sort -n | tail -1)
  [ "${newest:-99}" -le 28 ]
}

files() {
  check "checksums fit" sh -c 'cd dist && sha256sum --check --quiet SHA256SUMS'
  local wheel sbom
  wheel=$(made "roscausal-$version-*manylinux_2_28_$(uname -m).whl") || exit 1
  check "the wheel has at most 10 MB" test "$(stat -c %s "$wheel")" -le 10000000
  check "the wheel carries the licences" sh -c "unzip -l '$wheel' | grep -c 'licenses/.*LICENSE-' | grep -qx 2"
  unzip -qo "$wheel" -d "$work/wheel"
  check "the wheel needs glibc 2.28 or an older one" old_enough "$work"/wheel/roscausal/_native*.so
  sbom=$(made "roscausal-$version-sbom.json") || exit 1
  check "it has no folder of this machine" sh -c "! grep -q '$PWD' '$sbom'"
  check "the list of crates names each with its licence" python3 - "$sbom" <<'END'
import json, sys
listed = json.load(open(sys.argv[1]))
crates = {crate["name"]: crate for crate in listed["components"]}
assert listed["bomFormat"] == "CycloneDX" and {"faer", "roscausal_discovery", "parquet"} <= set(crates), sorted(crates)
assert not [name for name, crate in crates.items() if not crate.get("licenses")]
END
}

# What cargo-dist would make: the command alone, for each system of dist-workspace.toml.
plan() {
  local plan
  plan=$(made "roscausal-$version-dist-plan.json") || exit 1
  check "cargo-dist plans an archive of the command for each system, and of nothing else" python3 - "$plan" dist-workspace.toml <<'END'
import json, pathlib, re, sys
plan = json.load(open(sys.argv[1]))
systems = re.search(r"targets = \[(.*?)\]", pathlib.Path(sys.argv[2]).read_text(), re.S)[1]
archives = [made for made in plan["artifacts"].values() if made["kind"] == "executable-zip"]
assert [release["app_name"] for release in plan["releases"]] == ["roscausal"], plan["releases"]
assert sorted(sum((made["target_triples"] for made in archives), [])) == sorted(re.findall(r'"(.*?)"', systems)), archives
for made in archives:
    assert [part["name"] for part in made["assets"] if part["kind"] == "executable"] == ["roscausal"], made
END
}

# What the ROS package asks for, as bloom understood it.
rosdebian() {
  local distribution
  for distribution in humble jazzy; do
    tar -xJ -C "$work" -f "$(made "roscausal-$version-debian-$distribution.tar.xz")" || exit 1
    check "ros-$distribution-roscausal $version" grep -q "^ros-$distribution-roscausal ($version-0" "$work/debian/changelog"
    for package in ament-cmake std-msgs geometry-msgs builtin-interfaces rosidl-default-generators; do
      check "is built with $package" grep -q "^Build-Depends:.* ros-$distribution-$package\b" "$work/debian/control"
    done
    check "and put where ROS is" grep -q "CMAKE_INSTALL_PREFIX=\"/opt/ros/$distribution\"" "$work/debian/rules"
  done
}

# A Python that runs, on the path or of pyenv.
found() {
  for candidate in "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python "python$1"; do
    "$candidate" -c 'import ensurepip' 2>/dev/null && echo "$candidate" && return
  done
  return 1
}

wheel() {
  local wheel python venv here=()
  wheel=$(made "roscausal-$version-*manylinux_2_28_$(uname -m).whl") || exit 1
  # The first lines of Python in the package's README, and what the demo's model is.
  awk '/^```python/ { on = 1; next } /^```/ { if (on) exit } on' roscausal_py/README.md >"$work/readme.py"
  grep -q rc.demo "$work/readme.py" || broken "the README of the package does not begin with the demo"
  echo 'assert model.features == ["h_v", "h_dg", "h_risk"]
assert {("h_v", "h_dg"), ("h_dg", "h_v")} <= {(link.cause, link.effect) for link in model.links}
model.save(__import__("sys").argv[1])' >>"$work/readme.py"
  for version_of in 3.10 3.11 3.12 3.13; do
    python=$(found $version_of) || { echo "NOT TESTED: Python $version_of is not on this machine" >&2; continue; }
    venv=$work/$version_of
    "$python" -m venv "$venv" && "$venv/bin/pip" install --quiet --disable-pip-version-check "$wheel" || give_up "numpy cannot be installed from PyPI"
    check "Python $version_of: numpy is all it needs" test -z "$("$venv/bin/pip" list --format freeze | grep -viE '^(numpy|pip|setuptools|roscausal|wheel)==')"
    check "Python $version_of: README's lines give the demo's model" "$venv/bin/python" "$work/readme.py" "$work/$version_of.json"
    here+=("$version_of")
  done
  [ ${#here[@]} -gt 0 ] || give_up "there is no Python 3.10 to 3.13"
  (cd "$work" && "$work/${here[0]}/bin/roscausal" demo --out demo >/dev/null 2>&1)
  for version_of in "${here[@]}"; do
    check "Python $version_of: it is the command's" cmp "$work/$version_of.json" "$work/demo/model.json"
  done
}

# minimal FOLDER OPTION...: a minimal Debian in that folder below target/, made once with these options of debootstrap; `root` is where.
minimal() {
  root=target/$1
  shift
  [ -e $root/complete ] && return
  command -v debootstrap >/dev/null || debian debootstrap
  rm -rf --one-file-system $root
  debootstrap "$@" --variant=minbase bookworm $root >"$work/log" 2>&1 || { tail "$work/log"; give_up "debootstrap cannot make a minimal Debian"; }
  touch $root/complete
}
# What a package may leave: apt's lists, logs and dpkg's own records are not of it.
state() {
  (cd "$1" && find . -xdev \( -path ./var/lib/dpkg -o -path ./var/cache -o -path ./var/log -o -path ./var/lib/apt -o -path ./tmp \) -prune -o -print | sort)
}

deb() {
  local package
  package=$(made "roscausal_$version-*_$(dpkg --print-architecture).deb") || exit 1
  command -v lintian >/dev/null || debian lintian
  # Its one remark left out: that an upload to Debian's archive should close a bug there.
  check "lintian has no remarks" lintian --fail-on error,warning --suppress-tags initial-upload-closes-no-bugs --allow-root "$package"
  minimal minimal-debian
  cp -a "$root" "$work/root"
  cp "$package" "$work/root/tmp/roscausal.deb"
  state "$work/root" >"$work/before"
  check "installed" chroot "$work/root" dpkg -i /tmp/roscausal.deb
  check "the demo runs as a user" chroot --userspec=1000:1000 "$work/root" sh -c 'mkdir -p /tmp/home && cd /tmp/home && roscausal demo'
  check "and leaves the model and its pictures" test -s "$work/root/tmp/home/roscausal_demo/model.json" -a -s "$work/root/tmp/home/roscausal_demo/dag.png"
  check "manual, completions and licence are there" ls "$work"/root/usr/share/{man/man1/roscausal.1.gz,bash-completion/completions/roscausal,doc/roscausal/copyright}
  check "it runs on glibc 2.28" old_enough "$work/root/usr/bin/roscausal"
  check "purged" chroot "$work/root" dpkg --purge roscausal
  state "$work/root" >"$work/after"
  check "and nothing is left" diff "$work/before" "$work/after"
}

image() {
  local package
  package=$(made "roscausal_$version-*_$(dpkg --print-architecture).deb") || exit 1
  minimal minimal-debian
  cp -a "$root" "$work/image"
  cp "$package" "$work/image/tmp/"
  cp /etc/resolv.conf "$work/image/etc/"
  # Each RUN of the last stage as it is.
  local run
  run=$(sed -n '/^FROM debian/,$s/^RUN //p' Dockerfile)
  check "$run" chroot "$work/image" sh -c "$run"
  mkdir -p "$work/image/data" && chown 1000 "$work/image/data"
  check "ENTRYPOINT discovers in a folder of the user's" chroot --userspec="$(sed -n 's/^USER //p' Dockerfile)" "$work/image" sh -c \
    'cd /data && roscausal demo --out demo && roscausal discover demo/pp_pool/analysed/*.csv --out model'
  check "and leaves a model" test -s "$work/image/data/model/model.json"
}

aarch64() {
  local package
  package=$(made "roscausal_$version-*_arm64.deb") || exit 1
  command -v qemu-aarch64 >/dev/null || debian qemu-user
  # Unpacked and not set up, which would need to run its programs: the libraries are there.
  minimal minimal-debian-arm64 --foreign --arch=arm64
  dpkg-deb -x "$package" "$work/arm"
  check "it runs on glibc 2.28" old_enough "$work/arm/usr/bin/roscausal"
  check "the demo runs" qemu-aarch64 -L $root "$work/arm/usr/bin/roscausal" demo --out "$work/demo"
  check "and leaves the model and its pictures" test -s "$work/demo/model.json" -a -s "$work/demo/dag.png"
  check "its bytes are those of this machine" tests/processors.sh "qemu-aarch64 -L $root $work/arm/usr/bin/roscausal"
}

offline() {
  local archive
  archive=$(made "roscausal-$version-vendored.tar.xz") || exit 1
  command -v cmake >/dev/null || debian cmake make g++
  # ROS 1 of Debian, unless the shell has a ROS.
  [ -n "${ROS_VERSION-}" ] || debian_missing "${debian_catkin[@]}"
  tar -xJ -C "$work" -f "$archive"
  local source=$work/roscausal-$version-vendored
  # Nothing that cargo has fetched before is there; the tools are.
  mkdir "$work/cargo_home"
  # Unoptimised: what is tested is that nothing is missing.
  export CARGO_HOME=$work/cargo_home CARGO_PROFILE_DEV_OPT_LEVEL=0 CARGO_PROFILE_DEV_DEBUG=false
  check "there is no network: one interface, the loopback" test "$(unshare -n sed -n 's/^ *\([a-z0-9]*\):.*/\1/p' /proc/net/dev)" = lo
  check "it takes Debian's way of cleaning" sh -c "cd '$source' && ! find vendor -name '*.orig' -o -name '*~' | grep ."
  check "CMake takes the vendored source by itself" unshare -n cmake -S "$source" -B "$work/build" -DROSCAUSAL_PROFILE=dev -DPYTHON_EXECUTABLE=/usr/bin/python3 \
    -DCMAKE_INSTALL_PREFIX="$work/install"
  check "and builds it" unshare -n cmake --build "$work/build"
  check "and installs it" unshare -n cmake --install "$work/build"
  check "the node's program is there" sh -c "find '$work/install' -name 'roscausal_ros[12]' -type f | grep ."
}

for part in "${parts[@]}"; do
  echo "== packages: $part"
  "$part"
done
echo "$passed passed, $failed failed"
[ $failed -eq 0 ]
