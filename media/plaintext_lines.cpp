#include "media/plaintext_lines.h"

#include "base/error.h"

namespace kiroku::media {

void for_each_line(const crypto::ByteSource& source, const std::string& name, std::size_t longest,
                   bool tolerate_cut,
                   const std::function<void(std::uint64_t number, std::string_view)>& visit) {
  constexpr std::size_t kReadBytes = 4 * 64 * 1024;
  Bytes buffer(kReadBytes);
  std::string begun;  // of the line that the last read cut
  std::uint64_t number = 1;
  for (std::uint64_t offset = 0;;) {
    const std::size_t count = source.read_at(offset, buffer);
    if (count == 0) {
      break;
    }
    offset += count;
    std::string_view rest = text_of(ByteView(buffer).first(count));
    for (std::size_t end = rest.find('\n'); end != std::string_view::npos; end = rest.find('\n')) {
      begun += rest.substr(0, end);
      rest.remove_prefix(end + 1);
      if (begun.size() > longest) {
        break;
      }
      visit(number++, begun);
      begun.clear();
    }
    begun += rest;
    if (begun.size() > longest) {
      throw Error("line " + std::to_string(number) + " of " + name + " is longer than " +
                  std::to_string(longest) + " bytes");
    }
  }
  if (!begun.empty() && !tolerate_cut) {
    throw Error("line " + std::to_string(number) + " of " + name + " has no line end");
  }
}

}  // namespace kiroku::media
