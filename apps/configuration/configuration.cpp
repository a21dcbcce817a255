#include "apps/configuration/configuration.h"

#include <algorithm>

#include "apps/common/format.h"
#include "apps/configuration/consent_configuration.h"
#include "apps/configuration/room_configuration.h"
#include "apps/configuration/table_reader.h"
#include "apps/configuration/viewer_configuration.h"
#include "base/error.h"
#include "base/joined.h"

namespace kiroku::apps {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

void require_profile(const std::string& text, const std::string& key) {
  if (text != "mpeg2" && text != "uncompressed" && text != "lossless") {
    throw UsageError("'" + key + "' is '" + text + "': it must be mpeg2, uncompressed or lossless");
  }
}

namespace {

void read_recording(const toml::table& table, const std::string& file, Configuration& into) {
  TableReader reader(table, "[recording]", file);
  reader.text("profile", [&](const std::string& text) {
    require_profile(text);
    into.profile = text;
  });
  reader.text("bit_rate",
              [&](const std::string& text) { into.bit_rate = parse_bit_rate(text, "'bit_rate'"); });
  reader.text("chroma", [&](const std::string& text) { into.chroma_422 = parse_chroma(text, "'chroma'"); });
  reader.flag("deinterlace", into.deinterlace);
  reader.flag("audio", into.audio);
  reader.text("segment", [&](const std::string& text) {
    require_unit(text, "'segment'");
    into.segment = parse_segment_duration(text, "'segment'");
  });
  reader.text("stamp_every", [&](const std::string& text) {
    require_unit(text, "'stamp_every'");
    into.stamp_every = parse_stamp_interval(text, "'stamp_every'");
  });
  reader.text("source_timeout", [&](const std::string& text) {
    const nanoseconds duration = parse_stated_duration(text, "'source_timeout'");
    if (duration < milliseconds(100) || duration > std::chrono::minutes(1))
      throw UsageError("'source_timeout' is '" + text + "': it must be between 100ms and 1m");
    into.source_timeout = duration;
  });
  static_cast<void>(reader.find("profile_for"));  // read_profile_rules()
  reader.refuse_unknown_keys();
}

void read_search(const toml::table& table, const std::string& file, Configuration& into) {
  TableReader reader(table, "[search]", file);
  reader.text("key", [&](const std::string& text) { into.search.key = text; });
  reader.refuse_unknown_keys();
  if (into.search.key.empty())
    reader.refuse(table.source(), "[search] needs 'key', the file of a search key");
}

/// Rooms must have been read: a name that is mistyped would leave its stream open to everybody in
/// recipients.txt.
void read_recipients(const toml::table& table, const std::string& file, Configuration& into) {
  TableReader reader(table, "[recipients]", file);
  const std::vector<std::string> known = names_with_recipients(into);
  for (const auto& [key, node] : table) {
    const std::string stream(key.str());
    if (std::ranges::find(known, stream) == known.end()) {
      reader.refuse(key.source(), "[recipients] names the stream '" + stream +
                                      "', which nothing here records; known are " + joined(known));
    }
    if (const std::string why = mistyped_recipients(into, stream); !why.empty())
      reader.refuse(key.source(), why);
    reader.text(stream, [&](const std::string& text) { into.recipients[stream] = text; });
  }
}

void read_evidence(const toml::table& table, const std::string& file, Configuration& into) {
  TableReader reader(table, "[evidence]", file);
  reader.text("policy", [&](const std::string& text) {
    if (text.empty()) throw UsageError("'policy' is empty: name a file, or leave the key out");
    into.evidence.policy = text;
  });
  reader.refuse_unknown_keys();
}

}  // namespace

std::chrono::nanoseconds parse_segment_duration(std::string_view text, const std::string& what) {
  const nanoseconds duration = parse_duration(text, what);
  if (duration < milliseconds(500) || duration > std::chrono::seconds(9)) {
    throw UsageError(what + " is '" + std::string(text) + "': a segment lasts between 500ms and 9s");
  }
  return duration;
}

std::chrono::nanoseconds parse_stamp_interval(std::string_view text, const std::string& what) {
  const nanoseconds duration = parse_duration(text, what);
  if (duration < std::chrono::seconds(1) || duration > std::chrono::hours(24)) {
    throw UsageError(what + " is '" + std::string(text) + "': time-stamps are asked for every 1s to 24h");
  }
  return duration;
}

bool parse_chroma(std::string_view text, const std::string& what) {
  if (text != "420" && text != "422") {
    throw UsageError(what + " is '" + std::string(text) + "': it must be 420 or 422");
  }
  return text == "422";
}

Configuration parse_configuration(std::string_view text, const std::string& name_for_errors) {
  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    const auto& where = error.source().begin;
    throw UsageError(name_for_errors + ":" + std::to_string(where.line) + ":" + std::to_string(where.column) +
                     ": " + std::string(error.description()));
  }
  Configuration configuration;
  TableReader top(root, "the file", name_for_errors);
  const auto section = [&](const std::string& key, const auto& read) {
    if (const toml::table* table = top.table(key)) read(*table, name_for_errors, configuration);
  };
  section("recording", read_recording);
  section("evidence", read_evidence);
  section("search", read_search);
  configuration.authorities = read_authorities(top, AuthorityUse::kOfAppliance);
  read_daemon(top, configuration);
  read_rooms(top, configuration);
  section("recipients", read_recipients);
  read_profile_rules(top, configuration);
  read_retention_rules(top, configuration.retention);
  ConsentConfiguration consent;
  read_consent(top, consent);  // whether it is good; who needs it reads it alone
  configuration.store = read_store(top);
  static_cast<void>(read_viewer(top));  // whether it is good; kirokud alone needs it (viewer_configuration.h)
  top.refuse_unknown_keys();
  return configuration;
}

}  // namespace kiroku::apps
