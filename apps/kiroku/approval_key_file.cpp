#include "apps/kiroku/approval_key_file.h"

#include <optional>

#include "apps/common/file.h"
#include "apps/common/terminal.h"
#include "base/error.h"
#include "crypto/secret.h"
#include "crypto/signing_key.h"

namespace kiroku::apps {

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

}  // namespace kiroku::apps
