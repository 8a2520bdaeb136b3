#!/usr/bin/env bash
# Capture against a real kernel driver: runs in_vm.sh in a virtual machine whose kernel has vivid loaded.
# usage: run_test.sh CAPTURE_CHECK    status 77: skipped, and why
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "skipped: $1"; exit 77; }

for tool in qemu-system-x86_64 busybox v4l2-ctl cpio xz; do
  command -v $tool > /dev/null || skip "$tool is missing; scripts/setup --tests installs it"
done
exec "$here/virtual_machine.sh" "${VM_TIMEOUT:-900}" "$1" "$here/in_vm.sh" -- sh in_vm.sh
