// What is computed from secrets and is then known to everybody, such as a public key: said at its place in
// the code, for the test that follows secrets through it (tests/unit/crypto/secret_flow.cpp).
#pragma once

#ifdef KIROKU_FOLLOWS_SECRETS
#include <valgrind/memcheck.h>
#endif

namespace kiroku::crypto {

/// Branches and addresses may depend on `value` from here on. Does nothing but in that test.
template <typename T>
void publish([[maybe_unused]] const T* value, [[maybe_unused]] decltype(sizeof(T)) count = 1) {
#ifdef KIROKU_FOLLOWS_SECRETS
  VALGRIND_MAKE_MEM_DEFINED(value, count * sizeof(T));
#endif
}

}  // namespace kiroku::crypto
