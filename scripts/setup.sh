#!/bin/sh
# setup.sh study|test|view: installs what the study, the tests or the window need and this machine lacks; quick
# when nothing does.
# What can be done without (perf, llvm-mca, Embree, ccache) is tried until apt has answered, and named in a
# line when it does not come.
#
# System packages come by apt-get (Debian 12 and later, Ubuntu 24.04 and later), as root or by sudo where it asks
# for no password; Python packages from requirements.lock, checked by hash, into .venv. Exit status: 0 all is there,
# 1 something is missing and could not be installed (one line says what to do), 2 bad argument.
set -eu
unset CDPATH # cd would go elsewhere, and say so
cd -- "$(dirname -- "$0")/.."
root=$PWD
log=$root/build/setup.log
stamp=.venv/.installed-from # the lock's sha256, written last

say() { printf 'setup: %s\n' "$*"; }
die() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

case "${1-}" in
study | test | view) purpose=$1 ;;
*)
    printf 'usage: scripts/setup.sh study|test|view\n' >&2
    exit 2
    ;;
esac
case $(uname -m) in
x86_64 | amd64) arm= ;;
aarch64 | arm64) arm=yes ;;
*) die "this machine is $(uname -m); the phases are x86-64 and arm64 code, so nothing is installed" ;;
esac
{ mkdir -p build && : >build/setup.lock; } 2>/dev/null || die "$root cannot be written (read-only, full, or another user's)"
: "${HOME:=$root/build}" # pip keeps its cache below it
export HOME
if command -v flock >/dev/null; then # one setup at a time
    exec 9>build/setup.lock
    flock 9
fi
# Python starts with -I: PYTHONPATH and PYTHONHOME name packages of another one. A finished .venv whose packages its
# Python cannot load is of a Python that an upgrade has replaced, or of another machine.
if [ -e $stamp ] && ! .venv/bin/python -I -c 'import numpy' 2>/dev/null; then
    say ".venv is of another Python or machine; it is made anew"
    rm -rf .venv build/setup.without # which the new system may have
fi

# --- System packages: what is looked for is the tool or library itself, whoever installed it.

# The first Python that requirements.lock has wheels for; PYTHON3 names another one.
right_python='import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))'
find_python() {
    for python in "${PYTHON3-}" python3 python3.14 python3.13 python3.12 python3.11 /usr/bin/python3; do
        [ -n "$python" ] && "$python" -I -c "$right_python" 2>/dev/null && return
    done
    python=
}

missing_packages() {
    missing=
    need() { missing="$missing $1"; }
    command -v gcc >/dev/null || need gcc
    [ -e /usr/include/stdio.h ] || need libc6-dev
    command -v make >/dev/null || need make
    command -v pkg-config >/dev/null || need pkg-config
    pkg-config --exists jansson 2>/dev/null || need libjansson-dev
    pkg-config --exists OpenEXR 2>/dev/null || need libopenexr-dev
    pkg-config --exists zlib 2>/dev/null || need zlib1g-dev
    [ -e /usr/include/mpfr.h ] || need libmpfr-dev
    # The AVX2 code of opt3 to opt5 becomes NEON's by SIMDe's headers.
    [ -z "$arm" ] || [ -e "${STEPWISE_INCLUDE:-/usr/include}/simde/x86/avx2.h" ] || need libsimde-dev
    find_python
    if [ -z "$python" ]; then
        need python3
        need python3-venv
    elif [ ! -e $stamp ] && ! "$python" -I -c 'import ensurepip, venv' 2>/dev/null; then
        need python3-venv
    fi
    if [ "$purpose" = view ]; then
        pkg-config --exists sdl2 2>/dev/null || need libsdl2-dev
        pkg-config --exists libpng 2>/dev/null || need libpng-dev
    fi
    [ "$purpose" = test ] || return 0
    [ -n "$arm" ] || command -v qemu-x86_64 >/dev/null || need qemu-user
    [ -e /usr/include/cmocka.h ] || need libcmocka-dev
    if ! command -v clang >/dev/null; then
        need clang
    elif ! echo 'int main(void) { return 0; }' |
        clang -fsanitize=address,undefined -x c - -o build/setup.probe 2>/dev/null; then
        # the sanitizers' libraries are a package of their own, named after clang's version
        need "libclang-rt-$(clang -dumpversion | cut -d. -f1)-dev"
    fi
}

# The lists of packages, once a run. Without the option, apt-get's status is 0 where it reached nothing.
updated=''
update_once() {
    [ -z "$updated" ] || return "$updated"
    updated=0
    $sudo apt-get update -q -o APT::Update::Error-Mode=any >"$log" 2>&1 </dev/null || updated=$?
    return "$updated"
}

install_packages() {
    sudo=
    [ "$(id -u)" = 0 ] || sudo='sudo -n'
    # shellcheck disable=SC2086 # lists of words
    if ! command -v apt-get >/dev/null || ! $sudo true 2>/dev/null; then
        die "missing:$missing; to install: sudo apt-get update && sudo apt-get install -y$missing"
    fi
    say "installing$missing by apt-get (log: build/setup.log)"
    update_once || : # of a source that failed, perhaps another one: what is installed tells
    # shellcheck disable=SC2086
    $sudo env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -q --no-install-recommends $missing >"$log" 2>&1 </dev/null ||
        die "apt-get could not install$missing: $(grep -E '^(E|W):' "$log" | tail -1); log: build/setup.log"
}

missing_packages
if [ -n "$missing" ]; then
    install_packages
    installed=$missing
    missing_packages # clang's sanitizers can be asked for only once clang is there
    if [ -n "$missing" ] && [ "$missing" != "$installed" ]; then
        install_packages
        missing_packages
    fi
fi
rm -f build/setup.probe
[ -n "$python" ] || die "Python 3.11 to 3.14 is needed, here is $(python3 --version 2>&1); Debian 12 and 13 and Ubuntu 24.04 and 26.04 have it"
[ -z "$missing" ] || die "still missing after installation:$missing; log: build/setup.log"

# --- Optional ones. Ubuntu's perf comes with its kernel's tools, and is not there for WSL2's kernel.

there() { # a command, or a library's header by its path, which may be a pattern
    command -v "$1" >/dev/null && return
    case "$1" in */*) ;; *) return 1 ;; esac
    ( # of a pattern in a path with spaces
        IFS=
        # shellcheck disable=SC2086
        for path in $1; do
            [ ! -e "$path" ] || exit 0
        done
        exit 1
    )
}

optional() { # command or header, what it adds, packages of which the first that exists is taken
    there "$1" && return
    command=$1 adds=$2
    shift 2
    grep -qsxF "$command" build/setup.without && return
    sudo=
    [ "$(id -u)" = 0 ] || sudo='sudo -n'
    answered=
    if command -v apt-get >/dev/null && $sudo true 2>/dev/null && update_once; then
        answered=yes
        for package in "$@"; do
            apt-cache show "$package" >/dev/null 2>&1 || continue # not this distribution's name for it
            say "installing $package by apt-get: $adds"
            if $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$package" \
                >"$log" 2>&1 </dev/null; then
                there "$command" && return
            else
                answered= # another time it may come
            fi
        done
    fi
    say "$command is not here and could not be installed ($*): without it there is no $adds; the rest goes on"
    if [ "$answered" = yes ]; then
        printf '%s\n' "$command" >>build/setup.without
    fi
}
optional perf "table of hotspots" linux-perf linux-tools-generic
[ -n "$arm" ] || optional llvm-mca "model of what bounds the hot loops by LLVM" llvm
optional "${STEPWISE_INCLUDE:-/usr/include}/embree[34]/rtcore.h" "packet ray tracer beside Embree" libembree-dev
[ "$purpose" != test ] || optional ccache "cache of what the tests compile" ccache
[ "$purpose" != test ] || optional bwrap "test of the sandbox for students' phases" bubblewrap
# Sixteen lanes in pairs of eight, where the CPU has no AVX-512 (tests/emulate).
if [ "$purpose" = test ] && [ -z "$arm" ] && ! grep -qw avx512dq /proc/cpuinfo; then
    optional "${STEPWISE_INCLUDE:-/usr/include}/simde/x86/avx512.h" "test of 16 lanes on this CPU, which has no AVX-512" libsimde-dev
fi

# --- Python packages

wanted=$(sha256sum <requirements.lock | cut -d' ' -f1)
if [ -e $stamp ] && [ "$(cat $stamp)" = "$wanted" ]; then
    exit 0
fi
need_room() { # megabytes, at, for what, those that it has already
    left=$(df -Pk "$2" | awk 'NR == 2 {print int($4 / 1024)}')
    [ "$((left + $4))" -ge "$1" ] || die "the disk of $2 is too small: $3 takes $1 MB, and $left MB are left"
}
# A .venv that was left half-made, or whose Python is gone or another, is made again.
if ! .venv/bin/python -I -c "import pip; $right_python" 2>/dev/null; then
    say "making .venv with $("$python" --version)"
    rm -rf .venv
    "$python" -I -m venv .venv >"$log" 2>&1 || {
        need_room 700 . "what is installed" 0
        die "$python -m venv failed: $(tail -1 "$log")"
    }
fi
say "installing $(grep -c '==' requirements.lock) Python packages into .venv (some 300 MB, a minute or two)"
rm -f $stamp
pip_install() { # of a lock file, which names all that its packages need
    file=$1
    shift
    .venv/bin/python -I -m pip install --quiet --disable-pip-version-check --no-input --retries 2 --only-binary :all: \
        --no-deps --require-hashes "$@" -r "$file" >"$log" 2>&1 </dev/null
}
# Why pip failed is found by asking anew, not from its words: they change with its versions.
of_package() { # the lines of $1 in the lock file; with $2, all others
    awk -v name="$1==" -v others="${2-}" 'index($0, name) == 1 {mine = 1}
        mine ? !others : others {print} mine && !/\\$/ {mine = 0}' build/setup.lock.txt
}
index=${PIP_INDEX_URL:-$(.venv/bin/python -I -m pip config get global.index-url 2>/dev/null || :)}
index=${index:-https://pypi.org/simple}
answers() { # the index, whatever it answers: pip judges that
    .venv/bin/python -I - "${index%/}/pip/" <<'END'
import ssl, sys, urllib.error, urllib.request
try:
    urllib.request.urlopen(urllib.request.Request(sys.argv[1], method="HEAD"), timeout=30)
except urllib.error.HTTPError:
    pass
except Exception as error:
    sys.exit(not isinstance(getattr(error, "reason", error), ssl.SSLError))
END
}
# A package without a wheel for this Python is left out; what needs it says so when it is run.
cp requirements.lock build/setup.lock.txt
rm -f .venv/.without
if ! pip_install build/setup.lock.txt; then
    cp "$log" build/setup.pip.log
    said="$(tail -1 "$log" | cut -c1-300); log: build/setup.pip.log"
    need_room 700 .venv "what is installed" "$(du -sm .venv | cut -f1)"
    need_room 300 "${TMPDIR:-/tmp}" "what is downloaded" 0
    [ -n "${PIP_NO_INDEX-}" ] || answers ||
        die "no network, or a proxy that is none: no answer from ${index##*@}; log: build/setup.pip.log"
    lacking=
    names=$(sed -n 's/^\([A-Za-z0-9._-]*\)==.*/\1/p' build/setup.lock.txt)
    for name in $names; do
        of_package "$name" >build/setup.one.txt
        pip_install build/setup.one.txt --dry-run || lacking="$lacking $name"
    done
    [ -n "$lacking" ] && [ "$lacking" != " $(echo $names)" ] || die "pip failed: $said"
    for name in $lacking; do
        say "$name has no wheel for $(.venv/bin/python --version): what needs it is left out; the rest goes on"
        printf '%s\n' "$name" >>.venv/.without # scripts/study/core/cli.py
        of_package "$name" others >build/setup.lock.new
        mv build/setup.lock.new build/setup.lock.txt
    done
    pip_install build/setup.lock.txt || die "pip failed: $(tail -1 "$log" | cut -c1-300); log: build/setup.log"
fi
printf '%s\n' "$wanted" >$stamp
say "done"
