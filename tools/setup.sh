#!/bin/sh
# Sets up .venv with what is asked for, and keeps what it has. As root, installs missing Debian packages (Python, an OpenGL
# driver); other users get the command to run. Python packages are installed again only after pyproject.toml or
# constraints.txt changed, or with a new extra.
# Arguments: what else is needed: extras of pyproject.toml, as `+viewer`; commands, each provided by the Debian package of
# its name in lower case; and `window`, the libraries that GLFW opens a window with: `tools/setup.sh +test chromium window`.
# VENV names another environment than .venv, PYTHON the interpreter that it is made with.
set -eu
cd "$(dirname "$0")/.."

python_packages="python3 python3-venv"
gl_packages="libegl1 libgl1-mesa-dri libgl1"
window_packages="libx11-6 libxcursor1 libxext6 libxi6 libxinerama1 libxrandr2"
venv=${VENV:-.venv}
stamp=$venv/packages  # the files that they were installed from, and the extras

stop() {
    printf '%s\n' "$@" >&2
    exit 1
}

new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
}

# Prints the first Python on the path that is new enough and can create a virtual environment, if any: first those for
# which everything has wheels; python3 may be 3.14, for which the window has none.
find_python() {
    for candidate in ${PYTHON:-python3.13 python3.12 python3.11 python3 python3.14}; do
        if new_enough "$candidate" && "$candidate" -c 'import ensurepip, venv' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
}

# Whether the dynamic linker finds these libraries. Only Linux needs them: macOS has its own OpenGL and windows.
has_libraries() {
    [ "$(uname -s)" = Linux ] || return 0
    known=$(PATH="$PATH:/sbin:/usr/sbin" ldconfig -p) || return 1
    for library in "$@"; do
        case $known in *"$library "*) ;; *) return 1 ;; esac
    done
}

has() {
    case $1 in
        window) has_libraries libX11.so.6 libXcursor.so.1 libXext.so.6 libXi.so.6 libXinerama.so.1 libXrandr.so.2 ;;
        *) command -v "$1" >/dev/null ;;
    esac
}

packages_of() {
    case $1 in
        window) echo "$window_packages" ;;
        *) echo "$1" | tr '[:upper:]' '[:lower:]' ;;
    esac
}

install_packages() {
    if ! command -v apt-get >/dev/null; then
        stop "Missing on this machine: $*" \
            "These are Debian package names. Install your system's equivalents, then run make again."
    fi
    if [ "$(id -u)" -ne 0 ]; then
        stop "Missing on this machine: $*" \
            "Run this line, then make again:" \
            "    sudo apt-get update && sudo apt-get install --yes $*"
    fi
    echo "Installing $*"
    export DEBIAN_FRONTEND=noninteractive
    # Package lists are updated only if the installation fails, as on a fresh machine.
    apt-get install --yes --no-install-recommends "$@" >/dev/null 2>&1 || {
        apt-get update >/dev/null
        apt-get install --yes --no-install-recommends "$@" >/dev/null
    }
}

missing=""
if ! new_enough "$venv/bin/python" && [ -z "$(find_python)" ]; then
    [ -z "${PYTHON:-}" ] || stop "PYTHON=$PYTHON: not found, older than 3.11 or without its venv module"
    missing=$python_packages
fi
if ! has_libraries libEGL.so.1 libGL.so.1; then missing="$missing $gl_packages"; fi
extras=""
for need in "$@"; do
    case $need in
        +*) extras="$extras,${need#+}" ;;
        *) has "$need" || missing="$missing $(packages_of "$need")" ;;
    esac
done
# shellcheck disable=SC2086  # one word a package
if [ -n "$missing" ]; then install_packages $missing; fi

# Whether a folder can be written, in which what is needed is made.
writable() {
    [ -w "$1" ] || stop "$(cd "$1" && pwd): cannot be written, and make needs .venv there: copy the checkout to a folder of yours"
}

if ! new_enough "$venv/bin/python"; then
    writable .
    python=$(find_python)
    [ -n "$python" ] || stop "Python 3.11 or newer is needed, with its venv module; python3 here is $(python3 -V 2>&1)."
    echo "Making $venv with $("$python" -V)"
    "$python" -m venv --clear "$venv"
fi

wanted=$(cat pyproject.toml constraints.txt | cksum)
installed=$(cat "$stamp" 2>/dev/null || true)
extras=$(echo "${installed#*;}$extras" | tr ',' '\n' | sed '/^$/d' | sort -u | paste -sd, -)
if [ "$installed" != "$wanted;$extras" ]; then
    writable "$venv"
    echo "Installing the Python packages of constraints.txt into $venv${extras:+, with $extras}"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt uv || true
    "$venv/bin/uv" pip install --quiet --python "$venv/bin/python" -c constraints.txt -e ".[$extras]" || {
        echo "uv could not install them: pip does, which takes a minute or two"
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[$extras]"
    }
    echo "$wanted;$extras" >"$stamp"
fi
