#!/usr/bin/env bash
# Capture against a real kernel driver: boots a virtual machine with vivid and runs in_vm.sh there.
# usage: run_test.sh CAPTURE_CHECK    status 77: skipped, and why
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "skipped: $1"; exit 77; }

for tool in qemu-system-x86_64 cpio xz dpkg-deb; do
  command -v "$tool" >/dev/null || skip "$tool is not installed (scripts/setup installs it)"
done
"$here/run_vivid_vm.sh" --prepare || skip "the kernel's packages could not be fetched"
exec "$here/run_vivid_vm.sh" --timeout "${VM_TIMEOUT:-900}" --copy "$1:/opt/bin/capture_check" \
  --copy "$here/in_vm.sh:/data/in_vm.sh" -- sh /data/in_vm.sh
