# Sourced by tools/demo and tools/test: system libraries, virtual environment, package. Idempotent; quiet when done.
# Usage: . tools/setup.sh; setup EXTRAS      (EXTRAS such as "viewer" or "test,viewer,reference")
# PYTHON=python3.12 chooses another interpreter for a new .venv.

say() { printf '%s\n' "$*" >&2; }
die() { say "$*"; exit 1; }

# Headless OpenGL: EGL's loader and Mesa's drivers, llvmpipe among them.
egl_packages="libegl1 libgl1 libgl1-mesa-dri"

any_of() { for file in "$@"; do [ -e "$file" ] && return 0; done; return 1; }

has_egl() {
    # The loader itself is asked, so that libraries outside the system's folders count too.
    "$python" -c 'import ctypes; ctypes.CDLL("libEGL.so.1"); ctypes.CDLL("libGL.so.1")' 2>/dev/null &&
        any_of /usr/share/glvnd/egl_vendor.d/*.json /etc/glvnd/egl_vendor.d/*.json &&
        any_of /usr/lib/*/dri/swrast_dri.so /usr/lib64/dri/swrast_dri.so /usr/lib/dri/swrast_dri.so \
            /usr/lib/*/libgallium-*.so /usr/lib64/libgallium-*.so /usr/lib/libgallium-*.so /usr/lib*/*/libEGL_nvidia.so.0
}

# What comes before a command that needs root: nothing, sudo, or no way (sudo may ask only where somebody can answer).
root_prefix() {
    if [ "$(id -u)" = 0 ]; then return 0; fi
    command -v sudo >/dev/null 2>&1 && { sudo -n true 2>/dev/null || [ -t 0 ]; } && echo sudo
}

apt_install() {
    by_hand="missing: $*; get it with: sudo apt-get update && sudo apt-get install -y $*"
    command -v apt-get >/dev/null 2>&1 || return 1
    prefix=$(root_prefix) || die "$by_hand"
    say "Installing with apt-get: $*"
    for attempt in install refresh; do
        # The lists of a fresh machine are empty or old: the second attempt begins with new ones.
        [ $attempt = install ] || $prefix apt-get update -qq >/dev/null 2>&1 || true
        $prefix env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 && return 0
    done
    die "$by_hand"
}

find_python() {
    python=${PYTHON:-python3}
    command -v "$python" >/dev/null 2>&1 || apt_install python3 || die "missing: $python; install Python 3.10 or later"
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || die "Python 3.10 or later is needed, got $("$python" -V 2>&1); choose another with PYTHON=python3.12 $0"
}

make_venv() {
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
        apt_install "python$version-venv" || die "missing: the venv module of $python"
    fi
    say "Making .venv"
    rm -rf .venv
    "$python" -m venv .venv || die "could not make .venv with $python -m venv"
}

setup() {
    extras=$1
    # What was installed for is written down, so that a second start asks pip nothing.
    stamp=.venv/installed
    wanted=$(cksum pyproject.toml)
    find_python
    has_egl || apt_install $egl_packages || say "No headless OpenGL found (EGL and Mesa): if pictures fail, install it with your package manager; sonar doctor tells"
    if [ "$(sed -n 1p $stamp 2>/dev/null)" = "$wanted" ] && has_extras; then return; fi
    # An environment that was never finished may lack pip.
    .venv/bin/python -m pip --version >/dev/null 2>&1 || make_venv
    extras=$(printf '%s,%s' "$extras" "$(sed -n 2p $stamp 2>/dev/null)" | sed 's/,$//')
    say "Installing the package and what it needs into .venv (a minute or two)"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -e ".[$extras]" || die "pip could not install the package: see above"
    # pip compiles what it copies, which our own sources are not; where Python may not write, each start would again.
    .venv/bin/python -m compileall -q sonar_component || true
    warm_up
    printf '%s\n%s\n' "$wanted" "$extras" >$stamp
}

# The first image compiles the loops that bin it: better here than when somebody looks at a black page. Doctor says what
# is wrong with this machine's OpenGL, if anything.
warm_up() {
    say "Compiling and checking OpenGL"
    .venv/bin/sonar doctor >.venv/doctor.txt 2>&1 || grep BAD .venv/doctor.txt >&2 || cat .venv/doctor.txt >&2
    picture=$(mktemp -d)
    .venv/bin/sonar ping --scene configs/scenes/wreck_site/scene.yaml --noise on --out "$picture/wreck.npz" >/dev/null 2>&1 || true
    rm -rf "$picture"
}

has_extras() {
    known=",$(sed -n 2p $stamp),"
    for extra in $(printf %s "$extras" | tr , ' '); do
        case $known in *",$extra,"*) ;; *) return 1 ;; esac
    done
}
