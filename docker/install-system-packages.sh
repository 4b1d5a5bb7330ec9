#!/bin/sh
# Installs the Debian packages that Open3D needs, unless it imports already.
# usage: install-system-packages.sh PYTHON
set -eu
python=$1
list=$(dirname "$0")/system-packages.txt

if "$python" -c 'import open3d' >/dev/null 2>&1; then
    exit 0
fi
if ! command -v apt-get >/dev/null 2>&1; then
    echo "Open3D does not load. Install your system's equivalents of: $(tr '\n' ' ' <"$list")" >&2
    exit 1
fi
if [ "$(id -u)" = 0 ]; then
    as_root=
elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then
    as_root=sudo
else
    echo "Open3D needs system libraries and this user cannot install them. Run:" >&2
    echo "  sudo apt-get update && sudo apt-get install --yes $(tr '\n' ' ' <"$list")" >&2
    exit 1
fi
$as_root apt-get update -qq
# shellcheck disable=SC2046  # one word per package is what we want
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install --yes -qq --no-install-recommends $(cat "$list") >/dev/null
"$python" -c 'import open3d'
