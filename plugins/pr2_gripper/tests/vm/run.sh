#!/usr/bin/env bash
# The driver on a real USB and HID stack: installs what that takes, boots a kernel in a machine of its own under
# software emulation, and tries it there (inside.py). Fails where the machine does not boot.
#
#     run.sh PYTHON      PYTHON has graspsense with its plugins
#     run.sh --packages  only installs what it takes of this system
#
# Debian or Ubuntu on x86_64; root, or sudo without a password, where a package is missing.
set -euo pipefail
shopt -s inherit_errexit

python=$1
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
work=$(mktemp -d "${TMPDIR:-/tmp}/graspsense-vm.XXXXXX")
trap 'rm -rf "$work"' EXIT

fail() {
    printf 'vm: %s\n' "$*" >&2
    exit 1
}

apt() {
    local root=()
    ((EUID == 0)) || root=(sudo -n)
    # Another apt may be at work on this machine.
    "${root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 "$@" >"$work/apt.log" 2>&1 ||
        { cat "$work/apt.log" >&2; fail "apt-get $* failed"; }
}

# The image that this system's package of the newest kernel stands for, and the modules that come apart from it.
kernel_packages() {
    apt-cache depends --recurse --no-recommends --no-suggests --no-conflicts --no-breaks --no-replaces --no-enhances \
        linux-image-amd64 linux-image-generic 2>/dev/null |
        sed -nE 's/^[ |]*Depends: (linux-(image|modules|modules-extra)-[0-9][^ ]*)$/\1/p' | grep -v unsigned | sort -u
}

[[ $(uname -m) == x86_64 ]] || fail "this is $(uname -m): only x86_64 is provided for"
command -v apt-get >/dev/null || fail "there is no apt-get, by which QEMU and a kernel are had"
missing=()
command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
command -v busybox >/dev/null || missing+=(busybox-static)
[[ -x /lib/systemd/systemd-udevd ]] || missing+=(udev)
ldconfig -p | grep -q libusb-1.0.so.0 || missing+=(libusb-1.0-0)
# The lists may be empty or old; who is not root and lacks nothing takes them as they are.
((EUID != 0 && ${#missing[@]} == 0)) || apt update
kernel=$(kernel_packages)
((${#missing[@]} == 0)) || apt install -y --no-install-recommends "${missing[@]}"
[[ $python != --packages ]] || exit 0
[[ -n $kernel ]] || fail "apt knows no package linux-image-amd64 or linux-image-generic"
printf 'vm: %s after %d s\n' "$(qemu-system-x86_64 --version | head -n 1)" "$SECONDS"

mkdir "$work/kernel" "$work/share"
for package in $kernel; do
    (cd "$work" && apt-get -qq download "$package" >"$work/download.log" 2>&1) ||
        { cat "$work/download.log" >&2; fail "$package could not be had"; }
    dpkg-deb --fsys-tarfile "$work/$package"_*.deb | tar -x -C "$work/kernel" --wildcards --no-anchored \
        'vmlinuz-*' 'drivers/hid/*' 'drivers/usb/*' 'drivers/virtio/*' 'net/9p/*' 'kernel/fs/*' 'kernel/lib/*' \
        2>/dev/null || true # a package need not hold all of them
    rm "$work/$package"_*.deb
done
printf 'vm: %s after %d s\n' "${kernel//$'\n'/, }" "$SECONDS"

"$python" -m compileall -q "$here/../../src" "$here/../../../sim_gripper/src" "$here/../../../c45/src" \
    "$here/../../../../src" >/dev/null || true # what is not compiled is only slower
"$python" "$here/guest.py" --kernel "$work/kernel" --share "$work/share" --timeout "${GRASPSENSE_VM_TIMEOUT:-1200}" -- \
    "$python" "$here/inside.py" || fail "failed, or did not boot (exit code $?)"
printf 'vm: passed after %d s\n' "$SECONDS"
