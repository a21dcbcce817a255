// Another time zone for this process, as long as one of these is there. Not for two threads at once.
#pragma once

#include <cstdlib>
#include <ctime>
#include <optional>
#include <string>

namespace kiroku::test {

class LocalZone {
 public:
  /// As POSIX writes it, so that no database is needed: "CET-1CEST,M3.5.0,M10.5.0/3".
  explicit LocalZone(const std::string& rule) {
    if (const char* const before = std::getenv("TZ"); before != nullptr) before_ = before;
    set(rule);
  }
  ~LocalZone() { set(before_); }
  LocalZone(const LocalZone&) = delete;
  LocalZone& operator=(const LocalZone&) = delete;

 private:
  static void set(const std::optional<std::string>& rule) {
    if (rule) {
      ::setenv("TZ", rule->c_str(), 1);
    } else {
      ::unsetenv("TZ");
    }
    ::tzset();
  }

  std::optional<std::string> before_;
};

}  // namespace kiroku::test
