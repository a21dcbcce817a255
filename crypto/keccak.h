// SHA-3 and SHAKE (FIPS 202) over OpenSSL. Pure functions, thread-safe; they throw kiroku::Error if OpenSSL
// fails.
#pragma once

#include <initializer_list>
#include <span>

#include "base/bytes.h"

namespace kiroku::crypto {

enum class Keccak { kSha3With256Bits, kSha3With512Bits, kShake128, kShake256 };

/// Hashes the parts one after the other and fills `out`, which for SHA-3 must have the digest's size.
void keccak(Keccak function, std::initializer_list<ByteView> parts, std::span<std::byte> out);

}  // namespace kiroku::crypto
