#!/bin/sh
# Makes sure that the system packages are there: named as Debian names them. Installs what is missing when run as root
# (or where sudo asks for no password); otherwise says what is missing and stops.
# Usage: system_packages.sh [--optional] PACKAGE=PROBE ...   where PROBE is a command that succeeds once it is there
set -u
optional=0
[ "${1:-}" = "--optional" ] && { optional=1; shift; }
missing=""
for pair in "$@"; do
  package=${pair%%=*} probe=${pair#*=}
  sh -c "$probe" >/dev/null 2>&1 || missing="$missing $package"
done
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ]; then as_root=""
elif sudo -n true 2>/dev/null; then as_root="sudo -n"
else as_root="none"; fi
if [ "$as_root" != none ] && command -v apt-get >/dev/null 2>&1; then
  echo "installing system packages:$missing"
  $as_root apt-get update -qq || echo "apt-get update failed; trying with the package lists that are here" >&2
  # shellcheck disable=SC2086  # a list of packages
  DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null && exit 0
  echo "apt-get could not install:$missing" >&2
else
  echo "missing system packages:$missing" >&2
  echo "install them as root:  apt-get install --no-install-recommends$missing" >&2
fi
[ $optional = 1 ] && exit 0
exit 1
