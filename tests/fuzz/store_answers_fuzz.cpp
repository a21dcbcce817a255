// What anybody who answers in a store's place may say: header lines, an empty line, a body. Reading ends, and
// what is taken is whole.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "fleet/store_answers.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  fleet::AnswerHeaders headers;
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    if (line.empty()) break;
    fleet::take_header(line, headers);
  }
  require(headers.size() <= 100);
  try {
    const fleet::StoredObject object = fleet::object_of("or-1/a", headers);
    require(headers.contains("content-length"));
    require(object.lock_ends.has_value() || headers["x-amz-object-lock-retain-until-date"].empty());
  } catch (const Error& error) {
    require(!std::string_view(error.what()).empty());
  }
  require(fleet::error_code_of(rest).size() <= rest.size());
  try {
    const fleet::VersionPage page = fleet::version_page_of(rest);
    require(!page.more || !page.next_key.empty());
    for (const fleet::ListedVersion& each : page.versions)
      require(!each.key.empty() && !each.version.empty());
  } catch (const Error& error) {
    require(!std::string_view(error.what()).empty());
  }
  return 0;
}
