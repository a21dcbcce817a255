// From which browsers and addresses each user has signed in before: those never wait for the failures of
// others (OWASP, "Slow Down Online Guessing Attacks with Device Cookies"). In a database of the home
// (devices.sqlite), which holds hashes of the cookies. Thread-safe; other processes may use the same file.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/utc_time.h"

namespace kiroku::viewer {

/// The cookie that a browser keeps after somebody signed in with it.
inline constexpr std::string_view kDeviceCookie = "__Host-kiroku-device";
/// 400 days, the longest that browsers keep one.
inline constexpr std::int64_t kDeviceCookieSeconds = std::int64_t{400} * 86'400;

/// Every function throws kiroku::Error where the database cannot be used.
class KnownDevices {
 public:
  /// Somebody at the door.
  struct Caller {
    std::string user;
    UtcTime credential;  // User::changed: a new password or role makes strangers of everybody
    std::string device;  // the cookie's value, "" without one
    std::string holder;  // the address (base/network_address.h)
  };
  enum class Standing { kStranger, kKnownAddress, kKnownDevice };

  /// Opens or makes the file, mode 0600.
  static std::unique_ptr<KnownDevices> open(const std::filesystem::path& file);
  ~KnownDevices();

  [[nodiscard]] Standing standing(const Caller& caller) const;
  /// After signing in: remembers the address and the browser, whose cookie is replaced. Returns the new
  /// cookie's value, 43 characters; the old one is worth nothing from now on. Of one user the kMostOfUser
  /// latest browsers and addresses each are kept.
  std::string remember(const Caller& caller);
  /// After a wrong password: a known browser, or else a known address, is forgotten at the kOwnFailures-th in
  /// a row of its own.
  void note_failure(const Caller& caller);

  static constexpr int kMostOfUser = 32;
  static constexpr int kOwnFailures = 10;

 private:
  struct State;
  explicit KnownDevices(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace kiroku::viewer
