#include "fleet/reports/machine_run.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <linux/magic.h>
#include <optional>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "archive/writing/appliance_log.h"
#include "base/bytes.h"
#include "base/descriptor.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "crypto/secret.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRunBytes = 16, kSecretBytes = 32;
constexpr mode_t kForOwner = 0600, kForOthers = 0077;

bool is_in_memory(const fs::path& folder) {
  struct statfs about {};
  return ::statfs(folder.c_str(), &about) == 0 &&
         (about.f_type == TMPFS_MAGIC || about.f_type == RAMFS_MAGIC);
}

/// Who may have made the secret of a home that is `owner`'s: they, and root for them.
bool is_made_for(const struct stat& about, uid_t owner) {
  return S_ISREG(about.st_mode) && (about.st_uid == owner || about.st_uid == 0) &&
         (about.st_mode & kForOthers) == 0 && about.st_size == static_cast<off_t>(kSecretBytes);
}

/// Nothing where none is there that may count, as one that another user of the machine put there.
std::optional<crypto::Secret> read_secret(const fs::path& file, uid_t owner) {
  // Whoever may write there may have put a pipe or a link in its place.
  const Descriptor opened(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat about {};
  if (!opened || ::fstat(opened.number(), &about) != 0 || !is_made_for(about, owner)) return {};
  std::array<std::byte, kSecretBytes> bytes{};
  if (::read(opened.number(), bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) return {};
  crypto::Secret secret = crypto::Secret::copy_of(bytes);
  crypto::zeroise(bytes);
  return secret;
}

/// Whole or not at all, and never in the place of one that is there: another process may make it, too.
void make_secret(const fs::path& file, uid_t owner) {
  std::string beside = file.string() + ".XXXXXX";
  const Descriptor made(::mkostemp(beside.data(), O_CLOEXEC));
  if (!made) return;
  const crypto::Secret secret = crypto::Secret::random(kSecretBytes);
  const bool is_written =
      ::fchmod(made.number(), kForOwner) == 0 &&
      ::write(made.number(), secret.bytes().data(), kSecretBytes) == static_cast<ssize_t>(kSecretBytes);
  // Root reports by hand as well, and the service must be able to read it.
  const bool is_owned = ::geteuid() != 0 || ::fchown(made.number(), owner, static_cast<gid_t>(-1)) == 0;
  if (is_written && is_owned) (void)!::link(beside.c_str(), file.c_str());
  ::unlink(beside.c_str());
}

std::optional<crypto::Secret> secret_of(const fs::path& home, const fs::path& memory) {
  struct stat about {};
  if (!is_in_memory(memory) || ::stat(home.c_str(), &about) != 0) return {};
  const std::string which =
      crypto::to_hex(crypto::sha256(bytes_of(std::to_string(about.st_uid) + " " + home.string())))
          .substr(0, 2 * kRunBytes);
  const fs::path file = memory / ("kiroku-run-" + which);
  if (std::optional<crypto::Secret> there = read_secret(file, about.st_uid)) return there;
  make_secret(file, about.st_uid);
  return read_secret(file, about.st_uid);
}

}  // namespace

std::string run_of_machine(const fs::path& home, const fs::path& memory) {
  std::error_code failed;
  fs::path folder = fs::canonical(home, failed);
  if (failed) folder = home;
  const std::string boot = archive::kernel_boot_id();
  const std::optional<crypto::Secret> secret = secret_of(folder, memory);
  // As no process here can tell that another is of the same machine.
  if (!secret && boot == archive::kUnknownBoot)
    return crypto::to_hex(crypto::Secret::random(kRunBytes).bytes());
  std::string text = boot + " " + folder.string();
  if (secret) text += " " + crypto::to_hex(secret->bytes());
  return crypto::to_hex(crypto::sha256(bytes_of(text))).substr(0, 2 * kRunBytes);
}

}  // namespace kiroku::fleet
