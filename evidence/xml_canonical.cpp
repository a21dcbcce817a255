#include "evidence/xml_canonical.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

#include "base/error.h"
#include "base/printable.h"

namespace kiroku::evidence {
namespace {

constexpr std::string_view kXmlPrefix = "xml";
constexpr std::string_view kXmlNamespace = "http://www.w3.org/XML/1998/namespace";
constexpr std::size_t kLongestQuoted = 60;

std::string in_quotes(std::string_view name) {
  return "\"" + printable(name.substr(0, kLongestQuoted)) + "\"";
}

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
      put(node.value());
    }
    put("?>");
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
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_buffer(
      xml.data(), xml.size(), pugi::parse_full | pugi::parse_ws_pcdata | pugi::parse_fragment);
  if (!parsed)
    throw Error("it is no XML: " + std::string(parsed.description()) + " at byte " +
                std::to_string(parsed.offset));
  std::size_t elements = 0;
  for (const pugi::xml_node& child : document.children()) {
    if (child.type() == pugi::node_doctype) throw Error("it has a DOCTYPE, which is not read");
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
