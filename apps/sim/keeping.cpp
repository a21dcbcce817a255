#include "apps/sim/keeping.h"

#include <cctype>

#include "apps/common/file.h"
#include "apps/kiroku/output_file.h"
#include "apps/kiroku/plan_seal.h"
#include "apps/kiroku/stamped_file.h"
#include "archive/storage/file_stamps.h"
#include "base/error.h"
#include "crypto/age_file.h"
#include "viewer/http/disk_room.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

/// "liver-retraction" of "Liver_retraction.seal.json".
std::string name_of(const fs::path& plan_file) {
  const std::string file = plan_file.filename().string();
  std::string name;
  for (const char c : file.substr(0, file.find('.'))) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_letter = byte < 0x80 && std::isalnum(byte) != 0;
    if (is_letter) {
      name += static_cast<char>(std::tolower(byte));
    } else if (!name.empty() && name.back() != '-') {
      name += '-';
    }
  }
  constexpr std::size_t kLongest = 32;
  name.resize(std::min(name.size(), kLongest));
  while (name.ends_with('-')) name.pop_back();
  return name;
}

void make_private_folder(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (!failed) fs::permissions(folder, fs::perms::owner_all, failed);
  if (failed) throw IoError("create", folder, failed.value());
}

}  // namespace

Keeping::Keeping(const Home& home, const archive::CaseReader& recording, const std::string& stream,
                 const fs::path& plan_file, const std::optional<std::string>& asked, bool replace) {
  const std::string& case_id = recording.opening().case_id;
  if (!home.holds(recording.folder())) {
    throw UsageError("the case " + case_id + " is not in the archive of " + home.folder().string() +
                     ": say where the comparison shall be written: -o OUT.mp4, OUT.html or OUT.json");
  }
  const std::string name = asked.value_or(name_of(plan_file));
  if (!compare::is_comparison_name(name)) {
    throw UsageError("a comparison cannot be called '" + name +
                     "': give it a --name of at most 32 small letters, digits and hyphens");
  }
  place_ = compare::kept_place(home.comparisons_folder(), case_id, name);
  if (fs::exists(place_.sealed_document()) && !replace) {
    throw UsageError("the case has a comparison '" + name +
                     "' already: give this one another --name, or replace that one with --force");
  }
  viewer::require_disk_room(home.folder(), 0, "remove comparisons that nobody needs");
  recipients_ = compare::recipients_in_common(recording.opening(), stream);
  make_private_folder(home.comparisons_folder());
  make_private_folder(place_.folder);
  making_ = place_.making();
  std::error_code ignored;
  fs::remove_all(making_, ignored);  // what an earlier run that was killed left behind
  make_private_folder(making_);
  if (!replace) return;
  fs::remove(place_.sealed_document(), ignored);
  fs::remove(place_.sealed_replay(), ignored);
  fs::remove(place_.sealed_radiographs(), ignored);
  for (const fs::path& of : {place_.document(), place_.seal()})
    for (const fs::path& token : archive::tokens_beside(of)) fs::remove(token, ignored);
}

Keeping::~Keeping() {
  std::error_code ignored;
  fs::remove_all(making_, ignored);
}

compare::NamedFile Keeping::keep_film(const std::string& role) {
  OutputFile out(place_.folder / (place_.film_name(role) + ".age"), 0600);
  const MappedFile film(film_file(role));
  crypto::AgeSealer sealer(recipients_, [&](ByteView piece) { out.write(piece); });
  sealer.write(film.bytes());
  sealer.finish();
  out.commit(OutputFile::Durability::kNow);
  const SealedFile hash = hashed(role, place_.film_name(role), film_file(role));
  return {hash.role, hash.name, hash.bytes, hash.sha256};
}

void Keeping::keep_document(std::string_view text) {
  OutputFile out(place_.sealed_document(), 0600);
  out.write(crypto::seal_bytes(bytes_of(text), recipients_));
  out.commit(OutputFile::Durability::kNow);
}

void Keeping::keep_tokens_of(const fs::path& seal_file) {
  for (const fs::path& token : archive::tokens_beside(seal_file)) {
    const std::string authority = token.stem().extension().string().substr(1);
    write_durably(archive::token_beside(place_.seal(), authority), read_small_file(token, "the time-stamp"));
  }
}

}  // namespace kiroku::apps
