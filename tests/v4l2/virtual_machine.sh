#!/usr/bin/env bash
# A throw-away machine with the kernel's virtual camera: Debian's kernel with the vivid driver in QEMU, busybox and
# v4l2-ctl around it, no disk, no network.
# usage: virtual_machine.sh SECONDS FILE... -- COMMAND...
# Copies the files (programs with the libraries they need) to /work, runs the command there, prints what it prints,
# and ends with its status; 124 after SECONDS, 125 when the machine itself fails. The kernel (70 MB) is fetched with
# apt once and kept in ${XDG_CACHE_HOME:-~/.cache}/twofold.
# VM_VIVID: parameters of vivid; unless given, two cameras, each with a webcam and an HDMI input. VM_PROCESSOR: what QEMU
# emulates (qemu64). VM_MEMORY [MiB] (1024).
set -euo pipefail
shopt -s nullglob
fail() { echo "virtual_machine: $1" >&2; exit 125; }

vivid=${VM_VIVID:-n_devs=2 node_types=0x1,0x1 num_inputs=2,2 input_types=0xc,0xc vid_cap_nr=0,1}
seconds=$1; shift
files=()
while [ "$1" != -- ]; do files+=("$(realpath "$1")"); shift; done
shift
cache=${XDG_CACHE_HOME:-$HOME/.cache}/twofold
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fetch_kernel() {  # leaves $cache/kernel-NAME/{vmlinuz,modules}
  package=$(apt-cache depends linux-image-amd64 | sed -n 's/^ *Depends: //p' | head -1)
  [ -n "$package" ] || fail "apt knows no linux-image-amd64"
  kernel=$cache/$package
  [ -d "$kernel" ] && return
  mkdir -p "$cache"
  (cd "$scratch" && apt-get -qq -o APT::Sandbox::User=root download "$package") || fail "cannot fetch $package"
  dpkg-deb -x "$scratch/$package"_*.deb "$scratch/package"
  mkdir "$scratch/kernel"
  mv "$scratch"/package/boot/vmlinuz-* "$scratch/kernel/vmlinuz"
  mv "$scratch"/package/lib/modules/*/kernel/drivers/media "$scratch"/package/lib/modules/*/kernel/drivers/video \
    "$scratch/kernel/"
  mv "$scratch/kernel" "$kernel"  # all of it or nothing
}

add_module() {  # NAME: after those it needs, as its own record says
  local file
  file=$(find "$kernel" -name "${1//_/[-_]}.ko*" | head -1)
  [ -n "$file" ] || return 0  # built into the kernel
  grep -qx "$1" "$scratch/modules" && return
  case $file in
    *.xz) xz -dc "$file" > "$root/modules/$1.ko" ;;
    *) cp "$file" "$root/modules/$1.ko" ;;
  esac
  local needed
  needed=$(tr '\0' '\n' < "$root/modules/$1.ko" | sed -n 's/^depends=//p' | tr ',-' ' _')
  for module in $needed; do add_module "$module"; done
  echo "$1" >> "$scratch/modules"
}

add_program() {  # FILE FOLDER: and the libraries it names
  cp "$1" "$root/$2/"
  local library
  for library in $(ldd "$1" 2>/dev/null | grep -o '/[^ ]*'); do
    mkdir -p "$root$(dirname "$library")"
    cp -uL "$library" "$root$library"
  done
}

build_root() {
  root=$scratch/root
  mkdir -p "$root"/{bin,dev,proc,sys,tmp,work,modules}
  cp "$(command -v busybox)" "$root/bin/"
  add_program "$(command -v v4l2-ctl)" bin
  for file in "${files[@]}"; do add_program "$file" work; done
  : > "$scratch/modules"
  add_module vivid
  cat > "$root/init" <<INIT
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/work:/bin
mount -t proc none /proc; mount -t sysfs none /sys; mount -t devtmpfs none /dev
for module in $(tr '\n' ' ' < "$scratch/modules"); do
  [ \$module = vivid ] && set -- $vivid || set --
  insmod /modules/\$module.ko "\$@"
done
cd /work
$(printf '%q ' "$@")
echo "@status \$?"
poweroff -f
INIT
  chmod +x "$root/init"
  (cd "$root" && find . | cpio -o -H newc --quiet | gzip -1) > "$scratch/initramfs"
}

for tool in qemu-system-x86_64 busybox v4l2-ctl cpio xz dpkg-deb; do
  command -v $tool > /dev/null || fail "$tool is not installed"
done
fetch_kernel
build_root "$@"
timeout --foreground "$seconds" qemu-system-x86_64 -accel tcg -cpu "${VM_PROCESSOR:-qemu64}" -smp 2 \
  -m "${VM_MEMORY:-1024}" -nodefaults -no-reboot \
  -display none -serial "file:$scratch/console" -kernel "$kernel/vmlinuz" -initrd "$scratch/initramfs" \
  -append "console=ttyS0 loglevel=0 panic=-1" < /dev/null 2> "$scratch/qemu" && ended=0 || ended=$?
tr -d '\r' < "$scratch/console" | sed '/^@status /d'
[ "$ended" -eq 124 ] && exit 124
status=$(tr -d '\r' < "$scratch/console" | sed -n 's/^@status \([0-9]*\)$/\1/p')
[ -n "$status" ] || { cat "$scratch/qemu" >&2; fail "the machine ended without a word (QEMU: $ended)"; }
exit "$status"
