#include "archive/search/search_key.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <fcntl.h>
#include <optional>
#include <span>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/file_reading.h"
#include "base/descriptor.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/key_derivation.h"

namespace kiroku::search {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSiteWord = "kiroku-site-search-key-1";
constexpr std::string_view kApplianceWord = "kiroku-appliance-search-key-1";
constexpr std::size_t kKeyBytes = 32, kKeyDigits = 2 * kKeyBytes;
constexpr std::size_t kHalfOfSeries = 8, kSeriesDigits = 32;
constexpr std::size_t kStepDigits = 8;
constexpr std::size_t kMostBytes = 512;  // of a file

crypto::Sha256Digest hmac(const crypto::Secret& key, const std::string& message) {
  return crypto::hmac_sha256(key.bytes(), bytes_of(message));
}

/// A key's text must not stay in memory that is given back.
crypto::Secret hex_of(ByteView bytes) {
  std::string digits = crypto::to_hex(bytes);
  crypto::Secret secret = crypto::Secret::copy_of(digits);
  crypto::zeroise(std::as_writable_bytes(std::span(digits)));
  return secret;
}

std::optional<crypto::Secret> key_of(std::string_view digits) {
  if (digits.size() != kKeyDigits) return {};
  std::optional<Bytes> bytes = crypto::from_hex(digits);
  if (!bytes) return {};
  crypto::Secret secret = crypto::Secret::copy_of(*bytes);
  crypto::zeroise(*bytes);
  return secret;
}

crypto::Secret line_of(const std::string& words, const crypto::Secret& key) {
  const crypto::Secret digits = hex_of(key.bytes());
  crypto::Secret line(words.size() + 1 + digits.size() + 1);
  const auto bytes = line.bytes();
  auto at = std::ranges::copy(bytes_of(words + " "), bytes.begin()).out;
  at = std::ranges::copy(digits.bytes(), at).out;
  *at = std::byte{'\n'};
  return line;
}

/// The words of the one line.
std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  if (!text.ends_with('\n')) return words;
  text.remove_suffix(1);
  while (true) {
    const std::size_t blank = text.find(' ');
    words.push_back(text.substr(0, blank));
    if (blank == std::string_view::npos) return words;
    text.remove_prefix(blank + 1);
  }
}

crypto::Secret read_key_file(const fs::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0)
    throw UsageError("there is no search key in " + file.string() +
                     ": 'kiroku-fleet search-key' makes one (docs/how-to/run-a-fleet.md)");
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    throw UsageError(
        "the search key in " + file.string() +
        " can be read or written by others than its owner: chmod 600 it, and make another one if "
        "it was read");
  std::optional<std::string> text =
      archive::read_small(archive::real_reading().open_to_read(file), kMostBytes);
  if (!text) throw UsageError(file.string() + " is no search key: it is far too long");
  crypto::Secret secret = crypto::Secret::copy_of(*text);
  crypto::zeroise(std::as_writable_bytes(std::span(*text)));
  return secret;
}

std::string step_digits(std::uint64_t step) {
  std::string digits = std::to_string(step);
  return std::string(kStepDigits - std::min(kStepDigits, digits.size()), '0') + digits;
}

std::string series_tag(const crypto::Secret& site, std::string_view appliance, std::string_view random) {
  const crypto::Sha256Digest tag =
      hmac(site, "kiroku search series\n" + std::string(appliance) + "\n" + std::string(random));
  return crypto::to_hex(ByteView(tag).first(kHalfOfSeries));
}

}  // namespace

bool is_series(std::string_view text) {
  return text.size() == kSeriesDigits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

crypto::Sha256Digest Step::note_key() const { return hmac(chain, "kiroku search note"); }

Step Step::next() const {
  crypto::Sha256Digest following = hmac(chain, "kiroku search step");
  Step step{crypto::Secret::copy_of(ByteView(following))};
  crypto::zeroise(following);
  return step;
}

crypto::Secret ApplianceKey::text() const {
  return line_of(std::string(kApplianceWord) + " " + appliance + " " + series + " " + step_digits(step),
                 now.chain);
}

ApplianceKey ApplianceKey::parse(std::string_view text, const fs::path& file) {
  const std::vector<std::string_view> words = words_of(text);
  constexpr std::size_t kWords = 5;
  ApplianceKey key;
  bool fits = words.size() == kWords && words[0] == kApplianceWord && archive::is_short_name(words[1]) &&
              is_series(words[2]) && words[3].size() == kStepDigits;
  if (fits) {
    const auto [end, error] = std::from_chars(words[3].data(), words[3].data() + kStepDigits, key.step);
    std::optional<crypto::Secret> chain = key_of(words[4]);
    fits = error == std::errc() && end == words[3].data() + kStepDigits && chain;
    if (fits) key.now.chain = std::move(*chain);
  }
  if (!fits)
    throw UsageError(file.string() +
                     " is no search key of an appliance: 'kiroku-fleet search-key --from' makes one");
  key.appliance = words[1];
  key.series = words[2];
  return key;
}

ApplianceKey ApplianceKey::read(const fs::path& file) { return parse(read_key_file(file).text(), file); }

ApplianceKey take_step(const fs::path& file) {
  static_cast<void>(ApplianceKey::read(file));  // says what is wrong with it
  const Descriptor written(::open(file.c_str(), O_WRONLY | O_CLOEXEC));
  if (written.number() < 0) throw IoError("write", file, errno);
  // Read again under the lock: kirokud and `kiroku record` of one home share the file.
  while (::flock(written.number(), LOCK_EX) != 0) {
    if (errno != EINTR) throw IoError("lock", file, errno);
  }
  ApplianceKey key = ApplianceKey::read(file);
  if (key.step >= kMostSteps)
    throw Error("the search key in " + file.string() + " has made " + std::to_string(kMostSteps) +
                " notes, all that it can: have another one made ('kiroku-fleet search-key --from')");
  const ApplianceKey next{key.appliance, key.series, key.step + 1, key.now.next()};
  const crypto::Secret text = next.text();
  // In place: the former key is written over, and not left on the disk without a name. One sector holds it.
  const ssize_t count = ::pwrite(written.number(), text.bytes().data(), text.size(), 0);
  if (count != static_cast<ssize_t>(text.size())) throw IoError("write", file, count < 0 ? errno : ENOSPC);
  if (::fdatasync(written.number()) != 0) throw IoError("flush", file, errno);
  return key;
}

SiteKey SiteKey::make() { return SiteKey(crypto::Secret::random(kKeyBytes)); }

SiteKey SiteKey::read(const fs::path& file) {
  const crypto::Secret text = read_key_file(file);
  const std::vector<std::string_view> words = words_of(text.text());
  std::optional<crypto::Secret> key =
      words.size() == 2 && words[0] == kSiteWord ? key_of(words[1]) : std::nullopt;
  if (!key)
    throw UsageError(file.string() + " is no search key of a site: 'kiroku-fleet search-key' makes one" +
                     (!words.empty() && words[0] == kApplianceWord
                          ? ". It is that of an appliance, by which nothing is found"
                          : ""));
  return SiteKey(std::move(*key));
}

crypto::Secret SiteKey::text() const { return line_of(std::string(kSiteWord), secret_); }

ApplianceKey SiteKey::key_for(const std::string& appliance) const {
  if (!archive::is_short_name(appliance))
    throw UsageError("an appliance's name has up to 32 small letters, digits and hyphens");
  Bytes random(kHalfOfSeries);
  crypto::fill_random(random);
  const std::string half = crypto::to_hex(random);
  ApplianceKey key{appliance, half + series_tag(secret_, appliance, half), 0, {}};
  key.now = first_of(appliance, key.series);
  return key;
}

bool SiteKey::has_given(std::string_view appliance, std::string_view series) const {
  if (!is_series(series)) return false;
  const std::string_view half = series.substr(0, kSeriesDigits / 2);
  return series.substr(kSeriesDigits / 2) == series_tag(secret_, appliance, half);
}

Step SiteKey::first_of(std::string_view appliance, std::string_view series) const {
  return {crypto::hkdf_sha256(secret_.bytes(), bytes_of(series),
                              "kiroku search appliance\n" + std::string(appliance))};
}

}  // namespace kiroku::search
