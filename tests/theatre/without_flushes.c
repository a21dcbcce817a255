// Preloaded by power_cuts.py and failing_disk.py with --without-flushes: a recorder that forgets to flush. They must notice.
#include <unistd.h>

int fsync(int descriptor) {
  (void)descriptor;
  return 0;
}

int fdatasync(int descriptor) {
  (void)descriptor;
  return 0;
}
