// kiroku.toml: how a home records. The default file (deploy/kiroku.toml, kept in the program) is also the
// documentation of every key. Pure functions, thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/configuration/authority_configuration.h"
#include "apps/configuration/retention_configuration.h"
#include "apps/configuration/room_configuration.h"
#include "apps/configuration/store_configuration.h"

namespace kiroku::apps {

/// [evidence].
struct EvidenceConfiguration {
  std::string policy;  // a TOML file, relative to the home; empty: no algorithm ends
};

/// [search].
struct SearchConfiguration {
  std::string
      key;  // the appliance's search key, a file, relative to the home; empty: no case can be found by it
};

struct Configuration {
  std::string profile = "mpeg2";
  std::int64_t bit_rate = 4'000'000;
  bool chroma_422 = false;
  bool deinterlace = false;
  bool audio = false;
  std::chrono::nanoseconds segment = std::chrono::seconds(2);
  std::chrono::nanoseconds stamp_every = std::chrono::seconds(60);
  std::chrono::nanoseconds source_timeout = std::chrono::seconds(5);
  /// Stream to recipients file, relative to the home; of kEventsRecipients the patient is, too.
  std::map<std::string, std::string> recipients;
  std::vector<AuthorityConfiguration> authorities;
  std::vector<ProfileForConfiguration> profile_for;
  // Of an unattended recorder.
  std::vector<RoomConfiguration> rooms;
  DaemonConfiguration daemon;
  StorageConfiguration storage;
  RetentionConfiguration retention;
  EvidenceConfiguration evidence;
  SearchConfiguration search;
  std::optional<StoreConfiguration> store;
};

/// Throws kiroku::UsageError "<name_for_errors>:<line>:<column>: …" for what is no TOML, an unknown key, a
/// wrong type or a value out of its range.
Configuration parse_configuration(std::string_view toml, const std::string& name_for_errors);

/// What may have recipients of its own: the streams of every room, of `kiroku record` and of `kiroku train`;
/// "events", the operator's marks and the patient; "pointing".
std::vector<std::string> names_with_recipients(const Configuration& configuration);
inline constexpr const char* kEventsRecipients = "events";
/// Why `name` of [recipients] is mistyped, although `kiroku record` could record such a stream: rooms record
/// one whose name begins so, or with which it begins. "" where it is not.
std::string mistyped_recipients(const Configuration& configuration, const std::string& name);
/// A sentence for each name of [recipients] that is `kiroku record`'s alone, in a home with rooms.
std::vector<std::string> idle_recipients(const Configuration& configuration);
/// What a person should know of a configuration that is taken: idle_recipients(), shared_by_rooms().
std::vector<std::string> doubts_of(const Configuration& configuration);
/// A sentence for each [[retention]] of which nothing that is recorded now will ever be due: mistyped, or for
/// cases of before.
std::vector<std::string> idle_retention(const Configuration& configuration);
/// What a person should look at in [[retention]]: idle_retention(), what erases within a day, and streams of
/// rooms for which two rules are.
std::vector<std::string> doubtful_retention(const Configuration& configuration);

/// The text `kiroku init` writes.
std::string_view default_configuration_text();

/// Limits that the command line shares with the file; throw kiroku::UsageError naming `what`.
std::chrono::nanoseconds parse_segment_duration(std::string_view text,
                                                const std::string& what);                       // 0.5 to 9 s
std::chrono::nanoseconds parse_stamp_interval(std::string_view text, const std::string& what);  // 1 s to 24 h
/// Of recorder::parse_profile.
void require_profile(const std::string& text, const std::string& key = "profile");
bool parse_chroma(std::string_view text, const std::string& what);  // "422" is true, "420" false

}  // namespace kiroku::apps
