// Policies of algorithms: what is no policy is refused by its place, and what is one answers for every
// algorithm.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "evidence/policy.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace kiroku;  // NOLINT(google-build-using-namespace)
  try {
    const evidence::Policy policy =
        evidence::Policy::parse({reinterpret_cast<const char*>(data), size}, "policy");
    if (!policy.hash(crypto::hash_name(policy.new_hash())).listed) std::abort();
    if (policy.signature({"rsa", 1, "md5"}).listed) std::abort();
  } catch (const UsageError& error) {
    if (!std::string_view(error.what()).starts_with("policy")) std::abort();
  }
  return 0;
}
