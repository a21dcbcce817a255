#include "evidence/xml_canonical.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::evidence {
namespace {

constexpr std::string_view kXmlPrefix = "xml";
constexpr std::string_view kXmlNamespace = "http://www.w3.org/XML/1998/namespace";

struct Name {
  std::string_view prefix, local;
};
Name name_of(std::string_view qualified) {
  const std::size_t colon = qualified.find(':');
  if (colon == std::string_view::npos) return {"", qualified};
  return {qualified.substr(0, colon), qualified.substr(colon + 1)};
}

/// The prefix that an attribute declares a namespace for, empty of the default one; nothing of other
/// attributes.
std::optional<std::string_view> declared_by(std::string_view attribute) {
  if (attribute == "xmlns") return "";
  if (attribute.starts_with("xmlns:")) return attribute.substr(6);
  return {};
}

using Namespaces = std::map<std::string_view, std::string_view>;  // by prefix, in the order of the output

/// What an element adds to the namespaces that hold for it.
void take_declarations(const pugi::xml_node& element, Namespaces& in_scope) {
  for (const pugi::xml_attribute& attribute : element.attributes()) {
    if (const auto prefix = declared_by(attribute.name()); prefix && *prefix != kXmlPrefix)
      in_scope[*prefix] = attribute.value();
  }
}

std::string_view looked_up(const Namespaces& in_scope, std::string_view prefix) {
  if (prefix == kXmlPrefix) return kXmlNamespace;
  const auto at = in_scope.find(prefix);
  return at == in_scope.end() ? std::string_view() : at->second;
}

/// Refuses what no canonical form is made of.
class Check {
 public:
  void element(const pugi::xml_node& element, Namespaces in_scope, int depth) const {
    const std::string name = in_quotes(element.name());
    if (depth > kDeepestXml)
      throw Error("the element " + name + " stands within more than " + std::to_string(kDeepestXml) +
                  " others");
    std::size_t count = 0;
    for (const pugi::xml_attribute& attribute : element.attributes()) {
      if (++count > kMostXmlAttributes)
        throw Error("the element " + name + " has more than " + std::to_string(kMostXmlAttributes) +
                    " attributes");
      const auto prefix = declared_by(attribute.name());
      if (prefix && !prefix->empty() && std::string_view(attribute.value()).empty())
        throw Error("the element " + name + " takes the prefix " + in_quotes(*prefix) +
                    " back, which XML does not have");
    }
    take_declarations(element, in_scope);
    if (in_scope.size() > kMostXmlAttributes)
      throw Error("more than " + std::to_string(kMostXmlAttributes) + " namespaces hold for the element " +
                  name);
    require_declared(element.name(), in_scope);
    std::vector<std::pair<std::string_view, std::string_view>> expanded;
    for (const pugi::xml_attribute& attribute : element.attributes()) {
      const std::string_view text = attribute.name();
      if (declared_by(text)) {
        expanded.emplace_back("xmlns", text);
        continue;
      }
      require_declared(text, in_scope);
      const Name parts = name_of(text);
      expanded.emplace_back(parts.prefix.empty() ? "" : looked_up(in_scope, parts.prefix), parts.local);
    }
    std::ranges::sort(expanded);
    if (std::ranges::adjacent_find(expanded) != expanded.end())
      throw Error("an attribute of the element " + name + " stands twice");
    for (const pugi::xml_node& child : element.children())
      if (child.type() == pugi::node_element) this->element(child, in_scope, depth + 1);
  }

 private:
  static void require_declared(std::string_view name, const Namespaces& in_scope) {
    const Name parts = name_of(name);
    const bool is_known = parts.prefix.empty() || !looked_up(in_scope, parts.prefix).empty();
    if (!is_known || parts.local.empty() || parts.local.find(':') != std::string_view::npos)
      throw Error("nothing declares the prefix of the name " + in_quotes(name));
  }
};

/// Whether XML has this character (XML 1.0, production 2).
bool is_character(std::uint32_t code) {
  return code == 0x9 || code == 0xA || code == 0xD || (code >= 0x20 && code <= 0xD7FF) ||
         (code >= 0xE000 && code <= 0xFFFD) || (code >= 0x10000 && code <= 0x10FFFF);
}

/// Takes one character of UTF-8 (RFC 3629 section 4) off the front; nothing where there is none.
std::optional<std::uint32_t> take_character(std::string_view& text) {
  const auto byte = [&](std::size_t at) { return std::uint32_t{static_cast<unsigned char>(text[at])}; };
  const std::uint32_t first = byte(0);
  const std::size_t length = first < 0x80   ? 1U
                             : first < 0xC2 ? 0U
                             : first < 0xE0 ? 2U
                             : first < 0xF0 ? 3U
                                            : 4U;
  if (length == 0 || first > 0xF4 || text.size() < length) return {};
  std::uint32_t code = length == 1 ? first : first & (0xFFU >> (length + 1));
  for (std::size_t at = 1; at < length; ++at) {
    if ((byte(at) & 0xC0U) != 0x80U) return {};
    code = code << 6U | (byte(at) & 0x3FU);
  }
  constexpr std::array<std::uint32_t, 5> kLeast{0, 0, 0x80, 0x800, 0x10000};
  if (code < kLeast.at(length)) return {};
  text.remove_prefix(length);
  return code;
}

/// Refuses what the parser forgives: it ends at a NUL, takes any encoding for UTF-8 and any entity for text,
/// and drops declarations. What it did not read, or read as something else, its canonical form would not
/// have, and could be changed unseen. This reads the marks of XML alone; names and attributes are the
/// parser's.
class StrictMarks {
 public:
  explicit StrictMarks(std::string_view xml) : whole_(xml), left_(xml) {}

  /// Whether it begins with an XML declaration.
  bool require() {
    if (left_.starts_with("\xFE\xFF") || left_.starts_with("\xFF\xFE"))
      throw Error("it is in UTF-16, which is not read");
    if (left_.starts_with("\xEF\xBB\xBF")) left_.remove_prefix(3);
    const bool is_declared = declaration();
    require_characters();
    while (!left_.empty()) {
      if (left_.front() == '<')
        markup();
      else
        text();
    }
    return is_declared;
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw Error("it is no XML: " + why + " at byte " + std::to_string(whole_.size() - left_.size()));
  }

  void skip_space() { left_.remove_prefix(std::min(left_.find_first_not_of(" \t\r\n"), left_.size())); }
  /// XML 1.0, production 23. The parser would let a value run on behind its end.
  bool declaration() {
    if (!left_.starts_with("<?xml") || left_.find_first_of(" \t\r\n") != 5) return false;
    left_.remove_prefix(5);
    skip_space();
    const auto version = declared("version");
    if (!version) refuse("its declaration has no version");
    if (*version != "1.0") throw Error("it is of XML " + in_quotes(*version) + ", and 1.0 alone is read");
    if (const auto encoding = declared("encoding")) require_encoding(*encoding);
    if (const auto standalone = declared("standalone");
        standalone && *standalone != "yes" && *standalone != "no")
      refuse("its declaration is none");
    if (!left_.starts_with("?>")) refuse("its declaration is none");
    left_.remove_prefix(2);
    return true;
  }
  std::optional<std::string_view> declared(std::string_view name) {
    if (!left_.starts_with(name)) return {};
    left_.remove_prefix(name.size());
    skip_space();
    if (!left_.starts_with('=')) refuse("its declaration is none");
    left_.remove_prefix(1);
    skip_space();
    if (!left_.starts_with('"') && !left_.starts_with('\'')) refuse("its declaration is none");
    const std::size_t end = left_.find(left_.front(), 1);
    if (end == std::string_view::npos) refuse("its declaration is none");
    const std::string_view value = left_.substr(1, end - 1);
    left_.remove_prefix(end + 1);
    skip_space();
    return value;
  }
  void require_encoding(std::string_view declared) const {
    std::string name(declared);
    for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    if (name == "utf-8") return;
    const bool is_plain = std::ranges::all_of(whole_, [](char c) { return (c & 0x80) == 0; });
    if (name != "us-ascii" || !is_plain)
      throw Error("it says that it is in " + in_quotes(declared) + ", and UTF-8 alone is read");
  }

  void require_characters() {
    const std::string_view begun = left_;
    while (!left_.empty()) {
      const auto code = take_character(left_);
      if (!code) refuse("what is no UTF-8 stands");
      if (!is_character(*code)) refuse("before this a character that XML does not have ends");
    }
    left_ = begun;
  }

  void text() {
    if (left_.front() == '&') {
      if (depth_ == 0) refuse("text stands outside of its outermost element");
      reference();
      return;
    }
    const std::size_t end = std::min(left_.find_first_of("<&"), left_.size());
    if (left_.substr(0, end).find("]]>") != std::string_view::npos) refuse("\"]]>\" stands in the text");
    left_.remove_prefix(end);
  }
  void reference() {
    const std::size_t end = left_.find(';');
    if (end == std::string_view::npos) refuse("a reference without end stands");
    std::string_view name = left_.substr(1, end - 1);
    if (name.starts_with('#')) {
      name.remove_prefix(1);
      const bool is_hexadecimal = name.starts_with('x');
      if (is_hexadecimal) name.remove_prefix(1);
      std::uint32_t code = 0;
      const char* const behind = name.data() + name.size();
      const auto [read, error] = std::from_chars(name.data(), behind, code, is_hexadecimal ? 16 : 10);
      if (error != std::errc{} || read != behind || !is_character(code))
        refuse("a reference to a character that XML does not have stands");
    } else if (name != "amp" && name != "lt" && name != "gt" && name != "quot" && name != "apos") {
      refuse("the entity " + in_quotes(name) + ", which nothing declares, stands");
    }
    left_.remove_prefix(end + 1);
  }

  /// For each of them the parser allocates many times its bytes.
  void count() {
    if (++marks_ > kMostXmlMarks)
      throw Error("it has more than " + std::to_string(kMostXmlMarks) + " tags, values of attributes and " +
                  "other marks");
  }
  void markup() {
    count();
    if (left_.starts_with("<!--")) {
      skip_behind("-->", 4);
    } else if (left_.starts_with("<![CDATA[")) {
      if (depth_ == 0) refuse("text stands outside of its outermost element");
      skip_behind("]]>", 9);
    } else if (left_.starts_with("<!DOCTYPE")) {
      throw Error("it has a DOCTYPE, which is not read");
    } else if (left_.starts_with("<!")) {
      refuse("a mark that is none stands");
    } else if (left_.starts_with("<?")) {
      skip_behind("?>", 2);
    } else {
      tag();
    }
  }
  void skip_behind(std::string_view end, std::size_t from) {
    const std::size_t at = left_.find(end, from);
    if (at == std::string_view::npos) refuse("a mark without end stands");
    left_.remove_prefix(at + end.size());
  }
  void tag() {
    const bool is_end = left_.starts_with("</");
    if (is_end && depth_ == 0) refuse("an end of an element that did not begin stands");
    left_.remove_prefix(1);
    for (char before = '<';;) {
      left_.remove_prefix(std::min(left_.find_first_of("\"'<>/"), left_.size()));
      if (left_.empty()) refuse("a mark without end stands");
      const char here = left_.front();
      if (here == '<') refuse("a mark within a mark stands");
      if (here == '"' || here == '\'') {
        value();
        before = here;
        continue;
      }
      // The parser takes a slash in its place alone.
      const bool is_empty = here == '>' && before == '/' && !is_end;
      left_.remove_prefix(1);
      before = here;
      if (here != '>') continue;
      if (is_end)
        --depth_;
      else if (!is_empty)
        ++depth_;
      return;
    }
  }
  void value() {
    count();
    const char quote = left_.front();
    const std::array<char, 3> stops{quote, '<', '&'};
    left_.remove_prefix(1);
    for (;;) {
      left_.remove_prefix(
          std::min(left_.find_first_of(std::string_view(stops.data(), stops.size())), left_.size()));
      if (left_.empty() || left_.front() == '<')
        refuse("the value of an attribute does not end before what stands");
      if (left_.front() == '&') {
        reference();
        continue;
      }
      left_.remove_prefix(1);
      return;
    }
  }

  const std::string_view whole_;
  std::string_view left_;
  std::size_t depth_ = 0;  // elements that are open
  std::size_t marks_ = 0;
};

class Writing {
 public:
  explicit Writing(Canonicalization how) : how_(how) {}

  void document(const pugi::xml_document& document) {
    bool is_behind = false;
    for (const pugi::xml_node& child : document.children()) {
      if (child.type() == pugi::node_element) {
        element(child, {}, {}, {});
        is_behind = true;
      } else if (is_written(child)) {
        if (is_behind) put("\n");
        misc(child);
        if (!is_behind) put("\n");
      }
    }
  }

  void apex(const pugi::xml_node& apex) {
    std::vector<pugi::xml_node> ancestors;
    for (pugi::xml_node at = apex.parent(); at.type() == pugi::node_element; at = at.parent())
      ancestors.push_back(at);
    Namespaces in_scope;
    std::map<std::string_view, std::string_view> inherited;  // xml:lang and the like (C14N 1.0, 2.4)
    for (auto at = ancestors.rbegin(); at != ancestors.rend(); ++at) {
      take_declarations(*at, in_scope);
      for (const pugi::xml_attribute& attribute : at->attributes()) {
        if (name_of(attribute.name()).prefix == kXmlPrefix) inherited[attribute.name()] = attribute.value();
      }
    }
    if (how_.exclusive) inherited.clear();
    for (const pugi::xml_attribute& attribute : apex.attributes()) inherited.erase(attribute.name());
    element(apex, in_scope, {}, inherited);
  }

  std::string take() { return std::move(out_); }

 private:
  void put(std::string_view text) {
    if (text.size() > kLongestCanonicalXml - out_.size())
      throw Error("its canonical form has more than " + std::to_string(kLongestCanonicalXml >> 20U) + " MiB");
    out_ += text;
  }

  void escaped(std::string_view text, bool in_attribute) {
    std::size_t from = 0;
    for (std::size_t at = 0; at < text.size(); ++at) {
      const std::string_view as = escape(text[at], in_attribute);
      if (as.empty()) continue;
      put(text.substr(from, at - from));
      put(as);
      from = at + 1;
    }
    put(text.substr(from));
  }
  static std::string_view escape(char c, bool in_attribute) {
    switch (c) {
      case '&':
        return "&amp;";
      case '<':
        return "&lt;";
      case '>':
        return in_attribute ? "" : "&gt;";
      case '"':
        return in_attribute ? "&quot;" : "";
      case '\t':
        return in_attribute ? "&#x9;" : "";
      case '\n':
        return in_attribute ? "&#xA;" : "";
      case '\r':
        return "&#xD;";
      default:
        return "";
    }
  }

  [[nodiscard]] bool is_written(const pugi::xml_node& node) const {
    return node.type() == pugi::node_pi || (node.type() == pugi::node_comment && how_.with_comments);
  }
  void misc(const pugi::xml_node& node) {
    if (node.type() == pugi::node_comment) {
      put("<!--");
      put(node.value());
      put("-->");
      return;
    }
    put("<?");
    put(node.name());
    if (!std::string_view(node.value()).empty()) {
      put(" ");
      instruction(node.value());
    }
    put("?>");
  }
  /// With each end of a line as a line feed (XML 1.0, section 2.11): of instructions alone the parser leaves
  /// them as they are.
  void instruction(std::string_view text) {
    for (std::size_t end = text.find('\r'); end != std::string_view::npos; end = text.find('\r')) {
      put(text.substr(0, end));
      put("\n");
      text.remove_prefix(end + (text.substr(end).starts_with("\r\n") ? 2 : 1));
    }
    put(text);
  }

  /// `in_scope` and `rendered` are those of the parent.
  void element(const pugi::xml_node& element, Namespaces in_scope, Namespaces rendered,
               const std::map<std::string_view, std::string_view>& inherited) {
    take_declarations(element, in_scope);
    put("<");
    put(element.name());
    for (const auto& [prefix, uri] : to_render(element, in_scope)) {
      const auto known = rendered.find(prefix);
      if (known == rendered.end() ? prefix.empty() && uri.empty() : known->second == uri) continue;
      rendered[prefix] = uri;
      attribute(prefix.empty() ? "xmlns" : "xmlns:" + std::string(prefix), uri);
    }
    // By namespace, then by name; those without a prefix have none and come first.
    std::vector<std::tuple<std::string_view, std::string_view, std::string_view, std::string_view>> sorted;
    const auto add = [&](std::string_view name, std::string_view value) {
      const Name parts = name_of(name);
      sorted.emplace_back(parts.prefix.empty() ? "" : looked_up(in_scope, parts.prefix), parts.local, name,
                          value);
    };
    for (const pugi::xml_attribute& each : element.attributes())
      if (!declared_by(each.name())) add(each.name(), each.value());
    for (const auto& [name, value] : inherited) add(name, value);
    std::ranges::sort(sorted);
    for (const auto& [uri, local, name, value] : sorted) attribute(name, value);
    put(">");
    for (const pugi::xml_node& child : element.children()) {
      if (child.type() == pugi::node_element)
        this->element(child, in_scope, rendered, {});
      else if (child.type() == pugi::node_pcdata || child.type() == pugi::node_cdata)
        escaped(child.value(), false);
      else if (is_written(child))
        misc(child);
    }
    put("</");
    put(element.name());
    put(">");
  }

  /// All namespaces that hold; exclusively only those that the element's own names use.
  [[nodiscard]] Namespaces to_render(const pugi::xml_node& element, const Namespaces& in_scope) const {
    if (!how_.exclusive) return in_scope;
    Namespaces used;
    const auto use = [&](std::string_view prefix) {
      if (prefix != kXmlPrefix) used[prefix] = looked_up(in_scope, prefix);
    };
    use(name_of(element.name()).prefix);
    for (const pugi::xml_attribute& each : element.attributes()) {
      const Name parts = name_of(each.name());
      if (!declared_by(each.name()) && !parts.prefix.empty()) use(parts.prefix);
    }
    return used;
  }

  void attribute(std::string_view name, std::string_view value) {
    put(" ");
    put(name);
    put("=\"");
    escaped(value, true);
    put("\"");
  }

  Canonicalization how_;
  std::string out_;
};

}  // namespace

std::optional<Canonicalization> canonicalization_named(std::string_view uri) {
  constexpr std::string_view kInclusive = "http://www.w3.org/TR/2001/REC-xml-c14n-20010315";
  constexpr std::string_view kExclusive = "http://www.w3.org/2001/10/xml-exc-c14n#";
  if (uri == kInclusive) return Canonicalization{false, false};
  if (uri == std::string(kInclusive) + "#WithComments") return Canonicalization{false, true};
  if (uri == kExclusive) return Canonicalization{true, false};
  if (uri == std::string(kExclusive) + "WithComments") return Canonicalization{true, true};
  return {};
}

pugi::xml_document parse_xml(std::string_view xml) {
  if (xml.size() > kLongestXml)
    throw Error("it has more than " + std::to_string(kLongestXml >> 20U) + " MiB of XML");
  const bool is_declared = StrictMarks(xml).require();
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(
      xml.data(), xml.size(), pugi::parse_full | pugi::parse_ws_pcdata | pugi::parse_fragment,
      pugi::encoding_utf8);
  if (!parsed)
    throw Error("it is no XML: " + std::string(parsed.description()) + " at byte " +
                std::to_string(parsed.offset));
  std::size_t elements = 0;
  for (const pugi::xml_node& child : document.children()) {
    if (child.type() == pugi::node_doctype) throw Error("it has a DOCTYPE, which is not read");
    if (child.type() == pugi::node_declaration && (!is_declared || child.previous_sibling()))
      throw Error("it is no XML: a declaration stands behind its beginning");
    // The parser drops or keeps what stands outside of the outermost element; XML has white space there
    // alone.
    const bool is_text = child.type() == pugi::node_pcdata || child.type() == pugi::node_cdata;
    if (is_text && std::string_view(child.value()).find_first_not_of(" \t\r\n") != std::string_view::npos)
      throw Error("it is no XML: text stands outside of its outermost element");
    elements += child.type() == pugi::node_element ? 1U : 0U;
  }
  if (elements != 1) throw Error("it is no XML: it has not one outermost element");
  Check().element(document.document_element(), {}, 1);
  return document;
}

std::string_view namespace_of(const pugi::xml_node& element) {
  const std::string_view prefix = name_of(element.name()).prefix;
  for (pugi::xml_node at = element; at.type() == pugi::node_element; at = at.parent()) {
    for (const pugi::xml_attribute& attribute : at.attributes())
      if (declared_by(attribute.name()) == prefix) return attribute.value();
  }
  return "";
}

std::string in_quotes(std::string_view text) {
  return "\"" + printable(text.substr(0, kLongestQuoted)) + "\"";
}

std::string_view local_name_of(const pugi::xml_node& element) { return name_of(element.name()).local; }

std::string canonical_document(const pugi::xml_document& document, Canonicalization how) {
  Writing writing(how);
  writing.document(document);
  return writing.take();
}

std::string canonical_element(const pugi::xml_node& element, Canonicalization how) {
  Writing writing(how);
  writing.apex(element);
  return writing.take();
}

}  // namespace kiroku::evidence
