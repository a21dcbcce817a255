#include "light/ledger_follower.h"

#include <algorithm>
#include <variant>
#include <vector>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/ledger_tail.h"
#include "archive/format/limits.h"
#include "base/error.h"
#include "light/ledger_lights.h"
#include "light/light_code.h"

namespace kiroku::light {

LedgerFollower::LedgerFollower(std::filesystem::path case_folder) : folder_(std::move(case_folder)) {
  read_on();
}

void LedgerFollower::read_on() {
  if (is_over_) return;
  const std::string name = (folder_ / archive::kLedgerFile).string();
  const auto folder = archive::CaseFolder::open(folder_);
  const archive::FileOpening opening = folder.open_file(archive::kLedgerFile);
  if (!opening.file)
    throw Error("cannot follow " + name + ": it " +
                (opening.problem == archive::FileProblem::kMissing ? "is not there; give the folder of a case"
                                                                   : opening.explanation));
  if (opening.file->size() < read_) {
    is_over_ = true;
    return;
  }
  std::vector<std::byte> buffer(2 * archive::kMaximumLineBytes);
  while (!is_over_) {
    const std::size_t got = opening.file->read_at(read_, buffer);
    const std::string_view text = text_of(std::span(buffer).first(got));
    std::size_t at = 0;
    for (std::size_t end = text.find('\n'); end != std::string_view::npos && !is_over_;
         end = text.find('\n', at)) {
      const std::string_view line = text.substr(at, end - at);
      const archive::EntryParse parse = archive::parse_case_entry(line);
      if (!parse.entry)
        throw Error("cannot follow " + name + ": entry " + std::to_string(tree_.size()) +
                    " cannot be read: " + parse.problem);
      if (const auto* open = std::get_if<archive::OpenEntry>(&parse.entry->body)) case_id_ = open->case_id;
      is_over_ = std::holds_alternative<archive::CloseEntry>(parse.entry->body);
      newest_us_ = parse.entry->at.utc.time_since_epoch().count();
      tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
      at = end + 1;
    }
    read_ += at;
    if (at == 0) {
      if (got > archive::kMaximumLineBytes)
        throw Error("cannot follow " + name + ": entry " + std::to_string(tree_.size()) + " is too long");
      return;  // the rest is being written
    }
  }
}

std::optional<ShownLight> LedgerFollower::light_at(std::int64_t second) const {
  if (is_over_ || tree_.size() == 0) return std::nullopt;
  if (second - newest_us_ / 1'000'000 > LedgerLights::kLongestSilence) return std::nullopt;
  return ShownLight{light_code(tree_.size(), tree_.root(), second), second, tree_.size(), case_id_};
}

std::optional<ShownLight> ArchiveFollower::light_at(std::int64_t second) {
  try {
    problem_.clear();
    if (case_) case_->read_on();
    if (!case_ || case_->is_over()) {
      case_.reset();
      std::vector<std::string> names = archive::real_reading().names_in(archive_);
      std::erase_if(names, [](const std::string& name) { return !archive::is_case_id(name); });
      // Identifiers begin with the time; of many rooms only the newest few can be at work.
      constexpr std::size_t kLookedAt = 16;
      const std::size_t first = names.size() > kLookedAt ? names.size() - kLookedAt : 0;
      for (std::size_t i = names.size(); i > first; --i) {
        const std::filesystem::path folder = archive_ / names[i - 1];
        const auto tail = archive::read_ledger_tail(folder);
        if (!tail || tail->closed) continue;
        auto found = std::make_unique<LedgerFollower>(folder);
        if (!found->light_at(second)) continue;
        case_ = std::move(found);
        break;
      }
    }
    if (case_) return case_->light_at(second);
  } catch (const Error& error) {
    problem_ = error.what();
    case_.reset();
  }
  return std::nullopt;
}

}  // namespace kiroku::light
