#include "apps/common/terminal.h"

#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <memory>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

constexpr std::size_t kLongestPassphrase = 1024;

class TerminalDevice {
 public:
  TerminalDevice() : descriptor_(::open("/dev/tty", O_RDWR | O_NOCTTY | O_CLOEXEC)) {}
  ~TerminalDevice() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  TerminalDevice(const TerminalDevice&) = delete;
  TerminalDevice& operator=(const TerminalDevice&) = delete;
  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void print(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t written = ::write(descriptor_, text.data(), text.size());
      if (written <= 0) return;
      text.remove_prefix(std::size_t(written));
    }
  }

 private:
  int descriptor_;
};

/// Keys arrive one by one and unseen, Ctrl-C as a key: so that no signal leaves the terminal without echo.
class SilentKeys {
 public:
  explicit SilentKeys(int descriptor) : descriptor_(descriptor) {
    if (::tcgetattr(descriptor_, &before_) != 0) return;
    termios silent = before_;
    silent.c_lflag &= ~tcflag_t(ECHO | ECHOE | ECHOK | ECHONL | ICANON | ISIG);
    silent.c_cc[VMIN] = 1;
    silent.c_cc[VTIME] = 0;
    changed_ = ::tcsetattr(descriptor_, TCSAFLUSH, &silent) == 0;
  }
  ~SilentKeys() {
    if (changed_) ::tcsetattr(descriptor_, TCSAFLUSH, &before_);
  }
  SilentKeys(const SilentKeys&) = delete;
  SilentKeys& operator=(const SilentKeys&) = delete;
  [[nodiscard]] bool silent() const { return changed_; }

 private:
  int descriptor_;
  termios before_{};
  bool changed_ = false;
};

/// The prompt comes when keys are silent already: nothing typed at once is shown or lost.
crypto::Secret ask(const TerminalDevice& device, const std::string& prompt) {
  constexpr char kInterrupt = 3, kEndOfFile = 4, kKillLine = 21;
  const SilentKeys keys(device.descriptor());
  if (!keys.silent())
    throw UsageError("cannot read a passphrase unseen on this terminal: set KIROKU_PASSPHRASE");
  device.print(prompt);
  crypto::Secret typed(kLongestPassphrase);
  std::size_t length = 0;
  for (;;) {
    char key = 0;
    const ssize_t got = ::read(device.descriptor(), &key, 1);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0 || key == kInterrupt || key == kEndOfFile) {
      device.print("\n");
      throw UsageError("no passphrase was given: nothing was done");
    }
    if (key == '\n' || key == '\r') break;
    if (key == kKillLine) {
      length = 0;
    } else if (key == 127 || key == 8) {
      // A whole UTF-8 character goes.
      while (length > 0 && (std::to_integer<unsigned>(typed.bytes()[length - 1]) & 0xc0U) == 0x80U) --length;
      if (length > 0) --length;
    } else if (length < kLongestPassphrase) {
      typed.bytes()[length++] = std::byte(key);
    }
  }
  device.print("\n");
  return crypto::Secret::copy_of(ByteView(typed.bytes()).first(length));
}

/// The passphrase of the environment, if there is one.
const char* passphrase_from_environment() { return std::getenv("KIROKU_PASSPHRASE"); }

void require_terminal(const TerminalDevice& device, const std::string& what_for) {
  if (!device.is_open()) {
    throw UsageError("a passphrase is needed for " + what_for +
                     " and there is no terminal to ask on: set KIROKU_PASSPHRASE");
  }
}

}  // namespace

bool output_is_terminal() { return ::isatty(STDOUT_FILENO) == 1; }

bool errors_are_terminal() { return ::isatty(STDERR_FILENO) == 1; }

std::size_t terminal_width() {
  winsize size{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

std::string paint(Colour colour, std::string_view text) {
  const char* no_colour = std::getenv("NO_COLOR");
  const char* kind = std::getenv("TERM");
  const bool plain = !output_is_terminal() || (no_colour != nullptr && *no_colour != '\0') ||
                     kind == nullptr || std::string_view(kind) == "dumb";
  if (plain) return std::string(text);
  const char* code = colour == Colour::kGreen    ? "\033[1;32m"
                     : colour == Colour::kYellow ? "\033[1;33m"
                                                 : "\033[1;31m";
  return code + std::string(text) + "\033[0m";
}

crypto::Secret ask_passphrase(const std::string& what_for) {
  if (const char* given = passphrase_from_environment())
    return crypto::Secret::copy_of(std::string_view(given));
  const TerminalDevice device;
  require_terminal(device, what_for);
  return ask(device, "Passphrase for " + what_for + ": ");
}

crypto::Secret ask_new_passphrase(const std::string& what_for) {
  if (const char* given = passphrase_from_environment()) {
    if (*given == '\0') throw UsageError("KIROKU_PASSPHRASE is empty: choose a passphrase for " + what_for);
    return crypto::Secret::copy_of(std::string_view(given));
  }
  const TerminalDevice device;
  require_terminal(device, what_for);
  crypto::Secret first = ask(device, "New passphrase for " + what_for + ": ");
  if (first.empty()) throw UsageError("an empty passphrase protects nothing: choose one for " + what_for);
  const crypto::Secret second = ask(device, "The same once more: ");
  if (!crypto::equal_constant_time(first.bytes(), second.bytes())) {
    throw UsageError("the two passphrases differ: nothing was done, try again");
  }
  return first;
}

}  // namespace kiroku::apps
