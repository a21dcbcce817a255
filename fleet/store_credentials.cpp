#include "fleet/store_credentials.h"

#include <algorithm>
#include <optional>
#include <string_view>
#include <sys/stat.h>

#include "archive/format/case_folder.h"
#include "archive/format/file_reading.h"

namespace kiroku::fleet {
namespace {

constexpr std::size_t kMostBytes = 4096;

std::string_view trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

bool is_printable_word(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c > ' ' && c < 0x7f; });
}

}  // namespace

StoreCredentials read_credentials(const std::filesystem::path& file) {
  const std::string name = file.string();
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) {
    throw UsageError(
        "there are no credentials in " + name +
        ": write two lines, 'access_key = ...' and 'secret_key = ...', into it, and chmod it to 600");
  }
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    throw UsageError(
        "the store's credentials in " + name +
        " can be read or written by others than their owner: chmod 600 it, and have the store give a new "
        "secret key if it was read");
  }
  std::optional<std::string> text =
      archive::read_small(archive::real_reading().open_to_read(file), kMostBytes);
  if (!text) throw UsageError(name + " is no file of credentials: it is far too long");
  StoreCredentials credentials;
  std::string_view left = *text;
  while (!left.empty()) {
    const std::size_t end = std::min(left.find('\n'), left.size());
    const std::string_view line = trimmed(left.substr(0, end));
    left.remove_prefix(std::min(end + 1, left.size()));
    if (line.empty() || line.front() == '#') continue;
    const std::size_t equals = line.find('=');
    const std::string_view key = trimmed(line.substr(0, equals));
    const std::string_view value = equals == std::string_view::npos ? "" : trimmed(line.substr(equals + 1));
    const bool is_access = key == "access_key" && credentials.access_key.empty();
    const bool is_secret = key == "secret_key" && credentials.secret_key.empty();
    // An access key with a colon could not be told from the secret behind it.
    if ((!is_access && !is_secret) || !is_printable_word(value) ||
        (is_access && value.find(':') != value.npos)) {
      std::ranges::fill(*text, '\0');
      throw UsageError(
          name +
          " is no file of credentials: it must hold 'access_key = ...' and 'secret_key = ...', each "
          "once, without quotation marks");
    }
    if (is_access) {
      credentials.access_key = value;
    } else {
      credentials.secret_key = crypto::Secret::copy_of(value);
    }
  }
  std::ranges::fill(*text, '\0');
  if (credentials.access_key.empty() || credentials.secret_key.empty())
    throw UsageError(name + " is no file of credentials: it lacks 'access_key = ...' or 'secret_key = ...'");
  return credentials;
}

}  // namespace kiroku::fleet
