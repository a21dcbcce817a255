// Why an age file is refused: each kind of damage has its own name and message.
#pragma once

#include <string>

#include "base/error.h"

namespace kiroku::crypto {

enum class AgeFailure {
  kArmored,          // ASCII armor: not read here, use `age -d` or strip it
  kHeaderMalformed,  // not an age header, or not as the specification demands
  kHeaderForged,     // header MAC does not fit the file key
  kNoMatch,          // none of the identities is a recipient
  kPayloadDamaged,   // a chunk does not authenticate (wrong bytes, order, or a false last chunk)
  kTruncated,        // ends before the last chunk
  kTrailingData,     // goes on after the last chunk
};

class AgeError : public Error {
 public:
  AgeError(AgeFailure failure, const std::string& message) : Error(message), failure_(failure) {}
  [[nodiscard]] AgeFailure failure() const { return failure_; }

 private:
  AgeFailure failure_;
};

}  // namespace kiroku::crypto
