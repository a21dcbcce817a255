#include "archive/verify/carried_on.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>

#include "archive/format/case_folder.h"
#include "archive/format/case_layout.h"
#include "archive/format/line_reader.h"
#include "archive/verify/case_against_log.h"
#include "archive/verify/checkpoint_rules.h"
#include "archive/verify/finding_list.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEvents = "events";
constexpr std::string_view kCarriesOn = "operator; carries on case ";
constexpr std::string_view kEntries = " entries, root ";
constexpr std::string_view kAnnounces = "recovered; to be carried on as case ";

/// What stands before `mark`, which is taken off `text` with it; nothing if it is not there.
std::optional<std::string_view> take_until(std::string_view& text, std::string_view mark) {
  const std::size_t at = text.find(mark);
  if (at == std::string_view::npos) {
    return std::nullopt;
  }
  const std::string_view before = text.substr(0, at);
  text.remove_prefix(at + mark.size());
  return before;
}

std::optional<std::uint64_t> number_of(std::string_view text) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

/// What of another ledger matters here.
struct Neighbour {
  std::optional<OpenEntry> open;
  std::string close_reason;                  // within the entries that were read
  std::uint64_t entries = 0;                 // that were read
  std::optional<crypto::Sha256Digest> root;  // over the first `asked` entries
};

/// The first `asked` entries of a ledger; nothing where no case lies there. Throws kiroku::Error where it
/// cannot be read.
std::optional<Neighbour> read_neighbour(const FileReading& files, const fs::path& folder,
                                        std::uint64_t asked) {
  if (!files.is_folder(folder)) {
    return std::nullopt;
  }
  const FileOpening ledger = CaseFolder::open(folder, files).open_file(kLedgerFile);
  if (!ledger.file && ledger.problem == FileProblem::kUnreadable) {
    throw Error((folder / kLedgerFile).string() + " " + ledger.explanation + "; check the disk");
  }
  if (!ledger.file) {
    return std::nullopt;
  }
  Neighbour found;
  crypto::MerkleFrontier tree;
  LineReader reader(*ledger.file);
  LedgerLine line;
  while (tree.size() < asked && reader.next(line) && !line.torn && !line.too_long) {
    tree.append(crypto::merkle_leaf_hash(bytes_of(line.text)));
    const bool is_first = tree.size() == 1;
    if (!is_first && line.text.find(R"("close")") == std::string_view::npos) {
      continue;
    }
    EntryParse parse = parse_case_entry(line.text);
    if (auto* open = parse.entry ? std::get_if<OpenEntry>(&parse.entry->body) : nullptr) {
      found.open = std::move(*open);
    } else if (const auto* close = parse.entry ? std::get_if<CloseEntry>(&parse.entry->body) : nullptr) {
      found.close_reason = close->reason;
    }
  }
  found.entries = tree.size();
  if (tree.size() == asked) {
    found.root = tree.root();
  } else if (!line.too_long) {
    ledger.file->require_read_to_end(line.offset + line.bytes);
  }
  return found;
}

/// The same for a verification, to which a ledger that cannot be read is one that does not lie there.
std::optional<Neighbour> readable_neighbour(const fs::path& folder, std::uint64_t asked) {
  try {
    return read_neighbour(real_reading(), folder, asked);
  } catch (const Error&) {
    return std::nullopt;
  }
}

fs::path beside(const CaseFolder& folder, const std::string& case_id) {
  return fs::absolute(folder.path()).lexically_normal().parent_path() / case_id;
}

Place in_ledger(std::optional<std::uint64_t> entry = std::nullopt) {
  return {std::string(kLedgerFile), entry};
}

/// Whether the device that `open` names signed what lies in `folder` as its case `case_id`, of at least
/// `least` entries: the smallest such note is asked.
bool is_signed_there(const fs::path& folder, const std::string& case_id, std::uint64_t least,
                     const OpenEntry& open, const std::vector<crypto::VerifierKey>& devices) {
  try {
    const crypto::VerifierKey device = known_device(crypto::VerifierKey::parse(open.device), devices);
    const std::vector<std::uint64_t> sizes = note_sizes(CaseFolder::open(folder).list());
    const auto size = std::ranges::lower_bound(sizes, least);
    if (size == sizes.end()) {
      return false;
    }
    const auto found = read_neighbour(real_reading(), folder, *size);
    return found && found->root &&
           is_signed(folder, {case_origin(device.name(), case_id), *size, *found->root}, device);
  } catch (const Error&) {
    return false;
  }
}

void check_earlier(const CaseFolder& folder, const OpenEntry& open, const CarriedOn& earlier,
                   const std::vector<crypto::VerifierKey>& devices, FindingList& findings) {
  const std::string stated = "the case carries on case " + earlier.case_id;
  const fs::path its = beside(folder, earlier.case_id);
  const auto found = readable_neighbour(its, earlier.size);
  if (!found) {
    findings.add("carried-on-not-here", in_ledger(0),
                 stated + ", which does not lie beside it: they were not compared");
  } else if (!found->root) {
    findings.add("carried-on-not-compared", in_ledger(0),
                 stated + " after " + std::to_string(earlier.size) +
                     " entries, and what lies beside it has " + std::to_string(found->entries) +
                     ": the end of that one was removed, or it is a copy from before");
  } else if (*found->root != earlier.root &&
             !is_signed_there(its, earlier.case_id, earlier.size, open, devices)) {
    findings.add("carried-on-not-compared", in_ledger(0),
                 stated + ", and of what lies beside it the first " + std::to_string(earlier.size) +
                     " entries are others, which the device did not sign: anybody can have put them there");
  } else if (*found->root != earlier.root) {
    findings.add("carrying-on-broken", in_ledger(0),
                 stated + ", whose first " + std::to_string(earlier.size) +
                     " entries are not those of the one beside it");
  } else if (announced_by(found->close_reason) != open.case_id) {
    findings.add("carrying-on-broken", in_ledger(0), stated + ", which does not announce it");
  } else if (!found->open || found->open->case_id != earlier.case_id || found->open->device != open.device) {
    findings.add("carrying-on-broken", in_ledger(0),
                 stated + ", and the one beside it names another case or another device");
  } else {
    findings.add("carrying-on-holds", in_ledger(0), stated + ", which lies beside it and announces it");
  }
}

void check_later(const CaseFolder& folder, const OpenEntry& open, const std::string& later,
                 const std::vector<crypto::VerifierKey>& devices, FindingList& findings) {
  const std::string stated = "the case was to be carried on as case " + later;
  const fs::path its = beside(folder, later);
  const auto found = readable_neighbour(its, 1);
  if (!found) {
    findings.add("carried-on-not-here", in_ledger(),
                 stated + ", which does not lie beside it: it was not compared, or was never begun");
    return;
  }
  const auto broken = [&](const std::string& why) {
    if (is_signed_there(its, later, 1, open, devices)) {
      findings.add("carrying-on-broken", in_ledger(), stated + why);
    } else {
      findings.add("carried-on-not-compared", in_ledger(),
                   stated + why +
                       "; but this one's device did not sign what lies there: anybody can have put it there");
    }
  };
  const auto earlier = found->open ? carried_on_by(*found->open) : std::nullopt;
  if (!earlier || earlier->case_id != open.case_id || found->open->case_id != later) {
    broken(", and the one beside it does not say that it carries this one on");
    return;
  }
  if (found->open->device != open.device) {
    broken(", and the one beside it names another device than this one");
    return;
  }
  const auto here = readable_neighbour(folder.path(), earlier->size);
  if (here && !here->root && here->entries < earlier->size) {
    broken(", which names " + std::to_string(earlier->size) +
           " entries of this one, more than there are here (" + std::to_string(here->entries) +
           "): the end of this one was removed, or it is a copy from before");
    return;
  }
  if (!here || here->root != earlier->root) {
    broken(", which names other first " + std::to_string(earlier->size) + " entries than there are here");
    return;
  }
  // Whoever has the lines of this one can write a first line that names it.
  if (!is_signed_there(its, later, 1, open, devices)) {
    findings.add("carried-on-not-compared", in_ledger(),
                 stated +
                     ", and what lies beside it names this one; but this one's device did not sign what lies "
                     "there, or not yet: anybody can have put it there");
    return;
  }
  findings.add("carrying-on-holds", in_ledger(), stated + ", which lies beside it and names it");
}

}  // namespace

bool is_events(const StreamInfo& stream) { return stream.kind == kEvents && stream.name == kEvents; }

std::string source_carrying_on(const CarriedOn& earlier) {
  return std::string(kCarriesOn) + earlier.case_id + ", " + std::to_string(earlier.size) +
         std::string(kEntries) + crypto::to_hex(earlier.root);
}

std::optional<CarriedOn> carried_on_by(const OpenEntry& open) {
  const auto events = std::find_if(open.streams.begin(), open.streams.end(), is_events);
  if (events == open.streams.end() || !events->source.starts_with(kCarriesOn)) {
    return std::nullopt;
  }
  std::string_view rest = std::string_view(events->source).substr(kCarriesOn.size());
  const auto id = take_until(rest, ", ");
  const auto entries = take_until(rest, kEntries);
  const auto size = entries ? number_of(*entries) : std::nullopt;
  const auto root = crypto::from_hex(rest);
  CarriedOn earlier;
  if (!id || !is_case_id(*id) || !size || *size == 0 || !root || root->size() != earlier.root.size()) {
    return std::nullopt;
  }
  earlier.case_id = *id;
  earlier.size = *size;
  std::copy(root->begin(), root->end(), earlier.root.begin());
  return earlier;
}

std::string reason_to_be_carried_on(const std::string& later_case) {
  return std::string(kAnnounces) + later_case;
}

std::optional<std::string> announced_by(const std::string& close_reason) {
  if (!close_reason.starts_with(kAnnounces)) {
    return std::nullopt;
  }
  std::string id = close_reason.substr(kAnnounces.size());
  return is_case_id(id) ? std::optional(std::move(id)) : std::nullopt;
}

Announced announced_by_earlier(const fs::path& folder, const OpenEntry& open,
                               const crypto::VerifierKey& device, const FileReading& files) {
  const auto earlier = carried_on_by(open);
  if (!earlier) {
    return Announced::kNo;
  }
  const fs::path its = fs::absolute(folder).lexically_normal().parent_path() / earlier->case_id;
  const auto found = read_neighbour(files, its, earlier->size);
  const auto hash_of = [](const OpenEntry& of) {
    return of.subject ? std::optional(of.subject->sha256) : std::nullopt;
  };
  const bool is_announced =
      found && found->open && found->root == earlier->root &&
      announced_by(found->close_reason) == open.case_id && found->open->plan == open.plan &&
      is_signed(its, {case_origin(device.name(), earlier->case_id), earlier->size, earlier->root}, device,
                files);
  if (!is_announced) {
    return Announced::kNo;
  }
  return hash_of(*found->open) == hash_of(open) ? Announced::kYes : Announced::kWithOtherSubject;
}

void check_carrying_on(const CaseFolder& folder, const OpenEntry& open, const std::string& close_reason,
                       const std::vector<crypto::VerifierKey>& devices, FindingList& findings) {
  if (const auto earlier = carried_on_by(open)) {
    check_earlier(folder, open, *earlier, devices, findings);
  }
  if (const auto later = announced_by(close_reason)) {
    check_later(folder, open, *later, devices, findings);
  }
}

}  // namespace kiroku::archive
