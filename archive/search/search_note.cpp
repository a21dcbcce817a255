#include "archive/search/search_note.h"

#include "archive/format/case_layout.h"
#include "archive/format/strict_json.h"
#include "crypto/encoding.h"
#include "crypto/key_derivation.h"

namespace kiroku::search {
namespace {

constexpr std::string_view kFormat = "kiroku-search/1";
constexpr std::size_t kWordBytes = 16, kWordDigits = 2 * kWordBytes, kWordsOfNote = 4;
constexpr std::size_t kMacDigits = 64;

/// In the order in which they stand.
struct Words {
  std::string patient, patient_of, code, code_of;
};
Words words_in(const SearchWords& words) {
  Words all;
  if (!words.patient.empty()) all.patient = "patient\n" + words.patient;
  if (!words.patient.empty() && !words.authority.empty())
    all.patient_of = "patient of\n" + words.patient + "\n" + words.authority;
  if (!words.code.empty()) all.code = "procedure\n" + words.code;
  if (!words.code.empty() && !words.system.empty())
    all.code_of = "procedure of\n" + words.code + "\n" + words.system;
  return all;
}

std::string hash_of(const crypto::Sha256Digest& key, const std::string& case_id, const std::string& word) {
  const crypto::Sha256Digest hash =
      crypto::hmac_sha256(key, bytes_of("kiroku search word\n" + case_id + "\n" + word));
  return crypto::to_hex(ByteView(hash).first(kWordBytes));
}

std::string mac_of(const crypto::Sha256Digest& key, const SearchNote& note) {
  std::string text = "kiroku search mac";
  for (const NoteKey* each : {&note.of, &note.words})
    text += "\n" + each->case_id + "\n" + each->series + "\n" + std::to_string(each->step);
  return crypto::to_hex(crypto::hmac_sha256(key, bytes_of(text + "\n" + note.hashes)));
}

bool is_hex(std::string_view text, std::size_t digits) {
  return text.size() == digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::string members(const NoteKey& key, const std::string& prefix) {
  return "\"" + prefix + "case\":\"" + key.case_id + "\",\"" + prefix + "series\":\"" + key.series + "\",\"" +
         prefix + "step\":" + std::to_string(key.step) + ",";
}

NoteKey key_in(archive::JsonFields& fields, const std::string& prefix) {
  NoteKey key;
  key.case_id = fields.text(prefix + "case");
  key.series = fields.text(prefix + "series");
  key.step = fields.count(prefix + "step");
  return key;
}

bool is_sound(const NoteKey& key) {
  return archive::is_case_id(key.case_id) && is_series(key.series) && key.step < kMostSteps;
}

}  // namespace

std::string SearchNote::text() const {
  return "{\"format\":\"" + std::string(kFormat) + "\"," + members(of, "") + members(words, "words_") +
         "\"words\":\"" + hashes + "\",\"mac\":\"" + mac + "\"}\n";
}

std::optional<SearchNote> SearchNote::parse(std::string_view text) {
  if (text.size() > kMostNoteBytes || !text.ends_with('\n')) return {};
  const archive::JsonParse parsed = archive::parse_json(text.substr(0, text.size() - 1));
  if (!parsed.value) return {};
  std::string problem;
  archive::JsonFields fields(*parsed.value, "note", problem);
  SearchNote note;
  const std::string format = fields.text("format");
  note.of = key_in(fields, "");
  note.words = key_in(fields, "words_");
  note.hashes = fields.text("words");
  note.mac = fields.text("mac");
  // Written otherwise it would be another text with the same meaning.
  if (!problem.empty() || format != kFormat || !is_sound(note.of) || !is_sound(note.words) ||
      !is_hex(note.hashes, kWordsOfNote * kWordDigits) || !is_hex(note.mac, kMacDigits) ||
      note.text() != text)
    return {};
  return note;
}

SearchNote make_note(const ApplianceKey& key, const std::string& case_id, const SearchWords& words) {
  const crypto::Sha256Digest note_key = key.now.note_key();
  SearchNote note;
  note.of = note.words = {case_id, key.series, key.step};
  const Words all = words_in(words);
  for (const std::string* word : {&all.patient, &all.patient_of, &all.code, &all.code_of}) {
    Bytes unknown(kWordBytes);
    crypto::fill_random(unknown);
    note.hashes += word->empty() ? crypto::to_hex(unknown) : hash_of(note_key, case_id, *word);
  }
  note.mac = mac_of(note_key, note);
  return note;
}

SearchNote carry_over(const ApplianceKey& key, const std::string& case_id, const SearchNote& earlier) {
  SearchNote note = earlier;
  note.of = {case_id, key.series, key.step};
  note.mac = mac_of(key.now.note_key(), note);
  return note;
}

NoteReader::Answer NoteReader::read(const std::string& appliance, const std::string& case_id,
                                    const SearchNote& note, const SearchWords& asked) {
  if (note.of.case_id != case_id) return Answer::kForeign;
  const std::optional<crypto::Sha256Digest> own = key_at(appliance, note.of);
  if (!own || !crypto::equal_constant_time(bytes_of(mac_of(*own, note)), bytes_of(note.mac)))
    return Answer::kForeign;
  const std::optional<crypto::Sha256Digest> of_words = key_at(appliance, note.words);
  if (!of_words) return Answer::kForeign;
  const auto has = [&](std::size_t place, const std::string& word) {
    return note.hashes.compare(place * kWordDigits, kWordDigits,
                               hash_of(*of_words, note.words.case_id, word)) == 0;
  };
  const Words all = words_in(asked);
  enum Place : std::size_t { kPatient, kPatientOf, kCode, kCodeOf };
  const bool is_patient =
      asked.patient.empty() ||
      (asked.authority.empty() ? has(kPatient, all.patient) : has(kPatientOf, all.patient_of));
  const bool is_procedure =
      asked.code.empty() || (asked.system.empty() ? has(kCode, all.code) : has(kCodeOf, all.code_of));
  return is_patient && is_procedure ? Answer::kFits : Answer::kDiffers;
}

std::optional<crypto::Sha256Digest> NoteReader::key_at(const std::string& appliance, const NoteKey& at) {
  const auto name = std::pair(appliance, at.series);
  auto found = series_.find(name);
  if (found == series_.end()) {
    // Steps of a series that the site never gave are not computed.
    if (!key_.has_given(appliance, at.series)) return {};
    found = series_.emplace(name, Series{key_.first_of(appliance, at.series), {}}).first;
  }
  Series& series = found->second;
  while (series.keys.size() <= at.step && at.step < kMostSteps) {
    series.keys.push_back(series.next.note_key());
    series.next = series.next.next();
  }
  return at.step < series.keys.size() ? std::optional(series.keys[at.step]) : std::nullopt;
}

}  // namespace kiroku::search
