#include "recorder/procedure/worklist_box.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <netdb.h>
#include <netinet/in.h>
#include <string_view>
#include <sys/resource.h>
#include <unistd.h>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/foreign_json.h"
#include "base/printable.h"
#include "crypto/utf8.h"
#include "media/box/child.h"
#include "media/box/sandbox.h"
#include "recorder/vitals/hl7_charset.h"

namespace kiroku::recorder {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

enum class ToBox : std::uint32_t { kAsk = 1 };
enum class FromBox : std::uint32_t {
  kClosed = 1,  // the box is: the question begins
  kAnswered,    // JSON: "items", "not_asked_for", "is_cut", "problem"
};

constexpr std::size_t kSharedBytes = 4096;
constexpr milliseconds kStep{100};
/// A process is started and its libraries loaded meanwhile, also on a machine that is busy.
constexpr std::chrono::seconds kStarting{30};
/// In all: to connect, for the association, and for the answers, each of which may take options.timeout.
constexpr std::chrono::seconds kLeastPatience{60};
constexpr int kTimeoutsInAll = 6;
constexpr std::chrono::hours kNoLimit{1000};
constexpr std::size_t kLongestText = 4096, kLongestProblem = 500, kMostStaff = 32, kMostAddresses = 8;
constexpr std::size_t kLongestRequest = 64U << 10, kLongestAnswer = 4U << 20;
/// Of one step as JSON, so that as many as are kept fit into an answer: a step that says more costs itself
/// alone.
constexpr std::size_t kLongestItem = 8U << 10;
static_assert(kMostWorklistItems * kLongestItem + kLongestItem <= kLongestAnswer);
constexpr unsigned kProcessorSeconds = 60;
/// Answers take some MiB; addresses, more.
constexpr rlim_t kMostMemory = rlim_t{1} << 30;

constexpr const char* kNoAnswer = "did not answer: the program that reads its answers says what is none";

WorklistAnswer failure(const std::string& problem) {
  WorklistAnswer answer;
  answer.problem = problem;
  return answer;
}

std::string name_of(const WorklistOptions& options) {
  return "the worklist " + options.called_ae + " at " + options.host + ":" + std::to_string(options.port);
}

// Each member under its name, so that writing and reading agree.
template <typename Visit>
void for_each_text(const Visit& visit) {
  visit("patient_id", &ProcedureData::patient_id);
  visit("patient_id_issuer", &ProcedureData::patient_id_issuer);
  visit("birth_date", &ProcedureData::birth_date);
  visit("sex", &ProcedureData::sex);
  visit("visit", &ProcedureData::visit);
  visit("description", &ProcedureData::description);
  visit("code", &ProcedureData::code);
  visit("coding_system", &ProcedureData::coding_system);
  visit("procedure_id", &ProcedureData::procedure_id);
  visit("accession", &ProcedureData::accession);
  visit("study_uid", &ProcedureData::study_uid);
  visit("planned", &ProcedureData::planned);
  visit("location", &ProcedureData::location);
}

/// What is no UTF-8 in it becomes U+FFFD.
std::string text_of_json(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

json json_of(const PersonName& name) { return {name.family, name.given, name.as_sent}; }

json json_of(const WorklistItem& item) {
  json out{{"patient", json_of(item.data.patient)}, {"staff", json::array()}, {"at", nullptr}};
  if (item.planned) out["at"] = item.planned->time_since_epoch().count();
  if (item.within) out["from"] = item.within->earliest.time_since_epoch().count();
  if (item.within) out["to"] = item.within->latest.time_since_epoch().count();
  for_each_text([&](const char* name, std::string ProcedureData::*member) { out[name] = item.data.*member; });
  for (const StaffMember& member : item.data.staff)
    out["staff"].push_back({member.role, member.id, json_of(member.name)});
  return out;
}

std::string text_from(const json& value) {
  std::string text = value.get<std::string>();
  if (text.size() > kLongestText || !crypto::is_utf8(text)) throw Error("a text is none");
  return text;
}

PersonName name_from(const json& value) {
  return {text_from(value.at(0)), text_from(value.at(1)), text_from(value.at(2))};
}

std::optional<UtcTime> time_from(const json& value, const char* key) {
  const auto at = value.find(key);
  if (at == value.end() || !at->is_number_integer()) return {};
  constexpr std::int64_t kLatestUs = std::int64_t{1} << 58;
  const auto at_us = at->get<std::int64_t>();
  if (at_us < -kLatestUs || at_us > kLatestUs) throw Error("a time is none");
  return UtcTime(UtcTime::duration(at_us));
}

ProcedureData data_from(const json& value) {
  ProcedureData data;
  data.origin = "worklist";
  data.patient = name_from(value.at("patient"));
  for_each_text([&](const char* name, std::string ProcedureData::*member) {
    data.*member = text_from(value.at(name));
  });
  if (value.at("staff").size() > kMostStaff) throw Error("a step has too many people");
  for (const json& member : value.at("staff"))
    data.staff.push_back({text_from(member.at(0)), text_from(member.at(1)), name_from(member.at(2))});
  return data;
}

/// A step that says more than is kept costs itself alone.
WorklistItem item_from(const json& value) {
  WorklistItem item;
  item.planned = time_from(value, "at");
  const std::optional<UtcTime> earliest = time_from(value, "from"), latest = time_from(value, "to");
  if (earliest && latest) item.within = TimeSpan{*earliest, *latest};
  try {
    item.data = data_from(value);
  } catch (const std::exception&) {
    item.is_left_out = true;
  }
  return item;
}

WorklistAnswer answer_from(ByteView body, const WorklistOptions& options) {
  const json answered = parse_foreign_json(text_of(body));
  WorklistAnswer answer;
  try {
    answer.problem = printable(answered.at("problem").get<std::string>().substr(0, kLongestProblem));
    const json& items = answered.at("items");
    if (items.size() > kMostWorklistItems) throw Error("too many");
    for (const json& item : items) answer.items.push_back(item_from(item));
    answer.not_asked_for =
        std::min<std::uint64_t>(answered.at("not_asked_for").get<std::uint64_t>(), kMostWorklistItems);
    answer.is_cut = answered.at("is_cut").get<bool>();
  } catch (const std::exception&) {
    return failure(name_of(options) + " " + kNoAnswer);
  }
  if (!answer.problem.empty()) return failure(name_of(options) + " " + answer.problem);
  return answer;
}

}  // namespace

// --- outside -----------------------------------------------------------------------------------------------

WorklistAnswer ask_worklist(const WorklistOptions& options, UtcTime now, const std::atomic<bool>* cancelled) {
  const auto fail = [&](const std::string& why) { return failure(name_of(options) + " " + why); };
  const char* const zone = std::getenv("TZ");
  const json asked{{"host", options.host},
                   {"port", options.port},
                   {"called_ae", options.called_ae},
                   {"calling_ae", options.calling_ae},
                   {"station_ae", options.station_ae},
                   {"modality", options.modality},
                   {"timeout_s", options.timeout.count()},
                   {"window_ns", options.window.count()},
                   {"now_us", now.time_since_epoch().count()},
                   // Of an empty environment the C library would look the zone up anew, in a file.
                   {"zone", zone == nullptr ? ":/etc/localtime" : zone}};
  try {
    const Descriptor memory = media::make_shared_memory(kSharedBytes);
    media::BoxedChild child("worklist", memory);
    child.channel().send(static_cast<std::uint32_t>(ToBox::kAsk), bytes_of(text_of_json(asked)));
    auto until = steady_clock::now() + kStarting;
    bool closed = false;
    try {
      while (steady_clock::now() < until) {
        if (cancelled != nullptr && *cancelled) return fail("is not asked any more");
        const auto said = child.channel().receive(kStep, kLongestAnswer);
        if (!said) continue;
        if (said->kind == static_cast<std::uint32_t>(FromBox::kAnswered))
          return answer_from(said->body, options);
        // Said once: who took the box over would else have the question last for ever.
        if (std::exchange(closed, true))
          return fail("did not answer to the end: the program that reads its answers says what it may not");
        until = steady_clock::now() +
                std::max<steady_clock::duration>(kLeastPatience, kTimeoutsInAll * options.timeout);
      }
    } catch (const media::ChannelError&) {
      return fail("did not answer to the end: the program that reads its answers " + child.how_it_ended());
    }
    return fail("did not answer to the end: its answers take too long");
  } catch (const Error& error) {
    return fail(std::string("cannot be asked: ") + error.what());
  }
}

// --- in the box --------------------------------------------------------------------------------------------

namespace {

/// Of IPv4 first, which every version of DCMTK knows.
std::vector<std::string> addresses_of(const std::string& host) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  std::vector<std::string> all;
  if (::getaddrinfo(host.c_str(), nullptr, &wanted, &found) != 0) return {};
  for (const int family : {AF_INET, AF_INET6}) {
    for (const addrinfo* each = found; each != nullptr && all.size() < kMostAddresses; each = each->ai_next) {
      std::array<char, NI_MAXHOST> text{};
      if (each->ai_family == family && ::getnameinfo(each->ai_addr, each->ai_addrlen, text.data(),
                                                     text.size(), nullptr, 0, NI_NUMERICHOST) == 0)
        all.emplace_back(text.data());
    }
  }
  ::freeaddrinfo(found);
  return all;
}

void limit_memory() {
  const rlimit most{kMostMemory, kMostMemory};
  if (std::string_view(KIROKU_SANITIZERS).empty()) (void)::setrlimit(RLIMIT_AS, &most);
}

WorklistAnswer answer_in_box(const json& asked, media::Channel& channel) {
  WorklistOptions options;
  options.port = asked.at("port").get<std::uint16_t>();
  options.called_ae = asked.at("called_ae");
  options.calling_ae = asked.at("calling_ae");
  options.station_ae = asked.at("station_ae");
  options.modality = asked.at("modality");
  options.timeout = std::chrono::seconds(asked.at("timeout_s").get<std::int64_t>());
  options.window = std::chrono::nanoseconds(asked.at("window_ns").get<std::int64_t>());
  ::setenv("TZ", asked.at("zone").get<std::string>().c_str(), 1);
  if (const std::string why = prepare_worklist_query(); !why.empty()) return failure(why);
  const std::vector<std::string> addresses = addresses_of(asked.at("host"));
  if (addresses.empty()) return failure("cannot be asked: nobody knows its name");
  // What answered for the name (nscd, sssd) is not to be spoken to from the box.
  if (::close_range(media::kMemoryDescriptor + 1, ~0U, 0) != 0)
    return failure("cannot be asked: descriptors stay open in its box");
  media::close_box(media::BoxNeeds::kNetwork);
  channel.send(static_cast<std::uint32_t>(FromBox::kClosed), "");
  WorklistAnswer answer;
  for (const std::string& address : addresses) {
    options.host = address;
    answer = query_worklist(options, UtcTime(UtcTime::duration(asked.at("now_us").get<std::int64_t>())));
    if (answer.problem.empty()) break;
  }
  return answer;
}

}  // namespace

void run_worklist_box() {
  try {
    // Who answers for the name is foreign, too. The C library looks it up in files and over sockets that a
    // closed box refuses, and which ones is the machine's configuration (nsswitch.conf), so it happens under
    // these limits before the box closes.
    media::limit_process(kProcessorSeconds);
    limit_memory();
    media::Channel channel{Descriptor(media::kChannelDescriptor)};
    const auto message = channel.receive(kNoLimit, kLongestRequest);
    if (!message || message->kind != static_cast<std::uint32_t>(ToBox::kAsk)) ::_exit(1);
    WorklistAnswer answer;
    try {
      answer = answer_in_box(json::parse(text_of(message->body)), channel);
    } catch (const media::ChannelError&) {
      throw;
    } catch (const std::exception& error) {
      answer = failure(std::string("cannot be asked: ") + error.what());
    }
    json items = json::array();
    for (const WorklistItem& item : answer.items) {
      json one = json_of(item);
      // Without what it says: read as left out.
      if (text_of_json(one).size() > kLongestItem) {
        json times = json::object();
        for (const char* const key : {"at", "from", "to"}) {
          if (one.contains(key)) times[key] = one[key];
        }
        one = std::move(times);
      }
      items.push_back(std::move(one));
    }
    const std::string said = text_of_json({{"items", std::move(items)},
                                           {"not_asked_for", answer.not_asked_for},
                                           {"is_cut", answer.is_cut},
                                           {"problem", answer.problem}});
    channel.send(static_cast<std::uint32_t>(FromBox::kAnswered), bytes_of(said));
  } catch (const std::exception&) {  // the other end is gone, or will see that this one is
    ::_exit(1);
  }
  ::_exit(0);
}

}  // namespace kiroku::recorder
