#!/usr/bin/env bash
# The verifier that an expert installs stands on OpenSSL and the compiler's own libraries, and says how it is used.
# Usage: tests/lint/verifier_alone.sh KIROKU_VERIFY. Exit status: 0 so it is, 1 it needs more, or does not start.
set -euo pipefail
program=$1
others=$(ldd "$program" | awk '{ print $1 }' | grep -vE '^(linux-vdso|libcrypto|libstdc\+\+|libm|libgcc_s|libc)\.so|/ld-linux' || true)
[[ -z $others ]] || { printf '%s needs more than OpenSSL:\n%s\n' "$program" "$others" >&2; exit 1; }
"$program" --help >/dev/null
echo "It needs libcrypto and nothing heavier, $(($(stat -L -c %s "$program") / 1024)) KiB."
