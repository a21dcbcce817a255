// Whether time or addresses depend on secrets: ML-DSA and ML-KEM run under valgrind's memcheck on secrets
// that it takes for uninitialised memory, and every branch or index on what was computed from them is
// reported (A. Langley's "ctgrind"). The implementations are compiled into this program once more, with
// KIROKU_FOLLOWS_SECRETS, so that what they publish on purpose is known (crypto/published.h).
//
// Usage: valgrind secret_flow [--branch | --index]; these two do what must be reported.
#include <cstdio>
#include <string_view>
#include <utility>
#include <valgrind/memcheck.h>

#include "crypto/ml_dsa_own.h"
#include "crypto/ml_kem_own.h"
#include "tests/support/patterned_bytes.h"

namespace kiroku::crypto {
namespace {

Secret followed(std::size_t size) {
  Secret secret = Secret::copy_of(test::patterned_bytes(size));
  VALGRIND_MAKE_MEM_UNDEFINED(secret.bytes().data(), size);
  return secret;
}

void know(ByteView bytes) { VALGRIND_MAKE_MEM_DEFINED(bytes.data(), bytes.size()); }

bool signs(MlDsaSet set) {
  const Secret seed = followed(kMlDsaSeedSize);
  const ml_dsa_own::Keys keys = ml_dsa_own::generate(set, seed.bytes());
  bool valid = true;
  // Several messages: a signature may be the first try's.
  for (std::size_t size = 0; size < 8; ++size) {
    const Bytes message =
        ml_dsa_own::representative(keys.public_key, test::patterned_bytes(size), test::patterned_bytes(3));
    const Secret randomness = followed(kMlDsaRandomnessSize);
    const Bytes signature = ml_dsa_own::sign(set, keys.private_key.bytes(), message, randomness.bytes());
    valid = valid && ml_dsa_own::verify(set, keys.public_key, message, signature);
  }
  return valid;
}

bool encapsulates() {
  const Secret seed = followed(kMlKemSeedSize);
  Bytes public_key = ml_kem_own::public_key_of(seed.bytes());
  know(public_key);
  const Secret message = followed(kMlKemMessageSize);
  MlKemEncapsulation sealed = ml_kem_own::encapsulate(public_key, message.bytes());
  know(sealed.ciphertext);
  const Secret shared = ml_kem_own::decapsulate(seed.bytes(), public_key, sealed.ciphertext);
  sealed.ciphertext[7] ^= std::byte{1};
  const Secret rejected = ml_kem_own::decapsulate(seed.bytes(), public_key, sealed.ciphertext);
  for (ByteView each : {shared.bytes(), rejected.bytes(), std::as_const(sealed.shared_secret).bytes()})
    know(each);
  return equal_constant_time(shared.bytes(), sealed.shared_secret.bytes()) &&
         !equal_constant_time(rejected.bytes(), sealed.shared_secret.bytes());
}

int run(std::string_view what) {
  if (RUNNING_ON_VALGRIND == 0) {
    std::puts("secret_flow finds nothing by itself: run it under valgrind");
    return 2;
  }
  if (what == "--branch") {
    const Secret secret = followed(1);
    if (secret.bytes()[0] == std::byte{1}) std::puts("a branch on a secret");
    return 0;
  }
  if (what == "--index") {
    const Secret secret = followed(1);
    const Bytes table = test::patterned_bytes(256);
    const volatile std::byte entry = table[std::to_integer<std::size_t>(secret.bytes()[0])];
    static_cast<void>(entry);
    return 0;
  }
  if (!signs(MlDsaSet::k44) || !signs(MlDsaSet::k65) || !encapsulates()) {
    std::puts("what was computed is wrong");
    return 3;
  }
  return 0;
}

}  // namespace
}  // namespace kiroku::crypto

int main(int count, char** arguments) { return kiroku::crypto::run(count > 1 ? arguments[1] : ""); }
