#include "archive/format/excerpt_document.h"

#include <algorithm>

#include "archive/format/case_layout.h"
#include "archive/format/json_writer.h"
#include "archive/format/strict_json.h"
#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

constexpr std::size_t kDepth = 4;  // document, earlier, one of them, proof

std::vector<std::string> in_hex(const std::vector<crypto::Sha256Digest>& hashes) {
  std::vector<std::string> texts;
  texts.reserve(hashes.size());
  for (const crypto::Sha256Digest& hash : hashes) {
    texts.push_back(crypto::to_hex(hash));
  }
  return texts;
}

std::vector<crypto::Sha256Digest> read_hashes(JsonFields& fields, std::string_view key) {
  std::vector<crypto::Sha256Digest> hashes;
  for (const std::string& text : fields.texts(key)) {
    const std::optional<Bytes> bytes = crypto::from_hex(text);
    crypto::Sha256Digest hash{};
    if (!bytes || bytes->size() != hash.size()) {
      fields.refuse(key, "is not a list of SHA-256 hashes in lower-case hex");
      return {};
    }
    std::copy(bytes->begin(), bytes->end(), hash.begin());
    hashes.push_back(hash);
  }
  return hashes;
}

void check_names(JsonFields& fields, std::vector<std::string> names) {
  if (fields.failed()) {
    return;
  }
  if (names.empty()) {
    fields.refuse("streams", "names no stream, so it is an excerpt of nothing");
  }
  std::sort(names.begin(), names.end());
  if (const auto twice = std::adjacent_find(names.begin(), names.end()); twice != names.end()) {
    fields.refuse("streams", "names " + *twice + " twice");
  }
}

}  // namespace

std::string to_text(const ExcerptDocument& document) {
  std::vector<std::string> earlier;
  for (const ExcerptDocument::Earlier& each : document.earlier) {
    JsonWriter json;
    json.count("size", each.size).texts("proof", in_hex(each.proof));
    earlier.push_back(json.finish());
  }
  JsonWriter json;
  json.text("format", kExcerptFormat)
      .text("case", document.case_id)
      .integer("from_ns", document.from_ns)
      .integer("to_ns", document.to_ns)
      .texts("streams", document.streams)
      .count("first_entry", document.first_entry)
      .count("size", document.size)
      .texts("open_proof", in_hex(document.open_proof))
      .texts("left", in_hex(document.left))
      .json("earlier", json_array(earlier));
  if (document.made_utc) {
    json.utc("made_utc", *document.made_utc);
  }
  if (!document.made_by.empty()) {
    json.text("made_by", document.made_by);
  }
  return json.finish() + "\n";
}

ExcerptParse parse_excerpt(std::string_view text) {
  ExcerptParse result;
  if (!text.ends_with('\n')) {
    result.problem = "it does not end with a line feed";
    return result;
  }
  const JsonParse json = parse_json(text.substr(0, text.size() - 1), {kMaximumExcerptBytes, kDepth});
  if (!json.value) {
    result.problem = json.problem;
    return result;
  }
  JsonFields fields(*json.value, "excerpt", result.problem);
  ExcerptDocument document;
  const std::string format = fields.text("format");
  if (!fields.failed() && format != kExcerptFormat) {
    fields.refuse("format", "is not \"" + std::string(kExcerptFormat) + "\"");
  }
  document.case_id = fields.text("case");
  if (!fields.failed() && !is_case_id(document.case_id)) {
    fields.refuse("case", "is not a case identifier");
  }
  document.from_ns = fields.integer("from_ns");
  document.to_ns = fields.integer("to_ns");
  if (!fields.failed() && document.to_ns <= document.from_ns) {
    fields.refuse("to_ns", "is not after from_ns");
  }
  document.streams = fields.texts("streams");
  check_names(fields, document.streams);
  document.first_entry = fields.count("first_entry");
  document.size = fields.count("size");
  if (!fields.failed() && document.size <= document.first_entry) {
    fields.refuse("size", "is not above first_entry");
  }
  document.open_proof = read_hashes(fields, "open_proof");
  document.left = read_hashes(fields, "left");
  for (JsonFields& each : fields.objects("earlier")) {
    ExcerptDocument::Earlier earlier;
    earlier.size = each.count("size");
    earlier.proof = read_hashes(each, "proof");
    each.no_more();
    document.earlier.push_back(std::move(earlier));
  }
  if (fields.has("made_utc")) {
    document.made_utc = fields.utc("made_utc");
  }
  if (fields.has("made_by")) {
    document.made_by = fields.text("made_by");
  }
  fields.no_more();
  if (!fields.failed()) {
    result.document = std::move(document);
  }
  return result;
}

}  // namespace kiroku::archive
