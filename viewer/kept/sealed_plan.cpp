#include "viewer/kept/sealed_plan.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/bytes.h"
#include "base/foreign_json.h"

namespace kiroku::compare {
namespace {

namespace fs = std::filesystem;

constexpr int kDeepest = 3;
constexpr std::uintmax_t kLargestSeal = 1U << 20;

/// Nothing where it cannot be read.
std::optional<std::string> text_of_file(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  return in ? std::optional(std::move(text)) : std::nullopt;
}

/// Calls `visit` with each file that may be a seal until it returns false.
void for_each_seal(const fs::path& folder, const std::function<bool(const fs::path& file)>& visit) {
  std::error_code failed;
  for (fs::recursive_directory_iterator file(folder, fs::directory_options::skip_permission_denied, failed),
       end;
       !failed && file != end; file.increment(failed)) {
    const fs::file_status status = file->symlink_status(failed);
    if (failed) return;
    if (fs::is_directory(status) && file.depth() >= kDeepest) file.disable_recursion_pending();
    if (!fs::is_regular_file(status) || !file->path().string().ends_with(".seal.json")) continue;
    if (file->file_size(failed) > kLargestSeal || failed) continue;
    if (!visit(file->path())) return;
  }
}

}  // namespace

std::optional<fs::path> find_sealed_plan(const fs::path& folder, const crypto::Sha256Digest& seal) {
  std::optional<fs::path> found;
  for_each_seal(folder, [&](const fs::path& file) {
    const std::optional<std::string> text = text_of_file(file);
    if (text && crypto::sha256(bytes_of(*text)) == seal) found = file;
    return !found;
  });
  return found;
}

std::vector<SealedPlanFile> sealed_plans(const fs::path& folder) {
  std::vector<SealedPlanFile> all;
  for_each_seal(folder, [&](const fs::path& file) {
    const std::optional<std::string> text = text_of_file(file);
    if (!text) return true;
    const auto seal = parse_foreign_json(*text);
    if (!seal.is_object()) return true;
    const auto name = seal.find("plan");
    all.push_back({file, crypto::sha256(bytes_of(*text)),
                   name != seal.end() && name->is_string() ? name->get<std::string>() : std::string()});
    return true;
  });
  std::ranges::sort(all, {}, &SealedPlanFile::file);
  return all;
}

}  // namespace kiroku::compare
