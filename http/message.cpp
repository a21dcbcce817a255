#include "http/message.h"

#include <algorithm>

#include "base/ascii.h"

namespace kiroku::http {

std::string_view Request::field(std::string_view name) const {
  const auto found =
      std::ranges::find_if(fields, [name](const auto& each) { return same_but_for_case(each.first, name); });
  return found == fields.end() ? std::string_view() : found->second;
}

}  // namespace kiroku::http
