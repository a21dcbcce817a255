#include "apps/kiroku/case_recording.h"

#include <iostream>
#include <utility>

#include "apps/common/command_line.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/recovering.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "crypto/hardware_key.h"
#include "crypto/signing_key.h"

namespace kiroku::apps {
namespace {

/// What a recorder that died left behind comes first: then nothing else writes the archive.
void recover_first(const WritableHome& writable, const Authorities& authorities,
                   const archive::RecordingLock& lock) {
  for (const archive::CaseRecovery& each : recover_home(writable, authorities.named(), lock)) {
    std::cerr << recovery_text(each);
  }
}

/// Whoever records should know before, rather than from a verifier.
void warn_if_silent(const crypto::SigningKey& key) {
  if (key.hardware() == nullptr) return;
  if (const std::string why = crypto::why_silent(*key.hardware()); !why.empty())
    print_error("kiroku",
                "warning: the key in hardware does not sign, so that the case will be unproven: " + why);
}

}  // namespace

recorder::SessionResult record_case(
    const Home& home, recorder::SessionOptions options, const std::vector<std::string>& names,
    const std::function<recorder::SessionResult(recorder::SessionOptions)>& drive) {
  const Authorities authorities(home, home.configuration(), names);
  options.authorities = authorities.named();
  const WritableHome writable(home);
  options.trust = &writable.trust;
  options.queue = writable.queue.get();
  options.key = &writable.key;
  options.log = writable.log.get();
  const archive::RecordingLock lock =
      archive::RecordingLock::take(archive::real_file_system(), home.archive());
  log_configuration(home.configuration_file(), home, *writable.log,
                    [](const std::string& sentence) { print_error("kiroku", "warning: " + sentence); });
  recover_first(writable, authorities, lock);
  warn_if_silent(writable.key);

  recorder::SessionResult result = drive(std::move(options));
  try {
    refresh_catalogue(home, result.folder);
  } catch (const Error& error) {
    print_error("kiroku", std::string("warning: the catalogue does not know this case yet: ") + error.what());
  }
  return result;
}

}  // namespace kiroku::apps
