# flip_bit FILE OFFSET: flips the lowest bit of one byte, so that the file differs whatever stood there: a fixed character stands in ciphertext once in 256 times.
# Sourced by the shell scripts that damage a file.
flip_bit() {
  local byte
  byte=$(od -An -tu1 -j "$2" -N 1 "$1")
  printf "\\x$(printf %02x $((byte ^ 1)))" | dd of="$1" bs=1 seek="$2" conv=notrunc status=none
}
