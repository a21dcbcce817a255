// Errors of the whole project. Header-only types; thread-safe.
#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace kiroku {

/// Something was refused or failed. what() is one sentence that says what failed, where, and what to do about
/// it; the programs print it as it is. Never used for a verdict: what verification finds is data
/// (archive::Finding).
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The caller asked for something impossible (wrong option, wrong key, wrong folder): nothing was done.
class UsageError : public Error {
 public:
  using Error::Error;
};

/// A system call on a file or device failed. `error_number()` is errno, e.g. ENOSPC for a full disk.
class IoError : public Error {
 public:
  /// Message: "cannot <action> <path>: <strerror>".
  IoError(const std::string& action, const std::filesystem::path& path, int error_number);
  [[nodiscard]] int error_number() const { return error_number_; }
  [[nodiscard]] bool disk_full() const;

 private:
  int error_number_;
};

}  // namespace kiroku
