#include "viewer/http/new_file_name.h"

#include <algorithm>

#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

bool may_be_in_a_name(char letter) {
  return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
         (letter >= '0' && letter <= '9') || letter == ' ' || letter == '-' || letter == '_' ||
         letter == '.' || static_cast<unsigned char>(letter) >= 0x80;
}

}  // namespace

void check_new_file_name(const std::string& name, const std::string& what) {
  constexpr std::size_t kLongest = 120;
  if (name.empty() || name.size() > kLongest || name.front() == '.' || name.front() == ' ' ||
      !std::ranges::all_of(name, may_be_in_a_name)) {
    throw Refusal(400, what +
                           " is saved under letters, digits, spaces, '-', '_' and '.', at most 120 bytes "
                           "of them");
  }
}

}  // namespace kiroku::viewer
