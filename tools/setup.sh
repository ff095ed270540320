# Sourced by tools/demo and tools/test: system libraries, virtual environment, package. Idempotent; quiet when done.
# Usage: . tools/setup.sh EXTRAS      (EXTRAS such as "viewer" or "test,viewer,reference")

say() { printf '%s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

# Headless OpenGL: EGL's loader and Mesa's drivers, llvmpipe among them.
packages="libegl1 libgl1 libgl1-mesa-dri"

any_of() { for file in "$@"; do [ -e "$file" ] && return 0; done; return 1; }

has_library() { { ldconfig -p 2>/dev/null || /sbin/ldconfig -p; } | grep -q "$1"; }

has_egl() {
    has_library 'libEGL\.so\.1' && has_library 'libGL\.so\.1' && any_of /usr/share/glvnd/egl_vendor.d/*.json /etc/glvnd/egl_vendor.d/*.json &&
        any_of /usr/lib/*/dri/swrast_dri.so /usr/lib64/dri/swrast_dri.so /usr/lib/dri/swrast_dri.so /usr/lib/*/libgallium-*.so /usr/lib*/*/libEGL_nvidia.so.0
}

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then sudo "$@"; else return 127; fi
}

apt_install() {
    command -v apt-get >/dev/null 2>&1 || die "missing: $*; this is not Debian or Ubuntu: install them with your package manager"
    say "Installing with apt-get: $*"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 && return
    as_root apt-get update -qq >/dev/null 2>&1
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 && return
    die "missing and could not be installed: run: sudo apt-get update && sudo apt-get install -y $*"
}

setup() {
    extras=$1
    python=${PYTHON:-python3}
    command -v "$python" >/dev/null 2>&1 || apt_install python3
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || die "Python 3.10 or later is needed, got $("$python" -V 2>&1)"
    has_egl || apt_install $packages
    if [ ! -x .venv/bin/python ]; then
        "$python" -c 'import ensurepip, venv' 2>/dev/null || apt_install python3-venv
        say "Making .venv"
        rm -rf .venv
        "$python" -m venv .venv || die "could not make .venv with $python -m venv"
    fi
    # What was installed for is written down, so that a second start asks pip nothing.
    stamp=.venv/installed-$(printf %s "$extras" | tr , -)
    wanted=$(cksum pyproject.toml)
    if [ "$(cat "$stamp" 2>/dev/null)" != "$wanted" ]; then
        say "Installing the package and what it needs into .venv (a minute or two)"
        .venv/bin/python -m pip install --quiet --disable-pip-version-check -e ".[$extras]" || die "pip could not install the package: see above"
        printf '%s\n' "$wanted" >"$stamp"
    fi
}
