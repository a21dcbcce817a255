// Policies of algorithms: what is no policy is refused by its place, and what is one answers for every
// algorithm.
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "evidence/policy.h"

namespace {

/// "policy:12:3: sentence", or "policy is no policy of algorithms: …".
bool names_its_place(std::string_view message) {
  constexpr std::string_view kFile = "policy:", kWhole = "policy is no policy of algorithms: ";
  if (message.starts_with(kWhole)) return message.size() > kWhole.size();
  return message.starts_with(kFile) && message.size() > kFile.size() &&
         std::isdigit(static_cast<unsigned char>(message[kFile.size()])) != 0;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku;  // NOLINT(google-build-using-namespace)
  try {
    const evidence::Policy policy =
        evidence::Policy::parse({reinterpret_cast<const char*>(data), size}, "policy");
    if (!policy.hash(crypto::hash_name(policy.new_hash())).listed) std::abort();
    if (policy.signature({"rsa", 1, "md5"}).listed) std::abort();
  } catch (const UsageError& error) {
    if (!names_its_place(error.what())) std::abort();
  }
  return 0;
}
