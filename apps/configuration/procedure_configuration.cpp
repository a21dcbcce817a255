#include "apps/configuration/procedure_configuration.h"

#include <charconv>

#include "apps/common/format.h"
#include "apps/configuration/table_reader.h"
#include "recorder/procedure/procedure_inbox.h"

namespace kiroku::apps {
namespace {

using std::chrono::nanoseconds;

nanoseconds parse_between(const std::string& text, const std::string& key, nanoseconds least,
                          nanoseconds most, const std::string& range) {
  const nanoseconds duration = parse_stated_duration(text, "'" + key + "'");
  if (duration < least || duration > most) {
    throw UsageError("'" + key + "' is '" + text + "': it must be between " + range);
  }
  return duration;
}

void read_window(TableReader& reader, nanoseconds& into) {
  reader.text("window", [&](const std::string& text) {
    into = parse_between(text, "window", std::chrono::minutes(1), recorder::ProcedureBook::kLongestWindow,
                         "1m and 72h");
  });
}

/// An application entity title (DICOM PS3.5 6.2, AE): 1 to 16 printable characters without backslash.
void read_title(TableReader& reader, const std::string& key, std::string& into) {
  reader.text(key, [&](const std::string& text) {
    const bool good = !text.empty() && text.size() <= 16 && text.find('\\') == std::string::npos &&
                      text.find_first_not_of(' ') != std::string::npos &&
                      std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
    if (!good) {
      throw UsageError("'" + key + "' is '" + text +
                       "': a title has 1 to 16 printable characters, no backslash");
    }
    into = text;
  });
}

Hl7Configuration read_hl7(const toml::table& table, const std::string& file) {
  Hl7Configuration hl7;
  TableReader reader(table, "[room.procedure.hl7]", file);
  reader.text("listen", [&](const std::string& text) {
    recorder::ProcedureInbox::check(text);
    hl7.listen = text;
  });
  reader.texts("locations",
               [&](const std::vector<std::string>& locations) { hl7.rule.locations = locations; });
  read_window(reader, hl7.rule.window);
  reader.refuse_unknown_keys();
  if (hl7.listen.empty()) reader.refuse(table.source(), "[room.procedure.hl7] needs a 'listen'");
  return hl7;
}

void read_address(const std::string& text, recorder::WorklistOptions& into) {
  const std::size_t colon = text.rfind(':');
  const char* const end = text.data() + text.size();
  const bool has_port = colon != std::string::npos && colon > 0;
  const auto [rest, error] = std::from_chars(has_port ? text.data() + colon + 1 : end, end, into.port);
  if (!has_port || error != std::errc() || rest != end || into.port == 0) {
    throw UsageError("'address' is '" + text +
                     "': write a host and a port, such as ris.hospital.example:104");
  }
  into.host = text.substr(0, colon);
}

recorder::WorklistOptions read_worklist(const toml::table& table, const std::string& file) {
  recorder::WorklistOptions worklist;
  TableReader reader(table, "[room.procedure.worklist]", file);
  reader.text("address", [&](const std::string& text) { read_address(text, worklist); });
  read_title(reader, "called_ae", worklist.called_ae);
  read_title(reader, "calling_ae", worklist.calling_ae);
  read_title(reader, "station_ae", worklist.station_ae);
  read_title(reader, "modality", worklist.modality);
  read_window(reader, worklist.window);
  reader.text("refresh", [&](const std::string& text) {
    worklist.refresh =
        parse_between(text, "refresh", std::chrono::seconds(5), std::chrono::hours(1), "5s and 1h");
  });
  reader.text("timeout", [&](const std::string& text) {
    worklist.timeout = std::chrono::ceil<std::chrono::seconds>(
        parse_between(text, "timeout", std::chrono::seconds(1), std::chrono::minutes(1), "1s and 1m"));
  });
  reader.refuse_unknown_keys();
  if (worklist.host.empty()) reader.refuse(table.source(), "[room.procedure.worklist] needs an 'address'");
  return worklist;
}

}  // namespace

ProcedureConfiguration read_procedure(TableReader& room) {
  ProcedureConfiguration procedure;
  const toml::table* table = room.table("procedure");
  if (table == nullptr) return procedure;
  TableReader reader(*table, "[room.procedure]", room.file());
  if (const toml::table* hl7 = reader.table("hl7")) procedure.hl7 = read_hl7(*hl7, room.file());
  if (const toml::table* worklist = reader.table("worklist")) {
    procedure.worklist = read_worklist(*worklist, room.file());
  }
  reader.refuse_unknown_keys();
  return procedure;
}

}  // namespace kiroku::apps
