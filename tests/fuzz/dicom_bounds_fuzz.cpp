// DICOM files of strangers, as they are looked at before DCMTK reads them: nothing but kiroku::Error may come
// of them.
#include <string>
#include <sys/mman.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "sim/volume/dicom_bounds.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const kiroku::Descriptor file(::memfd_create("fuzz", MFD_CLOEXEC));
  if (!file || ::write(file.number(), data, size) != static_cast<ssize_t>(size)) return 0;
  try {
    kiroku::sim::require_bounded_dicom("/proc/self/fd/" + std::to_string(file.number()));
  } catch (const kiroku::Error&) {
  }
  return 0;
}
