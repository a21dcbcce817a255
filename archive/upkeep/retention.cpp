#include "archive/upkeep/retention.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "archive/format/case_layout.h"
#include "archive/format/file_reading.h"
#include "archive/format/log_entry.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/age.h"
#include "archive/upkeep/holds.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/log_reading.h"
#include "base/error.h"
#include "crypto/hardware_key.h"
#include "crypto/hash.h"

namespace kiroku::archive {

namespace {

namespace fs = std::filesystem;

/// What the ledger says of one stream's segments.
struct Segments {
  std::map<std::uint64_t, FileReference> files;  // by index
  bool stream_known = false;
  std::vector<ErasedEntry> erased;
  bool closed = false;
  std::int64_t last_mono_ns = 0;
  OpenEntry opening;
  OpeningTime opened;

  void take(const CaseEntry& entry, const std::string& stream) {
    last_mono_ns = entry.at.mono_ns;
    opened.take(entry);
    if (const auto* open = std::get_if<OpenEntry>(&entry.body)) {
      opening = *open;
      stream_known = std::any_of(open->streams.begin(), open->streams.end(),
                                 [&](const StreamInfo& each) { return each.name == stream; });
    } else if (const auto* segment = std::get_if<SegmentEntry>(&entry.body)) {
      if (segment->stream == stream) {
        files[segment->index] = segment->file;
      }
    } else if (const auto* gone = std::get_if<ErasedEntry>(&entry.body)) {
      if (gone->stream == stream) {
        erased.push_back(*gone);
        files.erase(files.lower_bound(gone->first_index), files.upper_bound(gone->last_index));
      }
    } else if (std::holds_alternative<CloseEntry>(entry.body)) {
      closed = true;
    }
  }
};

/// What is left as runs of indexes.
std::vector<ErasedEntry> runs_of(const Segments& segments, const std::string& stream,
                                 const std::string& policy) {
  std::vector<ErasedEntry> runs;
  for (const auto& [index, file] : segments.files) {
    if (!runs.empty() && runs.back().last_index + 1 == index) {
      runs.back().last_index = index;
    } else {
      runs.push_back({stream, index, index, policy});
    }
  }
  return runs;
}

/// Why the file is not what was recorded; "" where it is. Throws kiroku::IoError where nobody can tell.
std::string why_not_as_recorded(const FileReading& files, const fs::path& folder,
                                const FileReference& stated) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  const std::optional<FileStatus> status = files.status(folder / stated.file);
  if (!status) {
    return stated.file + " is missing";
  }
  if (status->kind != FileStatus::Kind::kRegular) {
    return stated.file + " is no file";
  }
  const ReadableFile file = files.open_to_read(folder / stated.file);
  if (file.size() != stated.bytes) {
    return stated.file + " has " + std::to_string(file.size()) + " bytes, and its ledger says " +
           std::to_string(stated.bytes);
  }
  crypto::Sha256 hash;
  Bytes piece(kPiece);
  for (std::uint64_t offset = 0; offset < stated.bytes;) {
    const std::size_t count = file.read_at(offset, piece);
    if (count == 0) {
      return stated.file + " became shorter while it was read";
    }
    hash.update(ByteView(piece).first(count));
    offset += count;
  }
  return hash.finish() == stated.sha256 ? "" : stated.file + " has another hash than its ledger says";
}

struct StampedEnd {
  bool stamped = false;
  bool in_the_way = false;  // something lay under the name of a token
};

StampedEnd stamp_newest(CaseWriter& writer, const CheckpointStamper& stamper,
                        const std::function<Moment()>& now) {
  const StoredCheckpoint over = writer.checkpoint(now(), true);
  std::vector<CheckpointStamp> stamps = stamper ? stamper(over) : std::vector<CheckpointStamp>();
  if (stamps.empty()) {
    stamps.push_back({"none", {}, {}, {}, "no authority was at hand"});
  }
  StampedEnd end;
  for (const CheckpointStamp& stamp : stamps) {
    if (!stamp.cause.empty()) {
      writer.append({TokenMissedEntry{over.size, stamp.authority, stamp.cause}}, now());
    } else if (const auto missed = writer.token_in_the_way(over.size, stamp.authority)) {
      writer.append({*missed}, now());
      end.in_the_way = true;
    } else {
      writer.store_authority_chain(stamp.authority, stamp.chain);
      writer.add_token(over, stamp.authority, stamp.response, stamp.facts, now());
      end.stamped = true;
    }
  }
  return end;
}

}  // namespace

std::vector<fs::path> files_to_erase(const FileReading& files, const fs::path& folder,
                                     const std::vector<ErasedEntry>& erased) {
  std::set<std::string> streams;
  for (const ErasedEntry& each : erased) {
    streams.insert(each.stream);
  }
  std::vector<fs::path> found;
  for (const std::string& stream : streams) {
    const fs::path segments = folder / kSegmentsFolder / stream;
    if (!files.is_folder(segments)) {
      continue;
    }
    for (const std::string& name : files.names_in(segments)) {
      const std::optional<std::uint64_t> index = parse_index(name.substr(0, name.find('.')));
      const bool gone =
          index && std::any_of(erased.begin(), erased.end(), [&](const ErasedEntry& each) {
            return each.stream == stream && each.first_index <= *index && *index <= each.last_index;
          });
      const std::optional<FileStatus> status = gone ? files.status(segments / name) : std::nullopt;
      if (status && status->kind == FileStatus::Kind::kRegular) {
        found.push_back(segments / name);
      }
    }
  }
  return found;
}

void remove_erased(FileSystem& files, const std::vector<fs::path>& to_erase) {
  std::set<fs::path> folders;
  for (const fs::path& file : to_erase) {
    files.remove(file);
    folders.insert(file.parent_path());
  }
  for (const fs::path& folder : folders) {
    files.sync_folder(folder);
  }
}

std::string why_erasure_waits(const fs::path& log_folder, const std::string& case_id) {
  std::string why;
  // Without either a consent is the one under which the case was recorded.
  bool may_be_given_again = false;
  for_each_log_line(log_folder, [&](const LogLine& line) {
    const LogEntryParse parse =
        line.json.find(case_id) == std::string::npos ? LogEntryParse() : parse_log_entry(line.json);
    if (!parse.entry) {
      return;
    }
    const auto since = [&](const std::string& of, const char* what) {
      if (of == case_id) {
        why = "since it was signed, or before, " + std::string(what) + " (entry " + std::to_string(line.seq) +
              " of the appliance log), so that it may no longer have to go: `kiroku erase` decides";
      }
    };
    const LogEntryBody& body = parse.entry->body;
    if (const auto* given = std::get_if<ConsentGivenEntry>(&body)) {
      if (may_be_given_again) {
        since(given->case_id, "a consent was given again");
      }
    } else if (const auto* held = std::get_if<CaseHeldEntry>(&body)) {
      since(held->case_id, "a legal hold was stated");
    } else if (const auto* released = std::get_if<CaseReleasedEntry>(&body)) {
      since(released->case_id, "a legal hold was released");
    } else if (const auto* withdrawn = std::get_if<ConsentWithdrawnEntry>(&body)) {
      may_be_given_again = may_be_given_again || withdrawn->case_id == case_id;
    } else if (const auto* erased = std::get_if<CaseErasedEntry>(&body);
               erased != nullptr && erased->case_id == case_id) {
      may_be_given_again = true;
      why.clear();
    }
  });
  return why;
}

bool stamp_end(CaseWriter& writer, const CheckpointStamper& stamper, const std::function<Moment()>& now) {
  // A file that lies under a token's name costs that token. The next checkpoint has another name.
  constexpr int kMostTries = 3;
  for (int tries = 1;; ++tries) {
    const StampedEnd end = stamp_newest(writer, stamper, now);
    if (end.stamped || !end.in_the_way || tries == kMostTries) {
      return end.stamped;
    }
  }
}

// Step by step, each durable before the next:
//
//   erased in the ledger → checkpoint, also in the appliance log → erased in the appliance log → token
//   → last checkpoint → the files are removed, their folder flushed
//
Erasure erase_stream(FileSystem& files, const RetentionOptions& options, const fs::path& folder,
                     const std::string& stream, const std::string& policy) {
  if (policy.empty()) {
    throw UsageError("nothing is erased without a policy that says why: name it");
  }
  Segments segments;
  const auto writer = CaseWriter::resume(files, folder, *options.key, options.device_name, options.log,
                                         [&](const CaseEntry& entry) { segments.take(entry, stream); });
  if (!segments.stream_known) {
    throw UsageError("case " + writer->case_id() + " has no stream \"" + stream + "\"");
  }
  if (!segments.closed || writer->covered() < writer->size()) {
    throw UsageError("case " + writer->case_id() +
                     " was not brought to its end: nothing is erased from it before that; `kiroku recover` "
                     "does it");
  }
  // What is erased is claimed, too. Signed without the hardware it would make the whole case unproven for
  // good.
  if (writer->rests_on_hardware()) {
    const crypto::HardwareSigner* const hardware = options.key->hardware();
    const std::string silent =
        hardware == nullptr ? "no key in hardware was given to this program" : crypto::why_silent(*hardware);
    if (!silent.empty()) {
      throw Error("nothing was erased from case " + writer->case_id() +
                  ": the hardware that signs for this device does not answer (" + silent +
                  "), and without its signature the case would be unproven from then on; run `kiroku doctor` "
                  "as the user who erases, and erase again once the hardware signs");
    }
  }
  // What was changed or is missing is not covered by saying that it was erased. Before the turn, as it takes
  // as long as reading does.
  Erasure result;
  std::erase_if(segments.files, [&](const auto& each) {
    const std::string why = why_not_as_recorded(files, folder, each.second);
    if (!why.empty()) {
      result.not_as_recorded.push_back(why);
    }
    return !why.empty();
  });
  const ErasingTurn turn(folder.parent_path());
  // In the turn: what it goes by may be stated until then, such as a consent that is given again.
  if (options.may_go && !options.may_go(segments.opening, segments.opened.at())) {
    throw UsageError("case " + writer->case_id() +
                     " is not as it was when it was chosen, and may not go: nothing was erased; find out who "
                     "writes to the archive");
  }
  if (options.log != nullptr) {
    // Who removes the log removes its holds: what the device signs here must not say otherwise.
    if (segments.opening.appliance_log_size > 0 &&
        options.log->case_state(writer->case_id()) == ApplianceLog::CaseState::kUnknown) {
      throw UsageError("the appliance log does not know case " + writer->case_id() +
                       ", which was recorded beside one: nobody can tell whether it is under legal hold, and "
                       "nothing was erased from it; put the log back");
    }
    const std::string held =
        why_held(read_holds(options.log->folder(), {options.device_name, options.key->public_key()}),
                 writer->case_id());
    if (!held.empty()) {
      throw UsageError("nothing is erased from case " + writer->case_id() + ": " + held);
    }
  }
  // After close the case clock stands.
  const auto now = [&] { return Moment{options.now(), segments.last_mono_ns}; };
  const std::vector<fs::path> left = files_to_erase(files, folder, segments.erased);
  result.left_before = left.size();
  for (const auto& [index, file] : segments.files) {
    ++result.segments;
    result.bytes += file.bytes;
  }
  const std::vector<ErasedEntry> runs = runs_of(segments, stream, policy);
  const std::uint64_t entered = writer->size();
  try {
    if (!runs.empty()) {
      writer->append(std::vector<CaseEntryBody>(runs.begin(), runs.end()), now());
      writer->checkpoint(now(), true);
      if (options.log != nullptr) {
        options.log->erased(writer->case_id(), stream, policy);
      }
      result.stamped = stamp_end(*writer, options.stamp, now);
      writer->finish(now());
      segments.erased.insert(segments.erased.end(), runs.begin(), runs.end());
    } else if (!left.empty() && options.log != nullptr) {
      // Cut off before the log had it, perhaps.
      options.log->erased(writer->case_id(), stream, segments.erased.back().policy);
    }
    remove_erased(files, files_to_erase(files, folder, segments.erased));
  } catch (const Error& error) {
    if (writer->size() == entered && left.empty()) {
      throw;  // nothing was entered
    }
    throw ErasureCutOff("erasing " + stream + " was begun and cut off: " + error.what() +
                        "; its ledger says that it was erased, and files of it may still be there: `kiroku "
                        "recover` brings that to its end, or takes it back where it was not signed");
  }
  return result;
}

}  // namespace kiroku::archive
