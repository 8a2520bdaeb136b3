#!/usr/bin/env bash
# Capture against a real kernel driver: runs in_vm.sh in a virtual machine whose kernel has vivid loaded.
# usage: run_test.sh CAPTURE_CHECK    status 77: skipped, and why
#
# TWOFOLD_VM_RUNNER names a program that boots such a machine: RUNNER --timeout S --copy FILE:PATH... -- COMMAND...
# copies the files in, runs the command inside, and ends with its status.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "skipped: $1"; exit 77; }

[ -n "${TWOFOLD_VM_RUNNER:-}" ] || skip "TWOFOLD_VM_RUNNER names no program that boots a virtual machine with vivid"
exec "$TWOFOLD_VM_RUNNER" --timeout "${VM_TIMEOUT:-900}" --copy "$1:/opt/bin/capture_check" \
  --copy "$here/in_vm.sh:/data/in_vm.sh" -- sh /data/in_vm.sh
