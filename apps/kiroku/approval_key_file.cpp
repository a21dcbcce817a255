#include "apps/kiroku/approval_key_file.h"

#include <cerrno>
#include <fcntl.h>
#include <optional>
#include <sys/stat.h>
#include <unistd.h>

#include "apps/common/file.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/output_file.h"
#include "archive/storage/file_system.h"
#include "base/error.h"
#include "crypto/secret.h"
#include "crypto/signing_key.h"

namespace kiroku::apps {
namespace {

void set_mode(const std::filesystem::path& path, mode_t mode) {
  if (::chmod(path.c_str(), mode) != 0) throw IoError("set the permissions of", path, errno);
}

}  // namespace

crypto::ApprovalKey load_approval_key(const std::filesystem::path& file) {
  Bytes read = read_small_file(file, "the approval key");
  const crypto::Secret pem = crypto::Secret::copy_of(read);
  crypto::zeroise(read);
  if (is_open_to_others(file)) {
    throw UsageError(
        file.string() +
        " can be read or written by others than its owner: chmod 600 it, or mount a stick without "
        "such permissions with umask=077; if others may have read it, see "
        "docs/how-to/keep-a-key-in-hardware.md");
  }
  std::optional<crypto::Secret> passphrase;
  if (crypto::SigningKey::pem_is_encrypted(pem.text()))
    passphrase = ask_passphrase("the approval key " + file.string());
  try {
    return crypto::ApprovalKey::from_pem(pem.text(), passphrase ? &*passphrase : nullptr);
  } catch (const Error& error) {
    throw Error("cannot use " + file.string() + ": " + error.what());
  }
}

void save_approval_key(const std::filesystem::path& file, const crypto::Secret& pem) {
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (descriptor < 0 && errno == EEXIST)
    throw UsageError(file.string() + " is there already and is not overwritten: name another file");
  if (descriptor < 0) throw IoError("write", file, errno);
  try {
    write_all(descriptor, pem.bytes(), file);
    if (::fsync(descriptor) != 0) throw IoError("make durable", file, errno);
  } catch (...) {
    ::close(descriptor);
    ::unlink(file.c_str());
    throw;
  }
  ::close(descriptor);
  archive::real_file_system().sync_folder(file.has_parent_path() ? file.parent_path() : ".");
}

std::filesystem::path keep_approval(const std::filesystem::path& folder,
                                    const recorder::BootApproval& approval) {
  constexpr mode_t kFolderForAll = 0755, kFileForAll = 0644;
  archive::FileSystem& files = archive::real_file_system();
  if (!files.exists(folder)) {
    files.make_folder(folder);
    set_mode(folder, kFolderForAll);
  }
  std::filesystem::path kept = folder / recorder::approval_file_name(approval);
  files.write_durably(kept, bytes_of(approval.to_json()));
  set_mode(kept, kFileForAll);
  return kept;
}

}  // namespace kiroku::apps
