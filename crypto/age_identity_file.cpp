// Identity files: as age-keygen writes them, plain or sealed with a passphrase. All of it stays in locked
// memory.
#include <algorithm>

#include "base/error.h"
#include "crypto/age_file.h"
#include "crypto/age_recipient.h"
#include "crypto/identity_text.h"

namespace kiroku::crypto {
namespace {

constexpr std::uint64_t kLargestIdentityFile = 1 << 20;

Secret read_secret_file(const std::filesystem::path& file) {
  const auto source = open_file_source(file);
  if (source->size() > kLargestIdentityFile)
    throw UsageError(file.string() + " is no identity file: it is larger than a megabyte");
  Secret content(static_cast<std::size_t>(source->size()));
  if (source->read_at(0, content.bytes()) != content.size())
    throw UsageError(file.string() + " became shorter while it was read; try again");
  return content;
}

Secret unseal_identity_file(const Secret& sealed, const std::string& name,
                            const AskPassphrase& ask_passphrase, int work_factor) {
  const Secret passphrase = ask_passphrase(name);
  try {
    const auto source = memory_source(sealed.bytes());
    const AgeFile opened = AgeFile::open(*source, {passphrase_identity(passphrase, work_factor)});
    if (opened.plaintext_size() > kLargestIdentityFile)
      throw UsageError(name + " is no identity file: it is larger than a megabyte");
    Secret content(static_cast<std::size_t>(opened.plaintext_size()));
    opened.read_at(0, content.bytes());
    return content;
  } catch (const AgeError& error) {
    if (error.failure() == AgeFailure::kNoMatch)
      throw Error("the passphrase does not open " + name + "; try again");
    throw Error("cannot open " + name + ": " + error.what());
  }
}

AgeIdentities parse_identities(std::string_view text, const std::string& name, std::size_t most) {
  AgeIdentities identities;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() || line.starts_with('#')) continue;
    if (identities.size() == most) {
      throw UsageError(name + " holds more than " + std::to_string(most) +
                       " keys; bring a file with those that open these recordings");
    }
    try {
      identities.push_back(parse_identity(line));
    } catch (const UsageError& error) {
      throw UsageError(name + ", line " + std::to_string(number) + ": " + error.what());
    }
  }
  if (identities.empty()) throw UsageError(name + " holds no identity; give a file made by age-keygen");
  return identities;
}

}  // namespace

AgeIdentities read_identities(Secret content, const std::string& name, const AskPassphrase& ask_passphrase,
                              const IdentityLimits& limits) {
  if (content.text().starts_with("-----BEGIN AGE ENCRYPTED FILE-----"))
    throw UsageError(name + " is ASCII-armored, which is not read here; seal it with `age -p` without -a");
  if (content.text().starts_with("age-encryption.org/"))
    content = unseal_identity_file(content, name, ask_passphrase, limits.work_factor);
  return parse_identities(content.text(), name, limits.keys);
}

AgeIdentities load_identity_file(const std::filesystem::path& file, const AskPassphrase& ask_passphrase) {
  return read_identities(read_secret_file(file), "the identity file " + file.string(), ask_passphrase);
}

}  // namespace kiroku::crypto
