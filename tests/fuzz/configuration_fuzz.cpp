// kiroku.toml as it comes out of an editor: it is read, or refused with the place and one sentence.
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "apps/configuration/configuration.h"
#include "base/bytes.h"
#include "base/error.h"

namespace {

using namespace kiroku;  // NOLINT(google-build-using-namespace)

void require(bool holds) {
  if (!holds) std::abort();
}

/// "fuzz.toml:12:3: sentence"
bool names_its_place(const std::string& message) {
  constexpr std::string_view kFile = "fuzz.toml:";
  if (!message.starts_with(kFile)) return false;
  return message.size() > kFile.size() &&
         std::isdigit(static_cast<unsigned char>(message[kFile.size()])) != 0;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text = text_of(std::as_bytes(std::span(data, size)));
  try {
    const apps::Configuration read = apps::parse_configuration(text, "fuzz.toml");
    for (const apps::AuthorityConfiguration& authority : read.authorities) require(!authority.paths.empty());
    for (const apps::RoomConfiguration& room : read.rooms)
      require(!room.name.empty() && !room.streams.empty());
  } catch (const UsageError& error) {
    require(names_its_place(error.what()));
  }
  return 0;
}
