#!/usr/bin/env bash
# What a new user does, on a fresh Debian 13: a root made with mmdebstrap, the working tree copied into it, deploy/demo and deploy/test run there, the package made.
#
# Usage: tests/nightly/debian13.sh [--help] [--keep] [CTEST OPTION...]
#   tests/nightly/debian13.sh                 a new root, both commands: some 45 minutes on two cores, 10 GB in build/nightly/debian13
#   tests/nightly/debian13.sh --keep          goes on in the root of the last run: what is installed and built is not made again
#   tests/nightly/debian13.sh --keep -R Age   there, but only these tests, and no demo
#
# Packages come from where this machine's own apt takes Debian's, or from KIROKU_DEBIAN_MIRROR. Who is not root needs user namespaces, and folders
# above that others may enter. What the compilers made is cached beside the root. Exit status: 0 passed, 1 failed, 77 skipped: no mmdebstrap.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
source deploy/lib.sh
keep=
case ${1-} in
  -h | --help) help_of "${BASH_SOURCE[0]}" && exit ;;
  --keep) keep=yes && shift ;;
esac
command -v mmdebstrap >/dev/null || { echo "SKIPPED: mmdebstrap is not installed (deploy/dependencies, group nightly)"; exit 77; }

work=$root/build/nightly/debian13
debian=$work/root
# Ordinary users become root of a namespace of their own, by the numbers of /etc/subuid, as mmdebstrap makes them.
mode=root own=()
export PATH=$PATH:/usr/sbin  # chroot, which ordinary users are not offered
((EUID == 0)) || mode=unshare own=(--user --map-auto --setuid 0 --setgid 0)

# inside COMMAND ARGUMENT...: runs it in the tree in the root. What it mounts and starts goes when it ends.
inside() {
  local shared
  shared=$(realpath -m "$root/../shared")
  # shellcheck disable=SC2016 # the inner shell expands it
  unshare "${own[@]}" --mount --pid --fork --kill-child bash -euc '
    debian=$1 shared=$2 cache=$3
    mount -t proc proc "$debian/proc"
    mount --rbind /dev "$debian/dev"
    mount --rbind /sys "$debian/sys"
    mount --bind "$cache" "$debian/var/cache/ccache"
    [[ ! -d $shared ]] || mount --bind "$shared" "$debian/src/shared"
    shift 3
    exec chroot "$debian" env -i -C /src/kiroku HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 CCACHE_DIR=/var/cache/ccache "$@"' \
    inside "$debian" "$shared" "$work/ccache" "$@"
}

# debian_sources: where apt finds Debian 13, one a line: this machine's own addresses with the other release's name.
debian_sources() {
  if [[ -n ${KIROKU_DEBIAN_MIRROR-} ]]; then
    echo "deb $KIROKU_DEBIAN_MIRROR trixie main"
    return
  fi
  local here
  here=$(sed -n 's/^VERSION_CODENAME=//p' /etc/os-release)
  apt-get indextargets --format '$(REPO_URI) $(RELEASE)' 'Origin: Debian' 'Component: main' |
    awk -v here="$here" '$2 ~ "^" here "(-|$)" { sub("^" here, "trixie", $2); print "deb", $1, $2, "main" }' | sort -u
}

mkdir -p "$work/ccache"
# There, an ordinary user is somebody else.
((EUID == 0)) || chmod 777 "$work/ccache"
if [[ -z $keep || ! -e $debian/src ]]; then
  say "A fresh root of Debian 13 ($mode)"
  sources=$(debian_sources)
  [[ -n $sources ]] || die "apt here knows no source of Debian; name one: KIROKU_DEBIAN_MIRROR=ADDRESS tests/nightly/debian13.sh"
  if [[ -e $debian ]]; then
    unshare "${own[@]}" find "$debian" -xdev -mindepth 1 -delete
    rmdir "$debian"
  fi
  mmdebstrap --mode="$mode" --variant=apt --include=ca-certificates trixie "$debian" - <<<"$sources" 2>&1 | alive "mmdebstrap goes on"
  unshare "${own[@]}" mkdir -p "$debian/src/shared" "$debian/src/kiroku" "$debian/var/cache/ccache"
fi
say "The working tree goes into it"
# Times of change stay, so that only what changed is compiled again.
unshare "${own[@]}" find "$debian/src/kiroku" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
git ls-files -z --cached --others --exclude-standard --deduplicate |
  while IFS= read -r -d '' file; do [[ ! -e $file ]] || printf '%s\0' "$file"; done |
  tar --create --null --files-from=- | unshare "${own[@]}" tar --extract --no-same-owner --directory "$debian/src/kiroku"
# Names are looked up as here.
cat /etc/resolv.conf | unshare "${own[@]}" tee "$debian/etc/resolv.conf" >/dev/null
inside cat /etc/debian_version

if (($# == 0)); then
  say "deploy/demo on Debian 13"
  inside deploy/demo
fi
say "deploy/test on Debian 13"
inside deploy/test "$@"
if (($# == 0)); then
  say "The package on Debian 13"
  inside cmake --build build/release --target package
fi
