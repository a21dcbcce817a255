#include <algorithm>
#include <functional>
#include <iostream>
#include <memory>
#include <set>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/kiroku/authorities.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/recording_setup.h"
#include "apps/kiroku/standing_consents.h"
#include "apps/kiroku/standing_holds.h"
#include "apps/kiroku/store.h"
#include "archive/format/case_layout.h"
#include "archive/reading/case_reader.h"
#include "archive/storage/file_system.h"
#include "archive/upkeep/age.h"
#include "archive/upkeep/holds.h"
#include "archive/upkeep/retention.h"
#include "archive/verify/excerpt_verifier.h"
#include "base/error.h"
#include "base/joined.h"
#include "base/number_text.h"
#include "base/printable.h"
#include "fleet/stored_copy.h"
#include "recorder/checkpoint_stamper.h"
#include "recorder/clock/clock_watch.h"
#include "recorder/session_request.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

struct Request {
  std::optional<std::string> case_name, older_than, home;
  std::string stream, policy;
  bool due = false, only_copy = false, clock_is_right = false, dry_run = false, json = false;
};

using MayGo = std::function<bool(const archive::OpenEntry&, UtcTime opened)>;

/// One stream of one case that may go.
struct Candidate {
  fs::path folder;
  std::string stream, policy;
  MayGo may_go;  // by its first entry and when it was opened
  bool by_age = false;
  /// Because of a withdrawn consent: then copies elsewhere are no reason to wait for, they are to go, too.
  bool by_consent = false;
  std::optional<UtcTime> opened = {}, due = {};  // of by_age
};

/// How old cases are: now, once and for all, against the latest that ledger, tokens and appliance log say of
/// when a case was opened.
class Ages {
 public:
  explicit Ages(const Home& home) : now_(utc_now()), log_(archive::read_log_times(home.log_folder(), now_)) {}

  [[nodiscard]] bool is_older(const std::string& case_id, UtcTime opened,
                              std::chrono::nanoseconds age) const {
    return now_ - opened_by_log(case_id, opened) > std::chrono::duration_cast<UtcTime::duration>(age);
  }
  /// `opened`, or what the appliance log had entered before it.
  [[nodiscard]] UtcTime opened_by_log(const std::string& case_id, UtcTime opened) const {
    const auto before = log_.before_case.find(case_id);
    return before != log_.before_case.end() ? std::max(opened, before->second) : opened;
  }
  /// Of one case. Its ledger is read again where it is old enough by its first entry, once.
  class OfCase {
   public:
    OfCase(const Ages& ages, const archive::CaseReader& reader) : ages_(ages), reader_(reader) {}
    [[nodiscard]] bool is_older(std::chrono::nanoseconds age) {
      const std::string& id = reader_.opening().case_id;
      if (!ages_.is_older(id, reader_.opened_at().utc, age)) return false;
      return ages_.is_older(id, read_opened(), age);
    }
    /// When it was opened, by the latest that says so.
    [[nodiscard]] UtcTime opened() { return ages_.opened_by_log(reader_.opening().case_id, read_opened()); }

   private:
    UtcTime read_opened() {
      if (!opened_) {
        opened_.emplace();
        reader_.for_each([&](const archive::CaseEntry& entry) { opened_->take(entry); });
      }
      return opened_->at();
    }

    const Ages& ages_;
    const archive::CaseReader& reader_;
    std::optional<archive::OpeningTime> opened_;
  };
  /// "" where the machine's clock is believed.
  [[nodiscard]] std::string why_doubted() const {
    return archive::why_clock_is_doubted(recorder::read_kernel_clock().synchronised, now_, log_);
  }

 private:
  UtcTime now_;
  archive::LogTimes log_;
};

MayGo if_older(const Ages& ages, std::chrono::nanoseconds age) {
  return [&ages, age](const archive::OpenEntry& open, UtcTime opened) {
    return ages.is_older(open.case_id, opened, age);
  };
}
MayGo if_due(const Ages& ages, const RetentionRule& rule, const std::string& stream) {
  return [&ages, rule, stream](const archive::OpenEntry& open, UtcTime opened) {
    return ages.is_older(open.case_id, opened, rule.after) &&
           std::ranges::any_of(open.streams,
                               [&](const auto& each) { return each.name == stream && rule.concerns(each); });
  };
}

/// What of a stream could still be erased.
struct LeftOfStream {
  bool segments = false;  // some are not erased yet
  bool files = false;     // of an erasure that was cut off
  [[nodiscard]] bool anything() const { return segments || files; }
};
LeftOfStream left_of(const archive::CaseReader& reader, const std::string& stream) {
  std::set<std::uint64_t> left;
  std::vector<archive::ErasedEntry> erased;
  for (const archive::SegmentEntry& segment : reader.segments(stream, INT64_MIN, INT64_MAX))
    left.insert(segment.index);
  reader.for_each([&](const archive::CaseEntry& entry) {
    const auto* gone = std::get_if<archive::ErasedEntry>(&entry.body);
    if (gone == nullptr || gone->stream != stream) return;
    left.erase(left.lower_bound(gone->first_index), left.upper_bound(gone->last_index));
    erased.push_back(*gone);
  });
  return {!left.empty(),
          !archive::files_to_erase(archive::real_file_system(), reader.folder(), erased).empty()};
}

/// Whether erasing would find anything. Throws kiroku::UsageError where it would refuse the case as it is.
bool would_erase(const Candidate& candidate) {
  const archive::CaseReader reader = archive::CaseReader::open(candidate.folder);
  const std::string name = candidate.folder.filename().string();
  if (!reader.closing()) {
    throw UsageError("case " + name + " was not brought to its end: nothing is erased from it before that");
  }
  if (std::ranges::none_of(reader.opening().streams,
                           [&](const auto& each) { return each.name == candidate.stream; })) {
    throw UsageError("case " + name + " has no stream " + printable(candidate.stream));
  }
  return left_of(reader, candidate.stream).anything();
}

/// Cases of which nothing could be erased, with the reason: one that is damaged must not keep what is due in
/// the others.
class Refusals {
 public:
  template <typename Work>
  void guard(const fs::path& folder, const Work& work) {
    try {
      work();
    } catch (const archive::ErasureCutOff& error) {
      all_.push_back({folder.filename().string(), "", error.what()});
    } catch (const Error& error) {
      add(folder, error.what());
    } catch (const fs::filesystem_error& error) {
      add(folder, error.what());
    }
  }
  void tell() const {
    for (const auto& [name, what, reason] : all_) print_error("kiroku", name + ": " + what + reason);
  }
  [[nodiscard]] bool empty() const { return all_.empty(); }
  [[nodiscard]] ordered_json json() const {
    ordered_json out = ordered_json::array();
    for (const auto& [name, what, reason] : all_) out.push_back({{"case", name}, {"reason", reason}});
    return out;
  }

 private:
  void add(const fs::path& folder, const std::string& reason) {
    all_.push_back({folder.filename().string(), "nothing was erased from it: ", reason});
  }
  struct Refusal {
    std::string name, what, reason;
  };
  std::vector<Refusal> all_;
};

void for_each_closed_case(const Home& home, Refusals& refusals,
                          const std::function<void(const archive::CaseReader&)>& visit) {
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(home.archive())) {
    if (archive::is_case_id(entry.path().filename().string()) && entry.is_directory() &&
        !archive::is_excerpt(entry.path()))
      folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  for (const fs::path& folder : folders) {
    refusals.guard(folder, [&] {
      const archive::CaseReader reader = archive::CaseReader::open(folder);
      if (reader.closing()) visit(reader);
    });
  }
}

/// Of a case, the withdrawn consent by which it is due, as a policy: "consent to … withdrawn (entry 12 of the
/// appliance log)". Nothing where none is: a withdrawal that nobody signed erases nothing.
std::optional<std::string> why_due_by_consent(const archive::Consents& consents, const std::string& case_id,
                                              const ConsentConfiguration& site) {
  for (const std::string& purpose : site.erase_when_withdrawn) {
    if (const auto entry = archive::signed_withdrawal(consents, case_id, purpose)) {
      return "consent to " + purpose + " withdrawn (entry " + std::to_string(*entry) +
             " of the appliance log)";
    }
  }
  return std::nullopt;
}

/// What [consent] erase_when_withdrawn says may go.
void add_due_by_consent(const Home& home, const ConsentConfiguration& site, Refusals& refusals,
                        std::vector<Candidate>& due) {
  if (site.erase_when_withdrawn.empty()) return;
  const archive::Consents consents = standing_consents(home);
  for_each_closed_case(home, refusals, [&](const archive::CaseReader& reader) {
    const std::string name = reader.folder().filename().string();
    const std::optional<std::string> policy = why_due_by_consent(consents, name, site);
    if (!policy) return;
    for (const archive::StreamInfo& stream : reader.opening().streams) {
      // Due by age, too: the consent decides, which waits for no copy.
      std::erase_if(due, [&](const Candidate& each) {
        return each.folder == reader.folder() && each.stream == stream.name;
      });
      if (!left_of(reader, stream.name).anything()) continue;
      // A consent may be given again between choosing and erasing, lawfully.
      const MayGo still = [&home, site, name, policy](const archive::OpenEntry&, UtcTime /*opened*/) {
        if (why_due_by_consent(standing_consents(home), name, site) == policy) return true;
        throw UsageError(
            "case " + name + " is no longer due by the " + *policy +
            ": consents to its use were entered since it was chosen, and nothing was erased; the "
            "next 'kiroku erase --due' goes by what stands then");
      };
      due.push_back({reader.folder(), stream.name, *policy, still, false, true});
    }
  });
}

UtcTime due_after(UtcTime opened, std::chrono::nanoseconds age) {
  return opened + std::chrono::duration_cast<UtcTime::duration>(age);
}

/// What [[retention]] says may go by now.
std::vector<Candidate> what_is_due(const Home& home, const std::vector<RetentionRule>& rules,
                                   const Ages& ages, Refusals& refusals) {
  std::vector<Candidate> due;
  for_each_closed_case(home, refusals, [&](const archive::CaseReader& reader) {
    Ages::OfCase of_case(ages, reader);
    for (const archive::StreamInfo& stream : reader.opening().streams) {
      const RetentionRule* const rule = rule_for(rules, stream);
      if (rule == nullptr || !of_case.is_older(rule->after) || !left_of(reader, stream.name).anything())
        continue;
      due.push_back({reader.folder(), stream.name, rule->policy, if_due(ages, *rule, stream.name), true});
      due.back().opened = of_case.opened();
      due.back().due = due_after(of_case.opened(), rule->after);
    }
  });
  return due;
}

/// The one case that was named, or every case of the home that is old enough and has the stream.
std::vector<Candidate> what_was_named(const Home& home, const Request& request, const Ages& ages,
                                      Refusals& refusals) {
  if (!request.case_name && !request.older_than) {
    throw UsageError("name the CASE to erase from, or say which with --older-than, such as 30d");
  }
  if (request.stream.empty()) throw UsageError("name the stream that may go with --stream");
  if (request.policy.empty()) throw UsageError("--policy is empty: say why the recording may go");
  require_printable(request.policy, "--policy");
  const auto age = request.older_than ? parse_age_to_erase(*request.older_than, "--older-than")
                                      : std::chrono::nanoseconds{};
  if (request.case_name) {
    const fs::path folder = find_case(home, *request.case_name);
    if (!home.holds(folder)) {
      throw UsageError(folder.string() +
                       " is not in this home's archive: only the recorder that recorded a "
                       "case can state that something was erased from it");
    }
    Candidate candidate{fs::canonical(folder), request.stream, request.policy,
                        request.older_than ? if_older(ages, age) : MayGo{}, request.older_than.has_value()};
    if (request.older_than) {
      const archive::CaseReader reader = archive::CaseReader::open(folder);
      Ages::OfCase of_case(ages, reader);
      if (!of_case.is_older(age)) {
        throw UsageError("case " + folder.filename().string() + " is not older than " + *request.older_than +
                         ": nothing was erased");
      }
      candidate.opened = of_case.opened();
      candidate.due = due_after(of_case.opened(), age);
    }
    return {candidate};
  }
  std::vector<Candidate> named;
  for_each_closed_case(home, refusals, [&](const archive::CaseReader& reader) {
    const auto& streams = reader.opening().streams;
    const bool has_stream = std::any_of(streams.begin(), streams.end(),
                                        [&](const auto& stream) { return stream.name == request.stream; });
    Ages::OfCase of_case(ages, reader);
    if (!has_stream || !of_case.is_older(age)) return;
    named.push_back({reader.folder(), request.stream, request.policy, if_older(ages, age), true});
    named.back().opened = of_case.opened();
    named.back().due = due_after(of_case.opened(), age);
  });
  return named;
}

/// Erases from the home's cases, one after the other, and tells of each.
class Eraser {
 public:
  Eraser(const Home& home, const Configuration& configuration)
      : writable_(home), authorities_(home, configuration, {}) {
    options_.key = &writable_.key;
    options_.device_name = home.device().name();
    options_.log = writable_.log.get();
    options_.stamp =
        recorder::checkpoint_stamper(authorities_.named(), &writable_.trust, writable_.queue.get());
  }

  /// Why an outside authority makes this machine's clock doubtful; "" where the first that answers agrees,
  /// and where none does.
  [[nodiscard]] std::string why_clock_differs() const {
    constexpr std::chrono::hours kFarOff{1};
    for (const recorder::NamedAuthority& authority : authorities_.named()) {
      try {
        const timestamp::TokenJudgement said = ask_for_time(authority, writable_.trust);
        if (said.code != timestamp::TokenCode::kValid || said.authority == timestamp::TimeAuthority::kOwn)
          continue;
        const UtcTime now = utc_now();
        if (std::chrono::abs(said.info->gen_time - now) <= kFarOff) return "";
        return "this machine's clock shows " + format_utc(now) + ", and the authority " + authority.name +
               " says that it is " + format_utc(said.info->gen_time);
      } catch (const Error&) {  // it does not answer
      }
    }
    return "";
  }

  archive::Erasure erase(const Candidate& candidate) {
    options_.may_go = candidate.may_go;
    const archive::Erasure erased = archive::erase_stream(
        archive::real_file_system(), options_, candidate.folder, candidate.stream, candidate.policy);
    refresh_catalogue(writable_.home, candidate.folder);
    return erased;
  }

 private:
  WritableHome writable_;
  Authorities authorities_;
  archive::RetentionOptions options_;
};

/// Copies of the home's cases elsewhere: in replicas, and in the store.
class Copies {
 public:
  Copies(const Home& home, const Configuration& configuration) : replicas_(configuration.retention.replicas) {
    if (!configuration.store) return;
    const StoreConfiguration of = store_of(home);
    appliance_ = of.appliance;
    store_.emplace(open_store(home, of));
    list_.emplace(shipping_list_file(home, of));
  }

  /// Nothing if one of them holds all of the stream that the case still has; else why none does, a sentence.
  std::optional<std::string> why_none_holds(const Candidate& candidate) {
    if (!store_) return why_not_replicated(candidate.folder, candidate.stream, replicas_);
    std::optional<std::string> why;
    try {
      why = fleet::why_not_stored(*store_, *list_, appliance_, candidate.folder, candidate.stream, utc_now());
    } catch (const fleet::StoreError& error) {
      why = error.what();
    }
    if (!why || replicas_.empty()) return why;
    const auto not_replicated = why_not_replicated(candidate.folder, candidate.stream, replicas_);
    return not_replicated ? *why + "; " + *not_replicated : not_replicated;
  }

 private:
  const std::vector<fs::path>& replicas_;
  std::string appliance_;
  std::optional<fleet::ObjectStore> store_;
  std::optional<fleet::ShippingList> list_;
};

/// The stream whose pictures this one archives a second time; "": it has its own.
std::string first_of(const archive::StreamInfo& stream) {
  const std::size_t at = stream.source.find(recorder::kPicturesOfStream);
  if (at == std::string::npos) return "";
  const std::string name = stream.source.substr(at + recorder::kPicturesOfStream.size());
  return name.substr(0, name.find(';'));
}

/// Streams of the case that hold the same pictures in another form, and are not all erased.
std::vector<std::string> other_forms_of(const Candidate& candidate) {
  if (candidate.by_consent) return {};  // they go, too
  const archive::CaseReader reader = archive::CaseReader::open(candidate.folder);
  const std::string& stream = candidate.stream;
  const auto& streams = reader.opening().streams;
  const auto asked = std::ranges::find(streams, stream, &archive::StreamInfo::name);
  if (asked == streams.end()) return {};
  const std::string first = first_of(*asked).empty() ? stream : first_of(*asked);
  std::vector<std::string> others;
  for (const archive::StreamInfo& each : streams) {
    const bool is_same = each.name == first || first_of(each) == first;
    if (is_same && each.name != stream && left_of(reader, each.name).anything()) others.push_back(each.name);
  }
  return others;
}

std::string told_of(const std::vector<std::string>& other_forms) {
  return other_forms.empty()
             ? ""
             : "; the same pictures are left in another form: " + printable(joined(other_forms));
}

std::string told(const Candidate& candidate, const archive::Erasure& erased) {
  const bool is_rest = erased.segments == 0 && erased.left_before > 0;
  const std::string what = is_rest ? "removed " + counted(erased.left_before, "file", "files") + " of " +
                                         candidate.stream + " that an erasure had left which was cut off"
                           : erased.segments == 0
                               ? "nothing of " + candidate.stream + " was " +
                                     (erased.not_as_recorded.empty() ? "left to erase" : "erased")
                               : "erased " + std::to_string(erased.segments) + " segments of " +
                                     candidate.stream + " (" + format_bytes(erased.bytes) + ")";
  return what + (erased.segments > 0 && !erased.stamped ? "; no authority time-stamped it" : "");
}

int run(const Request& request) {
  if (request.due && (request.case_name || request.older_than || !request.stream.empty() ||
                      !request.policy.empty() || request.only_copy)) {
    throw UsageError(
        "--due goes by [[retention]] of kiroku.toml alone: leave out what else says what may go");
  }
  const Home home = Home::open(request.home);
  const Configuration configuration = home.configuration();
  if (request.due) require_clear(configuration.retention, home.configuration_file().string());
  Refusals refusals;
  const Ages ages(home);
  std::vector<Candidate> candidates = request.due
                                          ? what_is_due(home, configuration.retention.rules, ages, refusals)
                                          : what_was_named(home, request, ages, refusals);
  if (request.due) add_due_by_consent(home, consent_configuration(home), refusals, candidates);
  std::optional<Eraser> eraser;
  std::optional<Copies> copies;
  archive::Holds holds;
  if (!candidates.empty()) {
    holds = standing_holds(home);
    if (!request.dry_run) eraser.emplace(home, configuration);
  }
  // Erasing cannot be undone: what goes by age waits for a clock that shows it.
  std::string doubted = request.clock_is_right ? "" : ages.why_doubted();
  const bool is_by_age = std::ranges::any_of(candidates, &Candidate::by_age);
  if (!request.clock_is_right && doubted.empty() && is_by_age && eraser)
    doubted = eraser->why_clock_differs();
  // Not before they are asked for: a store that does not answer keeps nothing back that waits for no copy.
  const auto why_none_holds = [&](const Candidate& candidate) {
    if (!copies) copies.emplace(home, configuration);
    return copies->why_none_holds(candidate);
  };
  ordered_json cases = ordered_json::array(), kept = ordered_json::array();
  const auto keep = [&](const Candidate& candidate, const std::string& reason, const std::string& sentence) {
    const std::string name = candidate.folder.filename().string();
    kept.push_back({{"case", name}, {"stream", candidate.stream}, {"reason", reason}});
    if (!request.json) print_error("kiroku", name + ": " + candidate.stream + " is kept" + sentence);
  };
  const auto take = [&](const Candidate& candidate) {
    const std::string name = candidate.folder.filename().string();
    if (const std::string held = archive::why_held(holds, name); !held.empty())
      return keep(
          candidate, held,
          ": " + held +
              (candidate.by_consent ? "; the legal hold wins over what is due otherwise: " + candidate.policy
                                    : ""));
    if (candidate.by_age && !doubted.empty())
      return keep(candidate, doubted,
                  ": " + doubted +
                      "; have the clock synchronised ('kiroku doctor' says whether it is), or compare 'date "
                      "-u' with another clock and give --clock-is-right");
    // Of what the ledger calls erased already no copy is asked for: an erasure that was cut off ends as it
    // began.
    const bool may_go = request.only_copy || candidate.by_consent ||
                        !left_of(archive::CaseReader::open(candidate.folder), candidate.stream).segments;
    const auto only_copy = may_go ? std::nullopt : why_none_holds(candidate);
    if (only_copy) {
      return keep(candidate, *only_copy,
                  ", for nothing else holds it (" + *only_copy + ")" +
                      (request.due ? "" : "; --only-copy erases it all the same"));
    }
    if (request.dry_run) {
      const bool left = would_erase(candidate);
      const auto others = other_forms_of(candidate);
      if (left) {
        cases.push_back({{"case", name}, {"stream", candidate.stream}, {"policy", candidate.policy}});
        if (candidate.opened) cases.back()["opened"] = format_utc(*candidate.opened);
        if (candidate.due) cases.back()["due"] = format_utc(*candidate.due);
        if (!others.empty()) cases.back()["also_in"] = others;
      }
      if (!request.json)
        std::cout << name
                  << (left ? ": would erase " + candidate.stream + ", by the policy: " + candidate.policy
                           : ": nothing of " + candidate.stream + " is left to erase")
                  << (left && candidate.due ? "; opened " + format_utc_for_people(*candidate.opened) +
                                                  ", it may go since " + format_utc_for_people(*candidate.due)
                                            : "")
                  << told_of(others) << "\n";
      return;
    }
    const archive::Erasure erased = eraser->erase(candidate);
    cases.push_back({{"case", name},
                     {"stream", candidate.stream},
                     {"segments", erased.segments},
                     {"bytes", erased.bytes},
                     {"stamped", erased.stamped},
                     {"policy", candidate.policy}});
    if (erased.left_before > 0) cases.back()["left_before"] = erased.left_before;
    const auto others = other_forms_of(candidate);
    if (!others.empty()) cases.back()["also_in"] = others;
    if (!request.json)
      std::cout << name << ": " << told(candidate, erased)
                << (candidate.by_consent ? ", by the policy: " + candidate.policy : "") << told_of(others)
                << "\n";
    if (!erased.not_as_recorded.empty()) {
      const std::size_t count = erased.not_as_recorded.size();
      keep(candidate, erased.not_as_recorded.front(),
           " in " + std::to_string(count) + (count == 1 ? " file that is" : " files that are") +
               " not as recorded: " + erased.not_as_recorded.front() + (count == 1 ? "" : "; and others") +
               "; saying that it was erased would hide that, so it is left for whoever examines the case");
    }
  };
  for (const Candidate& candidate : candidates) {
    if (request.case_name) {
      take(candidate);
    } else {
      refusals.guard(candidate.folder, [&] { take(candidate); });
    }
  }
  if (request.json) {
    ordered_json told{{"cases", cases}, {"kept", kept}, {"refused", refusals.json()}};
    if (request.dry_run) told["dry_run"] = true;
    print_json(told);
  } else if (candidates.empty() && refusals.empty()) {
    std::cout << (request.due ? "Nothing is due to be erased."
                              : "No closed case with a stream " + printable(request.stream) +
                                    " is older than " + *request.older_than + ".")
              << "\n";
  }
  refusals.tell();
  if (!refusals.empty()) return kRefused;
  return kept.empty() ? kDone : kAnswerIsNo;
}

}  // namespace

void add_erase_command(Command& program) {
  Command& command =
      program.add_command("erase", "erases one stream of closed cases and keeps the proof of the rest");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->case_name, "a case of this home; all that are old enough if absent");
  command.option("--stream", "S", request->stream, "the stream whose pictures or samples go");
  command.option("--policy", "TEXT", request->policy,
                 "why they may go; stands in the case and in the appliance log for good");
  command.option("--older-than", "T", request->older_than,
                 "only what was opened longer ago: 30d, or 12h, 90min");
  command.flag("--due", request->due,
               "what [[retention]] of kiroku.toml says may go by now, instead of naming it");
  command.flag("--only-copy", request->only_copy, "also what nothing else holds");
  command.flag(
      "--clock-is-right", request->clock_is_right,
      "somebody compared this machine's clock with another: erase by age though the kernel does not "
      "call it synchronised, it is far ahead of the appliance log, or an outside authority says otherwise");
  command.flag("--dry-run", request->dry_run,
               "only tells what would go and what would be kept; asks no authority for the time");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "Bytes go, hashes stay: 'kiroku verify' goes on proving everything else and says how many segments "
      "were "
      "erased by which policy. That they are erased is signed and time-stamped before the first byte goes. "
      "There is no way back. A case that is not closed is refused. What neither a replica of [storage] in "
      "kiroku.toml holds, byte for byte, nor the store of [store], confirmed and locked, is kept, and the "
      "exit status is 1, unless --only-copy is given. What is under legal hold ('kiroku hold') is kept, too, "
      "whatever is given. How old a case is counts from the latest moment that its entries, its time-stamps "
      "and what the appliance log had entered before it say that it was opened. What would go by its age is "
      "kept while the kernel does not call this machine's clock synchronised, it shows more than a year "
      "after "
      "the newest entry of the appliance log, or it is more than an hour away from what an outside authority "
      "says, unless --clock-is-right is given. What is not as it was recorded is not called erased, and "
      "kept. "
      "With --due a case goes, too, of which a consent was withdrawn that [consent] "
      "erase_when_withdrawn of kiroku.toml names: all its streams, whether copies are elsewhere or not. "
      "Of several rules of [[retention]] for one stream the one holds that keeps it longest. A stream that "
      "archives the same pictures in another form ('also') is a stream of its own: it is named where it is "
      "left. "
      "Where several "
      "cases "
      "are asked for, one that cannot be read or written keeps the others from nothing: it is named, and the "
      "exit status is 2.");
  command.example("kiroku erase 20260805T091502Z-3f9c21ab --stream room --policy 'consent withdrawn'",
                  "erases the room camera of one case");
  command.example("kiroku erase --older-than 30d --stream room --policy 'room: 30 days'",
                  "erases the room camera of every case that is older than thirty days");
  command.example("kiroku erase --due --dry-run", "tells what the next line would erase, and erases nothing");
  command.example("kiroku erase --due", "erases what kiroku.toml says may go, as the daily timer does");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
