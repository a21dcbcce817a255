#include "apps/sim/plan_sealing.h"

#include <utility>

#include "apps/common/output_place.h"
#include "apps/kiroku/authorities.h"
#include "apps/sim/sealed_files.h"
#include "base/error.h"
#include "viewer/http/disk_room.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSealEnding = ".seal.json";

fs::path seal_file(const fs::path& plan) {
  fs::path file = plan;
  return file.replace_extension(kSealEnding);
}

}  // namespace

void require_unsealed(const fs::path& plan) {
  const fs::path file = seal_file(plan);
  require_place_beside(plan, file);
  if (!fs::exists(file)) return;
  throw UsageError(file.string() +
                   " is there already: kiroku plan verify tells whether it still holds; to seal a changed "
                   "plan, give that another name");
}

SealedPlan seal_plan_file(const Home& home, const fs::path& plan, const std::string& name,
                          const std::vector<std::string>& authorities, const timestamp::TrustStore& trust,
                          const std::function<void(const crypto::Sha256Digest&)>& enter) {
  require_unsealed(plan);
  viewer::require_disk_room(home.archive(), 0, "free some, then seal the plan again");
  const Authorities asked(home, home.configuration(), authorities);
  SealedPlan sealed{seal_file(plan), seal_of_plan(plan, name), {}, {}};
  const std::string text = plan_seal_text(sealed.seal);
  sealed.digest = crypto::sha256(bytes_of(text));
  write_durably(sealed.file, bytes_of(text));
  enter(sealed.digest);
  for (const recorder::NamedAuthority& authority : asked.named())
    sealed.stamps.push_back(stamp_file(authority, sealed.file, sealed.digest, trust));
  return sealed;
}

}  // namespace kiroku::apps
