#include "viewer/report/stated_consents.h"

#include "base/error.h"

namespace kiroku::report {

StatedConsents read_stated_consents(const std::filesystem::path& log_folder,
                                    std::span<const crypto::VerifierKey> devices, const std::string& case_id,
                                    const std::optional<crypto::Checkpoint>& seen) {
  StatedConsents stated;
  stated.problem = "no device was named whose log it could be";
  for (const crypto::VerifierKey& device : devices) {
    try {
      archive::Consents all = archive::read_consents(log_folder, device, seen);
      return {std::move(all[case_id].entries), ""};
    } catch (const Error& error) {
      stated.problem = error.what();
    }
  }
  return stated;
}

}  // namespace kiroku::report
