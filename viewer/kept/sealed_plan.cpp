#include "viewer/kept/sealed_plan.h"

#include <fstream>
#include <iterator>
#include <string>
#include <system_error>

#include "base/bytes.h"

namespace kiroku::compare {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 3;
constexpr std::uintmax_t kLargestSeal = 1U << 20;

bool has_hash(const fs::path& file, const crypto::Sha256Digest& seal) {
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  return in && crypto::sha256(bytes_of(text)) == seal;
}

}  // namespace

std::optional<fs::path> find_sealed_plan(const fs::path& folder, const crypto::Sha256Digest& seal) {
  std::error_code failed;
  for (fs::recursive_directory_iterator file(folder, fs::directory_options::skip_permission_denied, failed),
       end;
       !failed && file != end; file.increment(failed)) {
    const fs::file_status status = file->symlink_status(failed);
    if (failed) return {};
    if (fs::is_directory(status) && file.depth() >= kDeepest) file.disable_recursion_pending();
    if (!fs::is_regular_file(status) || !file->path().string().ends_with(".seal.json")) continue;
    if (file->file_size(failed) > kLargestSeal || failed) continue;
    if (has_hash(file->path(), seal)) return file->path();
  }
  return {};
}

}  // namespace kiroku::compare
