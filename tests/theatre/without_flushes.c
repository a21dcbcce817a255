// Preloaded by tests/theatre/power_cuts.py --without-flushes: a recorder that forgets to flush. The test must notice.
#include <unistd.h>

int fsync(int descriptor) {
  (void)descriptor;
  return 0;
}

int fdatasync(int descriptor) {
  (void)descriptor;
  return 0;
}
