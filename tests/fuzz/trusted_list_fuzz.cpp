// A trusted list, which whoever publishes it wrote: reading ends, and what is taken can be judged by.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "timestamp/trusted_list.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const kiroku::timestamp::TrustedList list =
        kiroku::timestamp::parse_trusted_list({reinterpret_cast<const char*>(data), size}, "list");
    for (const kiroku::timestamp::QualifiedService& service : list.services)
      if (service.history.empty()) std::abort();
  } catch (const kiroku::Error& error) {
    if (std::string_view(error.what()).find("list") == std::string_view::npos) std::abort();
  }
  return 0;
}
