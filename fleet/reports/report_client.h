// How an appliance speaks to its hospital's report server: by libcurl over TLS, with its certificate once it
// has one. Not thread-safe.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/secret.h"

namespace kiroku::fleet {

/// What an enrolled appliance has: where to report, as whom, and whom it believes.
struct ReportingIdentity {
  std::string url, appliance;
  std::string certificate_pem, authority_pem;
  crypto::Secret key_pem;

  /// Nothing where there is no such file. Throws kiroku::UsageError where it holds something else, or is open
  /// to others than its owner.
  static std::optional<ReportingIdentity> read(const std::filesystem::path& file);
  /// Old or new, never a mixture; mode 0600.
  void write(const std::filesystem::path& file) const;
};

/// Whoever puts something into the place of a ReportingIdentity has the turn: the certificate that one
/// process renews would else be written over by what another one renewed a moment before, and does not count
/// any more. The kernel takes it back whatever becomes of the process.
class ReportingTurn {
 public:
  /// Of the home in which `file` lies. Nothing while somebody else has it. Throws kiroku::IoError.
  static std::optional<ReportingTurn> take(const std::filesystem::path& file);

 private:
  explicit ReportingTurn(Descriptor folder) : folder_(std::move(folder)) {}
  Descriptor folder_;
};

/// The report server did not take what it was given. what() says why and what to do.
class ReportError : public Error {
 public:
  ReportError(const std::string& sentence, long status) : Error(sentence), status_(status) {}
  /// HTTP status; 0 where no answer came.
  [[nodiscard]] long status() const { return status_; }
  /// Whether the same may succeed later.
  [[nodiscard]] bool passes() const { return status_ == 0 || status_ == 429 || status_ >= 500; }

 private:
  long status_;
};

class ReportClient {
 public:
  /// `url`: "https://fleet.hospital.example:8444". Of somebody who has no certificate yet, and believes
  /// nobody: what such a client learns counts only once the enrolment's code was compared. Throws
  /// kiroku::UsageError.
  explicit ReportClient(const std::string& url);
  explicit ReportClient(const ReportingIdentity& identity);
  ~ReportClient();
  ReportClient(const ReportClient&) = delete;
  ReportClient& operator=(const ReportClient&) = delete;

  /// The answer's body, of 200 or 202. Throws ReportError.
  std::string post(const std::string& path, const std::string& json);
  std::string get(const std::string& path);
  [[nodiscard]] long status() const;  // of the last answer

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::fleet
