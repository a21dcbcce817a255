#include "evidence/xml_record.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "evidence/xml_canonical.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;

constexpr std::string_view kNamespace = "urn:ietf:params:xml:ns:ers";
constexpr std::size_t kMostHashValues = 100'000;  // of one record

constexpr std::array<std::pair<std::string_view, HashAlgorithm>, 7> kDigestMethods{{
    // XML Encryption; RFC 6931 has the others.
    {"http://www.w3.org/2001/04/xmlenc#sha256", HashAlgorithm::kSha256},
    {"http://www.w3.org/2001/04/xmlenc#sha512", HashAlgorithm::kSha512},
    {"http://www.w3.org/2001/04/xmldsig-more#sha224", HashAlgorithm::kSha224},
    {"http://www.w3.org/2001/04/xmldsig-more#sha384", HashAlgorithm::kSha384},
    {"http://www.w3.org/2007/05/xmldsig-more#sha3-256", HashAlgorithm::kSha3_256},
    {"http://www.w3.org/2007/05/xmldsig-more#sha3-384", HashAlgorithm::kSha3_384},
    {"http://www.w3.org/2007/05/xmldsig-more#sha3-512", HashAlgorithm::kSha3_512},
}};

bool is(const pugi::xml_node& node, std::string_view name) {
  return node.type() == pugi::node_element && local_name_of(node) == name && namespace_of(node) == kNamespace;
}

std::vector<pugi::xml_node> children(const pugi::xml_node& parent, std::string_view name) {
  std::vector<pugi::xml_node> found;
  for (const pugi::xml_node& each : parent.children())
    if (is(each, name)) found.push_back(each);
  return found;
}

[[noreturn]] void refuse(const std::string& place, const std::string& why) {
  throw Error(place + ": " + why);
}

pugi::xml_node only_child(const pugi::xml_node& parent, std::string_view name, const std::string& place) {
  const std::vector<pugi::xml_node> found = children(parent, name);
  if (found.size() != 1)
    refuse(place,
           "it has " + std::to_string(found.size()) + " elements " + std::string(name) + " instead of one");
  return found.front();
}

/// Children of that name by their Order, which counts from 1 (RFC 6283 section 3.1).
std::vector<pugi::xml_node> ordered_children(const pugi::xml_node& parent, std::string_view name,
                                             std::size_t most, const std::string& place) {
  const std::vector<pugi::xml_node> found = children(parent, name);
  if (found.empty()) refuse(place, "it has no element " + std::string(name));
  if (found.size() > most)
    refuse(place, "it has more than " + std::to_string(most) + " elements " + std::string(name));
  std::vector<pugi::xml_node> sorted(found.size());
  for (const pugi::xml_node& each : found) {
    const std::string_view order = each.attribute("Order").value();
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(order.data(), order.data() + order.size(), number);
    if (error != std::errc{} || end != order.data() + order.size() || number == 0 || number > found.size() ||
        sorted[number - 1])
      refuse(place, "the Order " + in_quotes(order) + " of an element " + std::string(name) +
                        " is not the next number from 1 on");
    sorted[number - 1] = each;
  }
  return sorted;
}

Bytes base64_in(const pugi::xml_node& node, const std::string& place) {
  std::string text;
  for (const pugi::xml_node& child : node.children()) {
    if (child.type() == pugi::node_element) refuse(place, "an element stands within base64");
    if (child.type() == pugi::node_pcdata || child.type() == pugi::node_cdata) text += child.value();
  }
  std::erase_if(text, [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; });
  std::optional<Bytes> bytes = crypto::from_base64(text, crypto::Base64Padding::kPadded);
  if (!bytes || bytes->empty()) refuse(place, in_quotes(text) + " is no base64");
  if (bytes->size() > kMaximumPartBytes) refuse(place, "it has more than 1 MiB");
  return std::move(*bytes);
}

NamedHash hash_of(const pugi::xml_node& chain, const std::string& place) {
  const std::string_view uri = only_child(chain, "DigestMethod", place).attribute("Algorithm").value();
  const auto* const known =
      std::ranges::find(kDigestMethods, uri, &std::pair<std::string_view, HashAlgorithm>::first);
  if (known != kDigestMethods.end()) return named_hash(known->second);
  return {.algorithm = {}, .identifier = {}, .name = printable(uri.substr(0, kLongestQuoted))};
}

Canonicalization canonicalization_of(const pugi::xml_node& chain, const std::string& place) {
  const pugi::xml_node method = only_child(chain, "CanonicalizationMethod", place);
  const std::string_view uri = method.attribute("Algorithm").value();
  const auto known = canonicalization_named(uri);
  if (!known) refuse(place, "the canonicalization " + in_quotes(uri) + " is not known here");
  for (const pugi::xml_node& child : method.children())
    if (child.type() == pugi::node_element)
      refuse(place, "parameters of a canonicalization are not read here");
  return *known;
}

/// What renewals are over.
struct XmlChain {
  Canonicalization how;
  std::vector<pugi::xml_node> time_stamps;  // elements TimeStamp
};

}  // namespace

struct XmlRecord::State {
  pugi::xml_document document;
  pugi::xml_node sequence;  // ArchiveTimeStampSequence
  std::vector<XmlChain> chains;
  EvidenceRecord record;

  void read_chain(const pugi::xml_node& element);
  ArchiveTimeStamp read_time_stamp(const pugi::xml_node& element, const NamedHash& hash,
                                   const std::string& place);
  std::vector<HashList> read_tree(const pugi::xml_node& element, const std::string& place);
  std::size_t stamps = 0, values = 0;
};

void XmlRecord::State::read_chain(const pugi::xml_node& element) {
  const std::size_t number = chains.size();
  const std::string place = "archiveTimeStampSequence[" + std::to_string(number) + "]";
  XmlChain chain{canonicalization_of(element, place), {}};
  const NamedHash hash = hash_of(element, place);
  ArchiveTimeStampChain read;
  for (const pugi::xml_node& each :
       ordered_children(element, "ArchiveTimeStamp", kMostTimeStamps - stamps, place)) {
    const std::string at = place_of(number, read.size());
    chain.time_stamps.push_back(only_child(each, "TimeStamp", at));
    read.push_back(read_time_stamp(each, hash, at));
  }
  stamps += read.size();
  chains.push_back(std::move(chain));
  record.chains.push_back(std::move(read));
}

ArchiveTimeStamp XmlRecord::State::read_time_stamp(const pugi::xml_node& element, const NamedHash& hash,
                                                   const std::string& place) {
  ArchiveTimeStamp read;
  read.digest_algorithm = hash;
  const std::vector<pugi::xml_node> trees = children(element, "HashTree");
  if (trees.size() > 1) refuse(place, "it has two hash trees");
  if (!trees.empty()) read.reduced_tree = read_tree(trees.front(), place);
  const pugi::xml_node token = only_child(only_child(element, "TimeStamp", place), "TimeStampToken", place);
  const std::string_view type = token.attribute("Type").value();
  if (type != "RFC3161")
    refuse(place, "its token is of the type " + in_quotes(type) + ", which is not read here");
  read.token = base64_in(token, place);
  return read;
}

std::vector<HashList> XmlRecord::State::read_tree(const pugi::xml_node& element, const std::string& place) {
  std::vector<HashList> tree;
  for (const pugi::xml_node& each : ordered_children(element, "Sequence", kMostHashLists, place)) {
    HashList list;
    for (const pugi::xml_node& value : children(each, "DigestValue")) {
      if (++values > kMostHashValues)
        refuse(place, "the record has more than " + std::to_string(kMostHashValues) + " hash values");
      list.push_back(base64_in(value, place));
    }
    if (list.empty()) refuse(place, "a Sequence of its hash tree is empty");
    tree.push_back(std::move(list));
  }
  return tree;
}

namespace {

/// RFC 6283 sections 4.2.1 and 4.2.2.
class XmlCover : public RenewalCover {
 public:
  /// `chains` must outlive it; `sequence` is the element that has them.
  XmlCover(const std::vector<XmlChain>& chains, pugi::xml_node sequence)
      : chains_(chains), sequence_(sequence) {}

  Bytes time_stamp(std::size_t chain, std::size_t index, HashAlgorithm algorithm) override {
    return digest_of(canonical_element(chains_[chain].time_stamps[index], chains_[chain].how), algorithm);
  }
  /// The sequence as it was before this chain was added: without it and those behind it.
  Bytes chains_before(std::size_t chain, HashAlgorithm algorithm) override {
    pugi::xml_document before;
    // The names of the sequence are declared above it.
    pugi::xml_node copy = before.append_copy(sequence_.parent());
    pugi::xml_node sequence;
    for (const pugi::xml_node& each : copy.children())
      if (is(each, "ArchiveTimeStampSequence")) sequence = each;
    std::vector<pugi::xml_node> later;
    for (const pugi::xml_node& each : sequence.children()) {
      if (is(each, "ArchiveTimeStampChain") && order_of(each) > chain) later.push_back(each);
    }
    for (const pugi::xml_node& each : later) sequence.remove_child(each);
    return digest_of(canonical_element(sequence, chains_[chain].how), algorithm);
  }
  /// Also of XML the bytes as they are: archives that take files for octets hash them so.
  ObjectValues object(const DataObject& object, std::size_t chain, HashAlgorithm algorithm) override {
    ObjectValues values{.bytes = object.digest(algorithm), .canonical = {}};
    values.is_partial = !values.bytes;
    if (!object.content || !begins_as_xml(*object.content)) return values;
    const Form& form = form_of(object, chains_[chain].how, algorithm);
    values.canonical = form.digest;
    values.why = form.why;
    if (!form.digest) values.is_partial = true;
    return values;
  }
  [[nodiscard]] bool joins_objects_and_chains() const override { return false; }

 private:
  /// The hash of an object's canonical form, or why there is none.
  struct Form {
    std::optional<Bytes> digest;
    std::string why;
  };
  /// Made once for all chains that make and hash it in one way: a record has up to 64, and a file 64 MiB.
  const Form& form_of(const DataObject& object, Canonicalization how, HashAlgorithm algorithm) {
    const auto [at, is_new] = forms_.try_emplace({&object, how, algorithm});
    Form& form = at->second;
    if (!is_new) return form;
    try {
      form.digest = digest_of(canonical_document(parse_xml(text_of(*object.content)), how), algorithm);
    } catch (const Error& error) {
      form.why = error.what();
    }
    return form;
  }
  static Bytes digest_of(std::string_view text, HashAlgorithm algorithm) {
    return crypto::digest(algorithm, bytes_of(text));
  }
  static std::size_t order_of(const pugi::xml_node& chain) { return chain.attribute("Order").as_uint(); }

  const std::vector<XmlChain>& chains_;
  const pugi::xml_node sequence_;
  /// The objects of one judgement stay where they are.
  std::map<std::tuple<const DataObject*, Canonicalization, HashAlgorithm>, Form> forms_;
};

}  // namespace

bool begins_as_xml(ByteView file) {
  std::string_view text = text_of(file).substr(0, 4096);
  if (text.starts_with("\xFE\xFF") || text.starts_with("\xFF\xFE")) return true;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::size_t at = text.find_first_not_of(" \t\r\n");
  return at != std::string_view::npos && text[at] == '<';
}

XmlRecord::XmlRecord(std::unique_ptr<State> state) : state_(std::move(state)) {}
XmlRecord::~XmlRecord() = default;
XmlRecord::XmlRecord(XmlRecord&&) noexcept = default;
XmlRecord& XmlRecord::operator=(XmlRecord&&) noexcept = default;
const EvidenceRecord& XmlRecord::record() const { return state_->record; }

XmlRecord XmlRecord::parse(std::string_view xml) {
  if (xml.size() > kLongestXmlRecord) throw Error("the record has more than 4 MiB");
  auto state = std::make_unique<State>();
  state->document = parse_xml(xml);
  const pugi::xml_node root = state->document.document_element();
  if (!is(root, "EvidenceRecord")) throw Error("it is no evidence record in XML (RFC 6283)");
  const std::string_view version = root.attribute("Version").value();
  if (version != "1.0")
    refuse("EvidenceRecord", "its version is " + in_quotes(version) + " instead of \"1.0\"");
  state->sequence = only_child(root, "ArchiveTimeStampSequence", "EvidenceRecord");
  for (const pugi::xml_node& chain :
       ordered_children(state->sequence, "ArchiveTimeStampChain", kMostChains, "archiveTimeStampSequence"))
    state->read_chain(chain);
  return XmlRecord(std::move(state));
}

RecordJudgement XmlRecord::judge(const std::vector<DataObject>& objects, const JudgingRules& rules) const {
  XmlCover cover(state_->chains, state_->sequence);
  return judge_record(state_->record, objects, rules, cover);
}

}  // namespace kiroku::evidence
