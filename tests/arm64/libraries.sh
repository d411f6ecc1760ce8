#!/bin/sh
# What the tests of this folder need on an x86-64 Debian or Ubuntu: its cross compiler for aarch64, an emulator, SIMDe's
# headers, and arm64's libraries beside the cross compiler's own. They are unpacked, not installed, because
# libopenexr-dev of two machines cannot be. Run as root.
set -eu
root=/usr/aarch64-linux-gnu
dpkg --add-architecture arm64
apt-get -q update
apt-get -qy install gcc-aarch64-linux-gnu libc6-dev-arm64-cross libsimde-dev qemu-user
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
chmod 755 "$folder" # apt downloads as a user of its own
cd "$folder"
exr=$(apt-cache depends libopenexr-dev | sed -n 's/.*Depends: \(libopenexr-[0-9].*\)/\1/p')
math=$(apt-cache depends libimath-dev | sed -n 's/.*Depends: \(libimath-[0-9].*\)/\1/p')
for package in libjansson4 libjansson-dev libcmocka0 libcmocka-dev "$exr" libopenexr-dev "$math" libimath-dev zlib1g; do
    apt-get -q download "$package:arm64"
done
for file in *.deb; do
    dpkg -x "$file" .
done
cp -P --remove-destination usr/lib/aarch64-linux-gnu/*.so* "$root/lib"
[ ! -d lib/aarch64-linux-gnu ] || cp -P --remove-destination lib/aarch64-linux-gnu/*.so* "$root/lib"
ln -sf libz.so.1 "$root/lib/libz.so"
